"""The frozen verdicts: what the ledger must say, and why where it says `differs`."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache

from reproduce.judge.ledger import Ledger
from reproduce.judge.verdicts import VERDICTS
from reproduce.locate import data_folder
from reproduce.printed.cells import find


@dataclass(frozen=True)
class Expectation:
    """The verdict frozen for a cell, with the reason and the erratum where they are due."""

    verdict: str
    reason: str
    erratum: str = ""


@cache
def frozen() -> dict[str, Expectation]:
    """Return the frozen verdicts by address.

    Returns
    -------
    dict
        Address to expectation.

    Raises
    ------
    ValueError
        If the file names a cell twice, an unknown verdict, or a `differs` without a reason.
    KeyError
        If it names a cell that is not printed.
    """
    path = data_folder() / "verdicts.toml"
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    expectations: dict[str, Expectation] = {}
    for entry in content["expect"]:
        verdict, reason = entry["verdict"], entry.get("reason", "")
        if verdict not in VERDICTS:
            raise ValueError(f"{path.name}: unknown verdict {verdict!r}; one of {VERDICTS}")
        if verdict == "differs" and not reason:
            raise ValueError(f"{path.name}: {entry['cells']}: a differs needs its reason")
        for address in (cell.address for pattern in entry["cells"] for cell in find(pattern)):
            if address in expectations:
                raise ValueError(f"{path.name}: {address} stands twice; keep one")
            expectations[address] = Expectation(verdict, reason, entry.get("erratum", ""))
    return expectations


@dataclass(frozen=True)
class Surprise:
    """A cell whose verdict is not the frozen one."""

    cell: str
    expected: str
    found: str


def surprises(ledger: Ledger) -> list[Surprise]:
    """Compare the ledger's verdicts with the frozen ones.

    Parameters
    ----------
    ledger : Ledger
        Some or all records.

    Returns
    -------
    list of Surprise
        The cells that differ from their expectation; empty when all is as frozen.
    """
    expectations = frozen()
    found = [
        Surprise(r.cell, e.verdict if (e := expectations.get(r.cell)) else "none", r.verdict)
        for r in ledger.records
    ]
    return [surprise for surprise in found if surprise.expected != surprise.found]


def reason(address: str) -> str:
    """Return the written reason for the frozen verdict of a cell, empty where there is none.

    Parameters
    ----------
    address : str
        The cell.

    Returns
    -------
    str
        The reason in words.
    """
    expectation = frozen().get(address)
    return expectation.reason if expectation else ""


def erratum(address: str) -> str:
    """Return the id of the erratum behind a `differs`, empty where the register has none.

    Parameters
    ----------
    address : str
        The cell.

    Returns
    -------
    str
        An id of ``data/errata.toml``.
    """
    expectation = frozen().get(address)
    return expectation.erratum if expectation else ""
