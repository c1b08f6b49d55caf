"""The audit in a terminal, as JSON and on a page."""

import json
import math
import re
from collections import Counter
from pathlib import Path

import pytest
from click.testing import CliRunner

import reproduce as rp
from reproduce.consistency import relation
from reproduce.consistency.report import audit_paper
from reproduce.judge.ledger import frozen
from reproduce.printed.cells import PAPERS, anchor, library
from reproduce.views.cli import main
from reproduce.views.consistency import errata_register

AUDITS = [audit_paper(paper) for paper in PAPERS]


def page(part, paper=None):
    """Return the HTML of a part."""
    return rp.audit(paper)[part]._repr_html_()


def entry(name):
    """Return the unfolded text of an erratum."""
    return re.search(rf'id="{name}".*?</table>', page("errata"), re.DOTALL).group()


def run(*arguments):
    return CliRunner(env={"COLUMNS": "80", "TERM": "dumb"}).invoke(main, arguments)


def test_the_audit_of_a_paper_fits_the_terminal():
    result = run("audit", "chen2023")
    assert result.exit_code == 0, result.output
    assert max(map(len, result.stdout.splitlines())) <= 80
    for name in ("motion-4-y", "chen2023-table-5-motion", "60.66 µm printed, 60.36"):
        assert name in " ".join(result.stdout.split())
    assert "niu2024" not in result.stdout
    assert run("audit", "nobody2000").exit_code == 2
    # A verdict names its erratum.
    shown = " ".join(run("show", "niu2024/table-2").stdout.split())
    assert "Erratum niu2024-table-2-translation" in shown


def test_json_has_a_record_for_each_row():
    found = json.loads(run("audit", "--json").stdout)
    assert [row["name"] for row in found["score"]] == list(PAPERS)
    assert len(found["relations"]) == sum(len(a.findings) for a in AUDITS)
    outcomes = Counter(r["outcome"] for r in found["relations"] if not r["assumption"])
    assert outcomes == Counter(f.outcome for a in AUDITS for f in a.read)
    assert len(found["errata"]) + len(found["assumptions"]) == len(errata_register())
    assert len(found["equations"]) == sum(len(a.equations) for a in AUDITS)
    by_name = {row["name"]: row for row in found["relations"]}
    assert by_name["motion-4-y"]["restates"] == "chen2023/table-5#4.motion-y"


def test_the_score_counts_the_findings():
    for audit, row in zip(AUDITS, rp.audit()["score"].rows, strict=True):
        own, again = (audit.tally(restating=chosen) for chosen in (False, True))
        supposing = [shown for shown in audit.equations if shown.assumption]
        counts = [audit.cells, audit.examined, audit.bounded]
        expected = [*map(len, counts), sum(own.values()), *own.values()]
        expected += [sum(again.values()), again["contradicts"]]
        expected += [len(audit.equations) - len(supposing), len(audit.failing)]
        expected += [len(audit.supposed) + len(supposing)]
        assert list(row.values()) == [audit.name, *expected]
        cells = "".join(f"<td>{count}</td>" for count in expected)
        assert f"<code>{audit.name}</code></th>{cells}" in page("score")


def test_relations_lead_to_their_cells_and_declarations():
    """Each has an anchor, a link to the cell that it restates, and its declared name."""
    cells = {cell.anchor for table in library().values() for cell in table.cells}
    for audit in AUDITS:
        shown = page("relations", audit.name)
        anchors = re.findall(r'<tr id="([^"]+)"', shown)
        relations = [finding.relation for finding in audit.findings]
        expected = [f"relation-{audit.name}-{one.name}" for one in relations]
        assert sorted(anchors) == sorted(expected)
        restated = re.findall(r'restates <a href="#([^"]+)"', shown)
        addresses = (one.restates.partition(" (")[0] for one in relations)
        assert sorted(restated) == sorted(anchor(one) for one in addresses if one)
        assert set(restated) <= cells
        folder = Path(relation.__file__).parent / "relations"
        source = (folder / f"{audit.name}.toml").read_text()
        for one in relations:
            assert f'name = "{one.declared}"' in source
            assert (one.declared == one.name) != (f"<small>{one.declared}<" in shown)
        errata = page("errata", audit.name) + page("assumptions", audit.name)
        links = set(re.findall(r'href="#(relation-[^"]+)"', errata))
        assert links
        assert links <= set(anchors)


