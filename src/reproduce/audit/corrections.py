"""Slips of the pen that lift a group of contradictions, the smallest first.

The search rests on one fact. A relation that cannot hold stays so until one of its cells changes;
two relations that share an unknown and allow no common value of it stay apart until a cell of one
of them changes. Each contradiction is therefore a set of cells that every correction must touch, a
cover. The search follows every slip that touches a cover, and then every slip that touches all
covers that are left: up to two slips, in different numbers, it overlooks nothing. Beyond that it
follows the most promising pairs only.
"""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

from reproduce.audit import intervals
from reproduce.audit.examine import Agreement, agreements, by_value, contradicted, reprinted
from reproduce.audit.relation import Relation, Sheet
from reproduce.printed.cells import Cell
from reproduce.printed.number import ALIKE, Interval, si_factor

_SlipKind = Literal["digit", "swap", "drop", "extra", "sign", "unit", "cells", "rows", "columns"]

# How large a slip is, in slips of one digit. Only the order matters: a mistake in one character
# is smaller than one that moves a cell, and that is smaller than one that moves a whole line.
COSTS: Mapping[_SlipKind, float] = {
    "digit": 1.0,
    "swap": 1.0,
    "sign": 1.0,
    "drop": 1.25,
    "extra": 1.25,
    "unit": 1.5,
    "cells": 1.5,
    "rows": 2.0,
    "columns": 2.0,
}
_DEPTH = 3
_BREADTH = 30
# In the order of search, a relation still wrong weighs as one digit, a newly broken one half: an
# interchange may break what the next one mends.
_BROKEN = 0.5
# The search follows everything up to this many slips.
_COMPLETE = 2


@dataclass(frozen=True)
class _Slip:
    """One supposed mistake in words, and the cells as they should have been, by address."""

    kind: _SlipKind
    label: str
    changes: tuple[tuple[str, Cell], ...]

    @property
    def cost(self) -> float:
        """How large a slip it is."""
        return COSTS[self.kind]

    @functools.cached_property
    def addresses(self) -> frozenset[str]:
        """The cells that it touches."""
        return frozenset(address for address, _ in self.changes)

    def undone(self, cells: Sheet) -> dict[str, Cell]:
        """Return the sheet with the slip corrected."""
        return {**cells, **dict(self.changes)}


def of_digits(text: str) -> Iterator[tuple[_SlipKind, str]]:
    """Yield what the digits may have been before a slip.

    Examples
    --------
    >>> sorted(set(before for kind, before in of_digits("1.2") if kind in {"swap", "sign"}))
    ['-1.2', '2.1']
    """
    mantissa, mark, power = text.partition("e")
    sign = "-" if mantissa.startswith("-") else ""
    body = mantissa.removeprefix("-")
    tail = mark + power
    places = [i for i, character in enumerate(body) if character.isdigit()]
    for i in places:
        for digit in "0123456789":
            if digit != body[i]:
                yield "digit", f"{sign}{body[:i]}{digit}{body[i + 1 :]}{tail}"
    for i, j in itertools.pairwise(places):
        if body[i] != body[j]:
            swapped = body[:i] + body[j] + body[i + 1 : j] + body[i] + body[j + 1 :]
            yield "swap", f"{sign}{swapped}{tail}"
    for i in range(len(body) + 1):
        for digit in "0123456789":
            yield "drop", f"{sign}{body[:i]}{digit}{body[i:]}{tail}"
    # Without its last decimal a number only gets vaguer, and that would "mend" anything.
    for i in places[:-1] if "." in body else places:
        if len(places) > 1:
            yield "extra", f"{sign}{body[:i]}{body[i + 1 :]}{tail}"
    if any(character in "123456789" for character in body):
        yield "sign", ("" if sign else "-") + body + tail


def _of_cell(cell: Cell) -> Iterator[_Slip]:
    """Yield all slips in one cell: in its digits and in its unit."""
    address, printed = cell.address, cell.number.text
    seen = {printed}
    for kind, text in of_digits(printed):
        if text not in seen and readable(text):
            seen.add(text)
            label = f"{address}: {printed} → {text}"
            yield _Slip(kind, label, ((address, reprinted(cell, text)),))
    for unit in next((alike for alike in ALIKE if cell.unit in alike), ()):
        if unit != cell.unit:
            label = f"{address}: {cell.unit} → {unit}"
            yield _Slip("unit", label, ((address, replace(cell, unit=unit)),))


def readable(text: str) -> bool:
    """Tell whether a number could be printed so: it starts with a digit, without idle zeros."""
    body = text.removeprefix("-").partition("e")[0]
    return body[:1].isdigit() and not (len(body) > 1 and body[0] == "0" and body[1] != ".")


