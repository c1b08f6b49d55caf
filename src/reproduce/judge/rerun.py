"""The computation of an item again, under values, a seed or a number of replicates of one's own.

Only what the paper prints can be changed, and only what the item reads, directly or through other
items: everything else could not change it. Between a changed cell and the item, recomputed values
take the place of printed ones. The result carries no verdict: it is no longer the paper's.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Blocked, Computation, Prediction, Result
from reproduce.printed.cells import Cell, find, library
from reproduce.printed.given import given
from reproduce.printed.units import UNITS, si_factor, symbol

Interval = tuple[float, float]
_VALUE = re.compile(
    r"\s*([-+−]?\d[\d_]*\.?\d*(?:[eE][-+−]?\d+)?|[-+−]?\.\d+(?:[eE][-+−]?\d+)?)\s*(.*)"
)
# The central 99 % of a prediction, as in the ledger.
_ENDS = (0.005, 0.995)


class CannotChangeError(ValueError):
    """A change that the item does not read, or a value that does not fit its cell."""


@dataclass(frozen=True)
class ChangedCell:
    """One cell of an item under a change, in the unit of print.

    Parameters
    ----------
    cell : Cell
        What the paper prints.
    unchanged, value : float, optional
        Computed from the print, and under the change; the median of a prediction; none where
        nothing is computed.
    interval : tuple of float, optional
        Central 99 % of a prediction.
    reading : str
        For a cell that depends on how the text is read: which reading this is.
    """

    cell: Cell
    unchanged: float | None
    value: float | None
    interval: Interval | None = None
    reading: str = ""


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
        Address of each printed input whose place a recomputed value took, to that value in the
        unit of print.
    """

    key: str
    changes: dict[str, str]
    cells: tuple[ChangedCell, ...]
    replaced: dict[str, float]


def makers(key: str) -> tuple[Computation, ...]:
    """Return the computations of an item."""
    return catalogue()[key].computations


def maker(address: str) -> Computation | None:
    """Return the computation that makes a printed cell, if one does."""
    key, _, name = address.partition("#")
    return next((one for one in makers(key) if one.makes(name)), None)


def reads(computation: Computation) -> tuple[str, ...]:
    """Return the addresses that a computation reads itself."""
    return tuple(cell.address for pattern in computation.given for cell in find(pattern))


def changeable(key: str) -> tuple[str, ...]:
    """Return every cell that an item reads, directly or through other items.

    Parameters
    ----------
    key : str
        The item.

    Returns
    -------
    tuple of str
        Addresses, nearest first.

    Examples
    --------
    >>> "niu2024/text-simulation#noise" in changeable("niu2024/table-3")
    True
    """
    found: dict[str, None] = {}
    waiting = list(makers(key))
    while waiting:
        for address in reads(waiting.pop(0)):
            if (
                address not in found
                and library()[address.partition("#")[0]]
                .by_name[address.partition("#")[2]]
                .is_number
            ):
                found[address] = None
                above = maker(address)
                waiting += [above] if above is not None else []
    return tuple(found)


def in_si(cell: Cell, value: str | float) -> float:
    """Return a value written as in the print, such as ``"0.2 px"``, in SI units.

    Parameters
    ----------
    cell : Cell
        The printed cell whose place it takes.
    value : str or float
        Digits with a unit of the same kind; the unit may be left out for pure numbers, for
        counts and for a float, which is in the unit of print.

    Returns
    -------
    float
        In SI units; pixels stay pixels.

    Raises
    ------
    CannotChangeError
        If the text is no number, the unit is unknown or of another kind, or a count is broken.
    """
    text = f"{value:.17g}" if isinstance(value, int | float) else str(value)
    matched = _VALUE.fullmatch(text)
    bare = cell.unit in {"1", "count"}
    if matched is None:
        raise CannotChangeError(
            f"{cell.address}: expected a number as in the print ({cell.shown}), got {value!r}"
        )
    number = float(matched[1].replace("−", "-"))
    written = matched[2].strip()
    if not written and (bare or isinstance(value, int | float)):
        unit = cell.unit
    else:
        units = {name: name for name in UNITS} | {symbol(name): name for name in UNITS}
        unit = units.get(written, "") if written else ""
        if not unit or not _same_kind(unit, cell.unit):
            wanted = symbol(cell.unit) or "no unit"
            raise CannotChangeError(
                f"{cell.address}: expected {wanted} as in the print ({cell.shown}), got {value!r}"
            )
    if cell.unit == "count" and number != round(number):
        raise CannotChangeError(f"{cell.address}: expected a whole number, got {value!r}")
    if not np.isfinite(number):
        raise CannotChangeError(f"{cell.address}: expected a finite number, got {value!r}")
    return number * si_factor(unit)


def _same_kind(one: str, other: str) -> bool:
    if one == other:
        return True
    import pint

    kinds = [pint.application_registry.Quantity(1.0, UNITS[unit][0]) for unit in (one, other)]
    return one != "count" and other != "count" and kinds[0].is_compatible_with(kinds[1])


