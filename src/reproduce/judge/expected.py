"""The frozen verdicts: what the ledger must say, and why where it says `differs`."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from typing import Any

from reproduce.judge.ledger import Ledger
from reproduce.judge.verdicts import VERDICTS
from reproduce.locate import data_folders
from reproduce.printed.cells import find


@dataclass(frozen=True)
class Expectation:
    """The verdict frozen for a cell, with the reason and the erratum where they are due."""

    verdict: str
    reason: str
    erratum: str = ""


@cache
def frozen() -> dict[str, Expectation]:
    """Return the frozen verdicts by address."""
    expectations: dict[str, Expectation] = {}
    for entry in _entries():
        verdict, reason = entry["verdict"], entry.get("reason", "")
        if verdict not in VERDICTS:
            raise ValueError(f"verdicts.toml: unknown verdict {verdict!r}; one of {VERDICTS}")
        if verdict == "differs" and not reason:
            raise ValueError(f"verdicts.toml: {entry['cells']}: a differs needs its reason")
        for address in (cell.address for pattern in entry["cells"] for cell in find(pattern)):
            if address in expectations:
                raise ValueError(f"verdicts.toml: {address} stands twice; keep one")
            expectations[address] = Expectation(verdict, reason, entry.get("erratum", ""))
    return expectations


@cache
def _entries() -> list[dict[str, Any]]:
    """Return the entries of the frozen verdicts of all papers."""
    texts = [(one / "verdicts.toml").read_text(encoding="utf-8") for one in data_folders()]
    return [entry for text in texts for entry in tomllib.loads(text)["expect"]]


@dataclass(frozen=True)
class Surprise:
    """A cell whose verdict is not the frozen one."""

    cell: str
    expected: str
    found: str


def surprises(ledger: Ledger) -> list[Surprise]:
    """Compare the ledger's verdicts with the frozen ones."""
    unknown = Expectation("none", "")
    wanted = [(r, frozen().get(r.cell, unknown).verdict) for r in ledger.records]
    return [Surprise(r.cell, verdict, r.verdict) for r, verdict in wanted if verdict != r.verdict]


def reason(address: str) -> str:
    """Return the written reason for the frozen verdict of a cell, empty where there is none."""
    return frozen()[address].reason if address in frozen() else ""


def erratum(address: str) -> str:
    """Return the id of the erratum behind a `differs`, empty where the register has none."""
    return frozen()[address].erratum if address in frozen() else ""
