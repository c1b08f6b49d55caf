"""Arrangements of rotation angles over a field of view, from one declared family.

A step and a range do not fix an arrangement. This module enumerates the plausible ones (lattice,
offset, window) so that a count can select among them, and nothing else does.

Angles have shape (n, 2), x before y, in radians: x is the angle of the rotary table's middle frame,
y that of its external frame. Rows are sorted by y, then x.

Every lattice is a fine rectangular grid of spacings (a, b), either whole or chequered. Chequered,
it keeps the nodes whose indices have an even sum, which gives the quincunx and hexagonal lattices;
its points then stand 2a apart along a row, and rows stand b apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reproduce.physics.validate import FloatArray, Size, checked, whole_number

_EDGE = 1e-9
_LARGEST_SIDE = 2000


@dataclass(frozen=True)
class _Lattice:
    """A pattern without bounds: what its step measures, spacings of the fine grid (rad), nodes."""

    name: str
    spacing_x: float
    spacing_y: float
    chequered: bool


@dataclass(frozen=True, eq=False)
class Arrangement:
    """A finite set of rotation angles and how it came about.

    Attributes
    ----------
    lattice, offset, window : str
        The choices that made it.
    angles : ndarray, shape (n, 2), in radians, x before y
    """

    lattice: str
    offset: str
    window: str
    angles: FloatArray

    @property
    def name(self) -> str:
        """The three choices in one line."""
        return f"{self.lattice}; {self.offset}; {self.window}"


def _lattices(half_x: float, half_y: float, step: float) -> list[_Lattice]:
    """Every lattice by what the step can mean, and those stretched to fill the range."""
    root2, root3 = np.sqrt(2.0), np.sqrt(3.0)
    fixed = [
        _Lattice("square, step between neighbours", step, step, False),
        _Lattice("quincunx, step between rows", step, step, True),
        _Lattice("quincunx, step between neighbours", step / root2, step / root2, True),
        _Lattice("quincunx, step along a row", step / 2, step / 2, True),
        _Lattice("hexagonal, rows along x", step / 2, step * root3 / 2, True),
        _Lattice("hexagonal, rows along y", step * root3 / 2, step / 2, True),
    ]
    a, b = (2 * half / max(1, round(2 * half / step)) for half in (half_x, half_y))
    return [
        *fixed,
        _Lattice("square, stretched to the edges", a, b, False),
        _Lattice("quincunx, stretched to the edges, spacings nearest the step", a, b, True),
        *(
            _Lattice(f"quincunx, stretched to the edges in {m} by {n} spacings", dx, dy, True)
            for m, n, dx, dy in _stretched_to_mean(half_x, half_y, step)
        ),
    ]


@checked
def arrangements_with(count: int, half_x: Size, half_y: Size, step: Size) -> list[Arrangement]:
    """Every arrangement of the family that has exactly so many angles.

    The family is lattices by offsets by windows. Offsets: a point at the middle of the range; half
    a spacing away from it along the rows, across them, or both; a point at the lower left corner.
    Windows: the rectangle with and without its border, the ellipse that touches its sides, the
    circle of the smaller half range, that of the larger one cut by the rectangle, the diamond
    through the middles of its sides. (The circle through the corners cuts nothing off.)

    Parameters
    ----------
    count : int
    half_x, half_y, step : float
        Half the range in x and in y, and the step of the angles, in radians, above zero.

    Returns
    -------
    list of Arrangement
        All different; empty if none fits.

    Raises
    ------
    ValueError
        If the step is too small for the range.

    Examples
    --------
    >>> [found.name for found in arrangements_with(9, 1.0, 1.0, 1.0)][0]
    'square, step between neighbours; centred; rectangle'
    """
    if max(half_x, half_y) > _LARGEST_SIDE * step:
        raise ValueError(
            f"step: expected at least 1/{_LARGEST_SIDE} of the half range, got {step:g} for "
            f"{max(half_x, half_y):g}; are all three in radians?"
        )
    whole_number("count", count)
    every = _arrangements(half_x, half_y, step)
    return [found for found in every if len(found.angles) == count]


def _arrangements(half_x: float, half_y: float, step: float) -> Iterator[Arrangement]:
    """Every arrangement of the family but empty ones and those equal to an earlier one."""
    seen: set[bytes] = set()
    for lattice in _lattices(half_x, half_y, step):
        for offset, origin in _offsets(lattice, half_x, half_y).items():
            nodes = _nodes(lattice, origin, half_x, half_y)
            for window, inside in _windows(nodes, half_x, half_y).items():
                angles = nodes[inside]
                key = np.rint(angles / (_EDGE * step)).astype(np.int64).tobytes()
                if len(angles) and key not in seen:
                    seen.add(key)
                    yield Arrangement(lattice.name, offset, window, angles)


def _stretched_to_mean(
    half_x: float, half_y: float, step: float
) -> Iterator[tuple[int, int, float, float]]:
    """Divisions of both ranges whose two spacings average to the step, within a factor of two."""
    largest = round(3 * half_x / step) + 1
    for m in range(1, largest + 1):
        a = 2 * half_x / m
        b = 2 * step - a
        if not step * (2 / 3 - _EDGE) <= a <= step * (4 / 3 + _EDGE):
            continue
        n = 2 * half_y / b
        if n >= 1 - _EDGE and abs(n - round(n)) < _EDGE * n:
            yield m, round(n), a, 2 * half_y / round(n)


def _offsets(lattice: _Lattice, half_x: float, half_y: float) -> dict[str, tuple[float, float]]:
    along = lattice.spacing_x * (1.0 if lattice.chequered else 0.5)
    across = lattice.spacing_y / 2
    return {
        "centred": (0.0, 0.0),
        "half a spacing along x": (along, 0.0),
        "half a row spacing along y": (0.0, across),
        "half a spacing along both": (along, across),
        "from the lower left corner": (-half_x, -half_y),
    }


def _nodes(
    lattice: _Lattice, origin: tuple[float, float], half_x: float, half_y: float
) -> FloatArray:
    """All points of the lattice within the closed rectangle, sorted by y, then x."""
    reach_x = int(2 * half_x / lattice.spacing_x) + 2
    reach_y = int(2 * half_y / lattice.spacing_y) + 2
    i, j = np.meshgrid(np.arange(-reach_x, reach_x + 1), np.arange(-reach_y, reach_y + 1))
    kept = (i + j) % (2 if lattice.chequered else 1) == 0
    x = origin[0] + lattice.spacing_x * i[kept]
    y = origin[1] + lattice.spacing_y * j[kept]
    inside = (np.abs(x) <= half_x * (1 + _EDGE)) & (np.abs(y) <= half_y * (1 + _EDGE))
    return np.stack([x[inside], y[inside]], axis=-1)


def _windows(nodes: FloatArray, half_x: float, half_y: float) -> dict[str, NDArray[np.bool_]]:
    """Which nodes of the rectangle each window holds."""
    x, y = nodes.T
    small, large = min(half_x, half_y), max(half_x, half_y)
    return {
        "rectangle": np.ones(len(nodes), dtype=bool),
        "rectangle without its border": np.abs(nodes / [half_x, half_y]).max(axis=1) < 1 - _EDGE,
        "inscribed ellipse": (x / half_x) ** 2 + (y / half_y) ** 2 <= 1 + _EDGE,
        "circle of the smaller half range": np.hypot(x, y) <= small * (1 + _EDGE),
        "circle of the larger half range": np.hypot(x, y) <= large * (1 + _EDGE),
        "diamond": np.abs(x) / half_x + np.abs(y) / half_y <= 1 + _EDGE,
    }
