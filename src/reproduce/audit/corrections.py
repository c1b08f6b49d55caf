"""Corrections that lift contradictions, ranked by how small a slip of the pen they suppose.

A best-first search over slips: at each step every slip is tried that touches a cell of a relation
now in contradiction and that lifts at least one contradiction, and the most promising states
go on. What it returns has been checked against every relation; what it does not find within its
breadth and depth may still exist.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from reproduce.audit.examine import Fixed, boxes_of, contradicted, fix_unknowns
from reproduce.audit.quantity import Interval, Quantity, Sheet
from reproduce.audit.relation import Relation
from reproduce.audit.slips import Slip, of_lines, reaching
from reproduce.audit.solve import EVERYTHING, contract
from reproduce.printed.units import si_factor

DEPTH = 3
BREADTH = 30
# In the order of search, a relation still wrong weighs as one digit, a newly broken one half: an
# interchange may break what the next one mends.
_BROKEN = 0.5


@dataclass(frozen=True)
class Correction:
    """Slips that, undone together, lift a group of contradictions.

    Parameters
    ----------
    slips : tuple of Slip
        What is supposed to have gone wrong.
    lifted : tuple of str
        Names of the relations that no longer contradict.
    broken : tuple of str
        Names of relations that held as printed and no longer do.
    unknowns : dict
        Name to what the relations say of it after the correction.
    moved : tuple of str
        The paper's claims that no longer hold, once the cells that a broken relation computes
        are computed again.
    misfit : float
        How far the corrected numbers still lie from the relations that they should keep,
        relatively; all of it is within the rounding of print.
    """

    slips: tuple[Slip, ...]
    lifted: tuple[str, ...]
    broken: tuple[str, ...]
    unknowns: dict[str, Fixed]
    moved: tuple[str, ...]
    misfit: float

    @property
    def cost(self) -> float:
        """The sum of the slips' sizes."""
        return sum(slip.cost for slip in self.slips)

    @property
    def restores_everything(self) -> bool:
        """Whether no relation is broken in exchange."""
        return not self.broken


@dataclass(frozen=True)
class _State:
    slips: tuple[Slip, ...]
    cells: Sheet
    wrong: frozenset[str]

    @property
    def cost(self) -> float:
        return sum(slip.cost for slip in self.slips)


def corrections(
    cells: Sheet,
    relations: Sequence[Relation],
    targets: frozenset[str],
    depth: int = DEPTH,
    breadth: int = BREADTH,
) -> list[Correction]:
    """Return corrections that lift a group of contradictions, the smallest slips first.

    Parameters
    ----------
    cells : mapping of str to Quantity
        The printed numbers.
    relations : sequence of Relation
        What they should keep.
    targets : frozenset of str
        Names of the contradictions to lift, see `reproduce.audit.grouping`.
    depth : int
        At most so many slips.
    breadth : int
        How many states go on at each step.

    Returns
    -------
    list of Correction
        Those that restore everything first, then those that break other relations in exchange;
        within each, by size.
    """
    near = _neighbourhood(cells, relations, targets)
    already = contradicted(cells, near)
    level = [_State((), cells, already)]
    done: dict[frozenset[tuple[str, str]], _State] = {}
    seen: set[frozenset[tuple[str, str]]] = set()
    most = 0  # what one slip has lifted at most; slips to come are not expected to do better
    for left in reversed(range(depth)):
        nearer: list[_State] = []
        for state in level:
            for child in _children(state, near, targets, already):
                told = _fingerprint(child, cells)
                if told in seen:
                    continue
                seen.add(told)
                if not child.wrong & targets:
                    done.setdefault(told, child)
                nearer.append(child)
        if any(not state.wrong - already for state in done.values()):
            break  # everything is restored, and more slips are less likely
        fewest = min((len(state.wrong & targets) for state in nearer), default=0)
        most = most or len(targets) - fewest
        if fewest > left * most:
            break
        level = sorted(nearer, key=lambda s: _promise(s, targets, already))[:breadth]
    found = [_correction(state, near, targets, already) for state in done.values()]
    return sorted(_worth_showing(found), key=_rank)


def _rank(correction: Correction) -> tuple[bool, float, int, int, float]:
    """Order corrections: whole ones first, then by size, by what they break and lift, by fit."""
    broken = len(correction.broken)
    lifted = len(correction.lifted)
    return bool(broken), correction.cost, broken, -lifted, correction.misfit


def _promise(state: _State, targets: frozenset[str], already: frozenset[str]) -> float:
    return state.cost + len(state.wrong & targets) + _BROKEN * len(state.wrong - already)


def _fingerprint(state: _State, cells: Sheet) -> frozenset[tuple[str, str]]:
    """Tell states apart by what they print, whatever the order of the slips."""
    changed = (a for slip in state.slips for a, _ in slip.changes)
    return frozenset(
        (a, f"{state.cells[a].number.text} {state.cells[a].unit}")
        for a in changed
        if state.cells[a] != cells[a]
    )


def _neighbourhood(
    cells: Sheet, relations: Sequence[Relation], targets: frozenset[str]
) -> list[Relation]:
    """Return the relations that a correction could touch: those with a cell in the same tables."""
    keys = {cells[a].key for r in relations if r.name in targets for a in r.addresses}
    return [r for r in relations if any(cells[a].key in keys for a in r.addresses)]


