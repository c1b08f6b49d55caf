"""The whole audit of a table or paper in one call."""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace

from reproduce.audit.conflicts import Conflict, apart, conflicts, groups
from reproduce.audit.corrections import Correction, corrections
from reproduce.audit.equations import Demonstration, demonstrations
from reproduce.audit.examine import (
    OUTCOMES,
    Agreement,
    Examined,
    RelationOutcome,
    agreements,
    examine,
    rounding_votes,
)
from reproduce.audit.relation import Relation, declared, relations_of
from reproduce.audit.rounding import Sheet, sheet
from reproduce.printed.cells import PAPERS, Cell, library


@dataclass(frozen=True)
class Group:
    """Names of contradictions that hang together, and what would lift them.

    Corrections that restore everything stand first, then by size; none if no slips of the pen
    within the search lift them.
    """

    relations: tuple[str, ...]
    corrections: tuple[Correction, ...]


@dataclass(frozen=True)
class Audit:
    """What the relations say of a table or paper, and its equations run as printed.

    There is a finding for each relation, those that rest on a supposition of ours included.
    """

    name: str
    cells: Sheet
    findings: tuple[Examined, ...]
    conflicts: tuple[Conflict, ...]
    groups: tuple[Group, ...]
    unknowns: dict[str, Agreement]
    votes: dict[str, int]
    equations: tuple[Demonstration, ...] = ()

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
    def read(self) -> tuple[Examined, ...]:
        """The findings on what the paper says, without those that rest on a supposition of ours."""
        return tuple(f for f in self.findings if not f.relation.supposition)

    @property
    def supposed(self) -> tuple[Examined, ...]:
        """The findings that rest on a supposition of ours."""
        return tuple(f for f in self.findings if f.relation.supposition)

    @property
    def restating(self) -> tuple[Examined, ...]:
        """The findings on what the paper says that restate a number the library computes."""
        return tuple(f for f in self.read if f.relation.restates)

    @property
    def failing(self) -> tuple[Demonstration, ...]:
        """The equations that fail as extracted, without those that rest on a supposition."""
        return tuple(e for e in self.equations if not (e.holds or e.supposition))

    def tally(self, *, restating: bool | None = None) -> dict[RelationOutcome, int]:
        """Count the relations without suppositions by outcome, every outcome present.

        All of them, or only those that do, or do not, restate a computed number.
        """
        found = [f for f in self.read if restating in {None, bool(f.relation.restates)}]
        return {o: sum(f.outcome == o for f in found) for o in OUTCOMES}

    def blamed(self) -> dict[str, int]:
        """Count, for each cell in a contradiction, the smallest sets that hold it."""
        counts: dict[str, int] = {}
        for conflict in self.conflicts:
            for address in conflict.cells:
                counts[address] = counts.get(address, 0) + 1
        return counts

    def finding(self, name: str) -> Examined:
        """Return the finding on one relation, or raise KeyError."""
        for finding in self.findings:
            if finding.relation.name == name:
                return finding
        raise KeyError(f"{self.name} has no relation {name!r}")


def audit_table(name: str, cells: Sheet, relations: Sequence[Relation] | str) -> Audit:
    """Audit any table: which of its numbers agree among themselves, and what may be wrong.

    Examples
    --------
    >>> from reproduce.audit.rounding import printed_cell
    >>> texts = {"t#1.net": "8.25", "t#1.tax": "1.65", "t#1.gross": "9.09"}
    >>> table = {address: printed_cell(address, text) for address, text in texts.items()}
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
    >>> found.groups[0].corrections[0].slips[0].label
    't#1.gross: 9.09 → 9.90'
    """
    relations = declared(relations, cells) if isinstance(relations, str) else relations
    findings = examine(cells, relations)
    read = [relation for relation in relations if not relation.supposition]
    found = [part for names in groups(cells, read) for part in _parts(cells, read, names)]
    return Audit(
        name=name,
        cells=cells,
        findings=tuple(findings),
        conflicts=tuple(conflicts(cells, read)),
        groups=tuple(found),
        unknowns=agreements(cells, relations),
        votes=rounding_votes(f for f in findings if not f.relation.supposition),
    )


def _parts(cells: Sheet, relations: Sequence[Relation], names: frozenset[str]) -> list[Group]:
    """Explain contradictions that hang together as one, or else one by one."""

    def group(part: frozenset[str], found: Sequence[Correction]) -> Group:
        return Group(tuple(r.name for r in relations if r.name in part), tuple(found))

    whole = corrections(cells, relations, names)
    parts = [names] if whole else apart(relations, names)
    if len(parts) == 1:
        return [group(names, whole)]
    return [group(part, corrections(cells, relations, part)) for part in parts]


def paper_sheet(paper: str) -> dict[str, Cell]:
    """Return the printed numbers of a paper by address."""
    if paper not in PAPERS:
        raise KeyError(f"unknown paper {paper!r}; expected one of {', '.join(PAPERS)}")
    tables = (table for key, table in library().items() if key.startswith(f"{paper}/"))
    return sheet(cell for table in tables for cell in table.cells)


@functools.cache
def audit_paper(paper: str) -> Audit:
    """Audit the printed numbers and equations of a paper."""
    cells = paper_sheet(paper)
    found = audit_table(paper, cells, relations_of(paper, cells))
    return replace(found, equations=tuple(demonstrations(paper, cells)))
