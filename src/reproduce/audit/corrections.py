"""Corrections that lift contradictions, ranked by how small a slip of the pen they suppose."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from reproduce.audit.examine import Fixed, by_value, contradicted, fix_unknowns
from reproduce.audit.quantity import Quantity, Sheet
from reproduce.audit.relation import Relation
from reproduce.audit.search import Search, State
from reproduce.audit.slips import Slip
from reproduce.printed.units import si_factor

DEPTH = 3
BREADTH = 30


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


def corrections(
    cells: Sheet,
    relations: Sequence[Relation],
    targets: frozenset[str],
    depth: int = DEPTH,
    breadth: int = BREADTH,
) -> list[Correction]:
    """Return corrections that lift a group of contradictions, the smallest slips first.

    Those that restore everything first, then those that break other relations in exchange; within
    each, by size.
    """
    search = Search(cells, relations, targets)
    found = [_correction(state, search) for state in search.run(depth, breadth)]
    return sorted(_worth_showing(found), key=_rank)


def _rank(correction: Correction) -> tuple[bool, float, int, int, float]:
    """Order corrections: whole ones first, then by size, by what they break and lift, by fit."""
    broken = len(correction.broken)
    lifted = len(correction.lifted)
    return bool(broken), correction.cost, broken, -lifted, correction.misfit


def _correction(state: State, search: Search) -> Correction:
    near, already = search.near, search.already
    order = [relation.name for relation in near]
    broken = tuple(name for name in order if name in state.wrong - already)
    ours = [relation for relation in near if relation.name in search.targets]
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
    for relation in by_value(relations):
        if relation.unknown is None and relation.formula.sign == "=":
            left, right = relation.sides({a: cells[a].si for a in relation.addresses})
            size = max(abs(left), abs(right))
            apart.append(abs(left - right) / size if size else 0.0)
    return max(apart, default=0.0)
