"""Computation of an item with changed inputs, or under one reading of the text.

A change replaces a printed cell that is an input of the item, directly or through other items.
Between the changed cell and the item, recomputed values replace printed values. A number that
needs unpublished data stays as printed, because its computed value is only assumed. The result has
no verdict.

An option without a choice has its literal alternative. If only options are changed, the result is
one reading of the text and contains the verdict of each cell under this reading.
"""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from decimal import Decimal
from functools import cache, cached_property
from typing import Any, NamedTuple

import numpy as np

from reproduce.judge.ledger import record_of
from reproduce.judge.verdicts import central_interval
from reproduce.papers.declare import (
    Alternative,
    Computation,
    Options,
    changeable,
    computation_for,
    computations,
    upstream,
)
from reproduce.physics.validate import whole_number, without_none
from reproduce.printed.cells import PrintedCell, find, library
from reproduce.printed.inputs import Inputs, load_inputs
from reproduce.printed.number import Interval, minus
from reproduce.printed.quantity import si_value

# Relative difference of two results that rounding noise can explain.
_NOISE_RATIO = 1e-9
# Smallest and largest numbers. More replicates would only fill the memory.
_RANGES = {"seed": (0, math.inf), "replicates": (2, 100_000)}
# Cells that a message suggests instead of a cell that is not an input.
_MAX_SUGGESTED = 5


class _ChangedCell(NamedTuple):
    """One cell of an item under a change, in the printed unit.

    - `unchanged`, `value`: computed value or median of the prediction, without and with the change.
    - `interval`: central 99 % of a prediction. Under a reading, also what rounded inputs allow.
    - `verdict`: under the chosen reading, if only options are changed.
    """

    cell: PrintedCell
    unchanged: float
    value: float
    interval: Interval | None = None
    verdict: str = ""

    @property
    def texts(self) -> list[str]:
        """The displayed values without and with the change, and ends of the interval."""
        return [
            "" if number is None else minus(self.cell.number.format(number))
            for number in (self.unchanged, self.value, *(self.interval or (None, None)))
        ]


def options(key: str) -> Options:
    """Return the options of an item.

    Parameters
    ----------
    key : str
        Key of the item.

    Returns
    -------
    mapping
        Option to its alternatives, the literal one first.

    Examples
    --------
    >>> list(options("niu2024/table-3")["translations"])
    ['table-1', 'table-2']
    """
    by_option: dict[str, dict[str, Alternative]] = {}
    for computation in computations(key):
        for name, alternatives in computation.options.items():
            by_option.setdefault(name, {}).update(alternatives)
    return by_option


def effective_change(address: str) -> tuple[str, str] | None:
    """Return an input of an item or a cell, and another value that changes a computed value.

    The value is one unit of the last printed digit higher.
    """
    for result in find(address):
        texts = _texts(result.key)
        inputs = changeable(result.address)
        for cell in (find(one)[0] for one in inputs if result.name in texts):
            number = Decimal(cell.text) + Decimal(1).scaleb(cell.number.exponent)
            change = cell.address, f"{number:f} {cell.symbol}".strip()
            with suppress(ValueError):
                if _texts(result.key, change)[result.name] != texts[result.name]:
                    return change
    return None


@cache
def _texts(key: str, *changes: tuple[str, str]) -> dict[str, str]:
    """Return the displayed values of the computed cells under some changes, by name."""
    cells = Rerun(key, dict(changes), replicates=2 if _is_random(key) else None).cells
    return {one.cell.name: one.texts[1] for one in cells}


def _is_random(key: str) -> bool:
    """Return whether the computations of an item draw random numbers."""
    return any(computation.replicates for computation in computations(key))


def checked_values(key: str, changes: object) -> dict[str, float]:
    """Return the values of a user in SI units; raise an error for a cell that is not an input."""
    if not isinstance(changes, Mapping) or not all(isinstance(a, str) for a in changes):
        raise TypeError(
            f"changes: expected a mapping of addresses to values, got {changes!r}. Write "
            "{address: value}"
        )
    allowed = changeable(key)
    for address in changes:
        if address not in allowed:
            similar = difflib.get_close_matches(address, allowed, _MAX_SUGGESTED, 0)
            known = f"such as {', '.join(similar)}. All {len(allowed)} are in `.inputs`"
            raise ValueError(
                f"{address}: expected an input of {key}, {known if allowed else 'which has none'}"
            )
    return {
        address: si_value(find(address)[0], text) for address, text in changes.items()
    }


def _check_randomness(key: str, random: bool, settings: Mapping[str, int]) -> None:
    """Raise an error for a seed or a number of replicates that an object cannot take."""
    for name, number in settings.items():
        if not random:
            raise ValueError(
                f"{name}: expected None, since {key} draws no random numbers, got {number!r}"
            )
        least, greatest = _RANGES[name]
        if whole_number(name, number, least=least) > greatest:
            raise ValueError(f"{name}: expected {greatest:,} at most, got {number}")