def rerun(
    key: str,
    changes: Mapping[str, str | float] | None = None,
    *,
    seed: int | None = None,
    replicates: int | None = None,
) -> Rerun:
    """Compute an item again under a change.

    Parameters
    ----------
    key : str
        The item.
    changes : mapping, optional
        Address of a printed cell to the value that takes its place, as `in_si` takes it.
    seed : int, optional
        In place of the project's own root seed.
    replicates : int, optional
        In place of the declared number.

    Returns
    -------
    Rerun
        The cells under the change beside those computed from the print.

    Raises
    ------
    CannotChangeError
        If nothing is changed, or something that the item does not read; the message lists what
        it reads.
    """
    changes = dict(changes or {})
    allowed = changeable(key)
    strays = [address for address in changes if address not in allowed]
    if strays:
        raise CannotChangeError(
            f"{key} does not read {', '.join(strays)}; it reads: {', '.join(allowed) or 'nothing'}"
        )
    if replicates is not None and replicates < 2:
        raise CannotChangeError(f"replicates: expected at least 2, got {replicates}")
    values = {address: in_si(_cell(address), text) for address, text in changes.items()}
    run, plain = _Run(values, seed, replicates), _Run({}, None, None)
    cells: list[ChangedCell] = []
    for computation in makers(key):
        after, before = run.results(computation), plain.results(computation)
        for name, result in after.items():
            cells += _changed(library()[key][name], before[name], result)
    told = {address: str(value) for address, value in changes.items()}
    told |= {} if seed is None else {"seed": str(seed)}
    told |= {} if replicates is None else {"replicates": str(replicates)}
    order = list(library()[key].by_name)
    cells.sort(key=lambda one: order.index(one.cell.name))
    return Rerun(key, told, tuple(cells), run.replaced)


def _changed(cell: Cell, before: Result, after: Result) -> list[ChangedCell]:
    """Return a cell once, or once for every reading of the text that it depends on."""
    pairs = [("", before, after)]
    if isinstance(before, Blocked) and isinstance(after, Blocked) and after.readings:
        pairs = [
            (one.name, one.result, other.result)
            for one, other in zip(before.readings, after.readings, strict=True)
        ]
    return [
        ChangedCell(cell, _shown(cell, one), _shown(cell, other), _central(cell, other), reading)
        for reading, one, other in pairs
    ]


class _Run:
    """Values of cells under one set of changes, every computation run at most once."""

    def __init__(
        self, values: Mapping[str, float], seed: int | None, replicates: int | None
    ) -> None:
        self.values, self.seed, self.replicates = dict(values), seed, replicates
        self.replaced: dict[str, float] = {}
        self._results: dict[str, Mapping[str, Result]] = {}
        self._touched: dict[str, bool] = {}
        self._unchanged: _Run | None = None

    def results(self, computation: Computation) -> Mapping[str, Result]:
        """Return the results of a computation whose inputs follow the changes."""
        if computation.name not in self._results:
            inputs = {a: v for a in reads(computation) if (v := self._input(a)) is not None}
            door = given(computation.given).changed(inputs)
            self._results[computation.name] = computation(door, self.replicates, self.seed)
        return self._results[computation.name]

    def _input(self, address: str) -> float | None:
        """Return what takes the place of a printed input, if anything does."""
        if address in self.values:
            return self.values[address]
        above = maker(address)
        if above is None or not self._reached(above):
            return None
        cell = _cell(address)
        found = self._made(above, cell)
        if self._unchanged is None:
            self._unchanged = _Run({}, self.seed, self.replicates)
        if found is None or found == self._unchanged._made(above, cell):
            return None  # nothing is computed, or no change reaches this cell
        self.replaced[address] = found / si_factor(cell.unit)
        return found

    def _made(self, computation: Computation, cell: Cell) -> float | None:
        result = self.results(computation).get(cell.name)
        return None if result is None else _middle(result)

    def _reached(self, computation: Computation) -> bool:
        """Tell whether a change reaches a computation."""
        if computation.name not in self._touched:
            self._touched[computation.name] = any(
                address in self.values
                or ((above := maker(address)) is not None and self._reached(above))
                for address in reads(computation)
            )
        return self._touched[computation.name]


def _cell(address: str) -> Cell:
    key, _, name = address.partition("#")
    return library()[key][name]


def _middle(result: Result) -> float | None:
    if isinstance(result, Prediction):
        return float(np.median(result.draws))
    if isinstance(result, Blocked):
        return result.stand_in
    return float(result) if isinstance(result, int | float) else None


def _shown(cell: Cell, result: Result) -> float | None:
    middle = _middle(result)
    return None if middle is None else middle / si_factor(cell.unit)


def _central(cell: Cell, result: Result) -> Interval | None:
    if not isinstance(result, Prediction):
        return None
    low, high = np.quantile(result.draws, _ENDS) / si_factor(cell.unit)
    return float(low), float(high)