@dataclass(frozen=True)
class _Interchange:
    """Two cells, rows or columns of one table that could change places, pair by pair."""

    kind: _SlipKind
    label: str
    pairs: tuple[tuple[str, str], ...]

    @functools.cached_property
    def addresses(self) -> frozenset[str]:
        """All cells that would move."""
        return frozenset(itertools.chain.from_iterable(self.pairs))

    def slip(self, cells: Sheet) -> _Slip | None:
        """Return the interchange, or None if it would change nothing or mix units.

        A row or column must change at least two pairs of cells; with one pair it is no more
        than an interchange of two cells.
        """
        pairs = [(cells[one], cells[two]) for one, two in self.pairs]
        if any(one.unit != two.unit for one, two in pairs):
            return None
        changes: list[tuple[str, Cell]] = []
        for one, two in pairs:
            if one.number != two.number:
                changes.append((one.address, replace(one, content=two.number)))
                changes.append((two.address, replace(two, content=one.number)))
        if len(changes) <= (0 if self.kind == "cells" else 2):
            return None
        return _Slip(self.kind, self.label, tuple(changes))


def _interchanges(cells: Sheet, keys: Iterable[str]) -> list[_Interchange]:
    """Return what could be interchanged in some tables.

    Two cells within their row, column or group; two rows or two columns of a table.
    """
    found: list[_Interchange] = []
    for key in keys:
        # By row, which is empty in a group, and column.
        table = {c.name.rpartition(".")[::2]: a for a, c in cells.items() if c.key == key}
        for ((row, column), one), (other, two) in itertools.combinations(table.items(), 2):
            if not row or row == other[0] or column == other[1]:
                found.append(_Interchange("cells", f"{one} ↔ {two}", ((one, two),)))
        columns: dict[str, dict[str, str]] = {}
        rows: dict[str, dict[str, str]] = {}
        for (row, column), address in table.items():
            if row:
                columns.setdefault(column, {})[row] = address
                rows.setdefault(row, {})[column] = address
        found += [*_two_lines(key, "columns", columns), *_two_lines(key, "rows", rows)]
    return found


def _two_lines(
    key: str, kind: _SlipKind, lines: Mapping[str, Mapping[str, str]]
) -> Iterator[_Interchange]:
    for (name, one), (other, two) in itertools.combinations(lines.items(), 2):
        pairs = tuple((one[at], two[at]) for at in one if at in two)
        if len(pairs) > 1:
            yield _Interchange(kind, f"{key}: {kind} {name} ↔ {other}", pairs)


@dataclass(frozen=True)
class _State:
    """A sheet with some slips undone, in their order, and the relations that then contradict."""

    slips: tuple[_Slip, ...]
    cells: Sheet
    wrong: frozenset[str]

    @property
    def cost(self) -> float:
        """The sum of the slips' sizes."""
        return sum(slip.cost for slip in self.slips)

    def changed(self, cells: Sheet) -> frozenset[Cell]:
        """Return the cells that print something else, whatever the order of the slips."""
        moved = {address for slip in self.slips for address in slip.addresses}
        return frozenset(self.cells[a] for a in moved if self.cells[a] != cells[a])


@dataclass(frozen=True)
class Correction(_State):
    """Slips that, undone together, lift a group of contradictions.

    `lifted` relations no longer contradict, `broken` ones held as printed and no longer do;
    `unknowns` has what the relations then say of them. `moved` are the paper's claims that no
    longer hold, once the cells that a broken relation computes are computed again.
    """

    lifted: tuple[str, ...]
    broken: tuple[str, ...]
    unknowns: dict[str, Agreement]
    moved: tuple[str, ...]

    @property
    def restores_everything(self) -> bool:
        """Whether no relation is broken in exchange."""
        return not self.broken


def corrections(
    cells: Sheet,
    relations: Sequence[Relation],
    targets: frozenset[str],
    depth: int = _DEPTH,
) -> list[Correction]:
    """Return corrections that lift a group of contradictions, given by name.

    Those that restore everything first, then those that break other relations in exchange; within
    each, by size, and by what they break and lift.
    """

    def rank(found: Correction) -> tuple[bool, float, int, int]:
        broken = len(found.broken)
        return bool(broken), found.cost, broken, -len(found.lifted)

    search = _Search(cells, relations, targets)
    found = [_correction(state, search) for state in search.run(depth)]
    return sorted(_worth_showing(found), key=rank)