def _children(
    state: _State, near: Sequence[Relation], targets: frozenset[str], already: frozenset[str]
) -> Iterator[_State]:
    left_alone = already - targets  # other groups of contradictions, not ours to lift
    ours = [r for r in near if r.name in state.wrong - left_alone]
    touched = dict.fromkeys(a for relation in ours for a in relation.addresses)
    tried: dict[tuple[tuple[str, Quantity], ...], Slip] = {}
    for relation in ours:
        for slip in _single(relation, near, state.cells):
            tried.setdefault(slip.changes, slip)
    for slip in of_lines(state.cells, touched):
        tried.setdefault(slip.changes, slip)
    bound = _promise(state, targets, already)
    for slip in tried.values():
        cells = slip.undone(state.cells)
        wrong = _updated(state, near, slip, cells)
        child = _State((*state.slips, slip), cells, wrong)
        lifts = len(wrong & targets) < len(state.wrong & targets)
        if lifts or _promise(child, targets, already) - slip.cost < bound:
            yield child


def _updated(state: _State, near: Sequence[Relation], slip: Slip, cells: Sheet) -> frozenset[str]:
    """Judge again the relations that a slip touches, with those that share their unknown."""
    moved = {address for address, _ in slip.changes}
    hit = [r for r in near if moved & set(r.addresses)]
    unknowns = {r.unknown.name for r in hit if r.unknown}
    again = [r for r in near if r in hit or (r.unknown and r.unknown.name in unknowns)]
    names = {r.name for r in again}
    return (state.wrong - names) | contradicted(cells, again)


def _single(relation: Relation, near: Sequence[Relation], cells: Sheet) -> Iterator[Slip]:
    """Yield slips in one cell of a relation that let the relation hold."""
    boxes = boxes_of(cells, [relation], "nearest")
    for values in _unknown_values(relation, near, cells):
        for address in relation.addresses:
            free = contract(relation, boxes | {address: EVERYTHING}, values)
            if free is not None:
                yield from reaching(cells[address], [free[address]])


def _unknown_values(
    relation: Relation, near: Sequence[Relation], cells: Sheet
) -> Iterable[Interval | None]:
    """Return the values of the unknown worth trying: what the others agree on, or say alone."""
    if relation.unknown is None:
        return [None]
    others = [r for r in near if r.unknown is relation.unknown and r is not relation]
    about = fix_unknowns(cells, others).get(relation.unknown.name)
    if about is None or not about.by_relation:
        return [None]
    common = [about.common] if len(about.members) > 1 else []
    return common + list(about.by_relation.values())


def _correction(
    state: _State, near: Sequence[Relation], targets: frozenset[str], already: frozenset[str]
) -> Correction:
    order = [relation.name for relation in near]
    broken = tuple(name for name in order if name in state.wrong - already)
    ours = [relation for relation in near if relation.name in targets]
    unknowns = fix_unknowns(state.cells, ours)
    return Correction(
        slips=state.slips,
        lifted=tuple(name for name in order if name in already - state.wrong),
        broken=broken,
        unknowns=unknowns,
        moved=_moved_claims(state.cells, near, set(broken), already),
        misfit=_misfit(state.cells, ours, unknowns),
    )


def _moved_claims(
    cells: Sheet, near: Sequence[Relation], broken: set[str], already: frozenset[str]
) -> tuple[str, ...]:
    """Compute again the results of broken relations and see which claims then fail."""
    anew = dict(cells)
    for relation in near:
        result = relation.result
        if relation.name in broken and result is not None and relation.unknown is None:
            _, right = relation.sides({a: anew[a].si for a in relation.addresses})
            printed = anew[result]
            if not math.isfinite(right):
                continue
            text = printed.number.format(right / si_factor(printed.unit))
            anew[result] = printed.printing(text)
    claims = [relation for relation in near if relation.claim]
    fallen = contradicted(anew, claims) - already
    return tuple(dict.fromkeys(r.claim for r in claims if r.claim and r.name in fallen))


def _worth_showing(found: Sequence[Correction]) -> Iterator[Correction]:
    """Leave out what holds a smaller correction whole, unless only it restores everything."""
    kept: list[tuple[frozenset[tuple[tuple[str, Quantity], ...]], bool]] = []
    for correction in sorted(found, key=lambda c: c.cost):
        whole = correction.restores_everything
        changes = frozenset(slip.changes for slip in correction.slips)
        if not any(less < changes and (full or not whole) for less, full in kept):
            kept.append((changes, whole))
            yield correction


def _misfit(cells: Sheet, relations: Sequence[Relation], unknowns: Mapping[str, Fixed]) -> float:
    """Return how far the corrected numbers still lie from the relations, within rounding."""
    apart = [fixed.spread for fixed in unknowns.values() if fixed.by_relation]
    for relation in relations:
        if relation.unknown is None and relation.formula.sign == "=":
            left, right = relation.sides({a: cells[a].si for a in relation.addresses})
            size = max(abs(left), abs(right))
            apart.append(abs(left - right) / size if size else 0.0)
    return max(apart, default=0.0)
