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
def frozen(key: str | None = None) -> dict[str, Expectation]:
    """Return the frozen verdicts by address, those of one item or all."""
    expectations: dict[str, Expectation] = {}
    for entry in _entries():
        verdict, reason = entry["verdict"], entry.get("reason", "")
        if verdict not in VERDICTS:
            raise ValueError(f"verdicts.toml: unknown verdict {verdict!r}; one of {VERDICTS}")
        if verdict == "differs" and not reason:
            raise ValueError(f"verdicts.toml: {entry['cells']}: a differs needs its reason")
        wanted = (one for one in entry["cells"] if key in {None, one.partition("#")[0]})
        for address in (cell.address for pattern in wanted for cell in find(pattern)):
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
    keys = dict.fromkeys(record.key for record in ledger.records)
    expectations = {a: e for key in keys for a, e in frozen(key).items()}
    found = [
        Surprise(r.cell, e.verdict if (e := expectations.get(r.cell)) else "none", r.verdict)
        for r in ledger.records
    ]
    return [surprise for surprise in found if surprise.expected != surprise.found]


def _of(address: str) -> Expectation:
    return frozen(address.partition("#")[0]).get(address, Expectation("", ""))


def reason(address: str) -> str:
    """Return the written reason for the frozen verdict of a cell, empty where there is none."""
    return _of(address).reason


def erratum(address: str) -> str:
    """Return the id of the erratum behind a `differs`, empty where the register has none."""
    return _of(address).erratum
