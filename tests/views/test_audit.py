"""The audit in a terminal, as JSON and on a page."""

import json
import math
import re
from collections import Counter
from typing import get_args

import pytest
from commands import run, width, words

import reproduce as rp
from reproduce.consistency.examine import RelationOutcome
from reproduce.consistency.report import audit_paper
from reproduce.judge.ledger import frozen
from reproduce.printed.cells import PAPERS, library
from reproduce.views.consistency import errata_register

OUTCOMES = get_args(RelationOutcome)
AUDITS = [audit_paper(paper) for paper in PAPERS]
ORDER = ("moves", "not supported as printed", "open", "stands")


def page(part, paper=None):
    """Return the HTML of a part."""
    return rp.audit(paper)[part]._repr_html_()


def entry(name):
    """Return the unfolded text of an erratum."""
    return re.search(rf'id="{name}".*?</table>', page("errata"), re.DOTALL).group()


def test_the_audit_of_a_paper_fits_the_terminal():
    result = run("audit chen2023")
    assert result.exit_code == 0, result.output
    assert width(result.stdout) <= 80
    for name in ("motion-4-y", "chen2023-table-5-motion", "60.66 µm printed, 60.36"):
        assert name in words(result.stdout)
    assert "niu2024" not in result.stdout
    assert not re.search("e−1[0-9]", result.stdout)  # rounding noise
    # A verdict names its erratum.
    assert "niu2024-table-2-translation" in run("show niu2024/table-2").stdout


def test_json_has_a_record_for_each_row():
    found = json.loads(run("audit --json").stdout)
    assert [row["name"] for row in found["score"]] == list(PAPERS)
    outcomes = Counter(row["outcome"] for row in found["relations"])
    assert outcomes == Counter(f.outcome for audit in AUDITS for f in audit.findings)
    assert len(found["errata"]) + len(found["assumptions"]) == len(errata_register())
    assert len(found["equations"]) == sum(len(audit.equations) for audit in AUDITS)


def test_the_score_counts_the_findings():
    for audit, row in zip(AUDITS, rp.audit()["score"].rows, strict=True):
        relations, equations = (
            rp.audit(audit.name)[part].frame().query("assumption == ''")
            for part in ("relations", "equations")
        )
        restates = relations["restates"] != ""
        plain, again = (relations["outcome"][one] for one in (~restates, restates))
        every = len(audit.findings) + len(audit.equations)
        counts = [len(audit.cells), len(plain), *(sum(plain == o) for o in OUTCOMES)]
        counts += [len(again), sum(again == "contradicts")]
        counts += [len(equations), sum(~equations["holds"])]
        counts.append(every - len(relations) - len(equations))
        assert list(row.values()) == [audit.name, *counts]


def test_relations_have_groups_anchors_and_cells():
    cells = {cell.anchor for table in library().values() for cell in table.cells}
    for audit in AUDITS:
        shown, relations = (
            page("relations", audit.name),
            [f.relation for f in audit.findings],
        )
        anchors = re.findall(r'<tr id="([^"]+)"', shown)
        expected = [f"relation-{audit.name}-{one.name}" for one in relations]
        assert sorted(anchors) == sorted(expected)
        restated = re.findall(r'restates <a href="#([^"]+)"', shown)
        assert len(restated) == sum(bool(one.restates) for one in relations)
        assert set(restated) <= cells
        errata = page("errata", audit.name) + page("assumptions", audit.name)
        assert (
            set() < set(re.findall(r'href="#(relation-[^"]+)"', errata)) <= set(anchors)
        )
        captions = re.findall(r"<caption>The (\d+) relations of", shown)
        assert sum(map(int, captions)) == len(audit.findings)


@pytest.mark.parametrize("part", ["errata", "assumptions"])
def test_every_erratum_has_a_row_and_a_folded_entry(part):
    """In the order of their consequence."""
    resting = Counter(one.erratum for one in frozen().values() if one.erratum)
    register = sorted(
        (e for e in errata_register() if bool(e.assumption) == (part != "errata")),
        key=lambda e: (ORDER.index(e.conclusion), -resting[e.id], e.extraction),
    )
    shown, expected = page(part), [erratum.id for erratum in register]
    assert re.findall(r'<tr><th scope="row"><a href="#([^"]+)"', shown) == expected
    entries = re.findall(r"<details(?: [^>]*)?>.*?</details>", shown, re.DOTALL)
    for erratum, text in zip(register, entries, strict=True):
        assert f'id="{erratum.id}"' in text
        letters = re.findall('<a href="#letter-([^"]+)">', text)
        assert letters == ([] if erratum.reply else [erratum.paper])


def test_an_erratum_shows_its_verdicts_and_the_values_that_each_pair_requires():
    """20.27 µm and 2.006 arcsec require 2084.3 mm, with the rounding of both."""
    shown = entry("chen2023-table-5-motion")
    assert "60.66\u202fµm printed, 60.36" in shown
    shown = entry("chen2023-table-5-columns")
    assert "2.reference-y</code></a>: −2.006″ printed, agrees with 3 of 6" in shown
    requires = r"reference-2-x-y</code></a>: requires [^<]*? ([\d.]+) to ([\d.]+) mm"
    found = re.search(requires, shown)
    for side, end in zip((-1, 1), found.groups(), strict=True):
        shift, angle = 20.27 + side * 0.005, (2.006 - side * 0.0005) * math.pi / 648000
        assert float(end) == pytest.approx(shift * 1e-3 / math.tan(angle), rel=1e-5)


def test_numbers_agree_if_the_intervals_of_print_and_result_overlap():
    """State 4: 60.66 printed, 60.36 computed, with half a digit of one and of two positions."""
    part = rp.audit()["differences"]
    rows = part.frame()
    assert "Table 2: Translation, y, Red" in repr(part)
    assert (rows["distance"].abs() <= 1).equals(rows["agrees"])
    assert rows["distance"]["chen2023/table-5#4.motion-y"] == pytest.approx(
        0.30 / 0.015
    )
    assert (~rows["agrees"]).sum() == 7
