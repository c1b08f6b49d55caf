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
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache, lru_cache
from itertools import chain
from typing import TypeVar

import numpy as np

from reproduce.judge.ledger import TableRecord, reread
from reproduce.judge.verdicts import central
from reproduce.papers.catalogue import catalogue, drawings, studies
from reproduce.papers.declare import Alternative, Computation, Prediction, Result
from reproduce.printed.cells import Cell, find, library
from reproduce.printed.given import Given, given
from reproduce.printed.number import ALIKE, UNITS, Interval, si_factor, symbol

_Replaced = dict[str, float]
Made = TypeVar("Made")
_VALUE = re.compile(
    r"\s*([-+−]?\d[\d_]*\.?\d*(?:[eE][-+−]?\d+)?|[-+−]?\.\d+(?:[eE][-+−]?\d+)?)\s*(.*)"
)
# Relative: far above rounding noise, far below what any printed digit shows.
_NOISE = 1e-9
# More than so many times a printed count, or so many replicates, would only fill the memory.
LARGEST, MOST_REPLICATES = 20, 100_000
# Cells that a message names of those that could be meant.
_SUGGESTED = 5


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

    cell: Cell
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
        Address to the value as given, and ``seed`` or ``replicates`` where they were.
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
        """Whether this is a reading of the paper as printed, with nothing of a reader's own."""
        return bool(self.options) and not self.changes


def maker(address: str) -> Computation | None:
    """Return the computation that makes a printed cell, if one does."""
    key, _, name = address.partition("#")
    return next((one for one in catalogue()[key].computations if one.makes(name)), None)


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
            found[name] = found.get(name, {}) | dict(ways)
    return found


def changeable(key: str) -> tuple[str, ...]:
    """Return every cell that an item, a cell or a study reads, directly or through other items.

    Addresses, nearest first.

    Examples
    --------
    >>> "niu2024/text-simulation#noise" in changeable("niu2024/table-3")
    True
    """
    for declared in (studies(), drawings()):
        if key in declared:
            return _upstream(declared[key].given)
    if "#" in key:
        made_by = maker(key)
        return () if made_by is None else _upstream(made_by.given)
    item = catalogue()[key]
    patterns = [one.given for one in item.computations]
    patterns += [] if item.draw is None else [item.draw.given]
    return _upstream(tuple(chain.from_iterable(patterns)))


@cache
def _upstream(patterns: tuple[str, ...]) -> tuple[str, ...]:
    """Return the addresses of the numbers that match, and of all that these are computed from."""
    found: dict[str, None] = {}
    waiting = list(patterns)
    while waiting:
        for cell in find(waiting.pop(0)):
            if cell.address not in found and cell.is_number:
                found[cell.address] = None
                above = maker(cell.address)
                waiting += [] if above is None else above.given
    return tuple(found)


def in_si(cell: Cell, value: str | float) -> float:
    """Return a value in SI units from text in the printed format, such as ``"0.2 px"``."""
    bare = isinstance(value, int | float)
    matched = _VALUE.fullmatch(str(value))
    number = float(matched[1].replace("−", "-")) if matched else math.nan
    written = matched[2].strip() if matched else ""
    units = {name: name for name in UNITS} | {
        symbol(name): name for name in UNITS if symbol(name)
    }
    as_printed = not written and (bare or cell.unit in {"1", "count"})
    unit = cell.unit if as_printed else units.get(written, "")
    most = LARGEST * cell.number.value
    wanted = ""
    if matched is None:
        wanted = f"a number in the printed format ({cell.shown})"
    elif not _same_kind(unit, cell.unit):
        wanted = f"{symbol(cell.unit) or 'no unit'} as printed ({cell.shown})"
    elif not math.isfinite(number):
        wanted = "a finite number"
    elif cell.unit == "count" and not (number == round(number) and 0 <= number <= most):
        wanted = f"a whole number up to {LARGEST} times the printed one, {most:.0f}"
    if wanted:
        raise CannotChangeError(f"{cell.address}: expected {wanted}, got {value!r}")
    return number * si_factor(unit)


