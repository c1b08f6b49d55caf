"""How numbers and verdicts are written, the same in the terminal, the book and the exports."""

from __future__ import annotations

import re
from collections.abc import Mapping

from reproduce.judge.ledger import ReadingRecord, Record, TableRecord
from reproduce.judge.verdicts import VERDICTS
from reproduce.printed.cells import PAPERS, Cell, library
from reproduce.printed.units import symbol
from reproduce.views.build import item_ledger, whole_ledger
from reproduce.views.numbers import chance

__all__ = [
    "FLAG_MEANINGS",
    "MEANINGS",
    "WEAK",
    "cell_of",
    "computed",
    "facts_of",
    "filled",
    "interval",
    "joint_chance",
    "probability",
    "qualified",
    "read",
    "strong",
    "tally",
    "unit",
    "weak",
    "weak_agreement",
]

_BLANK = re.compile(r"\{([^{}]+)\}")

MEANINGS: dict[str, str] = {
    "exact": "recomputed and rounds to the printed digits",
    "consistent": "inside the central 99 % of what the reproduction predicts",
    "differs": "recomputed and does not agree",
    "blocked": "needs something the paper does not publish, or depends on how the text is read",
    "pending": "belongs to work not done yet",
    "input": "taken from the paper, nothing to compute",
}

FLAG_MEANINGS: dict[str, str] = {
    "through_rounding": "agrees only because the printed inputs are rounded",
    "repeated": "the print repeats another printed cell",
    "difference": "one printed number less another",
    "uninformative": "the predicted interval is wider than the number itself",
    "bound": "the print states a limit, not a value",
    "stand_in": "the value shown stands in for something unpublished",
    "about": "printed as an approximate number",
    "nominal": "printed as a nominal value",
}


def cell_of(record: Record) -> Cell:
    """Return the printed cell that a record judges."""
    return library()[record.key].by_name[record.cell.partition("#")[2]]


def computed(record: Record, extra: int = 0) -> str:
    """Write a record's computed value with as many decimals as the print."""
    if record.computed is None:
        return ""
    # One more digit where the printed ones alone could not show the difference.
    hidden = record.verdict == "differs" or "through_rounding" in record.flags
    text = cell_of(record).number.format(record.computed, extra=extra + hidden)
    return text.replace("-", "−")


def interval(record: Record) -> str:
    """Write a record's interval, empty where there is none."""
    if record.interval is None or record.interval[0] == record.interval[1]:
        return ""
    number = cell_of(record).number
    low, high = (number.format(end, extra=1).replace("-", "−") for end in record.interval)
    return f"{low} to {high}"


def probability(record: Record) -> str:
    """Write a record's probability with no more digits than its Monte Carlo error allows."""
    if record.probability is None or record.mcse is None:
        return ""
    return chance(record.probability, record.mcse)


def joint_chance(joint: TableRecord) -> str:
    """Write the joint probability of a table."""
    if joint.joint_probability * (joint.replicates + 1) < 1.5:
        return f"below 1 in {joint.replicates:,}"
    return chance(joint.joint_probability, joint.mcse)


def read(record: Record, reading: ReadingRecord) -> str:
    """Write what a blocked cell is under one reading of the text."""
    flags = [flag for flag in reading.flags if flag in {"through_rounding", "uninformative"}]
    hidden = not reading.agrees or "through_rounding" in reading.flags
    value = cell_of(record).number.format(reading.computed, extra=int(hidden)).replace("-", "−")
    symbol_of = unit(record)
    gap = "" if symbol_of in {"", "°", "″"} else "\u202f"
    marks = f" ({', '.join(flag.replace('_', ' ') for flag in flags)})" if flags else ""
    return f"{value}{gap}{symbol_of}, {reading.verdict}{marks}"


def unit(record: Record) -> str:
    """Write the unit of a record, empty for pure numbers, counts and words."""
    return symbol(record.unit) if record.unit else ""


def tally(records: tuple[Record, ...]) -> dict[str, int]:
    """Count records by verdict.

    Verdict to count, every verdict present, in the order in which they are shown.
    """
    return {verdict: sum(r.verdict == verdict for r in records) for verdict in VERDICTS}


WEAK = ("repeated", "difference", "through_rounding", "uninformative")


