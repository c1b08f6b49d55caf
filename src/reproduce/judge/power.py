"""How much the verdicts can see: would they notice a slip in a printed cell?"""

from __future__ import annotations

import functools
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from reproduce.judge.ledger import Ledger, build
from reproduce.judge.propagate import result_intervals
from reproduce.judge.verdicts import judge_prediction, judge_value
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Computation, Prediction, Results
from reproduce.printed.cells import Cell, library
from reproduce.printed.given import Given, given
from reproduce.printed.units import si_factor

# Enough to place a number among the central 99 % of a prediction, few enough for many reruns.
REPLICATES = 400
_AGREES = ("exact", "consistent")


@dataclass(frozen=True)
class Sight:
    """What the verdicts make of one slip.

    Parameters
    ----------
    seen : bool
        Whether a verdict of agreement turned into `differs`.
    refused : bool
        Whether a computation refused the changed input with an error. That is not counted as
        seen: a table with the slip would not have been reproduced at all.
    """

    seen: bool
    refused: bool = False


def seen_by_verdicts(
    address: str, text: str, ledger: Ledger | None = None, replicates: int = REPLICATES
) -> Sight:
    """Tell whether the verdicts would notice that a cell prints something else.

    Parameters
    ----------
    address : str
        The cell.
    text : str
        What it prints instead.
    ledger : Ledger, optional
        The verdicts as they are; the whole ledger by default.
    replicates : int
        For predictions made again.

    Returns
    -------
    Sight
        Whether an agreement turns into a difference.
    """
    ledger = build() if ledger is None else ledger
    agreeing = {r.cell for r in ledger.records if r.verdict in _AGREES}
    key, _, name = address.partition("#")
    cell = library()[key][name]
    changed = replace(cell, content=replace(cell.number, text=text))
    refused = False
    for computation in _computations():
        makes = computation.key == key and computation.makes(name) and address in agreeing
        door = _door(computation)
        if not makes and address not in door.cells:
            continue
        cells = {address: changed} if makes else {}
        if address in door.cells:
            door = Given({**door.cells, address: changed})
            try:
                results, intervals = _run(computation, door, replicates)
            except (ArithmeticError, LookupError, ValueError, RuntimeError, StopIteration):
                refused = True
                continue
        else:
            results, intervals = _as_printed(computation, replicates)
        if _differs(computation, results, intervals, cells, agreeing):
            return Sight(True, refused)
    return Sight(False, refused)


@functools.cache
def _computations() -> tuple[Computation, ...]:
    return tuple(c for item in catalogue().values() for c in item.computations)


@functools.cache
def _door(computation: Computation) -> Given:
    return given(computation.given)


@functools.cache
def _as_printed(
    computation: Computation, replicates: int
) -> tuple[Results, Mapping[str, tuple[float, float]]]:
    return _run(computation, _door(computation), replicates)


def _run(
    computation: Computation, door: Given, replicates: int
) -> tuple[Results, Mapping[str, tuple[float, float]]]:
    if computation.replicates:
        results = computation(door, min(replicates, computation.replicates))
        intervals: Mapping[str, tuple[float, float]] = {}
    else:
        results, intervals = computation(door), result_intervals(computation, door)
    if strays := set(results) - set(library()[computation.key].by_name):
        raise LookupError(f"{computation.name} makes cells that are not printed: {strays}")
    return results, intervals


def _differs(
    computation: Computation,
    results: Results,
    intervals: Mapping[str, tuple[float, float]],
    changed: Mapping[str, Cell],
    agreeing: Iterable[str],
) -> bool:
    table = library()[computation.key]
    for name, result in results.items():
        cell = changed.get(table[name].address, table[name])
        if cell.address not in agreeing:
            continue
        unit = si_factor(cell.unit)
        if isinstance(result, Prediction):
            found = judge_prediction(cell.number, result.draws / unit)
        elif isinstance(result, float):
            low, high = intervals.get(name, (result, result))
            found = judge_value(cell.number, result / unit, (low / unit, high / unit))
        else:
            continue
        if found.verdict == "differs":
            return True
    return False
