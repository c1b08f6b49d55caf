"""The whole audit of a paper in one call, and the register of errata."""

from __future__ import annotations

import fnmatch
import functools
import tomllib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Literal

from pydantic import BaseModel, ConfigDict

from reproduce.consistency import examine
from reproduce.consistency.equations import Demonstration, demonstrations
from reproduce.consistency.relation import (
    Finder,
    Relation,
    Sheet,
    declarations,
    declared,
)
from reproduce.printed.cells import library


@dataclass(frozen=True)
class Audit:
    """Results of the relations and of the equations of a paper.

    There is a finding for each relation, with and without an assumption.
    """

    name: str
    cells: Sheet
    findings: tuple[examine.RelationResult, ...]
    conflicts: tuple[examine.Conflict, ...]
    unknowns: dict[str, examine.Agreement]
    equations: tuple[Demonstration, ...]

    @property
    def examined(self) -> tuple[str, ...]:
        """The cells that some relation compares with another one, in the order of the sheet."""
        return self._within(f.relation for f in self.findings if f.relation.compares)

    @property
    def bounded(self) -> tuple[str, ...]:
        """The cells of which relations give only a sign, a bound or a last digit."""
        related = self._within(f.relation for f in self.findings)
        return tuple(a for a in related if a not in self.examined)

    def _within(self, relations: Iterable[Relation]) -> tuple[str, ...]:
        found = {address for one in relations for address in one.addresses}
        return tuple(address for address in self.cells if address in found)

    @property
    def read(self) -> tuple[examine.RelationResult, ...]:
        """The findings that do not depend on an assumption of this project."""
        return tuple(f for f in self.findings if not f.relation.assumption)

    @property
    def supposed(self) -> tuple[examine.RelationResult, ...]:
        """The findings that depend on an assumption of this project."""
        return tuple(f for f in self.findings if f.relation.assumption)

    @property
    def failing(self) -> tuple[Demonstration, ...]:
        """The equations that fail as extracted, without those that depend on an assumption."""
        return tuple(e for e in self.equations if not (e.holds or e.assumption))

    def tally(
        self, *, restating: bool | None = None
    ) -> dict[examine.RelationOutcome, int]:
        """Count the relations without assumptions by outcome, every outcome present.

        All of them, or only those that do, or do not, restate a computed number.
        """
        found = [f for f in self.read if restating in {None, bool(f.relation.restates)}]
        return {o: sum(f.outcome == o for f in found) for o in examine.OUTCOMES}


@functools.cache
def audit_paper(paper: str) -> Audit:
    """Audit the printed numbers and equations of a paper."""
    tables = (table for key, table in library().items() if key.startswith(f"{paper}/"))
    cells = {
        cell.address: cell for table in tables for cell in table.cells if cell.is_number
    }
    content = declarations(paper)
    joint = {"relations": {"joint": content.get("joint", [])}}
    every = (declared(one, cells, f"{paper}/") for one in (content, joint))
    return audit(paper, cells, *every)


def audit(
    name: str,
    cells: Sheet,
    relations: Sequence[Relation],
    joint: Sequence[Relation] = (),
) -> Audit:
    """Audit some cells by relations between them, and by declared combinations of relations."""
    read = [relation for relation in relations if not relation.assumption]
    return Audit(
        name=name,
        cells=cells,
        findings=tuple(examine.examine(cells, relations)),
        conflicts=tuple(examine.conflicts(cells, read, joint)),
        unknowns=examine.agreements(cells, relations),
        equations=demonstrations(cells, declarations(name).get("equations", {})),
    )


# "not supported as printed" if a statement of the paper contradicts the numbers that it refers to.
_Conclusion = Literal["stands", "moves", "not supported as printed", "open"]


class Erratum(BaseModel):
    """One entry of the register.

    The numbers of its evidence are not written in it: they come from the relations and equations
    that it names. Where words stand against words, `evidence` says which. `reading` tells which
    of two independent readings of the paper found it, as for a relation, and `again` whether the
    third one did too, which knew no list. An entry that holds only if we suppose something that
    the paper does not say names it as its `assumption`, and is counted apart. `extraction` marks
    what rests on a formula, a digit or a heading of our text, which a machine read. `reply` is what
    the authors of the paper say to it, with their name and the day; empty until they do.
    """

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True
    )

    id: str
    """its name and anchor"""
    paper: str
    place: str
    """where in the paper it stands"""
    printed: str
    """what is printed there, in short"""
    problem: str
    """what does not fit, under the most charitable reading"""
    library: str
    """what the library does about it"""
    conclusion: _Conclusion
    """whether the paper's conclusion stands"""
    because: str
    """why it does"""
    status: Literal["open", "one reading of several", "reported", "confirmed"]
    reading: Finder
    """which of two independent readings of the paper found it"""
    again: bool = False
    """whether a third reading did, without a list"""
    extraction: bool = False
    """our text, read by a machine, may be wrong"""
    assumption: str = ""
    """what it supposes that the paper leaves open"""
    evidence: str = ""
    """words that stand against words"""
    reply: str = ""
    """what the authors replied"""
    relations: list[str] = []
    """relations of the audit that show it"""
    equations: list[str] = []
    """equations that show it, as extracted"""

    def findings(self, audit: Audit) -> list[examine.RelationResult]:
        """Return the findings of the relations that the entry names."""
        names = [finding.relation.name for finding in audit.findings]
        named = {n for one in self.relations for n in fnmatch.filter(names, one)}
        return [one for one in audit.findings if one.relation.name in named]

    def demonstrations(self, audit: Audit) -> list[Demonstration]:
        """Return the equations, run as printed, that the entry names."""
        return [shown for shown in audit.equations if shown.name in self.equations]


def register(text: str) -> list[Erratum]:
    """Read the register, in the order of the file."""
    return [Erratum.model_validate(entry) for entry in tomllib.loads(text)["erratum"]]
