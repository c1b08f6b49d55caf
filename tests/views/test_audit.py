"""The audit as a reader meets it: in the terminal, as JSON, and on the book's pages."""

import json
import math
import re
from collections import Counter
from pathlib import Path

import pytest
from click.testing import CliRunner

import reproduce as rp
from reproduce.audit import relation
from reproduce.audit.report import audit_paper
from reproduce.judge.ledger import erratum, frozen
from reproduce.printed.cells import anchor, library
from reproduce.views.cli import main
from reproduce.views.contradictions import JOINT, errata_register


def errata(part="errata"):
    return rp.contradictions()[part]._repr_html_()


def entry(name):
    """Return the unfolded text of an entry."""
    return re.search(rf'id="{name}".*?</table>', errata(), flags=re.DOTALL).group()


def ids(text):
    """Return the anchors of entries, as they stand."""
    return re.findall(r'<div class="rp-scroll" id="([^"]+)"', text)


def run(*arguments, columns=80):
    return CliRunner(env={"COLUMNS": str(columns), "TERM": "dumb"}).invoke(
        main, arguments
    )


def test_the_audit_of_a_paper_fits_the_terminal():
    result = run("audit", "chen2023")
    assert result.exit_code == 0, result.output
    assert max(map(len, result.stdout.splitlines())) <= 80
    found = " ".join(result.stdout.split())
    assert "motion-4-y" in found
    assert "Equations run as extracted" in found
    assert "relations of chen2023 that rest on a supposition of ours" in found
    assert "niu2024" not in found


def test_the_audit_as_json():
    """One table for each part, a record for each row."""
    told = json.loads(run("audit", "--json").stdout)
    found = [audit_paper(paper) for paper in ("niu2024", "chen2023")]
    assert [row["name"] for row in told["score"]] == ["niu2024", "chen2023"]
    assert [row["Held against others"] for row in told["score"]] == [
        len(a.examined) for a in found
    ]
    assert len(told["relations"]) == sum(len(a.findings) for a in found)
    outcomes = Counter(r["outcome"] for r in told["relations"] if not r["supposition"])
    assert outcomes == Counter(f.outcome for a in found for f in a.read)
    assert len(told["errata"]) + len(told["suppositions"]) == len(errata_register())


def test_an_unknown_paper_is_refused():
    assert run("audit", "nobody2000").exit_code == 2


def test_the_score_counts_what_the_audit_found():
    text = rp.contradictions()["score"]._repr_html_()
    for paper in ("niu2024", "chen2023"):
        found = audit_paper(paper)
        own, again = (found.tally(restating=chosen) for chosen in (False, True))
        row = re.search(rf"<code>{paper}</code></th>(.*?)</tr>", text).group(1)
        counts = [int(n) for n in re.findall(r"<td>(\d+)</td>", row)]
        assert counts[:3] == [len(found.cells), len(found.examined), len(found.bounded)]
        assert counts[3:8] == [sum(own.values()), *own.values()]
        assert counts[8:10] == [sum(again.values()), again["contradicts"]]
        assert counts[3] + counts[8] == len(found.read)
        supposing = [shown for shown in found.equations if shown.supposition]
        assert counts[-1] == len(found.supposed) + len(supposing)


def test_a_relation_that_restates_a_cell_links_to_it():
    """By the anchor of the cell, which the book turns into a link to its page."""
    for paper in ("niu2024", "chen2023"):
        text = rp.contradictions(paper)["relations"]._repr_html_()
        links = re.findall(r'restates <a href="#([^"]+)"', text)
        findings = audit_paper(paper).findings
        addresses = [f.relation.restates.partition(" (")[0] for f in findings]
        assert sorted(links) == sorted(
            anchor(address) for address in addresses if address
        )
        cells = {cell.anchor for table in library().values() for cell in table.cells}
        assert set(links) <= cells


def test_a_generated_name_leads_to_its_declaration():
    """The line is found by the pattern that the page and the data show beside it."""
    folder = Path(relation.__file__).parent / "relations"
    for paper in ("niu2024", "chen2023"):
        source = (folder / f"{paper}.toml").read_text()
        text = rp.contradictions(paper)["relations"]._repr_html_()
        for finding in audit_paper(paper).findings:
            pattern = finding.relation.declared
            assert f'name = "{pattern}"' in source
            assert (
                pattern == finding.relation.name or f"<small>{pattern}</small>" in text
            )
    found = json.loads(run("audit", "chen2023", "--json").stdout)
    by_name = {r["name"]: r for r in found["relations"]}
    assert by_name["motion-4-y"]["declared"] == "motion-{state}-{axis}"
    assert by_name["motion-4-y"]["restates"] == "chen2023/table-5#4.motion-y"


