"""The planted slips: what is planted, what is seen, and that the stored study is the real one."""

import random
import tomllib
from decimal import Decimal

import pytest

import planted_slips
from planted_slips import (
    KINDS,
    SEED,
    differing,
    plants,
    seen_by_relations,
    seen_by_verdicts,
    some,
)
from reproduce.audit.relation import declared
from reproduce.audit.report import audit_paper
from reproduce.printed.cells import PAPERS, Cell
from reproduce.printed.number import PrintedNumber
from reproduce.store import studies

STORED = studies.table(planted_slips.NAME)


def test_every_number_of_both_papers_is_in_the_study():
    planted = [p for paper in PAPERS for p in plants(audit_paper(paper).cells, SEED)]
    rows = STORED[["cell", "kind", "printed instead"]].itertuples(
        index=False, name=None
    )
    assert list(rows) == [(p.address, p.kind, p.text) for p in planted]
    numbers = [address for paper in PAPERS for address in audit_paper(paper).cells]
    assert list(dict.fromkeys(STORED["cell"])) == numbers
    assert set(STORED["kind"]) == set(KINDS)


def test_no_plant_prints_what_was_printed():
    for paper in PAPERS:
        cells = audit_paper(paper).cells
        assert all(p.text != cells[p.address].number.text for p in plants(cells, 1))


def test_the_relations_see_what_the_study_says():
    for paper in PAPERS:
        audit = audit_paper(paper)
        ours = STORED[STORED["cell"].str.startswith(paper)]
        relations = [finding.relation for finding in audit.findings]
        planted = list(plants(audit.cells, SEED))
        again = seen_by_relations(audit.cells, relations, planted)
        assert again == ours["relation"].tolist()
        comparing = [relation for relation in relations if relation.compares]
        again = seen_by_relations(audit.cells, comparing, planted)
        assert again == ours["compared"].tolist()


def test_a_verdict_sees_a_wrong_result_and_a_wrong_input():
    assert seen_by_verdicts("niu2024/table-2#scale.red", "0.9967").seen
    assert seen_by_verdicts("niu2024/table-1#focal-length.red", "25.6001").seen
    assert not seen_by_verdicts("niu2024/text-experiment#exposure", "900").seen
    assert seen_by_verdicts("niu2024/text-simulation#angle-count", "139").refused


def test_a_table_of_sums_sees_nearly_all():
    rng = random.Random(3)
    bills = [
        [Decimal(rng.randrange(100, 99_999)).scaleb(-2) for _ in ("net", "tax")]
        for _ in range(9)
    ]
    cells = {}
    for row, (net, tax) in enumerate(bills):
        for column, value in {"net": net, "tax": tax, "gross": net + tax}.items():
            name, number = f"{row}.{column}", PrintedNumber(str(value))
            cells[f"bill#{name}"] = Cell(
                "bill", name, name, number, "1", "derived", "bill"
            )
    text = """
    [[relations.all]]
    name = "sum-{r}"
    formula = "gross = net + tax"
    cells = "gross=bill#{r}.gross net=bill#{r}.net tax=bill#{r}.tax"
    each = { r = "012345678" }
    kind = "arithmetic"
    source = "by name"
    """
    planted = list(plants(cells, 3))
    seen = seen_by_relations(cells, declared(tomllib.loads(text), cells), planted)
    assert sum(seen) > 0.8 * len(planted)


def test_a_check_draws_the_same_numbers_each_time_and_sees_what_differs():
    cells = STORED["cell"].unique().tolist()
    drawn = some(cells)
    assert drawn == some(cells) != some(cells, SEED + 1)
    assert len(drawn) == len(cells) // planted_slips.ONE_IN
    part = STORED[STORED["cell"].isin(drawn)].reset_index(drop=True)
    assert differing(STORED, part).empty
    flipped = part.copy()
    flipped.loc[0, "verdict"] = not part.loc[0, "verdict"]
    assert differing(STORED, flipped)["cell"].tolist() == [part.loc[0, "cell"]] * 2
    lost = part.drop(index=0)
    assert differing(STORED, lost)["cell"].tolist() == [part.loc[0, "cell"]]


@pytest.mark.parametrize("words", [["--check"], ["--check", "--all"]])
def test_a_check_fails_where_the_study_says_otherwise(monkeypatch, words):
    """Two cells, of which the stored study says the contrary of what is found."""
    cells = ["niu2024/table-2#scale.red", "niu2024/table-2#scale.blue"]
    made = STORED[STORED["cell"].isin(cells)].reset_index(drop=True)
    asked = []
    monkeypatch.setattr(
        planted_slips, "study", lambda chosen=None: asked.append(chosen) or made
    )
    monkeypatch.setattr("sys.argv", ["planted_slips.py", *words])
    with pytest.raises(SystemExit) as end:
        planted_slips.main()
    assert end.value.code == 0
    wrong = STORED.assign(relation=~STORED["relation"])
    monkeypatch.setattr(studies, "table", lambda name: wrong)
    with pytest.raises(SystemExit, match="NOT as stored"):
        planted_slips.main()
    assert (asked[0] is None) == ("--all" in words)
