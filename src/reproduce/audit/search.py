"""The search for slips of the pen that lift a group of contradictions.

It rests on one fact. A relation that cannot hold stays so until one of its cells changes; two
relations that share an unknown and allow no common value of it stay apart until a cell of one of
them changes. Each contradiction is therefore a set of cells that every correction must touch. The
search follows every slip that touches such a set, and then every slip that touches all sets that
are left: up to two slips, in different numbers, it overlooks nothing. Beyond that it follows the
most promising pairs only.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

from reproduce.audit.examine import boxes_of, by_value, contradicted, fix_unknowns, uniform
from reproduce.audit.intervals import EVERYTHING
from reproduce.audit.quantity import Interval, Sheet, allowed
from reproduce.audit.relation import Relation
from reproduce.audit.slips import COSTS, Slip, lines, of_cell, reaching
from reproduce.audit.solve import contract, projection, widened

# In the order of search, a relation still wrong weighs as one digit, a newly broken one half: an
# interchange may break what the next one mends.
_BROKEN = 0.5
COMPLETE = 2
SMALLEST = min(COSTS.values())


@dataclass(frozen=True)
class State:
    """A sheet with some slips undone.

    Parameters
    ----------
    slips : tuple of Slip
        The slips, in the order in which they were undone.
    cells : mapping of str to Quantity
        What the sheet then prints.
    wrong : frozenset of str
        Names of the relations that then contradict.
    """

    slips: tuple[Slip, ...]
    cells: Sheet
    wrong: frozenset[str]

    @property
    def cost(self) -> float:
        """The sum of the slips' sizes."""
        return sum(slip.cost for slip in self.slips)

    def fingerprint(self, cells: Sheet) -> frozenset[tuple[str, str]]:
        """Tell states apart by what they print, whatever the order of the slips."""
        changed = (a for slip in self.slips for a, _ in slip.changes)
        return frozenset(
            (a, f"{self.cells[a].number.text} {self.cells[a].unit}")
            for a in changed
            if self.cells[a] != cells[a]
        )


