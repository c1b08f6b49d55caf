"""Every computation that a relation restates, held against that second entry of it.

The ledger moves the inputs of a computation to the corners of their rounding intervals; that gives
the ends of its result if it is monotone. The audit encloses the formula of the relation, whatever
its shape. Both must give the same interval.
"""

from __future__ import annotations

from reproduce.audit.relation import Relation, relations_of
from reproduce.audit.report import paper_sheet
from reproduce.audit.solve import enclosure
from reproduce.judge.ledger import Ledger, ReadingRecord, Record
from reproduce.printed.cells import PAPERS
from reproduce.printed.number import Interval
from reproduce.printed.units import si_factor

__all__ = ["disagreement", "disagreements"]

# Far above the noise of double precision, far below what any rounding of print moves.
_NOISE = 1e-9


def disagreements(ledger: Ledger) -> list[str]:
    """Name each relation whose interval is not that of the computation that it restates."""
    records = {record.cell: record for record in ledger.records}
    keys = {record.key for record in ledger.records}
    found = []
    for paper in PAPERS:
        cells = paper_sheet(paper)
        for relation in relations_of(paper, cells):
            if relation.restates.partition("#")[0] in keys:
                interval = _computed(relation, records)
                found.append(disagreement(relation, enclosure(relation, cells), interval))
    return [line for line in found if line]


def disagreement(relation: Relation, enclosed: Interval, computed: Interval) -> str:
    """Say how a formula's interval differs from that of the computation; empty if it does not."""
    size = max(map(abs, (*enclosed, *computed)))
    if all(abs(a - b) <= _NOISE * size for a, b in zip(enclosed, computed, strict=True)):
        return ""
    ours, theirs = (f"{low:.12g} to {high:.12g}" for low, high in (enclosed, computed))
    return (
        f"{relation.name} ({relation.formula.text}) gives {ours}, the computation of "
        f"{relation.restates} {theirs}, in SI: one of them is wrong, or not monotone"
    )


def _computed(relation: Relation, records: dict[str, Record]) -> Interval:
    """Return the interval of the number that a relation restates, in SI."""
    address, _, reading = relation.restates.partition(" (")
    record: Record | ReadingRecord = records[address]
    unit = records[address].unit
    if reading:
        by_name = {f"{one.name})": one for one in records[address].readings}
        record = by_name[reading]
    if record.computed is None:
        raise ValueError(f"{relation.name}: {relation.restates} is not computed")
    low, high = record.interval or (record.computed, record.computed)
    return low * si_factor(unit), high * si_factor(unit)
