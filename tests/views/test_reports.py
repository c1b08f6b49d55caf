"""Reports on a paper in the forms of other registers."""

import json
import re
import sys

import numpy as np
import pytest
import rdflib
import yaml
from commands import output_of, run
from jinja2 import UndefinedError

import reproduce as rp
from book_facts import card
from reproduce.judge import ledger
from reproduce.judge.ledger import expected, frozen, item_ledger, record_of
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import computations
from reproduce.printed.cells import PAPERS, anchor, library
from reproduce.printed.inputs import load_inputs
from reproduce.views import _reports as reports
from reproduce.views._blocks import written
from reproduce.views._export import table_files
from reproduce.views.citations import cite

NP = rdflib.Namespace("http://www.nanopub.org/nschema#")
CITO = rdflib.Namespace("http://purl.org/spar/cito/")


def of_paper(paper):
    """Return the results of each item of a paper, by the name of its files."""
    keys = [key for key in library() if key.startswith(f"{paper}/")]
    return {
        anchor(key): [r for r in item_ledger(key).records if r.role == "result"]
        for key in keys
    }


def test_codecheck_has_the_parts_of_its_specification_that_are_ours(paper):
    """Rules CC-CFG-001 to 007, 014 to 019, 021 to 023, 027 and 028 of rules-2.0.yml."""
    text = reports.report(paper, "codecheck")["codecheck.yml"]
    assert text.strip() in run(f"export {paper} --format codecheck").output
    assert text.startswith("---\n")
    found = yaml.safe_load(text)
    assert found["version"] == "https://codecheck.org.uk/spec/config/2.0"
    files = {one["file"] for one in found["manifest"]}
    assert files == {f"tables/{name}.csv" for name in of_paper(paper)}
    cited = json.loads(cite("all", "csl"))[1 + PAPERS.index(paper)]
    assert found["paper"]["title"] == cited["title"]
    assert found["paper"]["reference"] == f"https://doi.org/{cited['DOI']}"
    for one, author in zip(found["paper"]["authors"], cited["author"], strict=True):
        assert one["name"].endswith(author["family"])
    assert not re.search("FIXME|TODO|XXXX", text)


def test_rescience_has_the_fields_of_its_template_and_every_open_number(paper):
    files = reports.report(paper, "rescience")
    found = yaml.safe_load(files["metadata.yaml"])
    assert found["title"].startswith("[Re] ")
    assert found["type"] == "Replication"
    pairs = {name: value for one in found["replication"] for name, value in one.items()}
    assert pairs["doi"] in pairs["url"]
    article = files["article.tex"]
    items = re.findall(r"^\\item\[([^]]+)\] (\w+);", article, re.MULTILINE)
    judged = {c: v.verdict for c, v in frozen().items() if c.startswith(f"{paper}/")}
    open_ = {"differs", "ambiguous", "unpublished"}
    expected = [
        (c.partition("#")[2], word) for c, word in judged.items() if word in open_
    ]
    assert sorted(items) == sorted(expected)
    bare = re.sub(r"^%.*|\\[&%$#_{}]", "", article)
    assert not re.search(r"[%#_]|\.\.|(printed|recomputed|assumed) -", bare)


@pytest.mark.filterwarnings("ignore:(Dataset|Conj).*deprecated:DeprecationWarning")
def test_each_judged_table_is_a_nanopublication(paper):
    graph = rdflib.Dataset(default_union=True)
    text = reports.report(paper, "nanopublications")["nanopublications.trig"]
    graph.parse(data=text, format="trig")
    found = {}
    for name in graph.subjects(rdflib.RDF.type, NP.Nanopublication):
        parts = [
            graph.graph(graph.value(name, part))
            for part in (NP.hasAssertion, NP.hasProvenance, NP.hasPublicationInfo)
        ]
        assert all(len(part) for part in parts)
        ((_, relation, paper_),) = [t for t in parts[0] if t[1].startswith(CITO)]
        assert (None, None, paper_) in parts[1]
        found[name.rpartition("/")[2]] = relation.removeprefix(CITO)
    items = {name: results for name, results in of_paper(paper).items() if results}
    relations = {
        "validated": "confirms",
        "partially supported": "qualifies",
        "contradicted": "disputes",
    }
    assert found == {
        name: relations.get(reports.outcome(results), "discusses")
        for name, results in items.items()
    }