def test_relations_are_grouped_and_their_sides_have_units():
    for audit in AUDITS:
        doubtful = [one for one in audit.read if one.outcome != "agrees"]
        agreeing = [one for one in audit.read if one.outcome == "agrees"]
        restating = [one for one in agreeing if one.relation.restates]
        counts = [len(doubtful), len(agreeing) - len(restating), len(restating)]
        pattern = r"<caption>The (\d+) relations of"
        shown = re.findall(pattern, page("relations", audit.name))
        assert [*map(int, shown)] == [*counts, len(audit.supposed)]
    sides = {one["name"]: one["sides"] for one in rp.audit()["relations"].rows}
    assert sides["pixel-angle"] == "44.6″ against 44.6907″"


@pytest.mark.parametrize("part", ["errata", "assumptions"])
def test_every_erratum_has_a_row_that_leads_to_its_folded_entry(part):
    """In the order of their consequence."""
    register = [
        e for e in errata_register() if bool(e.assumption) == (part != "errata")
    ]
    resting = Counter(one.erratum for one in frozen().values() if one.erratum)
    order = ("moves", "not supported as printed", "open", "stands")
    register.sort(
        key=lambda e: (order.index(e.conclusion), -resting[e.id], e.extraction)
    )
    shown, expected = page(part), [e.id for e in register]
    assert re.findall(r'<tr><th scope="row"><a href="#([^"]+)"', shown) == expected
    entries = re.findall(r"<details(?: [^>]*)?>.*?</details>", shown, re.DOTALL)
    assert [re.search(r'id="([^"]+)"', one).group(1) for one in entries] == expected
    for erratum, text in zip(register, entries, strict=True):
        assert text.count(">Supposing that</th>") == bool(erratum.assumption)
        replies = re.findall('none yet; <a href="#letter-([^"]+)">', text)
        assert replies == ([] if erratum.reply else [erratum.paper])


def test_an_unsettled_verdict_links_to_its_erratum():
    known = {one.id for one in errata_register()}
    assert {one.erratum for one in frozen().values() if one.erratum} <= known
    shown = rp.table("niu2024/table-2")._repr_html_()
    assert shown.count('href="#niu2024-table-2-translation"') == 1


def test_pages_show_equations_and_sets():
    for audit in AUDITS:
        equations, sets = page("equations", audit.name), page("sets", audit.name)
        assert equations.count("<tr>") == 1 + len(audit.equations)
        assert sets.count("<tr>") == 1 + len(audit.conflicts)
        wrong = {f.relation.name for f in audit.read if f.outcome == "contradicts"}
        joint = [c for c in audit.conflicts if wrong.isdisjoint(c.relations)]
        assert sets.count('class="rp-flag"') == len(joint)


def test_an_erratum_shows_the_verdicts_that_rest_on_it():
    link = (
        '<a href="#chen2023-table-5-4-motion-y"><code>table-5#4.motion-y</code></a>: '
    )
    shown = entry("chen2023-table-5-motion")
    assert f"{link}60.66\u202fµm printed, 60.36" in shown
    shown = entry("chen2023-table-5-columns")
    assert "2.reference-y</code></a>: −2.006″ printed, agrees with 3 of 6" in shown


def test_the_evidence_on_a_shared_number_gives_the_values_that_each_pair_requires():
    """20.27 µm and 2.006 arcsec require 2084.3 mm, with the rounding of both."""
    found = re.search(
        r"reference-2-x-y</code></a>: requires the focal length of the telescope to lie from "
        r"([\d.]+) to ([\d.]+) mm",
        entry("chen2023-table-5-columns"),
    )
    ends = [
        (20.27 + side * 0.005)
        * 1e-3
        / math.tan((2.006 - side * 0.0005) * math.pi / 648000)
        for side in (-1, 1)
    ]
    assert [float(end) for end in found.groups()] == pytest.approx(ends, rel=1e-5)
