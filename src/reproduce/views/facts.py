"""What a sentence may say of a printed cell, an item, a paper or everything, by one word each."""

from __future__ import annotations

import re
from collections.abc import Mapping

from reproduce.judge.ledger import Record
from reproduce.judge.verdicts import VERDICTS
from reproduce.printed.cells import PAPERS
from reproduce.views.computed import item_ledger, whole_ledger
from reproduce.views.writing import verdicts


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
    value = verdicts.computed(record)
    said = {
        "printed": verdicts.cell_of(record).shown,
        "computed": verdicts.quantity(value, verdicts.unit(record)) if value else "nothing",
        "verdict": record.verdict,
        "probability": verdicts.probability(record) or "none",
    }
    if record.readings:
        said["readings"] = str(len(record.readings))
        said["agreeing"] = str(sum(reading.agrees for reading in record.readings))
    for number, reading in enumerate(record.readings, start=1):
        said[f"reading-{number}"] = verdicts.read(record, reading).partition(",")[0]
    return said


def _of_item(key: str) -> dict[str, str]:
    found = item_ledger(key)
    said = _agreement(found.of(key))
    said["results"] = str(sum(record.role == "result" for record in found.of(key)))
    if fits := found.whole_readings(key):
        said["fitting"] = str(sum(one.fits for one in fits) or "none")
        said["whole-readings"] = str(len(fits))
        said["replicates"] = f"{max(one.replicates for one in fits):,}"
        said["closest"] = verdicts.fitting(fits).partition("Closest: ")[2].removesuffix(".")
    if joint := found.table(key):
        said |= {"joint": verdicts.joint_chance(joint), "replicates": f"{joint.replicates:,}"}
    return said


def _of_paper(name: str) -> dict[str, str]:
    chosen = tuple(r for r in whole_ledger().records if name in {"all", r.key.split("/")[0]})
    by_verdict = verdicts.tally(chosen)
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
        weak = verdicts.weak(found)
        share = "all" if weak == len(found) else str(weak)
        said[name] = f"{len(found)} ({share} of them weakly)" if weak else str(len(found))
    weak = verdicts.weak(records)
    said |= {"strong": str(len(groups["agree"]) - weak), "weak": str(weak)}
    return said