def _same_kind(one: str, other: str) -> bool:
    kinds = ({one}, {"1", "percent"}, *map(set, ALIKE))
    return any({one, other} <= kind for kind in kinds)


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
    random = any(one.replicates for one in catalogue()[key].computations)
    check_randomness(key, random, changes, seed, replicates)
    told = by_name(changes, seed, replicates)
    with _told_why(key, told | chosen):
        if chosen and not told:
            return _reading(key, chosen)
        run = _Run(values, seed, replicates, chosen)
        plain = _from_print(None, None, tuple(chosen.items()))
        cells = [
            _changed(library()[key][name], plain.results(computation)[name], result)
            for computation in catalogue()[key].computations
            for name, result in run.results(computation).items()
        ]
        ends = {c.cell.address: [c.value or 0.0, *(c.interval or ())] for c in cells}
        if strays := [
            address for address, found in ends.items() if not np.isfinite(found).all()
        ]:
            raise ArithmeticError(f"no finite number comes out for {', '.join(strays)}")
    order = list(library()[key].by_name)
    cells.sort(key=lambda one: order.index(one.cell.name))
    return Rerun(key, told, tuple(cells), run.replaced, chosen)


def by_name(
    changes: Mapping[str, str | float], seed: int | None, replicates: int | None = None
) -> dict[str, str]:
    """Return all that is changed, by name, as given."""
    every = {**changes, "seed": seed, "replicates": replicates}
    return {name: str(value) for name, value in every.items() if value is not None}


def check_randomness(
    key: str,
    random: bool,
    changes: Iterable[str],
    seed: int | None,
    replicates: int | None = None,
) -> None:
    """Refuse a seed and replicates out of range, or where nothing draws random numbers."""
    for name, number, least, most, span in (
        (
            "replicates",
            replicates,
            2,
            MOST_REPLICATES,
            f"from 2 to {MOST_REPLICATES:,}",
        ),
        ("seed", seed, 0, math.inf, "from zero up"),
    ):
        whole = isinstance(number, int | np.integer)
        if number is not None and not (whole and least <= number <= most):
            raise CannotChangeError(
                f"{name}: expected a whole number {span}, got {number!r}"
            )
    asked = " and no ".join(by_name({}, seed, replicates))
    if asked and not random and not _drawn_above(key, set(changes)):
        raise CannotChangeError(
            f"{key} draws no random numbers when it is rerun: it takes no {asked}"
        )


def _drawn_above(key: str, changes: set[str]) -> bool:
    """Tell whether random numbers are drawn between a change and what an item reads."""
    above = filter(None, map(maker, changeable(key)))
    return any(one.replicates and changes & set(_upstream(one.given)) for one in above)


def checked_values(key: str, changes: Mapping[str, str | float]) -> dict[str, float]:
    """Return the values of a user in SI units; raise an error for a cell that is not an input."""
    refuse_strays(key, changes, changeable(key))
    return {address: in_si(find(address)[0], text) for address, text in changes.items()}


def refuse_strays(subject: str, changes: Iterable[str], allowed: Sequence[str]) -> None:
    """Refuse changes of what is not read; name the nearest cells, and how many there are."""
    if not (strays := [address for address in changes if address not in allowed]):
        return
    near = list(
        dict.fromkeys(chain.from_iterable(_near(stray, allowed) for stray in strays))
    )
    named = near[:_SUGGESTED] or allowed[:_SUGGESTED]
    listed = ", ".join(named) or "nothing"
    told = f"did you mean {listed}?" if near else f"it reads {listed}"
    if len(named) < len(allowed):
        told += f" (.reads lists all {len(allowed)})"
    raise CannotChangeError(f"{subject} does not read {', '.join(strays)}; {told}")


def _near(stray: str, allowed: Sequence[str]) -> list[str]:
    """Return the cells whose name is much like that of a stray."""
    names = [address.partition("#")[2] for address in allowed]
    alike = difflib.get_close_matches(
        stray.rpartition("#")[2], names, n=_SUGGESTED, cutoff=0.7
    )
    return [
        address for address, name in zip(allowed, names, strict=True) if name in alike
    ]


def under(
    key: str,
    patterns: tuple[str, ...],
    changes: Mapping[str, str | float],
    seed: int | None,
    compute: Callable[[Given], Made],
) -> tuple[Made, _Replaced]:
    """Return the result of `compute` with changed inputs, and the printed inputs replaced."""
    run = _Run(checked_values(key, changes), seed)
    with _told_why(key, by_name(changes, seed)):
        return compute(run.door(patterns)), run.replaced


