"""Every number that a sentence of the book may say, by name, computed once before the pages.

``python -m reproduce.views.facts FILE`` writes them, those of single papers where their keys
follow; the roles of the book only look them up. A
printed cell has a name for each of its sides (``niu2024/table-3#scale.red computed``); an item, a
paper and ``all`` have their counts (``niu2024/table-3 differs``); a study names its own results
(``niu2024/readings#best-joint``), and so does a posterior (``posterior/registration#noise-mean``).
"""

from __future__ import annotations

import functools
import json
import re
import sys
from collections.abc import Iterable, Mapping
from pathlib import Path

from reproduce.judge import ledger
from reproduce.judge.ledger import Ledger
from reproduce.judge.studies import studies
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import PAPERS, library
from reproduce.views import build, numbers, record_text

__all__ = [
    "facts",
    "facts_of",
    "filled",
    "item_ledger",
    "of_posteriors",
    "unsampled",
    "whole_ledger",
    "write",
]

_BLANK = re.compile(r"\{([^{}]+)\}")


@functools.cache
def item_ledger(*keys: str) -> Ledger:
    """Return the ledger of some items."""
    if build.kept() is None:
        return ledger.build(keys)
    whole = whole_ledger()
    records = tuple(record for record in whole.records if record.key in keys)
    tables = tuple(table for table in whole.tables if table.key in keys)
    return Ledger(records=records, tables=tables, altered=whole.altered)


@functools.cache
def whole_ledger() -> Ledger:
    """Return the ledger of everything."""
    return build.once("ledger", ledger.build)


def facts(*papers: str) -> dict[str, str]:
    """Compute every fact, or those of the cells, items and studies of some papers alone."""
    from reproduce.papers.posteriors import posteriors

    return unsampled(*papers) | ({} if papers else of_posteriors(posteriors()))


def of_posteriors(names: Iterable[str]) -> dict[str, str]:
    """Compute the facts of posteriors, which are sampled for it."""
    from reproduce.views.posterior_facts import posterior_facts
    from reproduce.views.sampled import book_posterior

    return {
        f"posterior/{name}#{label}": numbers.powers(text)
        for name in names
        for label, text in posterior_facts(name, book_posterior(name)).items()
    }


def unsampled(*papers: str) -> dict[str, str]:
    """Compute the facts of the ledger, the studies and the audit, or of some papers alone."""
    if papers:
        keys = [key for key in catalogue() if key.partition("/")[0] in papers and key in library()]
        records = tuple(record for key in keys for record in item_ledger(key).records)
    else:
        records = whole_ledger().records
        keys = list(dict.fromkeys(record.key for record in records))
    names = [*(record.cell for record in records), *keys, *(() if papers else (*PAPERS, "all"))]
    found = {f"{name} {what}": text for name in names for what, text in facts_of(name).items()}
    for key, study in studies().items():
        if not papers or key.partition("/")[0] in papers:
            quoted = study.facts().items()
            found |= {f"{key}#{name}": numbers.fact(one) for name, one in quoted}
    if not papers:
        from reproduce.views import audit_pages

        found |= {f"audit#{label}": text for label, text in audit_pages.audit_facts().items()}
    return {name: numbers.powers(text) for name, text in found.items()}


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


def write(path: Path, *papers: str) -> bool:
    """Write all facts to a JSON file, unless it holds those of the present files."""
    key = " ".join((build.fingerprint(), *papers))
    if path.is_file() and json.loads(path.read_text(encoding="utf-8"))["key"] == key:
        return False
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"key": key, "facts": facts(*papers)}, ensure_ascii=False, indent=0)
    path.write_text(text + "\n", encoding="utf-8")
    return True


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
    cell = record_text.cell_of(record)
    unit = record_text.unit(record)
    gap = "" if unit in {"", "°", "″"} else "\u202f"
    value = record_text.computed(record)
    said = {
        "printed": cell.shown,
        "computed": f"{value}{gap}{unit}" if value else "nothing",
        "verdict": record.verdict,
        "probability": record_text.probability(record) or "none",
    }
    if record.readings:
        said["readings"] = str(len(record.readings))
        said["agreeing"] = str(sum(reading.agrees for reading in record.readings))
        for number, reading in enumerate(record.readings, start=1):
            said[f"reading-{number}"] = record_text.read(record, reading).partition(",")[0]
    return said


def _of_item(key: str) -> dict[str, str]:
    found = item_ledger(key)
    said = {verdict: str(count) for verdict, count in record_text.tally(found.of(key)).items()}
    joint = found.table(key)
    if joint is not None:
        said["joint"] = record_text.joint_chance(joint)
        said["replicates"] = f"{joint.replicates:,}"
    return said


def _of_paper(name: str) -> dict[str, str]:
    chosen = tuple(r for r in whole_ledger().records if name in {"all", r.key.split("/")[0]})
    tally = record_text.tally(chosen)
    strong = record_text.strong(chosen)
    counts = {
        **tally,
        **{flag.replace("_", "-"): count for flag, count in record_text.weak(chosen).items()},
        "strong": strong,
        "weak": tally["exact"] + tally["consistent"] - strong,
        "cells": len(chosen),
        "judged": sum(tally[verdict] for verdict in ("exact", "consistent", "differs")),
    }
    return {what: str(count) for what, count in counts.items()}


if __name__ == "__main__":
    write(Path(sys.argv[1]), *sys.argv[2:])
