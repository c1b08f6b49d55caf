"""The check: all verdicts against the frozen ones, computations against their second entries.

The ledger moves the inputs of a computation to the corners of their rounding intervals; that gives
the ends of its result if it is monotone. The audit encloses the formula of a relation that restates
the computation, whatever its shape. Both must give the same interval.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

from reproduce.audit.intervals import enclosure
from reproduce.audit.relation import Relation, relations_of
from reproduce.audit.report import paper_sheet
from reproduce.judge.expected import surprises
from reproduce.judge.ledger import Ledger, ReadingRecord, Record, build
from reproduce.printed.cells import PAPERS
from reproduce.printed.number import Interval
from reproduce.printed.units import si_factor
from reproduce.views import keys
from reproduce.views.objects.contents import score_table
from reproduce.views.writing import verdicts
from reproduce.views.writing.blocks import Block
from reproduce.views.writing.display import Display

if TYPE_CHECKING:
    import pandas as pd

# Far above the noise of double precision, far below what any rounding of print moves.
_NOISE = 1e-9


class Check(Display):
    """The verdicts against the frozen ones. True if they and the printed files are the same.

    Parameters
    ----------
    wanted : tuple of str
        The items; all by default.
    progress : callable, optional
        Called with the number of items done and of all.
    """

    def __init__(
        self, wanted: tuple[str, ...] = (), progress: Callable[[int, int], None] | None = None
    ) -> None:
        self.ledger = build([keys.check_key(key) for key in wanted] or None, progress)
        self.surprises = surprises(self.ledger)
        self.disagreements = disagreements(self.ledger)

    def __bool__(self) -> bool:
        """Tell whether verdicts are as frozen, files as summed, and second entries agree."""
        return not (self.surprises or self.ledger.altered or self.disagreements)

    def frame(self) -> pd.DataFrame:
        """Return the cells whose verdict is not the frozen one."""
        import pandas as pd

        return pd.DataFrame(map(vars, self.surprises), columns=["cell", "expected", "found"])

    def remarks(self) -> list[str]:
        """Return what is to be said of the score: weak agreement, and the outcome if it is good."""
        records = self.ledger.records
        weak = [
            f"{count} {flag.replace('_', ' ')}"
            for flag, count in verdicts.weak(records).items()
            if count
        ]
        lines = [f"Weak agreement, counted apart: {', '.join(weak)}."] if weak else []
        return lines + ([f"All {len(records)} verdicts are as frozen."] if self else [])

    def faults(self) -> list[str]:
        """Return what is not as frozen, and what to do about it."""
        lines = [f"{s.cell}: expected {s.expected}, found {s.found}" for s in self.surprises]
        if lines:
            lines.append(
                f"{len(lines)} verdicts differ from data/verdicts.toml; find the cause, or change "
                "that file with the reason"
            )
        lines += [
            f"data/printed/{name}: not the file of its checksum in data/printed/SHA256SUMS; "
            "restore the printed digits, or enter them twice and renew the checksum"
            for name in self.ledger.altered
        ]
        return lines + self.disagreements

    def blocks(self) -> Iterator[Block]:
        """Yield the score, and what is not as frozen."""
        yield score_table(self.ledger)
        yield from (*self.remarks(), *self.faults())


def disagreements(ledger: Ledger) -> list[str]:
    """Name each relation whose interval is not that of the computation that it restates."""
    records = {record.cell: record for record in ledger.records}
    judged = {record.key for record in ledger.records}
    found = []
    for paper in PAPERS:
        cells = paper_sheet(paper)
        for relation in relations_of(paper, cells):
            if relation.restates.partition("#")[0] in judged:
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
