"""The audit of a paper, and the entries of the register of errata."""

from __future__ import annotations

import fnmatch
import functools
from collections.abc import Sequence
from typing import Literal, NamedTuple

from pydantic import BaseModel, ConfigDict

from reproduce.consistency._equations import Demonstration, demonstrations
from reproduce.consistency._relation import (
    Finder,
    Relation,
    Sheet,
    declarations,
    declared,
)
from reproduce.consistency.examine import RelationResult, examine
from reproduce.printed.cells import library


class Audit(NamedTuple):
    """Results of the relations and of the equations of a paper.

    - `name`: the paper.
    - `cells`: its printed numbers by address.
    - `findings`: result of each relation, with and without an assumption.
    - `equations`: equations, run as extracted.
    """

    name: str
    cells: Sheet
    findings: list[RelationResult]
    equations: list[Demonstration]

    @property
    def score(self) -> dict[str, int]:
        """Numbers of cells, of relations by outcome, and of equations, by their names.

        Relations and equations that depend on an assumption are counted separately. So are
        relations that restate a computed number.
        """
        own, again = (
            [
                finding.outcome
                for finding in self.findings
                if not finding.relation.assumption
                and bool(finding.relation.restates) == restating
            ]
            for restating in (False, True)
        )
        equations = [e for e in self.equations if not e.assumption]
        every = len(self.findings) + len(self.equations)
        return {
            "Numbers": len(self.cells),
            "Relations": len(own),
            "Agree": own.count("agrees"),
            "Only through rounding": own.count("agrees only through rounding"),
            "Only within a tolerance": own.count("agrees only within a tolerance"),
            "Contradict": own.count("contradicts"),
            "Restate computed cells": len(again),
            "Contradict among these": again.count("contradicts"),
            "Equations run": len(equations),
            "Fail as extracted": sum(not e.holds for e in equations),
            "Depend on an assumption": every - len([*own, *again, *equations]),
        }


@functools.cache
def audit_paper(paper: str) -> Audit:
    """Audit the printed numbers and equations of a paper."""
    cells = {
        cell.address: cell
        for key, table in library().items()
        for cell in table.cells
        if key.startswith(f"{paper}/") and cell.is_number
    }
    return audit(paper, cells, declared(declarations(paper), cells, f"{paper}/"))


def audit(name: str, cells: Sheet, relations: Sequence[Relation]) -> Audit:
    """Audit some cells by relations between them."""
    return Audit(
        name=name,
        cells=cells,
        findings=examine(cells, relations),
        equations=demonstrations(cells, declarations(name).get("equations", {})),
    )


class Erratum(BaseModel):
    """One entry of the register.

    An entry contains no numbers of its evidence. They come from the named relations and equations.
    An entry that depends on an assumption names it and is counted separately.
    """

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, use_attribute_docstrings=True
    )

    id: str
    """name and anchor"""
    paper: str
    place: str
    """passage of the paper"""
    printed: str
    """the passage as printed, in short"""
    problem: str
    """the contradiction, under the most charitable reading"""
    library: str
    """treatment in this package"""
    conclusion: Literal["stands", "moves", "not supported as printed", "open"]
    (
        "whether the conclusion of the paper is supported; not supported as printed if a statement "
        "of the paper contradicts the numbers that it refers to"
    )
    because: str
    """reason for this"""
    status: Literal["open", "one reading of several", "reported", "confirmed"]
    found_by: Finder
    """independent reading of the paper that found it, as for a relation"""
    again: bool = False
    """whether the third reading, which knew no list, also found it"""
    extraction: bool = False
    """whether it depends on a formula, digit or heading of the extracted text"""
    assumption: str = ""
    """assumption that the paper does not state"""
    evidence: str = ""
    """passages that contradict each other"""
    reply: str = ""
    """reply of the authors, with name and date"""
    relations: list[str] = []
    """relations that show it"""
    equations: list[str] = []
    """equations that show it, as extracted"""

    def findings(self, audit: Audit) -> list[RelationResult]:
        """Return the results of the relations that the entry names."""
        return [
            finding
            for finding in audit.findings
            if any(
                fnmatch.fnmatchcase(finding.relation.name, p) for p in self.relations
            )
        ]
