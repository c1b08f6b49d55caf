"""How a cell's numbers and its verdict are written, and what a sentence may say of them by name."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence

from reproduce.judge.ledger import ReadingRecord, Record, TableRecord, WholeReading
from reproduce.judge.verdicts import VERDICTS
from reproduce.printed.cells import PAPERS, Cell, library
from reproduce.printed.number import symbol
from reproduce.views.computed import item_ledger, whole_ledger
from reproduce.views.numbers import chance, minus

MEANINGS: dict[str, str] = {
    "exact": "recomputed and rounds to the printed digits",
    "consistent": "inside the central 99 % of what the reproduction predicts",
    "differs": "recomputed and does not agree",
    "blocked": "needs something the paper does not publish, or depends on how the text is read",
    "input": "taken from the paper, nothing to compute",
}

WEAK = ("repeated", "difference", "through_rounding", "uninformative")


def name_of(record: Record) -> str:
    """Return the name of a record's cell within its item."""
    return record.cell.partition("#")[2]


def cell_of(record: Record) -> Cell:
    """Return the printed cell that a record judges."""
    return library()[record.key].by_name[name_of(record)]


def computed(record: Record, extra: int = 0) -> str:
    """Write a record's computed value with as many decimals as the print."""
    if record.computed is None:
        return ""
    # One more digit where the printed ones alone could not show the difference.
    hidden = record.verdict == "differs" or "through_rounding" in record.flags
    return minus(cell_of(record).number.format(record.computed, extra=extra + hidden))


def error(record: Record) -> str:
    """Write the Monte Carlo error of a computed value, empty where nothing is drawn."""
    return quantity(minus(f"{record.error:.1g}") if record.error else "", unit(record))


def interval(record: Record) -> str:
    """Write the interval of a computed value, empty where there is none."""
    return between(record, record.interval)


def between(record: Record, ends: Sequence[float | None] | None) -> str:
    """Write an interval of a record, empty where there is none."""
    if ends is None or None in ends or ends[0] == ends[1]:
        return ""
    number = cell_of(record).number
    text = " to ".join(number.format(end, extra=1) for end in ends if end is not None)
    return quantity(minus(text), unit(record))


def probability(record: Record) -> str:
    """Write a record's probability with no more digits than its Monte Carlo error allows."""
    if record.probability is None or record.mcse is None:
        return ""
    return chance(record.probability, record.mcse)


def joint_sentence(joint: TableRecord) -> str:
    """Say how the cells of a table fare together."""
    return (
        f"Outside the central 99 % of the prediction lie {joint.outside} of {joint.cells} "
        f"predicted cells; chance alone would put {joint.expected_outside:.2g} there. The "
        "probability of a table as surprising as the printed one, or more, is "
        f"{joint_chance(joint)} ({joint.replicates:,} tables simulated)."
    )


def joint_chance(joint: TableRecord | WholeReading, before: str = "") -> str:
    """Write a joint probability, empty without one: a bound where next to none lie so far out."""
    if joint.joint_probability is None or joint.mcse is None:
        return ""
    if joint.joint_probability * (joint.replicates + 1) < 1.5:
        return f"below 1 in {joint.replicates:,}"
    return before + chance(joint.joint_probability, joint.mcse)


def fitting(readings: tuple[WholeReading, ...]) -> str:
    """Say whether one reading of the text fits all cells of a table that depend on one."""
    count = sum(one.fits for one in readings)
    what = "fits" if count == 1 else "fit"
    return (
        f"One reading for all cells that depend on a reading: {count or 'none'} of "
        f"{len(readings)} {what}. Closest: {_closest(readings)}."
    )


def _closest(readings: tuple[WholeReading, ...]) -> str:
    """Say which reading comes closest to all cells, and how it fares."""
    ranks = [(r.fits, r.agreeing - r.apart, r.joint_probability or 0.0) for r in readings]
    best = readings[ranks.index(max(ranks))]
    return f"{best.name}, {whole(best)}"


def whole(reading: WholeReading) -> str:
    """Write how a reading fares on all cells at once."""
    told = f"{reading.agreeing} of {reading.cells} cells one by one"
    if reading.apart:
        told += f", {reading.apart} of them through rounding"
    return told + (f"; together {joint_chance(reading, 'p = ')}" if reading.replicates else "")


def read(record: Record, reading: ReadingRecord) -> str:
    """Write what a blocked cell is under one reading of the text."""
    marks = flags(reading.flags, {"through_rounding", "uninformative"})
    hidden = not reading.agrees or "through_rounding" in reading.flags
    value = minus(cell_of(record).number.format(reading.computed, extra=int(hidden)))
    return f"{quantity(value, unit(record))}, {reading.verdict}{f' ({marks})' * bool(marks)}"


