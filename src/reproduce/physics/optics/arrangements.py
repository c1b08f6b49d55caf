"""Arrangements of rotation angles that a step, a range and a count allow.

A step and a range of angles do not determine their arrangement. `arrangements_with`
enumerates the plausible ones (lattice, offset, window), so that a count can select among
them. Every lattice is a fine rectangular grid of spacings (a, b), either whole or chequered.
A chequered grid keeps the nodes whose indices have an even sum, which gives the quincunx
and hexagonal lattices. Its points are 2a apart along a row, and its rows are b apart.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from reproduce.physics import validate
from reproduce.physics.validate import FloatArray, Size

# Relative distance within which a point is on a border.
_BORDER_TOLERANCE = 1e-9
# Steps in half a range, above which the unit of an angle is probably wrong.
_MAX_STEPS = 2000


@validate.checked
def arrangements_with(
    count: int, half_x: Size, half_y: Size, step: Size
) -> dict[str, FloatArray]:
    """Return every arrangement of the family that has exactly `count` angles.

    The family is lattices by offsets by windows. Offsets: a point at the middle of the range;
    half a spacing away from it along the rows, across them, or both; a point at the lower left
    corner. Windows: the rectangle with and without its border, the ellipse that touches its
    sides, the circle of the smaller half range, the circle of the larger half range cut by the
    rectangle, the diamond through the middles of its sides.

    Parameters
    ----------
    count : int
        Number of angles.
    half_x, half_y, step : float
        Half the range in x and in y, and the step of the angles, in radians, above zero.

    Returns
    -------
    dict of str to ndarray, shape (count, 2)
        Name (lattice; offset; window) to angles, in radians, x before y, sorted by y, then x.
        All are different. Empty if no arrangement has this count.

    Raises
    ------
    ValueError
        If the step is too small for the range.

    Examples
    --------
    >>> list(arrangements_with(9, 1.0, 1.0, 1.0))[0]
    'square, step between neighbours; centred; rectangle'
    """
    half = np.array([half_x, half_y])
    if half.max() > _MAX_STEPS * step:
        raise ValueError(
            f"step: expected at least 1/{_MAX_STEPS} of the half range, got {step:g} for "
            f"{half.max():g}. Give all three in radians."
        )
    validate.whole_number("count", count)
    return {name: one for name, one in _family(half, step) if len(one) == count}


def _family(half: FloatArray, step: float) -> Iterator[tuple[str, FloatArray]]:
    """Yield name and angles of every arrangement that is not equal to an earlier one."""
    seen: set[bytes] = set()
    for lattice, spacing, chequered in _lattices(half, step):
        along, across = spacing / [1 if chequered else 2, 2]
        origins = {
            "centred": (0.0, 0.0),
            "half a spacing along x": (along, 0.0),
            "half a row spacing along y": (0.0, across),
            "half a spacing along both": (along, across),
            "from the lower left corner": -half,
        }
        for offset, origin in origins.items():
            nodes = _nodes(np.array(origin), spacing, chequered, half)
            for window, inside in _windows(nodes, half).items():
                angles = nodes[inside]
                places = np.rint(angles / (_BORDER_TOLERANCE * step)).astype(np.int64)
                if places.tobytes() not in seen:
                    seen.add(places.tobytes())
                    yield f"{lattice}; {offset}; {window}", angles


def _lattices(half: FloatArray, step: float) -> Iterator[tuple[str, FloatArray, bool]]:
    """Yield name, spacings of the fine grid and kind of every lattice."""
    root2, root3 = np.sqrt(2.0), np.sqrt(3.0)
    unstretched = (
        ("square, step between neighbours", 1, 1, False),
        ("quincunx, step between rows", 1, 1, True),
        ("quincunx, step between neighbours", 1 / root2, 1 / root2, True),
        ("quincunx, step along a row", 1 / 2, 1 / 2, True),
        ("hexagonal, rows along x", 1 / 2, root3 / 2, True),
        ("hexagonal, rows along y", root3 / 2, 1 / 2, True),
    )
    for name, a, b, chequered in unstretched:
        yield name, np.array([a, b]) * step, chequered
    stretched = "stretched to the edges"
    nearest = 2 * half / np.maximum(1, np.rint(2 * half / step))
    yield f"square, {stretched}", nearest, False
    yield f"quincunx, {stretched}, spacings nearest the step", nearest, True
    # Divisions of both ranges whose two spacings average to the step, within a factor of two.
    for m in range(1, round(3 * half[0] / step) + 2):
        a = 2 * half[0] / m
        n = 2 * half[1] / (2 * step - a) if abs(a / step - 1) < 1 / 3 + 1e-9 else 0.0
        if round(n) >= 1 and abs(n - round(n)) < _BORDER_TOLERANCE * n:
            spacing = 2 * half / [m, round(n)]
            yield f"quincunx, {stretched} in {m} by {round(n)} spacings", spacing, True


def _nodes(
    origin: FloatArray, spacing: FloatArray, chequered: bool, half: FloatArray
) -> FloatArray:
    """Return all points of a lattice in the closed rectangle, sorted by y, then x."""
    reach = (2 * half / spacing).astype(int) + 2
    j, i = np.mgrid[-reach[1] : reach[1] + 1, -reach[0] : reach[0] + 1].reshape(2, -1)
    nodes = origin + spacing * np.stack([i, j], axis=-1)
    inside = (np.abs(nodes) <= half * (1 + _BORDER_TOLERANCE)).all(axis=1)
    return np.asarray(nodes[inside & ((i + j) % (2 if chequered else 1) == 0)])


def _windows(nodes: FloatArray, half: FloatArray) -> dict[str, NDArray[np.bool_]]:
    """Return the nodes of the rectangle that each window contains, as masks."""
    inside, radius = np.abs(nodes / half), np.hypot(*nodes.T)
    one = 1 + _BORDER_TOLERANCE
    return {
        "rectangle": np.ones(len(nodes), dtype=bool),
        "rectangle without its border": inside.max(axis=1) < 1 - _BORDER_TOLERANCE,
        "inscribed ellipse": np.square(inside).sum(axis=1) <= one,
        "circle of the smaller half range": radius <= half.min() * one,
        "circle of the larger half range": radius <= half.max() * one,
        "diamond": inside.sum(axis=1) <= one,
    }
