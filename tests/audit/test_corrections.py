"""Slips planted in made-up tables are found again, and ranked first."""

from dataclasses import replace

import numpy as np
import pytest
from made_up import TABLES, audited_table, printed_cell

from reproduce.audit.corrections import _of_cell, corrections, of_digits
from reproduce.audit.examine import conflicts, contradicted, examine, groups, reprinted
from reproduce.audit.intervals import EVERYTHING, printed_intervals, propagate


def planted(cells, kind, seed):
    """Plant a slip of one kind in a random cell; return the sheet, the cell and the kind."""
    rng = np.random.default_rng(seed)
    while True:
        victim = cells[rng.choice(sorted(cells))]
        ways = [s for s in _of_cell(victim) if s.kind == kind and s.changes[0][1] != victim]
        if ways:
            slip = ways[rng.integers(len(ways))]
            return slip.undone(cells), victim.address


def restored(cells, relations):
    """Return all corrections of all groups of contradictions."""
    found = [frozenset(r.name for r in group) for group in groups(cells, relations)]
    return [c for names in found for c in corrections(cells, relations, names)]


@pytest.mark.parametrize("table", TABLES)
def test_the_tables_are_right_as_they_are(table):
    cells, relations = TABLES[table]()
    assert {f.outcome for f in examine(cells, relations)} <= {
        "agrees",
        "agrees only through rounding",
    }
    assert conflicts(cells, relations) == []
    assert groups(cells, relations) == []


@pytest.mark.parametrize("table", TABLES)
@pytest.mark.parametrize("kind", ["digit", "swap", "sign", "drop", "extra"])
@pytest.mark.parametrize("seed", range(3))
def test_a_planted_slip_is_seen_and_undone(table, kind, seed):
    """Whatever contradicts is lifted by restoring the cell: the truth is among the answers.

    A slip in the last digit of an addend can hide within the rounding of its sum; then nothing
    contradicts, and nothing is claimed.
    """
    right, relations = TABLES[table]()
    cells, victim = planted(right, kind, seed)
    wrong = contradicted(cells, relations)
    if not wrong:
        return
    assert any(victim in conflict.cells for conflict in conflicts(cells, relations))
    found = [dict(s.changes) for c in restored(cells, relations) for s in c.slips]
    assert any(changes.get(victim) == right[victim] for changes in found)


@pytest.mark.parametrize("table", TABLES)
def test_most_first_digits_are_seen(table):
    """A wrong leading digit cannot hide in rounding."""
    right, relations = TABLES[table]()
    missed = []
    for address, printed in right.items():
        text = printed.number.text
        other = str((int(text[0]) + 4) % 9 + 1) + text[1:]
        if not contradicted(right | {address: reprinted(printed, other)}, relations):
            missed.append(address)
    assert missed == []


def interchanged(cells, pairs):
    out = dict(cells)
    for one, two in pairs:
        out[one] = replace(cells[one], content=cells[two].number)
        out[two] = replace(cells[two], content=cells[one].number)
    return out


def test_two_interchanged_columns_are_found():
    right, relations = TABLES["invoice"]()
    rows = ["1", "2", "3", "4", "sum"]
    cells = interchanged(right, [(f"bill#{r}.tax", f"bill#{r}.gross") for r in rows])
    best = restored(cells, relations)[0]
    assert [slip.kind for slip in best.slips] == ["columns"]
    assert best.restores_everything
    assert best.slips[0].undone(cells) == right


def test_interchanged_columns_and_a_wrong_digit_are_found_together():
    right, relations = TABLES["invoice"]()
    rows = ["1", "2", "3", "4", "sum"]
    cells = interchanged(right, [(f"bill#{r}.tax", f"bill#{r}.gross") for r in rows])
    cells["bill#3.net"] = reprinted(cells["bill#3.net"], "370.75")
    whole = [c for c in restored(cells, relations) if c.restores_everything]
    assert sorted(slip.kind for slip in whole[0].slips) == ["columns", "digit"]
    mended = cells
    for slip in whole[0].slips:
        mended = slip.undone(mended)
    assert mended == right


def test_two_interchanged_cells_are_found():
    right, relations = TABLES["race"]()
    cells = interchanged(right, [("race#2.time", "race#4.time")])
    best = restored(cells, relations)[0]
    assert best.slips[0].undone(cells) == right


def test_a_wrong_unit_is_found():
    right, relations = TABLES["readings"]()
    cells = right | {"log#3.mon": replace(right["log#3.mon"], unit="m")}
    best = restored(cells, relations)[0]
    assert [slip.kind for slip in best.slips] == ["unit"]
    assert best.slips[0].undone(cells) == right


@pytest.mark.parametrize("table", TABLES)
def test_conflicts_are_minimal(table):
    """Free any cell of a conflict and its relations can hold; free none and they cannot."""
    right, relations = TABLES[table]()
    cells, _ = planted(right, "digit", 1)
    found = conflicts(cells, relations)
    by_name = {relation.name: relation for relation in relations}
    for conflict in found:
        blamed = [by_name[name] for name in conflict.relations]
        boxes = printed_intervals(cells, blamed)
        others = {a: EVERYTHING for a in boxes if a not in conflict.cells}
        assert propagate(blamed, boxes | others) is None
        for address in conflict.cells:
            assert propagate(blamed, boxes | others | {address: EVERYTHING}) is not None


def test_a_correction_tells_what_it_breaks_and_whether_the_claim_moves():
    """b must be twice a, c its double minus a, and the paper claims that c stays below five."""
    text = """
    [[relations.all]]
    name = "twice"
    formula = "b = 2 * a"
    cells = "a=t#1.a b=t#1.b"
    kind = "equation"
    source = "s"
    [[relations.all]]
    name = "gap"
    formula = "c = b - a"
    cells = "a=t#1.a b=t#1.b c=t#1.c"
    kind = "arithmetic"
    source = "s"
    [[relations.all]]
    name = "claim"
    formula = "c <= 5"
    cells = "c=t#1.c"
    kind = "order"
    source = "s"
    claim = "the gap is small"
    """
    texts = {"t#1.a": "8.0", "t#1.b": "6.0", "t#1.c": "-2.0"}
    cells = {address: printed_cell(address, t) for address, t in texts.items()}
    (group,) = audited_table("made up", cells, text).groups
    by_slip = {c.slips[0].label: c for c in group.corrections if len(c.slips) == 1}
    larger, smaller = by_slip["t#1.b: 6.0 → 16.0"], by_slip["t#1.a: 8.0 → 3.0"]
    assert larger.broken == smaller.broken == ("gap",)
    assert larger.moved == ("the gap is small",)
    assert smaller.moved == ()
    whole = [c.restores_everything for c in group.corrections]
    assert whole == sorted(whole, reverse=True)


def test_digits_before_a_slip():
    found = dict.fromkeys(of_digits("-10.3"))
    assert ("digit", "-10.8") in found
    assert ("swap", "-01.3") in found
    assert ("drop", "-10.53") in found
    assert ("extra", "-1.3") in found
    assert ("sign", "10.3") in found
    assert ("extra", "-10.") not in found  # vaguer only
    assert ("sign", "-0.0") not in dict.fromkeys(of_digits("0.0"))