class _Search:
    """A search over the slips that could lift one group of contradictions, its targets."""

    def __init__(
        self, cells: Sheet, relations: Sequence[Relation], targets: frozenset[str]
    ) -> None:
        self.cells = cells
        self.targets = targets
        blamed = [r for r in relations if r.name in targets]
        family = _sharing(blamed, relations)
        keys = dict.fromkeys(cells[a].key for r in [*blamed, *family] for a in r.addresses)
        touched = [r for r in relations if any(cells[a].key in keys for a in r.addresses)]
        # What one relation allows of an unknown decides who else agrees with the most.
        voting = {*touched, *_sharing(touched, relations)}
        self.near = [r for r in relations if r in voting]
        self.interchanges = _interchanges(cells, keys)
        self.already = contradicted(cells, self.near)
        self.start = _State((), cells, self.already)
        self._touched: dict[frozenset[str], list[list[Relation]]] = {}

    def run(self, depth: int) -> list[_State]:
        """Return the states without a contradiction of the group."""
        done: dict[frozenset[Cell], _State] = {}
        limit = math.inf  # the size of the smallest correction that restores everything
        level = [self.start]
        for taken in range(depth):
            level = self._further(level, taken) if taken else level
            for state in level:
                for child in self._finished(state, limit):
                    done.setdefault(child.changed(self.cells), child)
                    if not child.wrong - self.already:
                        limit = min(limit, child.cost)
            if math.isfinite(limit):
                break  # more slips are less likely
        return [
            state
            for state in done.values()
            if len(state.slips) == 1 or state.cost < limit or not state.wrong - self.already
        ]

    def covers(self, state: _State) -> list[frozenset[str]]:
        """Return sets of cells, each of which must be touched to lift the group.

        At least one for each relation of the group that contradicts.
        """
        ours = [r for r in self.near if r.name in self.targets]
        found = []
        for relation in (r for r in ours if r.name in state.wrong):
            own = frozenset(relation.addresses)
            value = _value(relation, state.cells)
            if value is None:
                found.append(own)
                continue
            rivals = [r for r in ours if r.unknown is relation.unknown]
            asked = [(r, _value(r, state.cells)) for r in rivals]
            apart = [r for r, other in asked if other and not intervals.meet(value, other)]
            found += [own | frozenset(r.addresses) for r in apart]
            if not apart:  # outvoted by relations that were right: any of them may change sides
                family = [r for r in self.near if r.unknown is relation.unknown]
                found.append(frozenset(itertools.chain.from_iterable(r.addresses for r in family)))
        return list(dict.fromkeys(found))

    def _further(self, level: Sequence[_State], taken: int) -> list[_State]:
        """Return the states one slip on: all of them as long as the search is complete."""

        def promise(state: _State) -> float:
            return state.cost + self._ill(state.wrong)

        if taken < _COMPLETE:
            grown = itertools.chain(*(self._grown(state) for state in level))
            return sorted(grown, key=lambda state: (state.cost, len(state.wrong - self.already)))
        found: dict[frozenset[Cell], _State] = {}
        for state in sorted(level, key=promise)[:_BREADTH]:
            for child in self._grown(state, self._ill(state.wrong)):
                found.setdefault(child.changed(self.cells), child)
        return sorted(found.values(), key=promise)[:_BREADTH]

    def _ill(self, wrong: frozenset[str]) -> float:
        left, broken = wrong & self.targets, wrong - self.already
        return len(left) + _BROKEN * len(broken)

    def _grown(self, state: _State, below: float = math.inf) -> Iterator[_State]:
        """Yield the states one slip on that touch the smallest cover, with the group still wrong.

        Only those with less wrong than `below`, as `_ill` weighs it.
        """
        cover = min(self.covers(state), key=len)
        slips = (self._slips(state, address, lifting=False) for address in sorted(cover))
        for slip in itertools.chain(*slips, self._interchanged(state, [cover])):
            child = self._after(state, slip)
            if child and child.wrong & self.targets and self._ill(child.wrong) < below:
                yield child

    def _finished(self, state: _State, limit: float) -> Iterator[_State]:
        """Yield every state one slip on in which nothing of the group contradicts."""
        room = limit - state.cost
        if room < min(COSTS.values()):
            return
        covers = self.covers(state)
        common = frozenset.intersection(*covers)
        slips = (self._slips(state, address) for address in sorted(common))
        for slip in itertools.chain(*slips, self._interchanged(state, covers)):
            child = self._after(state, slip, lifting=True) if slip.cost <= room else None
            # One as large as what restores everything must do so too.
            if child and (slip.cost < room or not child.wrong - self.already):
                yield child

    def _interchanged(self, state: _State, covers: Sequence[frozenset[str]]) -> Iterator[_Slip]:
        """Yield the interchanges that touch all covers."""
        for one in self.interchanges:
            if not any(map(one.addresses.isdisjoint, covers)):
                slip = one.slip(state.cells)
                if slip is not None:
                    yield slip

    def _slips(self, state: _State, address: str, lifting: bool = True) -> Iterator[_Slip]:
        """Yield the slips in one cell, or those that may lift its contradictions."""
        if any(slip.addresses == {address} for slip in state.slips):
            return  # enough slips turn any number into any other
        wrong = state.wrong & self.targets if lifting else frozenset()
        blamed = [r for r in self.near if r.name in wrong and address in r.addresses]
        goals = [self._goals(r, address, state.cells) for r in by_value(blamed)]
        for slip, reached in _slips_of(state.cells[address]):
            if all(any(intervals.meet(reached, one) for one in goal) for goal in goals):
                yield slip

    def _goals(self, relation: Relation, address: str, cells: Sheet) -> list[Interval]:
        """Return the values of a cell that a relation allows, its unknown as the others have it."""
        others = [r for r in _sharing([relation], self.near) if address not in r.addresses]
        about = list(agreements(cells, others).values())
        values: list[Interval | None] = [*about[0].by_relation.values()] if about else []
        boxes = intervals.printed_intervals(cells, [relation]) | {address: intervals.EVERYTHING}
        free = [intervals.contract(relation, boxes, value) for value in values or [None]]
        return [found[address] for found in free if found is not None]

    def _after(self, state: _State, slip: _Slip, lifting: bool = False) -> _State | None:
        """Undo a slip, and judge again what it touches and what shares an unknown with that.

        If the group is to be lifted, None where it is not: its own relations tell first.
        """
        batches = self._touched.get(slip.addresses) or self._batches(slip.addresses)
        self._touched[slip.addresses] = batches
        cells = slip.undone(state.cells)
        wrong = state.wrong - {r.name for r in itertools.chain(*batches)}
        for batch in batches:
            wrong |= contradicted(cells, batch)
            if lifting and wrong & self.targets:
                return None
        return _State((*state.slips, slip), cells, wrong)

    def _batches(self, addresses: frozenset[str]) -> list[list[Relation]]:
        """Return what to judge again where some cells change: alone, or with all that share."""
        hit = [r for r in self.near if not addresses.isdisjoint(r.addresses)]
        batches = [[r] for r in hit if not r.unknown]
        shared = {r.unknown: _sharing([r], self.near) for r in hit if r.unknown}
        batches += shared.values()
        return sorted(batches, key=lambda batch: not any(r.name in self.targets for r in batch))