@pytest.mark.parametrize(
    ("words", "flags", "outcome"),
    [
        ("exact consistent unpublished", (), "validated"),
        ("exact differs", (), "partially supported"),
        ("differs", (), "contradicted"),
        ("differs ambiguous", (), "inconclusive"),
        ("unpublished", (), "not tested"),
        ("exact", ("copy",), "inconclusive"),
        ("exact ambiguous", ("copy",), "inconclusive"),
    ],
)
def test_an_outcome_never_says_more_than_the_verdicts(words, flags, outcome):
    one = record_of("niu2024/table-2#scale.red")
    records = [
        one.model_copy(update={"verdict": word, "flags": flags})
        for word in words.split()
    ]
    assert reports.outcome(records) == outcome


def test_decisions_are_the_options_of_the_computations(paper):
    found = yaml.safe_load(reports.report(paper, "decisions")["astra.yaml"])
    expected = {}
    for key in catalogue():
        for made in computations(key) if key.startswith(f"{paper}/") else ():
            for option, ways in made.options.items():
                name = (key.partition("/")[2], option)
                expected[name] = {
                    *expected.get(name, ()),
                    *(w.text for w in ways.values()),
                }
    stated = {
        (analysis["id"].replace("_", "-"), decision["id"]): {
            one["label"] for one in decision["options"].values()
        }
        for analysis in found["analyses"].values()
        for decision in analysis["decisions"].values()
    }
    assert stated == expected


def test_a_covariance_is_that_of_the_draws():
    key = "niu2024/table-3"
    frame = reports.covariance(key)
    (made,) = computations(key)
    results = made(load_inputs(made.inputs))
    one, other = (results[f"translation-{axis}.red"] for axis in "xy")
    found = frame.loc["translation-x.red", "translation-y.red"]
    assert found == pytest.approx(np.cov(one, other)[0, 1], rel=1e-9)
    assert [*frame.columns] == ["unit", *frame.index]
    for one, is_random in ((key, True), ("niu2024/table-2", False)):
        files = table_files(one)
        assert any("covariance" in path for path in files) is is_random


def test_a_file_without_a_value_is_an_error():
    with pytest.raises(UndefinedError, match="items"):
        written("citation.ris")


def test_the_state_of_a_reply_is_in_ledger_table_card_and_citation(monkeypatch):
    asked, given = "niu2024/table-3#scale.red", "niu2024/table-1#focal-length.red"
    assert (expected(asked).reply, expected(given).reply) == ("none", "")
    (record,) = json.loads(rp.table(asked).export("json"))["records"]
    assert record["reply"] == "none"
    shown = "reply of the authors: disputed"
    table, cell = rp.table("niu2024/table-3"), rp.table(asked)
    assert shown not in table._repr_html_() + cell.cite("sentence")
    assert "The authors' reply: none." in card(cell, "")
    erratum = rp.table("niu2024/table-2#translation-x.red").export("markdown")
    assert "none yet (page A letter to the authors of niu2024)" in erratum
    answered = expected(asked).model_copy(update={"reply": "disputed"})
    verdicts = {**frozen(), asked: answered}
    monkeypatch.setattr(ledger, "frozen", lambda: verdicts)
    item_ledger.cache_clear()
    table, cell = rp.table("niu2024/table-3"), rp.table(asked)
    assert f'<span class="rp-flag">{shown}</span>' in table._repr_html_()
    assert cell.cite("sentence").endswith(f" The {shown}.")
    assert "The authors' reply: disputed." in card(cell, "")
    item_ledger.cache_clear()


# The validator expects one nanopublication.
VALIDATORS = """
import sys, rdflib, yaml
from astra.datamodel.astra_pydantic import Analysis
from nanopub import Nanopub, NanopubConf
trig, astra = sys.argv[1:]
Analysis.model_validate(yaml.safe_load(open(astra, encoding="utf-8")))
parts, whole = {}, rdflib.Dataset()
whole.parse(trig, format="trig")
for s, p, o, graph in whole.quads():
    name = str(graph).partition("#")[0]
    parts.setdefault(name, rdflib.Dataset()).add((s, p, o, graph))
print(sum(Nanopub(rdf=part, conf=NanopubConf()).is_valid for part in parts.values()))
"""


@pytest.mark.nightly
def test_validators_of_the_registers_accept_the_reports(paper, tmp_path):
    """The validators are not in the lock, since their packages exclude others."""
    files = []
    for form in ("nanopublications", "decisions"):
        for name, text in reports.report(paper, form).items():
            (tmp_path / name).write_text(text, encoding="utf-8")
            files.append(name)
    packages = ("--with", "astra-spec==0.0.14", "--with", "nanopub==2.0.1")
    command = (
        sys.executable,
        "-m",
        "uv",
        "run",
        "--no-project",
        "--isolated",
        *packages,
    )
    valid = output_of(*command, "python", "-c", VALIDATORS, *files, cwd=tmp_path)
    judged = [results for results in of_paper(paper).values() if results]
    assert int(valid) == len(judged)
