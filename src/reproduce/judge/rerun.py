"""Computation of an item with changed inputs, or under one reading of the text.

A change replaces a printed cell that is an input of the item, directly or through other items.
Between the changed cell and the item, recomputed values replace printed values. The result has no
verdict.

An option without a choice has its literal alternative. If only options are changed, the result is
one reading of the text and contains the verdict of each cell under this reading.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from decimal import Decimal
from functools import cache
from itertools import product
from typing import TypeVar

import numpy as np

from reproduce.judge.ledger import TableRecord, reread
from reproduce.judge.verdicts import central_interval
from reproduce.papers.catalogue import catalogue, changeable, computation_for, upstream
from reproduce.papers.declare import Alternative, Computation, Prediction, Result
from reproduce.printed.cells import PrintedCell, find, library
from reproduce.printed.inputs import Inputs, load_inputs
from reproduce.printed.number import Interval, si_factor, symbol
from reproduce.printed.quantity import si_value

_Made = TypeVar("_Made")
# Relative difference of two results that rounding noise can explain.
_NOISE_RATIO = 1e-9
# More replicates would only fill the memory.
_MAX_REPLICATES = 100_000
# Cells that a message suggests instead of a cell that is not an input.
_MAX_SUGGESTED = 5


class CannotChangeError(ValueError):
    """Raised for a cell that is not an input, a value that does not fit, or an unknown option."""


@dataclass(frozen=True)
class _ChangedCell:
    """One cell of an item under a change, in the printed unit.

    Parameters
    ----------
    cell : PrintedCell
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
        Key of the item.
    changes : dict
        Address to the value as given, and ``seed`` or ``replicates`` if they are changed.
    cells : tuple of _ChangedCell
        Every cell that the item computes.
    replaced : dict
        Address of each printed input that a recomputed value replaces, to that value in the
        printed unit.
    options : dict
        Option to the chosen alternative.
    joint : TableRecord, optional
        Joint probability of a stochastic table, if only options are changed.
    """

    key: str
    changes: dict[str, str]
    cells: tuple[_ChangedCell, ...]
    replaced: dict[str, float]
    options: dict[str, str] = field(default_factory=dict)
    joint: TableRecord | None = None

    @property
    def is_reading(self) -> bool:
        """Whether this is a reading of the paper as printed, without changed inputs."""
        return bool(self.options) and not self.changes


def options(key: str) -> dict[str, dict[str, Alternative]]:
    """Return the options of an item.

    Parameters
    ----------
    key : str
        Key of the item.

    Returns
    -------
    dict
        Option to its alternatives, the literal one first.

    Examples
    --------
    >>> list(options("niu2024/table-3")["translations"])
    ['table-1', 'table-2']
    """
    by_option: dict[str, dict[str, Alternative]] = {}
    for computation in catalogue()[key].computations:
        for name, alternatives in computation.options.items():
            by_option.setdefault(name, {}).update(alternatives)
    return by_option


def rerun(
    key: str,
    changes: Mapping[str, str | float] | None = None,
    *,
    seed: int | None = None,
    replicates: int | None = None,
    chosen: Mapping[str, str] | None = None,
) -> Rerun:
    """Compute an item again under a change, or under a reading of the text.

    Parameters
    ----------
    key : str
        Key of the item.
    changes : mapping, optional
        Address of an input to a value as printed, with its unit.
    seed, replicates : int, optional
        Seed of the random number generator, and number of replicates.
    chosen : mapping, optional
        Option of the text to one of its alternatives.

    Returns
    -------
    Rerun
        Printed, computed and changed value of each cell.

    Raises
    ------
    CannotChangeError
        If a cell is not an input, a value does not fit, or the item cannot be computed.
    """
    changes, chosen = dict(changes or {}), dict(chosen or {})
    run = _Run(checked_values(key, changes), seed, replicates, chosen)
    known = options(key)
    for name, alternative in chosen.items():
        if alternative not in known.get(name, ()):
            listed = "; ".join(
                f"{n} ({', '.join(choices)})" for n, choices in known.items()
            )
            raise CannotChangeError(
                f"{name}: expected an option of {key}, {listed or 'which has none'}, got "
                f"{alternative!r}. Choose an alternative"
            )
    computations = catalogue()[key].computations
    random = any(computation.replicates for computation in computations)
    check_randomness(key, random, changes, seed, replicates)
    changed = by_name(changes, seed, replicates)
    if chosen and not changed:
        return _reading(key, chosen)
    cells = {}
    with _explained(key, changed | chosen):
        for computation in computations:
            before = computation.with_options(chosen)(load_inputs(computation.inputs))
            for name, after in run.results(computation).items():
                cell, ends = library()[key][name], None
                unit = si_factor(cell.unit)
                if isinstance(after, Prediction):
                    ends = central_interval(after.draws / unit)
                value = _median(after, unit)
                if not np.isfinite([value, *(ends or ())]).all():
                    raise ArithmeticError(f"{cell.address} is not a finite number")
                unchanged = _median(before[name], unit)
                cells[name] = _ChangedCell(cell, unchanged, value, ends)
    ordered = (cells[name] for name in library()[key].by_name if name in cells)
    return Rerun(key, changed, tuple(ordered), run.replaced, chosen)


@cache
def effective_changes(key: str) -> dict[str, tuple[str, str]]:
    """Return an input and another value of it for each computed cell that it changes, by name.

    The value is one or ten units of the last printed digit higher.
    """
    random = any(
        computation.replicates for computation in catalogue()[key].computations
    )
    replicates = 2 if random else None
    inputs = [cell for one in changeable(key) if (cell := find(one)[0]).is_number]

    def texts(changes: Mapping[str, str]) -> dict[str, str]:
        cells = rerun(key, changes, replicates=replicates).cells
        return {
            one.cell.name: one.cell.number.format(one.value or 0.0, extra=1)
            for one in cells
        }

    start, found = texts({}), dict[str, tuple[str, str]]()
    for units, cell in product((1, 10), inputs):
        number = Decimal(cell.text) + Decimal(units).scaleb(cell.number.exponent)
        change = cell.address, f"{number:f} {symbol(cell.unit)}".strip()
        with suppress(CannotChangeError):
            for name, value in texts(dict([change])).items():
                if value != start[name] and cell.address in changeable(f"{key}#{name}"):
                    found.setdefault(name, change)
        if len(found) == len(start):
            break
    return found


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
    if seed is replicates is None:
        return
    if not random:
        above = filter(None, map(computation_for, changeable(key)))
        changed = set(changes)
        random = any(
            c.replicates and changed.intersection(upstream(c.inputs)) for c in above
        )
    limits = {
        "seed": (seed, 0, math.inf),
        "replicates": (replicates, 2, _MAX_REPLICATES),
    }
    for name, (number, least, greatest) in limits.items():
        is_whole = isinstance(number, int | np.integer) and least <= number <= greatest
        if number is not None and not (random and is_whole):
            expected = f"None, since {key} draws no random numbers"
            if random:
                expected = f"a whole number from {least} to {greatest:,}"
            raise CannotChangeError(f"{name}: expected {expected}, got {number!r}")


def checked_values(key: str, changes: Mapping[str, str | float]) -> dict[str, float]:
    """Return the values of a user in SI units; raise an error for a cell that is not an input."""
    allowed, values = changeable(key), {}
    for address, text in changes.items():
        if address not in allowed:
            raise _stray(key, address, allowed)
        try:
            values[address] = si_value(find(address)[0], text)
        except ValueError as error:
            raise CannotChangeError(str(error)) from error
    return values


def _stray(key: str, stray: str, allowed: Sequence[str]) -> CannotChangeError:
    """Return the error of a cell that is not an input, with similar inputs."""
    names = {address.partition("#")[2]: address for address in reversed(allowed)}
    name = stray.rpartition("#")[2]
    near = difflib.get_close_matches(name, names, _MAX_SUGGESTED, cutoff=0.7)
    listed = [names[name] for name in near] or allowed[:_MAX_SUGGESTED]
    return CannotChangeError(
        f"{stray}: expected an input of {key}, such as {', '.join(listed)}. All {len(allowed)} "
        "are in `.inputs`"
    )


def compute_with_changes(
    key: str,
    patterns: tuple[str, ...],
    changes: Mapping[str, str | float],
    seed: int | None,
    compute: Callable[[Inputs], _Made],
) -> tuple[_Made, dict[str, float]]:
    """Return the result of `compute` with changed inputs, and the replaced printed inputs.

    Parameters
    ----------
    key : str
        Key of the item.
    patterns : tuple of str
        Addresses of its inputs.
    changes : mapping
        Address of an input to a value as printed, with its unit.
    seed : int, optional
        Seed of the random number generator.
    compute : callable
        Function of the inputs.

    Returns
    -------
    result
        Result of `compute`.
    replaced : dict
        Address to the recomputed value that replaces the printed one, in the printed unit.
    """
    run = _Run(checked_values(key, changes), seed)
    with _explained(key, by_name(changes, seed)):
        return compute(run.inputs(patterns)), run.replaced


@contextmanager
def _explained(key: str, changes: Mapping[str, str]) -> Iterator[None]:
    """Add the item and the changes to an error of a computation."""
    try:
        with np.errstate(all="ignore"):
            yield
    except (ValueError, ArithmeticError, IndexError, MemoryError) as error:
        setting = ", ".join(f"{name} = {text}" for name, text in changes.items())
        raise CannotChangeError(
            f"{key} cannot be computed with {setting}: {error}"
        ) from error


def _reading(key: str, chosen: dict[str, str]) -> Rerun:
    """Return an item under one reading of the text, with verdicts."""
    chosen_ledger, literal = reread(key, chosen), reread(key, {})
    cells = tuple(
        _ChangedCell(
            find(after.cell)[0],
            before.computed,
            after.computed,
            after.interval,
            after.verdict,
        )
        for before, after in zip(literal.records, chosen_ledger.records, strict=True)
        if after.function
    )
    return Rerun(key, {}, cells, {}, chosen, chosen_ledger.table(key))


@dataclass
class _Run:
    """Values of cells under one set of changes. Every computation runs at most once."""

    values: Mapping[str, float]
    seed: int | None
    replicates: int | None = None
    chosen: Mapping[str, str] = field(default_factory=dict)
    replaced: dict[str, float] = field(default_factory=dict)
    _results: dict[str, Mapping[str, Result]] = field(default_factory=dict)

    def results(self, computation: Computation) -> Mapping[str, Result]:
        """Return the results of a computation whose inputs follow the changes."""
        if computation.name not in self._results:
            inputs = self.inputs(computation.inputs)
            run = computation.with_options(self.chosen)
            self._results[computation.name] = run(inputs, self.replicates)
        return self._results[computation.name]

    def inputs(self, patterns: tuple[str, ...]) -> Inputs:
        """Return the inputs that match patterns, with the changes and recomputed values."""
        inputs = load_inputs(patterns, self.seed)
        values = {address: self._input(address) for address in inputs.cells}
        return inputs.changed({a: v for a, v in values.items() if v is not None})

    def _input(self, address: str) -> float | None:
        """Return the value that replaces a printed input; None if the printed value remains."""
        if address in self.values:
            return self.values[address]
        above = computation_for(address)
        if above is None or self.values.keys().isdisjoint(upstream(above.inputs)):
            return None
        cell = find(address)[0]
        unchanged = above.with_options(self.chosen)(
            load_inputs(above.inputs, self.seed), self.replicates
        )
        if cell.name not in unchanged:
            return None
        before, value = (
            _median(results[cell.name]) for results in (unchanged, self.results(above))
        )
        unit, (low, high) = si_factor(cell.unit), cell.number.interval()
        # Rounding noise, which differs between processors, is no change.
        tolerance = _NOISE_RATIO * unit * (high - low)
        if math.isclose(value, before, rel_tol=_NOISE_RATIO, abs_tol=tolerance):
            return None
        self.replaced[address] = value / unit
        return value


def _median(result: Result, unit: float = 1.0) -> float:
    """Return the median of a result in a unit, which is applied first, as in the ledger."""
    if isinstance(result, Prediction):
        return float(np.median(result.draws / unit))
    return float(result) / unit
