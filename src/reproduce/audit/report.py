"""The whole audit of a table or paper in one call."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field

from reproduce.audit.conflicts import Conflict, conflicts
from reproduce.audit.corrections import Correction, corrections
from reproduce.audit.declared import declared, relations_of
from reproduce.audit.equations import Demonstration, demonstrations
from reproduce.audit.examine import (
    OUTCOMES,
    Finding,
    Fixed,
    Outcome,
    examine,
    fix_unknowns,
    rounding_votes,
)
from reproduce.audit.grouping import apart, groups
from reproduce.audit.quantity import Sheet, sheet
from reproduce.audit.relation import Relation
from reproduce.printed.cells import PAPERS, library


@dataclass(frozen=True)
class Group:
    """Contradictions that hang together, and what would lift them.

    Parameters
    ----------
    relations : tuple of str
        Names of the relations.
    corrections : tuple of Correction
        Those that restore everything first, then by size; empty if no slips of the pen within
        the search lift them.
    """

    relations: tuple[str, ...]
    corrections: tuple[Correction, ...]


@dataclass(frozen=True)
class Audit:
    """What the relations say of a table or paper.

    Parameters
    ----------
    name : str
        The paper, or what the caller calls the table.
    cells : mapping of str to Quantity
        The printed numbers.
    findings : tuple of Finding
        One for each relation, those that rest on a supposition of ours included.
    conflicts : tuple of Conflict
        The smallest sets of cells that cannot all be right.
    groups : tuple of Group
        Contradictions that hang together, with corrections.
    unknowns : dict
        What the relations say of numbers that are not printed.
    equations : tuple of Demonstration
        Equations run as printed.
    """

    name: str
    cells: Sheet
    findings: tuple[Finding, ...]
    conflicts: tuple[Conflict, ...]
    groups: tuple[Group, ...]
    unknowns: dict[str, Fixed]
    equations: tuple[Demonstration, ...] = ()
    votes: dict[str, int] = field(default_factory=dict)

    @property
    def examined(self) -> tuple[str, ...]:
        """The cells held against another one by some relation, in the order of the sheet."""
        found = {a for f in self.findings if f.relation.compares for a in f.relation.addresses}
        return tuple(address for address in self.cells if address in found)

    @property
    def bounded(self) -> tuple[str, ...]:
        """The cells of which relations tell no more than a sign, a bound or a last digit."""
        found = {a for finding in self.findings for a in finding.relation.addresses}
        return tuple(a for a in self.cells if a in found and a not in self.examined)

    @property
    def read(self) -> tuple[Finding, ...]:
        """The findings on what the paper says, without those that rest on a supposition of ours."""
        return tuple(f for f in self.findings if not f.relation.supposition)

    @property
    def supposed(self) -> tuple[Finding, ...]:
        """The findings that rest on a supposition of ours."""
        return tuple(f for f in self.findings if f.relation.supposition)

    @property
    def failing(self) -> tuple[Demonstration, ...]:
        """The equations that fail as extracted, without those that rest on a supposition."""
        return tuple(e for e in self.equations if not (e.holds or e.supposition))

    def tally(self) -> dict[Outcome, int]:
        """Count the relations without suppositions by outcome, every outcome present."""
        return {o: sum(f.outcome == o for f in self.read) for o in OUTCOMES}

    def blamed(self) -> dict[str, int]:
        """Count, for each cell in a contradiction, the smallest sets that hold it."""
        counts: dict[str, int] = {}
        for conflict in self.conflicts:
            for address in conflict.cells:
                counts[address] = counts.get(address, 0) + 1
        return counts

    def finding(self, name: str) -> Finding:
        """Return the finding on one relation, or raise KeyError."""
        for finding in self.findings:
            if finding.relation.name == name:
                return finding
        raise KeyError(f"{self.name} has no relation {name!r}")


def audit_table(name: str, cells: Sheet, relations: Sequence[Relation] | str) -> Audit:
    """Audit any table: which of its numbers agree among themselves, and what may be wrong.

    Examples
    --------
    >>> from reproduce.audit.quantity import quantity
    >>> texts = {"t#1.net": "8.25", "t#1.tax": "1.65", "t#1.gross": "9.09"}
    >>> table = {address: quantity(address, text) for address, text in texts.items()}
    >>> relations = '''
    ... [[relations.all]]
    ... name = "sum"
    ... formula = "gross = net + tax"
    ... cells = "gross=t#1.gross net=t#1.net tax=t#1.tax"
    ... kind = "arithmetic"
    ... source = "by name"
    ... '''
    >>> found = audit_table("an invoice", table, relations)
    >>> found.findings[0].outcome
    'contradicts'
    >>> found.groups[0].corrections[0].slips[0].told
    't#1.gross: 9.09 → 9.90'
    """
    lines = declared(relations, cells) if isinstance(relations, str) else list(relations)
    findings = examine(cells, lines)
    told = [relation for relation in lines if not relation.supposition]
    found = [part for names in groups(cells, told) for part in _parts(cells, told, names)]
    return Audit(
        name=name,
        cells=cells,
        findings=tuple(findings),
        conflicts=tuple(conflicts(cells, told)),
        groups=tuple(found),
        unknowns=fix_unknowns(cells, lines),
        votes=rounding_votes(f for f in findings if not f.relation.supposition),
    )


def _parts(cells: Sheet, lines: Sequence[Relation], names: frozenset[str]) -> list[Group]:
    """Explain contradictions that hang together as one, or else one by one."""
    whole = corrections(cells, lines, names)
    parts = [names] if whole else apart(lines, names)
    if len(parts) == 1:
        return [Group(_ordered(lines, names), tuple(whole))]
    return [Group(_ordered(lines, n), tuple(corrections(cells, lines, n))) for n in parts]


def _ordered(lines: Sequence[Relation], names: frozenset[str]) -> tuple[str, ...]:
    return tuple(relation.name for relation in lines if relation.name in names)


@functools.cache
def audit_paper(paper: str) -> Audit:
    """Audit the printed numbers and equations of a paper."""
    if paper not in PAPERS:
        raise KeyError(f"unknown paper {paper!r}; expected one of {', '.join(PAPERS)}")
    tables = (table for key, table in library().items() if key.startswith(f"{paper}/"))
    cells = sheet(cell for table in tables for cell in table.cells)
    found = audit_table(paper, cells, relations_of(paper, cells))
    shown = tuple(demonstrations(paper, cells))
    return Audit(**{**found.__dict__, "equations": shown})
