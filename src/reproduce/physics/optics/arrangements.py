"""Arrangements of rotation angles: lattices, their offsets and the windows that bound them.

A step and a range of angles do not determine their arrangement. Every lattice is a fine
rectangular grid of spacings (a, b), either whole (square) or chequered. A chequered grid
keeps the nodes whose indices have an even sum, which gives the quincunx and hexagonal
lattices. Its points are 2a apart along a row, and its rows are b apart.
"""

from __future__ import annotations

import operator

import numpy as np
from numpy.typing import NDArray

from reproduce.physics.validate import (
    FloatArray,
    Size,
    checked,
    valid,
)

# Relative distance within which a point is on a border.
_BORDER_TOLERANCE = 1e-9
# Steps in half a range, above which the unit of an angle is probably wrong.
_MAX_STEPS = 2000
_ROOT2, _ROOT3 = np.sqrt([2.0, 3.0])
# Spacings of the fine grid, in steps.
_SPACINGS = {
    "square, step between neighbours": (1, 1),
    "quincunx, step between rows": (1, 1),
    "quincunx, step between neighbours": (1 / _ROOT2, 1 / _ROOT2),
    "quincunx, step along a row": (1 / 2, 1 / 2),
    "hexagonal, rows along x": (1 / 2, _ROOT3 / 2),
    "hexagonal, rows along y": (_ROOT3 / 2, 1 / 2),
}
# Numbers of spacings in the range whose mean spacing is the step, for the printed range.
_DIVISIONS = ((16, 15), (20, 12))
# Offsets in half spacings of the points along a row, and of the rows.
_OFFSETS = {
    "centred": (0, 0),
    "half a spacing along x": (1, 0),
    "half a row spacing along y": (0, 1),
    "half a spacing along both": (1, 1),
}
_CORNER = "from the lower left corner"


@checked
def arrangement_angles(name: str, half_x: Size, half_y: Size, step: Size) -> FloatArray:
    """Return the rotation angles of an arrangement.

    Parameters
    ----------
    name : str
        Lattice, offset and window, separated by semicolons. The error of another name lists them.
    half_x, half_y, step : float
        Half the range in x and in y, and the step of the angles, in radians, above zero.

    Returns
    -------
    ndarray, shape (n, 2)
        Angles, in radians, x before y, sorted by y, then x.

    Raises
    ------
    ValueError
        If the name is unknown, or the step is too small for the range.

    Examples
    --------
    >>> name = "square, step between neighbours; centred; diamond"
    >>> arrangement_angles(name, 1.0, 1.0, 1.0)
    array([[ 0., -1.],
           [-1.,  0.],
           [ 0.,  0.],
           [ 1.,  0.],
           [ 0.,  1.]])
    """
    half = np.array([half_x, half_y])
    expected = f"at least 1/{_MAX_STEPS} of the half range, both in radians"
    valid("step", step, half.max() <= _MAX_STEPS * step, expected)
    known = _lattices(half, step), (*_OFFSETS, _CORNER), _windows(half[None], half)
    parts = name.split("; ")
    if len(parts) != len(known) or not all(map(operator.contains, known, parts)):
        listed = ", ".join(f"one of {list(names)}" for names in known)
        raise ValueError(
            f"name: expected three parts with semicolons between them, {listed}, got {name!r}. "
            "Correct the name"
        )
    lattice, offset, window = parts
    spacing = known[0][lattice]
    # Points of a chequered grid are two spacings apart along a row.
    along = 1 if lattice.startswith("square") else 2
    x, y = (2 * half / spacing).astype(int) + 2
    j, i = np.mgrid[-y : y + 1, -x : x + 1].reshape(2, -1)
    origin = -half
    if offset != _CORNER:
        origin = spacing * _OFFSETS[offset] * [along / 2, 1 / 2]
    nodes = origin + spacing * np.stack([i, j], axis=-1)
    inside = _windows(nodes, half)
    selected = ((i + j) % along == 0) & inside["rectangle"] & inside[window]
    return nodes[selected]


def _lattices(half: FloatArray, step: float) -> dict[str, FloatArray]:
    """Return the spacings of the fine grid of every lattice, shape (2,)."""
    nearest = 2 * half / np.maximum(1, np.rint(2 * half / step))
    stretched = "stretched to the edges"
    return {
        **{name: np.array(spacing) * step for name, spacing in _SPACINGS.items()},
        f"square, {stretched}": nearest,
        f"quincunx, {stretched}, spacings nearest the step": nearest,
        **{
            f"quincunx, {stretched} in {m} by {n} spacings": 2 * half / [m, n]
            for m, n in _DIVISIONS
        },
    }


def _windows(nodes: FloatArray, half: FloatArray) -> dict[str, NDArray[np.bool_]]:
    """Return the nodes that each window contains, as masks."""
    inside, radius = np.abs(nodes / half), np.hypot(*nodes.T)
    edge = 1 + _BORDER_TOLERANCE
    return {
        "rectangle": inside.max(axis=1) <= edge,
        "rectangle without its border": inside.max(axis=1) < 1 - _BORDER_TOLERANCE,
        "inscribed ellipse": np.square(inside).sum(axis=1) <= edge,
        "circle of the smaller half range": radius <= half.min() * edge,
        "circle of the larger half range": radius <= half.max() * edge,
        "diamond": inside.sum(axis=1) <= edge,
    }