@functools.lru_cache(maxsize=5_000)
def _slips_of(cell: Cell) -> tuple[tuple[_Slip, Interval], ...]:
    """Return the slips in a cell, each with the values that then print so."""
    return tuple((slip, intervals.widened(slip.changes[0][1].allowed)) for slip in _of_cell(cell))


def _sharing(some: Iterable[Relation], relations: Iterable[Relation]) -> list[Relation]:
    """Return the relations that share an unknown with some of them."""
    unknowns = {r.unknown for r in some if r.unknown}
    return [r for r in relations if r.unknown in unknowns]


def _value(relation: Relation, cells: Sheet) -> Interval | None:
    """Return what a relation allows of its unknown; None if that is nothing or it has none."""
    return intervals.projection(relation, intervals.printed_intervals(cells, [relation]))


def _correction(state: _State, search: _Search) -> Correction:
    order = [relation.name for relation in search.near]
    broken = state.wrong - search.already
    ours = [relation for relation in search.near if relation.name in search.targets]
    return Correction(
        **vars(state),
        lifted=tuple(name for name in order if name in search.already - state.wrong),
        broken=tuple(name for name in order if name in broken),
        unknowns=agreements(state.cells, ours),
        moved=_moved_claims(state.cells, search, broken),
    )


def _moved_claims(cells: Sheet, search: _Search, broken: frozenset[str]) -> tuple[str, ...]:
    """Compute again the results of broken relations and see which claims then fail."""
    anew = dict(cells)
    for relation in search.near:
        result = relation.result
        if relation.name in broken and result is not None and relation.unknown is None:
            _, right = relation.sides({a: anew[a].si for a in relation.addresses})
            printed = anew[result]
            if math.isfinite(right):
                text = printed.number.format(right / si_factor(printed.unit))
                anew[result] = reprinted(printed, text)
    claims = [relation for relation in search.near if relation.claim]
    fallen = contradicted(anew, claims) - search.already
    return tuple(dict.fromkeys(r.claim for r in claims if r.claim and r.name in fallen))


def _worth_showing(found: Sequence[Correction]) -> Iterator[Correction]:
    """Leave out what holds a smaller correction whole, unless only it restores everything."""
    kept: list[tuple[frozenset[tuple[tuple[str, Cell], ...]], bool]] = []
    for correction in sorted(found, key=lambda c: c.cost):
        whole = correction.restores_everything
        changes = frozenset(slip.changes for slip in correction.slips)
        if not any(less < changes and (full or not whole) for less, full in kept):
            kept.append((changes, whole))
            yield correction
