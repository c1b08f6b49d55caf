"""Ledger numbers as text for the sentences of a page."""

from __future__ import annotations

import functools
import re
from collections.abc import Mapping

from reproduce.judge import ledger
from reproduce.judge.ledger import Ledger
from reproduce.printed.cells import PAPERS, anchor
from reproduce.views import words

_BLANK = re.compile(r"\{([^{}]+)\}")


@functools.cache
def item_ledger(key: str) -> Ledger:
    """Return the ledger of one item."""
    return ledger.build([key])


@functools.cache
def whole_ledger() -> Ledger:
    """Return the ledger of everything."""
    return ledger.build()


def sayable(name: str) -> dict[str, str]:
    """Return what a sentence may say of a cell, an item, a paper or everything.

    Label to text; the anchor of the name, a hyphen, and what is said.

    Examples
    --------
    >>> sayable("niu2024/table-2#scale.red")["niu2024-table-2-scale-red-computed"]
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
        return sayable(name)[f"{anchor(name)}-{what}"]

    return _BLANK.sub(fill, text)


def _of_cell(address: str) -> dict[str, str]:
    record = item_ledger(address.partition("#")[0]).cell(address)
    cell = words.cell_of(record)
    unit = words.unit(record)
    gap = "" if unit in {"", "°", "″"} else "\u202f"
    value = words.computed(record)
    said = {
        "printed": cell.shown,
        "computed": f"{value}{gap}{unit}" if value else "nothing",
        "verdict": record.verdict,
        "probability": words.probability(record) or "none",
    }
    if record.readings:
        said["readings"] = str(len(record.readings))
        said["agreeing"] = str(sum(reading.agrees for reading in record.readings))
        for number, reading in enumerate(record.readings, start=1):
            said[f"reading-{number}"] = words.read(record, reading).partition(",")[0]
    return {f"{cell.anchor}-{what}": text for what, text in said.items()}


def _of_item(key: str) -> dict[str, str]:
    name, found = anchor(key), item_ledger(key)
    said = {f"{name}-{v}": str(n) for v, n in words.tally(found.of(key)).items()}
    joint = found.table(key)
    if joint is not None:
        said[f"{name}-joint"] = words.joint_chance(joint)
        said[f"{name}-replicates"] = f"{joint.replicates:,}"
    return said


def _of_paper(name: str) -> dict[str, str]:
    chosen = tuple(r for r in whole_ledger().records if name in {"all", r.key.split("/")[0]})
    tally = words.tally(chosen)
    said = {f"{name}-{verdict}": str(count) for verdict, count in tally.items()}
    said |= {f"{name}-{flag.replace('_', '-')}": str(n) for flag, n in words.weak(chosen).items()}
    strong = words.strong(chosen)
    said[f"{name}-strong"] = str(strong)
    said[f"{name}-weak"] = str(tally["exact"] + tally["consistent"] - strong)
    said[f"{name}-cells"] = str(len(chosen))
    said[f"{name}-judged"] = str(sum(tally[v] for v in ("exact", "consistent", "differs")))
    return said
