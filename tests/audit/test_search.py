"""The search overlooks no correction of one slip, and no smaller one of two."""

import itertools
import math

import pytest
from made_up import declared, printed_cell

from reproduce.audit.corrections import _interchanges, _of_cell, _Search, corrections
from reproduce.audit.examine import contradicted, groups
from reproduce.audit.report import audit_paper

CHAIN = """
[relations]
all = [
    { name = "sum", formula = "c = a + b", cells = "a=t#1.a b=t#1.b c=t#1.c", %s },
    { name = "double", formula = "d = 2 * c", cells = "c=t#1.c d=t#1.d", %s },
]
""".replace("%s", 'kind = "arithmetic", source = "s"')
SHARED = """
[unknown]
k = { unit = "1", low = 0.1, high = 100, label = "factor" }
[[relations.all]]
name = "line-{i}"
formula = "y = k * x"
cells = "x=t#{i}.x y=t#{i}.y"
each = { i = "123" }
unknown = "k"
kind = "equation"
source = "s"
"""
SHEETS = {
    # One wrong number in two relations, two wrong numbers that share none, two in one sum.
    "one": (CHAIN, {"1.a": "12", "1.b": "21", "1.c": "73", "1.d": "66"}),
    "two": (CHAIN, {"1.a": "12", "1.b": "21", "1.c": "83", "1.d": "96"}),
    "far": (CHAIN, {"1.a": "82", "1.b": "91", "1.c": "33", "1.d": "99"}),
    "shared": (SHARED, {"1.x": "2", "1.y": "6", "2.x": "4", "2.y": "12", "3.x": "15", "3.y": "5"}),
    "split": (SHARED, {"1.x": "2", "1.y": "9", "2.x": "4", "2.y": "12", "3.x": "5", "3.y": "51"}),
}  # fmt: skip


def sheet_of(name):
    text, texts = SHEETS[name]
    # Exact steps keep the factors of "split" apart from each other.
    units = {a: "count" if name == "split" and a.endswith(".x") else "1" for a in texts}
    cells = {f"t#{a}": printed_cell(f"t#{a}", t, units[a]) for a, t in texts.items()}
    return cells, declared(text, cells)


def after_one(cells):
    """Every sheet that one slip, of whatever kind and wherever, may have come from."""
    for address in cells:
        for slip in _of_cell(cells[address]):
            yield slip, slip.undone(cells)
    for line in _interchanges(cells, {q.key for q in cells.values()}):
        slip = line.slip(cells)
        if slip is not None:
            yield slip, slip.undone(cells)


def printed(cells):
    return tuple((a, q.number.text, q.unit) for a, q in sorted(cells.items()))


def by_force(cells, relations, targets):
    """All sheets one or two slips away in which nothing of the group contradicts."""
    already = contradicted(cells, relations)
    found = {}
    singles = list(after_one(cells))
    for slip, sheet in singles:
        wrong = contradicted(sheet, relations)
        if not wrong & targets:
            found[printed(sheet)] = (1, slip.cost, bool(wrong - already))
    if any(not broken for _, _, broken in found.values()):
        return found
    begun = [pair for pair in singles if printed(pair[1]) not in found]
    for slip, sheet in begun:
        for more, second in after_one(sheet):
            if len(slip.addresses) == 1 and slip.addresses == more.addresses:
                continue  # two slips in one number
            wrong = contradicted(second, relations)
            if not wrong & targets and printed(second) not in found:
                found[printed(second)] = (2, slip.cost + more.cost, bool(wrong - already))
    whole = [cost for _, cost, broken in found.values() if not broken]
    limit = min(whole, default=math.inf)
    return {
        sheet: told
        for sheet, told in found.items()
        if told[0] == 1 or told[1] < limit or (not told[2] and told[1] == limit)
    }


@pytest.mark.slow
@pytest.mark.parametrize("name", SHEETS)
def test_the_search_finds_what_brute_force_finds(name):
    cells, relations = sheet_of(name)
    for group in groups(cells, relations):
        targets = frozenset(relation.name for relation in group)
        states = _Search(cells, relations, targets).run(2)
        wanted = by_force(cells, relations, targets)
        assert bool(wanted) == (name != "far")  # that one takes more than two slips
        assert {printed(state.cells) for state in states} == set(wanted)


def test_every_completion_touches_every_cover():
    cells, relations = sheet_of("split")
    (group,) = groups(cells, relations)
    targets = frozenset(relation.name for relation in group)
    search = _Search(cells, relations, targets)
    covers = search.covers(search.start)
    assert covers
    for state in search.run(2):
        moved = frozenset().union(*(slip.addresses for slip in state.slips))
        assert all(moved & cover for cover in covers)


def test_slips_in_more_tables_than_the_depth_are_not_sought():
    """Three contradictions in three tables cannot be lifted by two slips, and are by three."""
    lines = [
        f'{{ name = "r{i}", formula = "a = b", cells = "a=t{i}#a b=t{i}#b", '
        'kind = "repeat", source = "s" }'
        for i in "123"
    ]
    text = f"[relations]\nall = [{', '.join(lines)}]"
    texts = {f"t{i}#{name}": digit for i in "123" for name, digit in (("a", "4"), ("b", "7"))}
    cells = {address: printed_cell(address, digit) for address, digit in texts.items()}
    relations = declared(text, cells)
    targets = frozenset({"r1", "r2", "r3"})
    assert corrections(cells, relations, targets, depth=2) == []
    whole = corrections(cells, relations, targets, depth=3)
    assert whole
    assert all(len(c.slips) == 3 for c in whole)


def test_what_the_search_says_of_the_papers_lifts_the_group():
    """Every correction shown is applied again, and judged by all relations of the paper."""
    for paper in ("niu2024", "chen2023"):
        audit = audit_paper(paper)
        relations = [f.relation for f in audit.read]
        already = contradicted(audit.cells, relations)
        for group, correction in itertools.islice(
            ((g, c) for g in audit.groups for c in g.corrections[:3]), 60
        ):
            cells = audit.cells
            for slip in correction.slips:
                cells = slip.undone(cells)
            wrong = contradicted(cells, relations)
            assert not wrong & set(group.relations)
            assert wrong - already == set(correction.broken)