def unit(record: Record) -> str:
    """Write the unit of a record, empty for pure numbers, counts and words."""
    return symbol(record.unit) if record.unit else ""


def quantity(value: str, mark: str) -> str:
    """Write a number before the sign of its unit; nothing for nothing."""
    gap = "" if mark in {"", "°", "″"} else "\u202f"
    return f"{value}{gap}{mark}" if value else ""


def tally(records: Collection[Record]) -> dict[str, int]:
    """Count records by verdict, every verdict present, in the order in which they are shown."""
    return {verdict: sum(r.verdict == verdict for r in records) for verdict in VERDICTS}


def weak_agreement(record: Record) -> bool:
    """Tell whether a record agrees in a way that says little."""
    return record.verdict in {"exact", "consistent"} and not {*WEAK}.isdisjoint(record.flags)


def weak(records: Iterable[Record]) -> int:
    """Count the records that agree in a way that says little."""
    return sum(map(weak_agreement, records))


def flags(names: Iterable[str], shown: Collection[str] = WEAK) -> str:
    """Write flags as words."""
    return ", ".join(name.replace("_", " ") for name in names if name in shown)


def qualified(record: Record) -> str:
    """Write a verdict with what makes it weak."""
    marks = flags(record.flags, {*WEAK, "stand_in"})
    return f"{record.verdict} ({marks})" if marks else record.verdict


def facts_of(name: str) -> dict[str, str]:
    """Return what a sentence may say of a cell, an item, a paper or everything.

    Examples
    --------
    >>> facts_of("niu2024/table-2#scale.red")["computed"]
    '0.9976'
    """
    if "#" in name:
        return _of_cell(item_ledger(name.partition("#")[0]).cell(name))
    if "/" in name:
        return _of_item(name)
    if name not in {*PAPERS, "all"}:
        raise KeyError(f"expected an address, a key, 'all' or one of {PAPERS}, got {name!r}")
    return _of_paper(name)


def filled(text: str, known: Mapping[str, str]) -> str:
    """Fill the blanks of an alternative text, so that no number is typed into it.

    Examples
    --------
    >>> filled("a scale of {niu2024/table-2#scale.red printed}", {})
    'a scale of 0.9976'
    """

    def fill(blank: re.Match[str]) -> str:
        name, _, what = blank.group(1).partition(" ")
        return facts_of(name)[what] if what else known[name]

    return re.sub(r"\{([^{}]+)\}", fill, text)


def _of_cell(record: Record) -> dict[str, str]:
    said = {
        "printed": cell_of(record).shown,
        "computed": quantity(computed(record), unit(record)) or "nothing",
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
    said = _agreement(found.of(key))
    said["results"] = str(sum(record.role == "result" for record in found.of(key)))
    if fits := found.whole_readings(key):
        said["fitting"] = str(sum(one.fits for one in fits) or "none")
        said["whole-readings"] = str(len(fits))
        said["replicates"] = f"{max(one.replicates for one in fits):,}"
        said["closest"] = _closest(fits)
    if joint := found.table(key):
        said |= {"joint": joint_chance(joint), "replicates": f"{joint.replicates:,}"}
    return said


def _of_paper(name: str) -> dict[str, str]:
    chosen = tuple(r for r in whole_ledger().records if name in {"all", r.key.split("/")[0]})
    by_verdict = tally(chosen)
    counts = {
        "cells": len(chosen),
        "unsettled": by_verdict["differs"] + by_verdict["blocked"],
        "open": sum(bool(r.readings) for r in chosen if r.verdict == "blocked"),
        "unpublished": sum(not r.readings for r in chosen if r.verdict == "blocked"),
        "judged": sum(by_verdict[verdict] for verdict in ("exact", "consistent", "differs")),
    }
    return _agreement(chosen) | {what: str(count) for what, count in counts.items()}


def _agreement(records: tuple[Record, ...]) -> dict[str, str]:
    """Count verdicts; what agrees never stands without the part of it that is weak."""
    groups: dict[str, list[Record]] = {
        verdict: [r for r in records if r.verdict == verdict] for verdict in VERDICTS
    }
    groups["agree"] = groups["exact"] + groups["consistent"]
    said: dict[str, str] = {}
    for name, found in groups.items():
        doubtful = weak(found)
        share = "all" if doubtful == len(found) else str(doubtful)
        said[name] = f"{len(found)} ({share} of them weakly)" if doubtful else str(len(found))
    doubtful = weak(records)
    said |= {"strong": str(len(groups["agree"]) - doubtful), "weak": str(doubtful)}
    return said
