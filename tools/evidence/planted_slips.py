"""Plant a slip of the pen in every printed number, and see which check notices.

``python tools/evidence/planted_slips.py`` makes the study and stores it. With ``--check`` it makes
it again for some of the numbers, drawn with a fixed seed, and fails if what is stored says
otherwise; with ``--check --all``, for all of them.
"""

from __future__ import annotations

import argparse
import functools
import itertools
import random
import string
import sys
import time
import zlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import pandas as pd

import reproduce
from keep import write_table
from reproduce.audit.examine import contradicted
from reproduce.audit.relation import Relation, Sheet
from reproduce.audit.report import audit_paper
from reproduce.judge.ledger import frozen
from reproduce.judge.propagate import result_intervals
from reproduce.judge.verdicts import AGREES, Propagated, judge
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Computation, Results
from reproduce.printed.cells import PAPERS, Cell, library
from reproduce.printed.given import Given, given
from reproduce.store import studies

NAME = "planted-slips"
COMMAND = "python tools/evidence/planted_slips.py"
SEED = 20_240_102
# A check makes one number in so many again.
ONE_IN = 24
# Enough to place a number among the central 99 % of a prediction, few enough for many reruns.
REPLICATES = 400
ABOUT = (
    "One slip of each kind planted in every printed number, each alone. Seen means that an "
    "agreement, of a relation or of a verdict, turned into a disagreement; compared leaves out "
    "relations that know no more than a sign, a bound or a last digit. refused: a computation "
    "raised an error on the changed input; not counted as seen."
)
COLUMNS = (
    "cell",
    "kind",
    "printed instead",
    "compared",
    "relation",
    "verdict",
    "refused",
)
Kind = Literal["digit", "swap", "drop", "sign"]
KINDS: tuple[Kind, ...] = ("digit", "swap", "drop", "sign")


@dataclass(frozen=True)
class Plant:
    """A slip in one cell: one digit changed, two swapped, one dropped, or the sign."""

    address: str
    kind: Kind
    text: str


def plants(cells: Sheet, seed: int) -> Iterator[Plant]:
    """Yield one slip of each kind for every cell that can have it.

    Each cell has its own stream, so that the choice for one does not depend on the others.
    """
    for address, printed in cells.items():
        rng = np.random.default_rng([seed, zlib.crc32(address.encode())])
        for kind in KINDS:
            ways = sorted(_ways(printed.number.text, kind))
            if ways:
                yield Plant(address, kind, ways[rng.integers(len(ways))])


def _ways(text: str, kind: Kind) -> set[str]:
    """Return the numbers that one slip can make of a printed number."""
    mantissa, mark, power = text.partition("e")
    body = mantissa.removeprefix("-")
    sign = mantissa.removesuffix(body)
    places = [i for i, character in enumerate(body) if character.isdigit()]
    found: list[str] = []
    if kind == "digit":
        found = [
            body[:i] + digit + body[i + 1 :] for i in places for digit in string.digits
        ]
    elif kind == "swap":
        pairs = itertools.pairwise(places)
        found = [
            body[:i] + body[j] + body[i + 1 : j] + body[i] + body[j + 1 :]
            for i, j in pairs
        ]
    elif kind == "drop":
        found = [body[:i] + body[i + 1 :] for i in places if len(places) > 1]
    elif body.strip("0."):
        sign, found = "" if sign else "-", [body]
    return {sign + way + mark + power for way in found if _is_printable(way)} - {text}


def _is_printable(body: str) -> bool:
    """Tell whether digits can be printed: they start with a digit, without idle zeros."""
    return body[0].isdigit() and not (
        len(body) > 1 and body[0] == "0" and body[1] != "."
    )


def _reprinted(cell: Cell, text: str) -> Cell:
    """Return the same cell with other digits."""
    return replace(cell, content=replace(cell.number, text=text))


def seen_by_relations(
    cells: Sheet, relations: Sequence[Relation], planted: Sequence[Plant]
) -> list[bool]:
    """Tell which slips, each tried alone, turn a relation that holds into a contradiction."""
    before = contradicted(cells, relations)
    seen = []
    for plant in planted:
        touched = _touched(plant.address, relations)
        changed = {**cells, plant.address: _reprinted(cells[plant.address], plant.text)}
        seen.append(bool(contradicted(changed, touched) - before))
    return seen


def _touched(address: str, relations: Sequence[Relation]) -> list[Relation]:
    hit = [relation for relation in relations if address in relation.addresses]
    shared = {relation.unknown.name for relation in hit if relation.unknown}
    return [
        r for r in relations if r in hit or (r.unknown and r.unknown.name in shared)
    ]


@dataclass(frozen=True)
class Sight:
    """Whether a verdict of agreement turns into `differs`, and whether a computation refuses.

    A refused input is not seen: a table with the slip would not have been reproduced at all.
    """

    seen: bool
    refused: bool = False