@pytest.mark.parametrize("paper", ["niu2024", "chen2023"])
def test_every_relation_has_its_anchor_and_every_evidence_its_link(paper):
    anchors = re.findall(
        r'<tr id="([^"]+)"', rp.contradictions(paper)["relations"]._repr_html_()
    )
    assert len(anchors) == len(set(anchors)) == len(audit_paper(paper).findings)
    shown = errata() + errata("suppositions")
    links = re.findall(r'href="#([^"]+)"', shown)
    assert {link for link in links if f"-{paper}-" in link} <= set(anchors)
    assert any(f"-{paper}-" in link for link in links)


@pytest.mark.parametrize("supposed", [False, True])
def test_every_erratum_has_a_row_that_leads_to_its_folded_entry(supposed):
    register = errata_register()
    text = errata("suppositions" if supposed else "errata")
    anchors = ids(text)
    assert sorted(anchors) == sorted(
        e.id for e in register if bool(e.supposition) == supposed
    )
    assert re.findall(r'<tr><th scope="row"><a href="#([^"]+)"', text) == anchors
    entries = re.findall(r"<details(?: [^>]*)?>.*?</details>", text, flags=re.DOTALL)
    assert [re.search(r'id="([^"]+)"', entry).group(1) for entry in entries] == anchors
    assert text.count(">Supposing that</th>") == len(anchors) * supposed
    replies = re.findall('none yet; <a href="#letter-([^"]+)">how to answer</a>', text)
    unanswered = [
        e for e in register if bool(e.supposition) == supposed and not e.reply
    ]
    assert sorted(replies) == sorted(e.paper for e in unanswered)


def test_errata_come_by_consequence():
    """Those that move a conclusion first, then by the number of results that rest on them."""
    by_id = {entry.id: entry for entry in errata_register()}
    shown = ids(errata())
    resting = Counter(e.erratum for e in frozen().values() if e.erratum)
    order = ("moves", "not supported as printed", "open", "stands")
    ranks = [order.index(by_id[name].conclusion) for name in shown]
    assert ranks == sorted(ranks)
    counts = [resting[name] for name in shown]
    for rank in set(ranks):
        within = [
            count for count, own in zip(counts, ranks, strict=True) if own == rank
        ]
        assert within == sorted(within, reverse=True)
    assert shown[:2] == ["niu2024-table-3-scale", "chen2023-table-5-columns"]


def test_a_differs_links_to_its_erratum():
    known = {entry.id for entry in errata_register()}
    linked = {a: e.erratum for a, e in frozen().items() if e.erratum}
    assert set(linked.values()) <= known
    text = rp.table("niu2024/table-2")._repr_html_()
    assert text.count('href="#niu2024-table-2-translation"') == 1
    assert erratum("niu2024/table-1#focal-length.red") == ""
    shown = " ".join(run("show", "niu2024/table-2").stdout.split())
    assert "Erratum niu2024-table-2-translation" in shown


@pytest.mark.parametrize("paper", ["niu2024", "chen2023"])
def test_pages_show_equations_and_sets(paper):
    shown = rp.contradictions(paper)
    assert shown["equations"]._repr_html_().count("<tr>") == 1 + len(
        audit_paper(paper).equations
    )
    sets = shown["sets"]._repr_html_()
    assert sets.count("<tr>") == 1 + len(audit_paper(paper).conflicts)
    wrong = {
        f.relation.name for f in audit_paper(paper).read if f.outcome == "contradicts"
    }
    joint = [c for c in audit_paper(paper).conflicts if not wrong & set(c.relations)]
    assert sets.count(JOINT) == len(joint)


def test_an_erratum_shows_the_verdicts_that_rest_on_it():
    section = entry("chen2023-table-5-motion")
    link = '<a href="#chen2023-table-5-4-motion-y">'
    assert (
        f"{link}<code>table-5#4.motion-y</code></a>: 60.66\u202fµm printed, 60.36"
        in section
    )
    section = entry("chen2023-table-5-columns")
    assert "2.reference-y</code></a>: −2.006″ printed, agrees with 3 of 6" in section


def test_the_evidence_on_a_shared_number_says_what_each_pair_asks_for():
    """20.27 um and 2.006 arcsec ask for 2084.3 mm, with the rounding of both, and for no other."""
    told = re.search(
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
    assert [float(end) for end in told.groups()] == pytest.approx(ends, rel=1e-5)
