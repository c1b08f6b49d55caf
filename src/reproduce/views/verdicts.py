"""How a cell's numbers and its verdict are written, and what a sentence may say of them by name."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence

from markupsafe import Markup, escape

from reproduce.judge.ledger import Record, TableRecord, replies
from reproduce.judge.readings import ReadingSummary, evaluate
from reproduce.judge.verdicts import AGREES, VERDICTS, Flag, Reading
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import PAPERS, Cell, library
from reproduce.printed.number import symbol
from reproduce.views.computed import item_ledger, whole_ledger
from reproduce.views.numbers import chance, minus

MEANINGS: dict[str, str] = {
    "exact": "recomputed and rounds to the printed digits",
    "consistent": "inside the central 99 % of what the reproduction predicts",
    "differs": "recomputed and does not agree",
    "ambiguous": "agrees with some readings of the text and not with others",
    "unpublished": "needs data that the paper does not publish",
    "input": "taken from the paper, nothing to compute",
}

# Kinds of weak agreement, and their names for readers.
WEAK: dict[Flag, str] = {
    "copy": "copy",
    "difference": "difference",
    "rounding": "through rounding",
    "tolerance": "wide tolerance",
    "wide": "wide prediction",
}


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
    hidden = record.verdict not in AGREES or not {"rounding", "tolerance"}.isdisjoint(
        record.flags
    )
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


def probability(record: Record | Reading) -> str:
    """Write a probability with no more digits than its Monte Carlo error allows."""
    if record.probability is None or record.mcse is None:
        return ""
    return chance(record.probability, record.mcse)


def joint_sentence(joint: TableRecord) -> str:
    """Return a sentence on all cells of a table together."""
    return (
        f"Outside the central 99 % of the prediction lie {joint.outside} of {joint.cells} "
        f"predicted cells; {joint.expected_outside:.2g} are expected by chance. The "
        "probability of a table as far from the prediction as the printed one, or farther, is "
        f"{joint_chance(joint.joint_probability, joint)} ({joint.replicates:,} simulated tables)."
    )


def joint_chance(probability: float, joint: TableRecord) -> str:
    """Write a joint probability; a bound if next to no replicates are as far out."""
    if probability * (joint.replicates + 1) < 1.5:
        return f"below 1/{joint.replicates:,}"
    error = (probability * (1 - probability) / joint.replicates) ** 0.5
    return chance(probability, error)


def fitting(joint: TableRecord) -> str:
    """Return a sentence on the readings of a table, all cells at once."""
    return (
        f"{joint.fitting or 'None'} of {joint.readings} readings of the text fits all "
        f"{joint.cells} predicted cells together. Closest: {choices_text(joint.closest)}, with "
        f"{joint.closest_agreeing} cells and a joint probability "
        f"{_of_chance(joint_chance(joint.closest_probability, joint))}."
    )


def _of_chance(text: str) -> str:
    return text if text.startswith("below") else f"of {text}"


def choices_text(choices: Mapping[str, str]) -> str:
    """Write the choices of a reading as on the command line.

    Examples
    --------
    >>> choices_text({"noise": "green", "repeats": "one"})
    'noise=green, repeats=one'
    """
    return (
        ", ".join(f"{name}={way}" for name, way in choices.items()) or "every reading"
    )


def deciding(summary: ReadingSummary) -> str:
    """Write the options that decide, and choices with which a number agrees or never does."""
    if summary.agreeing in {0, summary.count}:
        return ""
    always = "; or ".join(map(choices_text, summary.agrees_if))
    never = ", ".join(
        f"{name}={way}" for name, ways in summary.never.items() for way in ways
    )
    decided = f"Decided by {', '.join(summary.decided_by)}. Always with {always}"
    return f"{decided}. Never with {never}" if never else decided


def read(record: Record, reading: Reading) -> str:
    """Write the computed value and the verdict of a cell under one reading."""
    marks = flags(reading.flags)
    hidden = not reading.agrees or bool(marks)
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
    return record.verdict in AGREES and not {*WEAK}.isdisjoint(record.flags)


def weak(records: Iterable[Record]) -> int:
    """Count the records that agree in a way that says little."""
    return sum(map(weak_agreement, records))


def flags(names: Iterable[Flag]) -> str:
    """Write the flags of a verdict in words."""
    shown = {**WEAK, "stand_in": "assumed value"}
    return ", ".join(shown[name] for name in names if name in shown)


def qualified(record: Record) -> str:
    """Write a verdict with what makes it weak."""
    marks = flags(record.flags)
    return f"{record.verdict} ({marks})" if marks else record.verdict


def replied(erratum: str) -> Markup:
    """Write the reply of the authors to an erratum, or where they can reply."""
    paper = erratum.partition("-")[0]
    place = Markup('none yet; <a href="#letter-{}">how to answer</a>').format(paper)
    return escape(replies()[erratum]) or place


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
        raise KeyError(
            f"expected an address, a key, 'all' or one of {PAPERS}, got {name!r}"
        )
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
    if (summary := record.readings) is not None:
        said |= {
            "readings": str(summary.count),
            "agreeing": str(summary.agreeing),
            "agrees-if": deciding(summary) or "no reading decides",
            "closest": choices_text(summary.closest.choices),
            "closest-computed": read(record, summary.closest).partition(",")[0],
            "closest-probability": probability(summary.closest) or "none",
        }
        computation = next(
            one
            for one in catalogue()[record.key].computations
            if one.makes(name_of(record))
        )
        found = evaluate(computation)
        for place, choices in enumerate(computation.readings):
            if len(changed := dict(choices.items() - computation.literal.items())) == 1:
                [(option, way)] = changed.items()
                one = found.cells[name_of(record)][place]
                said[f"if-{option}-{way}"] = read(record, one).partition(",")[0]
    return said


def _of_item(key: str) -> dict[str, str]:
    found = item_ledger(key)
    said = _agreement(found.of(key))
    said["results"] = str(sum(record.role == "result" for record in found.of(key)))
    if joint := found.table(key):
        said |= {
            "joint": joint_chance(joint.joint_probability, joint),
            "replicates": f"{joint.replicates:,}",
            "readings": f"{joint.readings:,}",
            "fitting": str(joint.fitting or "none"),
            "closest": choices_text(joint.closest),
            "closest-agreeing": str(joint.closest_agreeing),
            "closest-joint": joint_chance(joint.closest_probability, joint),
            "predicted": str(joint.cells),
        }
    return said


def _of_paper(name: str) -> dict[str, str]:
    chosen = tuple(
        r for r in whole_ledger().records if name in {"all", r.key.split("/")[0]}
    )
    by_verdict = tally(chosen)
    counts = {
        "cells": len(chosen),
        "numbers": sum(cell_of(record).is_number for record in chosen),
        "results": sum(record.role == "result" for record in chosen),
        "unsettled": sum(
            by_verdict[one] for one in ("differs", "ambiguous", "unpublished")
        ),
        "judged": sum(
            by_verdict[verdict] for verdict in ("exact", "consistent", "differs")
        ),
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
        said[name] = (
            f"{len(found)} ({share} of them weakly)" if doubtful else str(len(found))
        )
    doubtful = weak(records)
    said |= {"strong": str(len(groups["agree"]) - doubtful), "weak": str(doubtful)}
    return said