@functools.cache
def agreeing() -> frozenset[str]:
    """Return the cells whose frozen verdict is an agreement."""
    return frozenset(
        a for a, expected in frozen().items() if expected.verdict in AGREES
    )


def seen_by_verdicts(address: str, text: str) -> Sight:
    """Tell whether a verdict would notice that a cell prints something else."""
    key, _, name = address.partition("#")
    cell = library()[key][name]
    changed = _reprinted(cell, text)
    refused = False
    for computation in _computations():
        makes = (
            computation.key == key and computation.makes(name) and address in agreeing()
        )
        door = _door(computation)
        if not makes and address not in door.cells:
            continue
        if address in door.cells:
            door = Given({**door.cells, address: changed})
            try:
                results, intervals = _run(computation, door)
            except (
                ArithmeticError,
                LookupError,
                ValueError,
                RuntimeError,
                StopIteration,
            ):
                refused = True
                continue
        else:
            results, intervals = _as_printed(computation)
        prints = {address: changed} if makes else {}
        if _differs(computation, results, intervals, prints):
            return Sight(True, refused)
    return Sight(False, refused)


@functools.cache
def _computations() -> tuple[Computation, ...]:
    return tuple(c for item in catalogue().values() for c in item.computations)


@functools.cache
def _door(computation: Computation) -> Given:
    return given(computation.given)


@functools.cache
def _as_printed(computation: Computation) -> tuple[Results, Mapping[str, Propagated]]:
    return _run(computation, _door(computation))


def _run(
    computation: Computation, door: Given
) -> tuple[Results, Mapping[str, Propagated]]:
    if computation.replicates:
        results = computation(door, min(REPLICATES, computation.replicates))
        intervals: Mapping[str, Propagated] = {}
    else:
        results, intervals = computation(door), result_intervals(computation, door)
    if strays := set(results) - set(library()[computation.key].by_name):
        raise LookupError(
            f"{computation.name} makes cells that are not printed: {strays}"
        )
    return results, intervals


def _differs(
    computation: Computation,
    results: Results,
    intervals: Mapping[str, Propagated],
    changed: Mapping[str, Cell],
) -> bool:
    table = library()[computation.key]
    for name, result in results.items():
        cell = changed.get(table[name].address, table[name])
        if cell.address not in agreeing():
            continue
        if not judge(cell, result, {}, intervals.get(name)).agrees:
            return True
    return False


def study(chosen: set[str] | None = None) -> pd.DataFrame:
    """Make the study, or the part of it for some cells."""
    rows: list[tuple[str | bool, ...]] = []
    for paper in PAPERS:
        audit = audit_paper(paper)
        planted = [
            p
            for p in plants(audit.cells, SEED)
            if chosen is None or p.address in chosen
        ]
        relations = [finding.relation for finding in audit.findings]
        related = seen_by_relations(audit.cells, relations, planted)
        compared = seen_by_relations(
            audit.cells, [r for r in relations if r.compares], planted
        )
        for plant, one, two in zip(planted, compared, related, strict=True):
            sight = seen_by_verdicts(plant.address, plant.text)
            flags = (one, two, sight.seen, sight.refused)
            rows.append((plant.address, plant.kind, plant.text, *flags))
    return pd.DataFrame(rows, columns=list(COLUMNS))


def some(cells: Sequence[str], seed: int = SEED) -> set[str]:
    """Draw the cells that a check makes again."""
    return set(random.Random(seed).sample(cells, len(cells) // ONE_IN))


def differing(stored: pd.DataFrame, again: pd.DataFrame) -> pd.DataFrame:
    """Return the rows of a study, or of a part of it, that are not those stored for its cells."""
    same = stored[stored["cell"].isin(again["cell"])].reset_index(drop=True)
    both = same.merge(again, how="outer", on=list(COLUMNS), indicator="where")
    return both[both["where"] != "both"]


def main() -> None:
    """Make the study and store it, or hold what is stored against it."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--check", action="store_true", help="compare with what is stored"
    )
    parser.add_argument(
        "--all", action="store_true", help="check everything, not some numbers"
    )
    options = parser.parse_args()
    start = time.process_time()
    if options.check:
        stored = studies.table(NAME)
        cells = sorted({address for p in PAPERS for address in audit_paper(p).cells})
        again = study(None if options.all else some(cells))
        faults = differing(stored, again)
        print(
            f"{len(again)} slips planted again in {time.process_time() - start:.0f} s"
        )
        sys.exit(f"NOT as stored:\n{faults.to_string()}" if len(faults) else 0)
    found = study()
    seconds = round(time.process_time() - start)
    note = {
        "about": ABOUT,
        "command": COMMAND,
        "version": reproduce.__version__,
        "seed": SEED,
    }
    write_table(NAME, found, {**note, "processor_seconds": seconds})


if __name__ == "__main__":
    main()