def weak(records: tuple[Record, ...]) -> dict[str, int]:
    """Count the records whose agreement says little, by what makes it weak.

    Flag to count, each of `WEAK`, among the exact and consistent records. A record with two flags
    counts in both.
    """
    agreeing = _agreeing(records)
    return {flag: sum(flag in r.flags for r in agreeing) for flag in WEAK}


def strong(records: tuple[Record, ...]) -> int:
    """Count the records that agree and carry no flag of weak agreement."""
    return sum(not weak_agreement(r) for r in _agreeing(records))


def weak_agreement(record: Record) -> bool:
    """Tell whether a record agrees in a way that says little."""
    return bool(_agreeing((record,)) and set(WEAK) & set(record.flags))


def qualified(record: Record) -> str:
    """Write a verdict with what makes it weak."""
    flags = ", ".join(flag.replace("_", " ") for flag in record.flags if flag in WEAK)
    return f"{record.verdict} ({flags})" if flags else record.verdict


def _agreeing(records: tuple[Record, ...]) -> list[Record]:
    return [r for r in records if r.verdict in {"exact", "consistent"}]


def facts_of(name: str) -> dict[str, str]:
    """Return what a sentence may say of a cell, an item, a paper or everything.

    Examples
    --------
    >>> facts_of("niu2024/table-2#scale.red")["computed"]
    '0.9976'
    """
    if "#" in name:
        return _of_cell(name)
    if "/" in name:
        return _of_item(name)
    if name not in {*PAPERS, "all"}:
        raise KeyError(f"expected an address, a key, 'all' or one of {PAPERS}, got {name!r}")
    return _of_paper(name)


def filled(text: str, facts: Mapping[str, str] | None = None) -> str:
    """Fill the blanks of an alternative text, so that no number is typed into it.

    Examples
    --------
    >>> filled("a scale of {niu2024/table-2#scale.red printed}")
    'a scale of 0.9976'
    """

    def fill(blank: re.Match[str]) -> str:
        name, _, what = blank.group(1).partition(" ")
        if not what:
            return (facts or {})[name]
        return facts_of(name)[what]

    return _BLANK.sub(fill, text)


def _of_cell(address: str) -> dict[str, str]:
    record = item_ledger(address.partition("#")[0]).cell(address)
    cell = cell_of(record)
    symbol_of = unit(record)
    gap = "" if symbol_of in {"", "°", "″"} else "\u202f"
    value = computed(record)
    said = {
        "printed": cell.shown,
        "computed": f"{value}{gap}{symbol_of}" if value else "nothing",
        "verdict": record.verdict,
        "probability": probability(record) or "none",
    }
    if record.readings:
        said["readings"] = str(len(record.readings))
        said["agreeing"] = str(sum(reading.agrees for reading in record.readings))
        for number, reading in enumerate(record.readings, start=1):
            said[f"reading-{number}"] = read(record, reading).partition(",")[0]
    return said


def _of_item(key: str) -> dict[str, str]:
    found = item_ledger(key)
    counts = tally(found.of(key))
    said = {verdict: str(count) for verdict, count in counts.items()}
    said["agree"] = str(counts["exact"] + counts["consistent"])
    said["results"] = str(sum(record.role == "result" for record in found.of(key)))
    joint = found.table(key)
    if joint is not None:
        said["joint"] = joint_chance(joint)
        said["replicates"] = f"{joint.replicates:,}"
    return said


def _of_paper(name: str) -> dict[str, str]:
    chosen = tuple(r for r in whole_ledger().records if name in {"all", r.key.split("/")[0]})
    by_verdict, firm = tally(chosen), strong(chosen)
    counts = {
        **by_verdict,
        **{flag.replace("_", "-"): count for flag, count in weak(chosen).items()},
        "strong": firm,
        "weak": by_verdict["exact"] + by_verdict["consistent"] - firm,
        "cells": len(chosen),
        "unsettled": by_verdict["differs"] + by_verdict["blocked"],
        "open": sum(bool(r.readings) for r in chosen if r.verdict == "blocked"),
        "unpublished": sum(not r.readings for r in chosen if r.verdict == "blocked"),
        "agree": by_verdict["exact"] + by_verdict["consistent"],
        "judged": sum(by_verdict[verdict] for verdict in ("exact", "consistent", "differs")),
    }
    return {what: str(count) for what, count in counts.items()}