class Rerun:
    """An item under one set of changes. Every computation runs at most once.

    Parameters
    ----------
    key : str
        Key of an item, a supplementary table or a drawing.
    changes : mapping, optional
        Address of an input to a value as printed, with its unit.
    seed, replicates : int, optional
        Seed of the random number generator, and number of replicates.
    chosen : mapping, optional
        Option of the text to one of its alternatives.
    random : bool, optional
        Whether the object draws random numbers. Default: whether the item does.

    Attributes
    ----------
    changes : dict
        All changes as given, by address, ``seed`` or ``replicates``.
    options : dict
        Option to the chosen alternative.
    replaced : dict
        Address of each printed input that a recomputed value replaced, to that value in the
        printed unit.

    Raises
    ------
    ValueError
        If a cell is not an input, a value does not fit, or an option is unknown.
    """

    def __init__(
        self,
        key: str,
        changes: Mapping[str, str | float] = {},
        *,
        seed: int | None = None,
        replicates: int | None = None,
        chosen: Mapping[str, str] = {},
        random: bool | None = None,
    ) -> None:
        self.key, self._seed, self._replicates = key, seed, replicates
        self.options = dict(chosen)
        self._values = checked_values(key, changes)
        settings = without_none({"seed": seed, "replicates": replicates})
        given = {**changes, **settings}.items()
        self.changes = {name: str(value) for name, value in given}
        self.replaced: dict[str, float] = {}
        self._results: dict[str, dict[str, Any]] = {}
        known = options(key)
        for name, alternative in self.options.items():
            if alternative not in [*known.get(name, ())]:
                listed = "; ".join(
                    f"{n} ({', '.join(choices)})" for n, choices in known.items()
                )
                raise ValueError(
                    f"{name}: expected an option of {key}, {listed or 'which has none'}, got "
                    f"{alternative!r}. Choose an alternative"
                )
        random = _is_random(key) if random is None else random
        if not random:  # perhaps between a change and the inputs
            above = filter(None, map(computation_for, changeable(key)))
            random = any(c.replicates and self._reaches(c.inputs) for c in above)
        _check_randomness(key, random, settings)

    @property
    def is_reading(self) -> bool:
        """Whether this is a reading of the paper as printed, without changed inputs."""
        return bool(self.options) and not self.changes

    @property
    def setting(self) -> str:
        """Changes and options in one line."""
        return ", ".join(map(" = ".join, (self.changes | self.options).items()))

    @cached_property
    def cells(self) -> list[_ChangedCell]:
        """Every cell that the item computes, in printed order."""
        table = library()[self.key]
        cells = {}
        with self.explained():
            for computation in computations(self.key):
                kept = {} if self.is_reading else self.options
                before = computation.with_options(kept)
                unchanged = before(load_inputs(computation.inputs))
                for name, after in self.results(computation).items():
                    cell, ends, verdict = table[name], None, ""
                    unit = cell.si_unit
                    if self.is_reading:
                        record = record_of(cell.address, **self.options)
                        ends, verdict = record.interval, record.verdict
                    elif computation.replicates:
                        ends = central_interval(after / unit)
                    numbers = _median(unchanged[name], unit), _median(after, unit)
                    if not np.isfinite([*numbers, *(ends or ())]).all():
                        raise ArithmeticError(f"{cell.address} is not a finite number")
                    cells[name] = _ChangedCell(cell, *numbers, ends, verdict)
        return [cells[name] for name in table.by_name if name in cells]

    def _reaches(self, patterns: tuple[str, ...]) -> bool:
        """Return whether a changed value is an input, direct or through other items."""
        return not self._values.keys().isdisjoint(upstream(patterns))

    @contextmanager
    def explained(self) -> Iterator[None]:
        """Add the item and the changes to an error of a computation."""
        try:
            with np.errstate(all="ignore"):
                yield
        except (ValueError, ArithmeticError, LookupError, MemoryError) as error:
            raise ValueError(
                f"{self.key} cannot be computed with {self.setting}: {error}"
            ) from error

    def results(self, computation: Computation) -> dict[str, Any]:
        """Return the results of a computation whose inputs follow the changes."""
        if computation.name not in self._results:
            run = computation.with_options(self.options)
            self._results[computation.name] = run(
                self.inputs(computation.inputs), self._replicates
            )
        return self._results[computation.name]

    def inputs(self, patterns: tuple[str, ...]) -> Inputs:
        """Return the inputs that match patterns, with the changes and recomputed values."""
        inputs = load_inputs(patterns, self._seed)
        values = {address: self._input(address) for address in inputs.cells}
        return inputs.changed(without_none(values))

    def _input(self, address: str) -> float | None:
        """Return the value that replaces a printed input; None if the printed value remains."""
        if address in self._values:
            return self._values[address]
        above = computation_for(address)
        cell = find(address)[0]
        if above is None or cell.unpublished or not self._reaches(above.inputs):
            return None
        unchanged = above.with_options(self.options)(
            load_inputs(above.inputs, self._seed), self._replicates
        )
        if cell.name not in unchanged:
            return None
        before, value = (
            _median(results[cell.name]) for results in (unchanged, self.results(above))
        )
        unit, (low, high) = cell.si_unit, cell.number.interval()
        # Rounding noise, which differs between processors, is no change.
        tolerance = _NOISE_RATIO * unit * (high - low)
        if math.isclose(value, before, rel_tol=_NOISE_RATIO, abs_tol=tolerance):
            return None
        self.replaced[address] = value / unit
        return value


def _median(result: Any, unit: float = 1.0) -> float:
    """Return the median of a result in a unit, which is applied first, as in the ledger."""
    return float(np.median(result / unit))