@contextmanager
def _told_why(key: str, told: Mapping[str, str]) -> Iterator[None]:
    """Say in one sentence why an item cannot be computed under a change."""
    try:
        with np.errstate(all="ignore"):
            yield
    except (ValueError, ArithmeticError, IndexError, MemoryError) as error:
        setting = ", ".join(f"{name} = {text}" for name, text in told.items())
        raise CannotChangeError(
            f"{key} cannot be computed with {setting}: {error}"
        ) from error


def _check_options(key: str, chosen: Mapping[str, str]) -> None:
    known = options(key)
    for name, way in chosen.items():
        if name not in known:
            listed = "; ".join(f"{n} ({', '.join(ways)})" for n, ways in known.items())
            raise CannotChangeError(
                f"{key} has no option {name!r}; it leaves open: {listed or 'nothing'}"
            )
        if way not in known[name]:
            raise CannotChangeError(
                f"{key}: {name} is one of {', '.join(known[name])}, got {way!r}"
            )


def _reading(key: str, chosen: dict[str, str]) -> Rerun:
    """Judge an item under one reading of the text."""
    found, before = reread(key, chosen), reread(key, {})
    cells = tuple(
        ChangedCell(
            find(record.cell)[0],
            before.cell(record.cell).computed,
            record.computed,
            record.interval,
            record.verdict,
        )
        for record in found.of(key)
        if record.function
    )
    return Rerun(key, {}, cells, {}, chosen, found.table(key))


@lru_cache(maxsize=8)
def _from_print(
    seed: int | None, replicates: int | None, chosen: tuple[tuple[str, str], ...]
) -> _Run:
    """Return the run without changes, for comparison."""
    return _Run({}, seed, replicates, dict(chosen))


def _changed(cell: Cell, before: Result, after: Result) -> ChangedCell:
    """Return a cell before and after a change."""
    unit = si_factor(cell.unit)
    ends = central(after.draws / unit) if isinstance(after, Prediction) else None
    return ChangedCell(cell, _middle(before, unit), _middle(after, unit), ends)


@dataclass(frozen=True, eq=False)
class _Run:
    """Values of cells under one set of changes, every computation run at most once."""

    values: Mapping[str, float]
    seed: int | None = None
    replicates: int | None = None
    chosen: Mapping[str, str] = field(default_factory=dict)
    replaced: _Replaced = field(default_factory=dict)
    _results: dict[str, Mapping[str, Result]] = field(default_factory=dict)

    def results(self, computation: Computation) -> Mapping[str, Result]:
        """Return the results of a computation whose inputs follow the changes."""
        if computation.name not in self._results:
            door, under = self.door(computation.given), computation.under(self.chosen)
            self._results[computation.name] = under(door, self.replicates)
        return self._results[computation.name]

    def door(self, patterns: tuple[str, ...]) -> Given:
        """Return the inputs that match patterns, with the changes and recomputed values."""
        door = given(patterns, self.seed)
        return door.changed(
            {a: v for a in door.cells if (v := self._input(a)) is not None}
        )

    def _input(self, address: str) -> float | None:
        """Return what takes the place of a printed input, if anything does."""
        if address in self.values:
            return self.values[address]
        above = maker(address)
        if above is None or not self.values.keys() & set(_upstream(above.given)):
            return None
        cell = find(address)[0]
        plain = _from_print(self.seed, self.replicates, tuple(self.chosen.items()))
        found, unchanged = self._made(above, cell), plain._made(above, cell)
        if found is None:
            return None
        low, high = (end * si_factor(cell.unit) for end in cell.number.interval())
        # No more than rounding noise, which processors differ by: no change reaches this cell.
        noise = {"rel_tol": _NOISE, "abs_tol": _NOISE * (high - low)}
        if unchanged is not None and math.isclose(found, unchanged, **noise):
            return None
        self.replaced[address] = found / si_factor(cell.unit)
        return found

    def _made(self, computation: Computation, cell: Cell) -> float | None:
        result = self.results(computation).get(cell.name)
        return None if result is None else _middle(result)


def _middle(result: Result, unit: float = 1.0) -> float:
    """Return the middle of a result in a unit, which is applied first, as the ledger does."""
    if isinstance(result, Prediction):
        return float(np.median(result.draws / unit))
    return float(result) / unit
