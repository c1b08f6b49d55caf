"""Access of a computation to its declared printed numbers.

A computation declares the cells that it reads; it gets these and nothing else, so that no
answer can leak into it. It also contains the seed of a user for random numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from reproduce.printed.cells import PrintedCell, find
from reproduce.printed.number import si_factor


class UndeclaredInputError(LookupError):
    """A computation asked for a printed cell that it did not declare."""


@dataclass(frozen=True)
class Inputs:
    """The declared inputs of one computation, in SI units.

    Parameters
    ----------
    cells : mapping of str to Cell
        The declared cells by address.
    shifts : mapping of str to float
        For interval propagation: cells moved off their printed value, in fractions of the
        print leaves open (`PrintedNumber.reach`, half the last digit of a plain number).
    values : mapping of str to float
        For what-if questions: values in SI units that take the place of printed ones, exact.
    root : int, optional
        Root of all random seeds: a user's, or None for the seed of the project.
    """

    cells: Mapping[str, PrintedCell]
    shifts: Mapping[str, float] = field(default_factory=dict)
    values: Mapping[str, float] = field(default_factory=dict)
    root: int | None = None

    def __hash__(self) -> int:
        """Return equal numbers for equal inputs, so results can be cached by inputs."""
        held = (self.cells, self.shifts, self.values)
        return hash((self.root, *(frozenset(one.items()) for one in held)))

    def __getitem__(self, address: str) -> float:
        """Return the number at `address` in SI units (pixels stay pixels)."""
        cell = self._cell(address)
        if address in self.values:
            return self.values[address]
        number = cell.number
        moved = number.value + self.shifts.get(address, 0.0) * number.half_width
        return moved * si_factor(cell.unit)

    def half_unit(self, address: str) -> float:
        """Return half a unit of the last digit of the number at `address`, in SI units."""
        cell = self._cell(address)
        return cell.number.half_unit * si_factor(cell.unit)

    def upper(self, address: str) -> float:
        """Return the largest value that the number at `address` stands for, in SI units."""
        cell = self._cell(address)
        return self[address] + cell.number.half_width * si_factor(cell.unit)

    def count(self, address: str) -> int:
        """Return the whole number at `address`."""
        return round(self[address])

    def array(self, pattern: str) -> NDArray[np.float64]:
        """Return the numbers that match `pattern`, in printed order and SI units.

        Shape (n,). The numbers.
        """
        return np.array(
            [self[cell.address] for cell in find(pattern) if cell.is_number]
        )

    def numbers(self) -> list[PrintedCell]:
        """Return the declared cells that hold a rounded number."""
        cells = (
            c
            for c in self.cells.values()
            if c.is_number and c.address not in self.values
        )
        return [
            cell for cell in cells if not (cell.number.exact or cell.number.is_bound)
        ]

    def shifted(self, shifts: Mapping[str, float]) -> Inputs:
        """Return the same inputs with some moved within their rounding intervals."""
        return replace(self, shifts=dict(shifts))

    def changed(self, values: Mapping[str, float]) -> Inputs:
        """Return the same inputs with other values in place of some printed ones."""
        return replace(self, values={**self.values, **values})

    def _cell(self, address: str) -> PrintedCell:
        if address not in self.cells:
            raise UndeclaredInputError(
                f"{address} is not declared; add it to inputs=[...] of the computation that reads "
                f"it (declared: {', '.join(self.cells) or 'nothing'})"
            )
        return self.cells[address]


def load_inputs(patterns: Iterable[str], root: int | None = None) -> Inputs:
    """Return access to the cells that match `patterns`, with an optional seed of a user.

    Examples
    --------
    >>> inputs = load_inputs(["niu2024/table-1#focal-length.*"])
    >>> round(inputs["niu2024/table-1#focal-length.green"], 6)
    0.025
    """
    cells = {cell.address: cell for pattern in patterns for cell in find(pattern)}
    return Inputs(cells, root=root)