class Search:
    """A search over the slips that could lift one group of contradictions.

    Parameters
    ----------
    cells : mapping of str to Quantity
        The printed numbers.
    relations : sequence of Relation
        What they should keep.
    targets : frozenset of str
        Names of the contradictions to lift.
    """

    def __init__(
        self, cells: Sheet, relations: Sequence[Relation], targets: frozenset[str]
    ) -> None:
        self.cells = cells
        self.targets = targets
        blamed = [r for r in relations if r.name in targets]
        shared = {r.unknown.name for r in blamed if r.unknown}
        family = [r for r in relations if r.unknown and r.unknown.name in shared]
        keys = dict.fromkeys(cells[a].key for r in [*blamed, *family] for a in r.addresses)
        touched = [r for r in relations if any(cells[a].key in keys for a in r.addresses)]
        # What one relation allows of an unknown decides who else agrees with the most.
        voting = {r.unknown.name for r in touched if r.unknown}
        self.near = [
            r for r in relations if r in touched or (r.unknown and r.unknown.name in voting)
        ]
        self.lines = lines(cells, keys)
        self.already = contradicted(cells, self.near)
        self.start = State((), cells, self.already)
        self._affected: dict[frozenset[str], list[Relation]] = {}

    def run(self, depth: int, breadth: int) -> list[State]:
        """Return the states without a contradiction of the group."""
        if self._at_least(self.start) > depth:
            return []
        done: dict[frozenset[tuple[str, str]], State] = {}
        limit = math.inf  # the size of the smallest correction that restores everything
        level = [self.start]
        for taken in range(depth):
            level = self._further(level, taken, breadth) if taken else level
            for state in level:
                for child in self.finished(state, limit):
                    done.setdefault(child.fingerprint(self.cells), child)
                    if not child.wrong - self.already:
                        limit = min(limit, child.cost)
            if math.isfinite(limit):
                break  # more slips are less likely
        return [
            state
            for state in done.values()
            if len(state.slips) == 1 or state.cost < limit or not state.wrong - self.already
        ]

    def _further(self, level: Sequence[State], taken: int, breadth: int) -> list[State]:
        """Return the states one slip on: all of them as long as the search is complete."""
        if taken < COMPLETE:
            grown = (self._grown(state, self._any) for state in level)
            return sorted(itertools.chain(*grown), key=self._size)
        best = sorted(level, key=self._promise)[:breadth]
        found: dict[frozenset[tuple[str, str]], State] = {}
        for state in best:
            for child in self._grown(state, self._reaching, self._ill(state.wrong)):
                found.setdefault(child.fingerprint(self.cells), child)
        return sorted(found.values(), key=self._promise)[:breadth]

    def _grown(
        self,
        state: State,
        single: Callable[[State, str], Iterable[Slip]],
        below: float = math.inf,
    ) -> Iterator[State]:
        """Yield the states one slip on that touch the smallest set, with the group still wrong.

        Only those with less wrong than `below`, as `_ill` weighs it.
        """
        cover = min(self.covers(state), key=len)
        slips = (single(state, address) for address in sorted(cover))
        for slip in itertools.chain(*slips, self._interchanges(state, [cover])):
            child = self._after(state, slip, below)
            if child is not None and child.wrong & self.targets:
                yield child

    def _any(self, state: State, address: str) -> Iterable[Slip]:
        return [] if _slipped(state, address) else of_cell(state.cells[address])

    def _size(self, state: State) -> tuple[float, int]:
        return state.cost, len(state.wrong - self.already)

    def _promise(self, state: State) -> float:
        return state.cost + self._ill(state.wrong)

    def _ill(self, wrong: frozenset[str]) -> float:
        left, broken = wrong & self.targets, wrong - self.already
        return len(left) + _BROKEN * len(broken)

    def covers(self, state: State) -> list[frozenset[str]]:
        """Return sets of cells, each of which must be touched to lift the group.

        At least one for each relation of the group that contradicts.
        """
        ours = [r for r in self.near if r.name in self.targets]
        found = []
        for relation in (r for r in ours if r.name in state.wrong):
            own = frozenset(relation.addresses)
            value = _value(relation, state.cells)
            if relation.unknown is None or value is None:
                found.append(own)
                continue
            rivals = [r for r in ours if r.unknown is relation.unknown]
            apart = [r for r in rivals if _apart(value, _value(r, state.cells))]
            found += [own | frozenset(r.addresses) for r in apart]
            if not apart:  # outvoted by relations that were right: any of them may change sides
                family = [r for r in self.near if r.unknown is relation.unknown]
                found.append(frozenset(itertools.chain.from_iterable(r.addresses for r in family)))
        return list(dict.fromkeys(found))

    def _at_least(self, state: State) -> int:
        """Return how many slips are needed at least: a slip stays within one table."""
        seen: set[str] = set()
        count = 0
        for cover in sorted(self.covers(state), key=len):
            keys = {self.cells[a].key for a in cover}
            if not keys & seen:
                seen |= keys
                count += 1
        return count

    def _interchanges(
        self, state: State, covers: Sequence[frozenset[str]], room: float = math.inf
    ) -> Iterator[Slip]:
        for line in self.lines:
            if COSTS[line.kind] <= room and not any(map(line.addresses.isdisjoint, covers)):
                slip = line.slip(state.cells)
                if slip is not None:
                    yield slip

    def finished(self, state: State, limit: float = math.inf) -> Iterator[State]:
        """Yield every state one slip on in which nothing of the group contradicts."""
        room = limit - state.cost
        if room < SMALLEST:
            return
        covers = self.covers(state)
        if room == SMALLEST:  # nothing may stay broken, so what is broken must be touched too
            broken = state.wrong - self.already
            covers += [
                frozenset(r.addresses) for r in self.near if r.name in broken and not r.unknown
            ]
        common = frozenset.intersection(*covers) - self._tried_before(state)
        slips = (self._lifting(state, address) for address in sorted(common))
        for slip in itertools.chain(*slips, self._interchanges(state, covers, room)):
            lifts = slip.cost <= room and self._lifts(state, slip)
            if lifts and (slip.cost < room or self._restores(state, slip)):
                yield self._after(state, slip) or state

    def _tried_before(self, state: State) -> frozenset[str]:
        """Return the cells whose slips were tried first: a pair need not come in both orders."""
        if len(state.slips) != 1 or len(state.slips[0].addresses) > 1:
            return frozenset()
        (address,) = state.slips[0].addresses
        return frozenset(a for a in min(self.covers(self.start), key=len) if a < address)

    def _lifts(self, state: State, slip: Slip) -> bool:
        """Tell whether a slip leaves nothing of the group; cheaper than judging all it touches."""
        blamed = [r for r in self._again(slip.addresses) if r.name in self.targets]
        if state.wrong & self.targets - {r.name for r in blamed}:
            return False
        cells = slip.undone(state.cells)
        alone = [r for r in blamed if r.unknown is None]
        if any(contradicted(cells, [relation]) for relation in alone):
            return False
        shared = [r for r in self._again(slip.addresses) if r.unknown is not None]
        return not contradicted(cells, shared) & self.targets

    def _restores(self, state: State, slip: Slip) -> bool:
        """Tell whether a slip breaks nothing, and stop at the first relation that it breaks."""
        again = self._again(slip.addresses)
        if state.wrong - self.already - {r.name for r in again}:
            return False
        cells = slip.undone(state.cells)
        alone = (r for r in again if r.unknown is None and r.name not in self.already)
        if any(contradicted(cells, [relation]) for relation in alone):
            return False
        return not contradicted(cells, [r for r in again if r.unknown]) - self.already

    def _reaching(self, state: State, address: str) -> Iterator[Slip]:
        """Yield the slips in one cell that may let a contradicting relation hold."""
        if _slipped(state, address):
            return
        printed = state.cells[address]
        wrong = [r for r in self.near if r.name in state.wrong & self.targets]
        relation = next((r for r in wrong if address in r.addresses), None)
        if relation is None:
            yield from of_cell(printed)
        elif relation.kind == "print":
            yield from (s for s in of_cell(printed) if uniform(s.undone(state.cells), relation))
        else:
            boxes = boxes_of(state.cells, [relation], "nearest") | {address: EVERYTHING}
            free = [contract(relation, boxes, v) for v in self._values(relation, state.cells)]
            yield from reaching(printed, [f[address] for f in free if f is not None])

    def _lifting(self, state: State, address: str) -> Iterator[Slip]:
        """Yield the slips in one cell that may let every contradicting relation of it hold."""
        blamed = [
            r
            for r in self.near
            if r.name in state.wrong & self.targets and address in r.addresses and r.unknown is None
        ]
        goals: list[Interval] = []
        for relation in by_value(blamed):
            boxes = boxes_of(state.cells, [relation], "nearest") | {address: EVERYTHING}
            free = contract(relation, boxes)
            if free is None:
                return
            goals.append(free[address])
        for slip in self._reaching(state, address):
            low, high = widened(allowed(slip.changes[0][1]))
            if all(low <= end and high >= start for start, end in goals):
                yield slip

    def _values(self, relation: Relation, cells: Sheet) -> Iterable[Interval | None]:
        """Return the values of the unknown worth trying: those that the others allow."""
        if relation.unknown is None:
            return [None]
        others = [r for r in self.near if r.unknown is relation.unknown and r is not relation]
        about = fix_unknowns(cells, others).get(relation.unknown.name)
        return list(about.by_relation.values()) if about and about.by_relation else [None]

    def _after(self, state: State, slip: Slip, below: float = math.inf) -> State | None:
        """Undo a slip, and judge again what it touches and what shares an unknown with that.

        None as soon as so much is wrong as `below` says.
        """
        cells = slip.undone(state.cells)
        again = self._again(slip.addresses)
        wrong = state.wrong - {r.name for r in again}
        shared = [r for r in again if r.unknown]
        for some in [*([r] for r in again if not r.unknown), shared]:
            if self._ill(wrong) >= below:
                return None
            wrong |= contradicted(cells, some)
        return State((*state.slips, slip), cells, wrong) if self._ill(wrong) < below else None

    def _again(self, moved: frozenset[str]) -> list[Relation]:
        """Return the relations of some cells, and those that share an unknown with them."""
        if moved not in self._affected:
            hit = [r for r in self.near if not moved.isdisjoint(r.addresses)]
            unknowns = {r.unknown.name for r in hit if r.unknown}
            self._affected[moved] = [
                r for r in self.near if r in hit or (r.unknown and r.unknown.name in unknowns)
            ]
        return self._affected[moved]


def _slipped(state: State, address: str) -> bool:
    """Tell whether a number has had its slip: enough of them turn any number into any other."""
    return any(slip.addresses == {address} for slip in state.slips)


def _value(relation: Relation, cells: Sheet) -> Interval | None:
    if relation.unknown is None:
        return None
    return projection(relation, boxes_of(cells, [relation], "nearest"))


def _apart(one: Interval, two: Interval | None) -> bool:
    return two is not None and (one[1] < two[0] or two[1] < one[0])
