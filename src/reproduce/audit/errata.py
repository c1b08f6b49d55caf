"""The register of errata: what is printed, why it cannot be, and what the library does."""

from __future__ import annotations

import fnmatch
import tomllib
from typing import Literal

from pydantic import BaseModel, ConfigDict

from reproduce.audit.equations import Demonstration
from reproduce.audit.examine import Examined
from reproduce.audit.relation import Finder
from reproduce.audit.report import Audit
from reproduce.printed.cells import PAPERS

Conclusion = Literal["stands", "moves", "open"]


class Erratum(BaseModel):
    """One entry of the register.

    The numbers of its evidence are not written in it: they come from the relations and equations
    that it names. Where words stand against words, `evidence` says which. `reading` tells which
    of two independent readings of the paper found it, as for a relation, and `again` whether the
    third one did too, which knew no list. An entry that holds only if we suppose something that
    the paper does not say names it as its `supposition`, and is counted apart. `extraction` marks
    what rests on a formula, a digit or a heading of our text, which a machine read.
    """

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)

    id: str
    paper: str
    place: str
    printed: str
    problem: str
    library: str
    conclusion: Conclusion
    because: str
    status: Literal["open", "one reading of several", "reported", "confirmed"]
    reading: Finder
    again: bool = False
    extraction: bool = False
    supposition: str = ""
    evidence: str = ""
    relations: list[str] = []
    equations: list[str] = []

    def findings(self, audit: Audit) -> list[Examined]:
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
    entries = [Erratum.model_validate(entry) for entry in tomllib.loads(text)["erratum"]]
    seen: set[str] = set()
    for entry in entries:
        if entry.id in seen:
            raise ValueError(f"erratum {entry.id!r} stands twice; give each its own id")
        if not entry.relations and not entry.equations and not entry.evidence:
            raise ValueError(
                f"erratum {entry.id!r}: name the relations or equations it rests on, "
                "or the words that stand against each other"
            )
        if entry.paper not in PAPERS:
            raise ValueError(
                f"erratum {entry.id!r}: unknown paper {entry.paper!r}; one of {', '.join(PAPERS)}"
            )
        seen.add(entry.id)
    return entries
