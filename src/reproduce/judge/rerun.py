"""Computation of an item with changed inputs, or under a reading of the text.

A change replaces a printed cell that is an input of the item, directly or through other items.
Recomputed values replace the printed values between the changed cell and the item. Such a result
has no verdict.

Options of the text select one reading; an option without a choice takes its literal alternative.
With options only, the result contains the verdict of each cell under this reading.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np

from reproduce.judge.ledger import TableRecord, reread
from reproduce.judge.verdicts import central_interval
from reproduce.papers.catalogue import catalogue, changeable, computation_for, upstream
from reproduce.papers.declare import Alternative, Computation, Prediction, Result
from reproduce.printed.cells import PrintedCell, find, library
from reproduce.printed.inputs import Inputs, load_inputs
from reproduce.printed.number import Interval, si_factor
from reproduce.printed.quantity import si_value

_Made = TypeVar("_Made")
# Relative difference of two results that rounding noise can explain.
_NOISE_RATIO = 1e-9
# More replicates would only fill the memory.
_MAX_REPLICATES = 100_000
# Cells that a message suggests in place of a cell that is not read.
_MAX_SUGGESTED = 5


class CannotChangeError(ValueError):
    """A change that the item does not read, a value that does not fit, an unknown option."""


@dataclass(frozen=True)
class ChangedCell:
    """One cell of an item under a change, in the printed unit.

    Parameters
    ----------
    cell : Cell
        Printed cell.
    unchanged, value : float, optional
        Computed value, or median of the prediction, without and with the change.
    interval : tuple of float, optional
        Central 99 % of a prediction.
    verdict : str
        Verdict under the chosen reading, if only options are changed.
    """

    cell: PrintedCell
    unchanged: float | None
    value: float | None
    interval: Interval | None = None
    verdict: str = ""


@dataclass(frozen=True)
class Rerun:
    """An item computed again under a change.

    Parameters
    ----------
    key : str
        The item.
    changes : dict
        Address to the value as given, and ``seed`` or ``replicates`` if they are changed.
    cells : tuple of ChangedCell
        Every cell that the item computes.
    replaced : dict
        Address of each printed input that a recomputed value replaces, to that value in the
        printed unit.
    options : dict
        Option to the alternative chosen.
    joint : TableRecord, optional
        Joint probability of a stochastic table, if only options are changed.
    """

    key: str
    changes: dict[str, str]
    cells: tuple[ChangedCell, ...]
    replaced: dict[str, float]
    options: dict[str, str] = field(default_factory=dict)
    joint: TableRecord | None = None

    @property
    def is_reading(self) -> bool:
        """Whether this is a reading of the paper as printed, without changed inputs."""
        return bool(self.options) and not self.changes


def options(key: str) -> dict[str, dict[str, Alternative]]:
    """Return the options of an item.

    Option to its alternatives, the literal one first.

    Examples
    --------
    >>> list(options("niu2024/table-3")["translations"])
    ['table-1', 'table-2']
    """
    found: dict[str, dict[str, Alternative]] = {}
    for computation in catalogue()[key].computations:
        for name, ways in computation.options.items():
            found.setdefault(name, {}).update(ways)
    return found


def rerun(
    key: str,
    changes: Mapping[str, str | float] | None = None,
    *,
    seed: int | None = None,
    replicates: int | None = None,
    chosen: Mapping[str, str] | None = None,
) -> Rerun:
    """Compute an item again under a change, or under a reading of the text."""
    changes, chosen = dict(changes or {}), dict(chosen or {})
    values = checked_values(key, changes)
    _check_options(key, chosen)
    computations = catalogue()[key].computations
    random = any(one.replicates for one in computations)
    check_randomness(key, random, changes, seed, replicates)
    changed = by_name(changes, seed, replicates)
    if chosen and not changed:
        return _reading(key, chosen)
    run = _Run(values, seed, replicates, chosen)
    cells = {}
    with _explained(key, changed | chosen):
        for computation in computations:
            before = computation.with_options(chosen)(load_inputs(computation.inputs))
            for name, after in run.results(computation).items():
                cells[name] = _changed(library()[key][name], before[name], after)
        for one in cells.values():
            if not np.isfinite([one.value, *(one.interval or ())]).all():
                raise ArithmeticError(f"{one.cell.address} is not a finite number")
    ordered = (cells[name] for name in library()[key].by_name if name in cells)
    return Rerun(key, changed, tuple(ordered), run.replaced, chosen)


def by_name(
    changes: Mapping[str, str | float], seed: int | None, replicates: int | None = None
) -> dict[str, str]:
    """Return all changes as given, by address, ``seed`` or ``replicates``."""
    every = {**changes, "seed": seed, "replicates": replicates}
    return {name: str(value) for name, value in every.items() if value is not None}


def check_randomness(
    key: str,
    random: bool,
    changes: Iterable[str],
    seed: int | None,
    replicates: int | None = None,
) -> None:
    """Raise an error for a seed or a number of replicates that an item cannot take.

    Random numbers are drawn by the item, or between a change and the inputs of the item.
    """
    if not random and (seed, replicates) != (None, None):
        above = [
            one
            for one in map(computation_for, changeable(key))
            if one and one.replicates
        ]
        changed = set(changes)
        random = any(changed.intersection(upstream(one.inputs)) for one in above)
    numbers: list[tuple[str, Any, int, float]] = [
        ("seed", seed, 0, math.inf),
        ("replicates", replicates, 2, _MAX_REPLICATES),
    ]
    for name, number, least, most in numbers:
        whole = isinstance(number, int | np.integer) and least <= number <= most
        if number is not None and not (whole and random):
            wanted = f"a whole number from {least} to {most:,}"
            if not random:
                wanted = f"None, since {key} draws no random numbers"
            raise CannotChangeError(f"{name}: expected {wanted}, got {number!r}")


def checked_values(key: str, changes: Mapping[str, str | float]) -> dict[str, float]:
    """Return the values of a user in SI units; raise an error for a cell that is not an input."""
    _refuse_strays(key, changes, changeable(key))
    try:
        return {one: si_value(find(one)[0], text) for one, text in changes.items()}
    except ValueError as error:
        raise CannotChangeError(str(error)) from error


def _refuse_strays(
    subject: str, changes: Iterable[str], allowed: Sequence[str]
) -> None:
    """Raise an error for the first cell that is not an input; suggest similar inputs."""
    names = {address.partition("#")[2]: address for address in reversed(allowed)}
    for stray in (address for address in changes if address not in allowed):
        name = stray.rpartition("#")[2]
        near = difflib.get_close_matches(name, names, _MAX_SUGGESTED, cutoff=0.7)
        listed = [names[one] for one in near] or allowed[:_MAX_SUGGESTED]
        raise CannotChangeError(
            f"{stray}: expected an input of {subject}, such as {', '.join(listed)}. "
            f"All {len(allowed)} are in `.inputs`"
        )


def compute_with_changes(
    key: str,
    patterns: tuple[str, ...],
    changes: Mapping[str, str | float],
    seed: int | None,
    compute: Callable[[Inputs], _Made],
) -> tuple[_Made, dict[str, float]]:
    """Return the result of `compute` with changed inputs, and the printed inputs replaced."""
    run = _Run(checked_values(key, changes), seed)
    with _explained(key, by_name(changes, seed)):
        return compute(run.inputs(patterns)), run.replaced


@contextmanager
def _explained(key: str, changes: Mapping[str, str]) -> Iterator[None]:
    """Name the item and the changes in an error of a computation."""
    try:
        with np.errstate(all="ignore"):
            yield
    except (ValueError, ArithmeticError, IndexError, MemoryError) as error:
        setting = ", ".join(f"{name} = {text}" for name, text in changes.items())
        raise CannotChangeError(
            f"{key} cannot be computed with {setting}: {error}"
        ) from error


def _check_options(key: str, chosen: Mapping[str, str]) -> None:
    known = options(key)
    for name, way in chosen.items():
        if way not in known.get(name, ()):
            listed = "; ".join(f"{n} ({', '.join(ways)})" for n, ways in known.items())
            raise CannotChangeError(
                f"{name}: expected an option of {key}, {listed or 'which has none'}; "
                f"got {way!r}"
            )


def _reading(key: str, chosen: dict[str, str]) -> Rerun:
    """Judge an item under one reading of the text."""
    found, literal = reread(key, chosen), reread(key, {})
    cells = tuple(
        ChangedCell(
            cell=find(record.cell)[0],
            unchanged=literal.cell(record.cell).computed,
            value=record.computed,
            interval=record.interval,
            verdict=record.verdict,
        )
        for record in found.records
        if record.function
    )
    return Rerun(key, {}, cells, {}, chosen, found.table(key))


def _changed(cell: PrintedCell, before: Result, after: Result) -> ChangedCell:
    """Return a cell before and after a change."""
    unit = si_factor(cell.unit)
    ends = (
        central_interval(after.draws / unit) if isinstance(after, Prediction) else None
    )
    return ChangedCell(cell, _middle(before, unit), _middle(after, unit), ends)


class _Run:
    """Values of cells under one set of changes; every computation runs at most once."""

    def __init__(
        self,
        values: Mapping[str, float],
        seed: int | None,
        replicates: int | None = None,
        chosen: Mapping[str, str] | None = None,
    ) -> None:
        self.values, self.seed, self.replicates = values, seed, replicates
        self.chosen = chosen or {}
        self.replaced: dict[str, float] = {}
        self._results: dict[str, Mapping[str, Result]] = {}

    def results(self, computation: Computation) -> Mapping[str, Result]:
        """Return the results of a computation whose inputs follow the changes."""
        if computation.name not in self._results:
            inputs = self.inputs(computation.inputs)
            found = computation.with_options(self.chosen)(inputs, self.replicates)
            self._results[computation.name] = found
        return self._results[computation.name]

    def inputs(self, patterns: tuple[str, ...]) -> Inputs:
        """Return the inputs that match patterns, with the changes and recomputed values."""
        inputs = load_inputs(patterns, self.seed)
        values = {address: self._input(address) for address in inputs.cells}
        return inputs.changed({a: v for a, v in values.items() if v is not None})

    def _input(self, address: str) -> float | None:
        """Return the value that replaces a printed input; None if no value does."""
        if address in self.values:
            return self.values[address]
        above = computation_for(address)
        if above is None or not self.values.keys() & set(upstream(above.inputs)):
            return None
        cell = find(address)[0]
        found = self.results(above).get(cell.name)
        plain = above.with_options(self.chosen)(
            load_inputs(above.inputs, self.seed), self.replicates
        )
        if found is None:
            return None
        value, unit = _middle(found), si_factor(cell.unit)
        low, high = cell.number.interval()
        # Rounding noise, which differs between processors, is no change.
        tolerance = _NOISE_RATIO * unit * (high - low)
        if math.isclose(
            value, _middle(plain[cell.name]), rel_tol=_NOISE_RATIO, abs_tol=tolerance
        ):
            return None
        self.replaced[address] = value / unit
        return value


def _middle(result: Result, unit: float = 1.0) -> float:
    """Return the middle of a result in a unit, which is applied first, as the ledger does."""
    if isinstance(result, Prediction):
        return float(np.median(result.draws / unit))
    return float(result) / unit
