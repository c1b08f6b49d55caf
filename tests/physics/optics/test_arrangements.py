"""Arrangements of rotation angles: the family, and its windows by hand."""

from itertools import product

import numpy as np
from numpy.testing import assert_allclose

from reproduce.physics import optics
from reproduce.physics.optics import arrangement_angles

HALVES = np.radians((8.0, 6.0, 0.9))
NAMES = map(
    "; ".join,
    product(
        optics._lattices(np.ones(2), 1.0),
        (*optics._OFFSETS, optics._CORNER),
        optics._windows(np.ones((1, 2)), np.ones(2)),
    ),
)
FAMILY = {name: arrangement_angles(name, *HALVES) for name in NAMES}
SQUARE, CIRCLE = "square, step between neighbours", "circle of the smaller half range"


def test_the_arrangements_with_137_angles():
    """Names by the first of equal arrangements: the rule that makes the readings complete."""
    assert len(FAMILY) == 10 * 5 * 6
    first = {}
    for name, angles in FAMILY.items():
        if len(angles) == 137:
            first.setdefault((np.rint(angles * 1e8) + 0.0).tobytes(), name)
    assert list(first.values()) == [
        f"{SQUARE}; centred; {CIRCLE}",
        f"{SQUARE}; from the lower left corner; {CIRCLE}",
        f"quincunx, step between neighbours; centred; {CIRCLE}",
        "hexagonal, rows along x; from the lower left corner; diamond",
        "hexagonal, rows along y; half a row spacing along y; diamond",
        "hexagonal, rows along y; half a spacing along both; diamond",
        "hexagonal, rows along y; from the lower left corner; diamond",
        f"square, stretched to the edges; centred; {CIRCLE}",
        "quincunx, stretched to the edges in 20 by 12 spacings; centred; rectangle",
    ]


def test_windows_contain_the_places_that_they_should_with_their_edges():
    windows = {
        "rectangle": lambda i, j: abs(i) <= 10 and abs(j) <= 5,
        "rectangle without its border": lambda i, j: abs(i) < 10 and abs(j) < 5,
        "inscribed ellipse": lambda i, j: i * i + 4 * j * j <= 100,
        CIRCLE: lambda i, j: i * i + j * j <= 25,
        "circle of the larger half range": lambda i, j: i * i + j * j <= 100,
        "diamond": lambda i, j: abs(i) + 2 * abs(j) <= 10,
    }
    for offset, half in (("centred", 0.0), ("half a spacing along both", 0.5)):
        for window, inside in windows.items():
            grid = ((i + half, j + half) for j in range(-6, 6) for i in range(-11, 11))
            expected = [
                place for place in grid if abs(place[1]) <= 5 and inside(*place)
            ]
            name = f"{SQUARE}; {offset}; {window}"
            found = arrangement_angles(name, 10.0, 5.0, 1.0)
            assert_allclose(found, expected, atol=1e-12)
