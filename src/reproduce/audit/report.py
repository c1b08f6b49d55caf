"""The whole audit of a paper in one call, and the register of errata."""

from __future__ import annotations

import fnmatch
import functools
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from pydantic import BaseModel, ConfigDict

from reproduce.audit import examine
from reproduce.audit.corrections import Correction, corrections
from reproduce.audit.equations import Demonstration, demonstrations
from reproduce.audit.relation import Finder, Relation, Sheet, relations_of
from reproduce.printed.cells import Cell, library


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
    """What the relations say of a paper, and its equations run as printed.

    There is a finding for each relation, those that rest on a supposition of ours included.
    """

    name: str
    cells: Sheet
    findings: tuple[examine.Examined, ...]
    conflicts: tuple[examine.Conflict, ...]
    groups: tuple[Group, ...]
    unknowns: dict[str, examine.Agreement]
    equations: tuple[Demonstration, ...]

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
    def read(self) -> tuple[examine.Examined, ...]:
        """The findings on what the paper says, without those that rest on a supposition of ours."""
        return tuple(f for f in self.findings if not f.relation.supposition)

    @property
    def supposed(self) -> tuple[examine.Examined, ...]:
        """The findings that rest on a supposition of ours."""
        return tuple(f for f in self.findings if f.relation.supposition)

    @property
    def restating(self) -> tuple[examine.Examined, ...]:
        """The findings on what the paper says that restate a number the library computes."""
        return tuple(f for f in self.read if f.relation.restates)

    @property
    def failing(self) -> tuple[Demonstration, ...]:
        """The equations that fail as extracted, without those that rest on a supposition."""
        return tuple(e for e in self.equations if not (e.holds or e.supposition))

    def tally(self, *, restating: bool | None = None) -> dict[examine.RelationOutcome, int]:
        """Count the relations without suppositions by outcome, every outcome present.

        All of them, or only those that do, or do not, restate a computed number.
        """
        found = [f for f in self.read if restating in {None, bool(f.relation.restates)}]
        return {o: sum(f.outcome == o for f in found) for o in examine.OUTCOMES}

    def finding(self, name: str) -> examine.Examined:
        """Return the finding on one relation, or raise KeyError."""
        for finding in self.findings:
            if finding.relation.name == name:
                return finding
        raise KeyError(f"{self.name} has no relation {name!r}")


def _paper_sheet(paper: str) -> dict[str, Cell]:
    """Return the printed numbers of a paper by address."""
    tables = (table for key, table in library().items() if key.startswith(f"{paper}/"))
    return {cell.address: cell for table in tables for cell in table.cells if cell.is_number}


@functools.cache
def audit_paper(paper: str) -> Audit:
    """Audit the printed numbers and equations of a paper."""
    cells = _paper_sheet(paper)
    return audit(paper, cells, relations_of(paper, cells))


def audit(name: str, cells: Sheet, relations: Sequence[Relation]) -> Audit:
    """Audit some cells: which agree among themselves, and what may be wrong."""
    read = [relation for relation in relations if not relation.supposition]
    return Audit(
        name=name,
        cells=cells,
        findings=tuple(examine.examine(cells, relations)),
        conflicts=tuple(examine.conflicts(cells, read)),
        groups=tuple(
            part for group in examine.groups(cells, read) for part in _parts(cells, read, group)
        ),
        unknowns=examine.agreements(cells, relations),
        equations=tuple(demonstrations(name, cells)),
    )


def _parts(cells: Sheet, every: Sequence[Relation], group: Sequence[Relation]) -> list[Group]:
    """Explain contradictions that hang together as one, or else by shared unknowns, one by one."""
    parts: dict[object, list[str]] = {}
    for relation in group:
        parts.setdefault(relation.unknown or relation.name, []).append(relation.name)
    names = [relation.name for relation in group]
    whole = corrections(cells, every, frozenset(names))
    if whole or len(parts) == 1:
        return [Group(tuple(names), tuple(whole))]
    return [
        Group(tuple(part), tuple(corrections(cells, every, frozenset(part))))
        for part in parts.values()
    ]


_Conclusion = Literal["stands", "moves", "open"]


class Erratum(BaseModel):
    """One entry of the register.

    The numbers of its evidence are not written in it: they come from the relations and equations
    that it names. Where words stand against words, `evidence` says which. `reading` tells which
    of two independent readings of the paper found it, as for a relation, and `again` whether the
    third one did too, which knew no list. An entry that holds only if we suppose something that
    the paper does not say names it as its `supposition`, and is counted apart. `extraction` marks
    what rests on a formula, a digit or a heading of our text, which a machine read. `reply` is what
    the authors of the paper say to it, with their name and the day; empty until they do.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    id: str
    paper: str
    place: str
    printed: str
    problem: str
    library: str
    conclusion: _Conclusion
    because: str
    status: Literal["open", "one reading of several", "reported", "confirmed"]
    reading: Finder
    again: bool = False
    extraction: bool = False
    supposition: str = ""
    evidence: str = ""
    reply: str = ""
    relations: list[str] = []
    equations: list[str] = []

    def findings(self, audit: Audit) -> list[examine.Examined]:
        """Return the findings of the relations that the entry names."""
        return [f for f in audit.findings if self.names(f.relation.name)]

    def names(self, relation: str) -> bool:
        """Tell whether the entry rests on a relation."""
        return any(fnmatch.fnmatchcase(relation, pattern) for pattern in self.relations)

    def demonstrations(self, audit: Audit) -> list[Demonstration]:
        """Return the equations, run as printed, that the entry names."""
        return [shown for shown in audit.equations if shown.name in self.equations]


def register(text: str) -> list[Erratum]:
    """Read the register, in the order of the file."""
    return [Erratum.model_validate(entry) for entry in tomllib.loads(text)["erratum"]]
