"""Access of a computation to its declared printed numbers.

A computation declares the cells that it uses. It has access to no other cell, so that no result can
leak into it. The inputs also contain the seed of a user for random numbers.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from reproduce.printed.cells import PrintedCell, find

# Root seed of the project. Every computation adds its own name to it (see `declare.seed_of`).
ROOT_SEED = 20_240_102


@dataclass(frozen=True)
class Inputs:
    """The declared inputs of one computation, in SI units.

    Parameters
    ----------
    cells : mapping of str to PrintedCell
        The declared cells by address.
    root : int
        Root of all random seeds.
    values : mapping of str to float
        Values in SI units that replace printed values: of a user, or in the rounding interval.
    """

    cells: Mapping[str, PrintedCell]
    root: int
    values: Mapping[str, float] = field(default_factory=dict)

    def __hash__(self) -> int:
        """Return equal numbers for equal inputs, so that results can be cached by inputs."""
        cells, values = self.cells.items(), self.values.items()
        return hash((self.root, frozenset(cells), frozenset(values)))

    def __getitem__(self, address: str) -> float:
        """Return the number at `address` in SI units (pixels stay pixels)."""
        return self.values.get(address, self._cell(address).si)

    def half_unit(self, address: str) -> float:
        """Return half a unit of the last digit of the number at `address`, in SI units."""
        cell = self._cell(address)
        return cell.number.half_unit * cell.si_unit

    def half_width(self, address: str) -> float:
        """Return half the width of the interval of the number at `address`, in SI units."""
        cell = self._cell(address)
        return cell.number.half_width * cell.si_unit

    def seed(self, *key: int) -> SeedSequence:
        """Return the seed of simulated data, which the numbers of the key identify."""
        return SeedSequence(self.root, spawn_key=key)

    def count(self, address: str) -> int:
        """Return the whole number at `address`; raise ValueError for a fraction."""
        number = self[address]
        if number % 1:
            raise ValueError(f"{address}: expected a whole number, got {number:g}")
        return int(number)

    def array(self, pattern: str) -> NDArray[np.float64]:
        """Return the numbers that match `pattern`, in printed order and SI units, shape (n,)."""
        return np.array(
            [self[cell.address] for cell in find(pattern) if cell.is_number]
        )

    def pairs(self, pattern: str) -> NDArray[np.float64]:
        """Return the numbers of `array` in pairs, such as positions along x and y, shape (n, 2)."""
        return self.array(pattern).reshape(-1, 2)

    def rounded(self) -> list[str]:
        """Return the addresses of the printed numbers with a rounding interval."""
        return [
            address
            for address, cell in self.cells.items()
            if cell.is_number and cell.number.half_width
        ]

    def shifted(self, shifts: Mapping[str, float]) -> Inputs:
        """Return the inputs with some numbers shifted by fractions of their half width."""
        return self.changed(
            {
                address: self[address] + shift * self.half_width(address)
                for address, shift in shifts.items()
            }
        )

    def changed(self, values: Mapping[str, float]) -> Inputs:
        """Return the inputs with other values for some printed ones."""
        return replace(self, values={**self.values, **values})

    def _cell(self, address: str) -> PrintedCell:
        if address not in self.cells:
            raise LookupError(
                f"{address}: expected a declared input, one of {', '.join(self.cells)}. Add it "
                "to inputs=[...] of the computation."
            )
        return self.cells[address]


def load_inputs(patterns: Iterable[str], root: int | None = None) -> Inputs:
    """Return access to the cells that match `patterns`, with the seed of the project or a user.

    Examples
    --------
    >>> inputs = load_inputs(["niu2024/table-1#focal-length.*"])
    >>> round(inputs["niu2024/table-1#focal-length.green"], 6)
    0.025
    """
    cells = {cell.address: cell for pattern in patterns for cell in find(pattern)}
    return Inputs(cells, ROOT_SEED if root is None else root)
