"""The arrangements of rotation angles: counts by other means, and the family's bounds."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from reproduce.physics.optics import Arrangement, arrangements_with
from reproduce.physics.optics.simulate import _arrangements, _lattices

HALF_X, HALF_Y, STEP = np.radians((8.0, 6.0, 0.9))
FAMILY = list(_arrangements(HALF_X, HALF_Y, STEP))


def pick(lattice: str, offset: str, window: str) -> Arrangement:
    (found,) = (
        a
        for a in FAMILY
        if (a.lattice, a.offset, a.window) == (lattice, offset, window)
    )
    return found


def test_centred_square_in_a_circle_solves_the_circle_problem() -> None:
    found = pick(
        "square, step between neighbours", "centred", "circle of the smaller half range"
    )
    # Integer points with i^2 + j^2 <= (6 / 0.9)^2 = 44.44.
    assert len(found.angles) == sum(
        i * i + j * j <= 44 for i in range(-6, 7) for j in range(-6, 7)
    )


def test_full_rectangle_never_has_a_prime_count() -> None:
    for lattice in (
        "square, step between neighbours",
        "square, stretched to the edges",
    ):
        for found in FAMILY:
            if found.lattice == lattice and found.window == "rectangle":
                columns, rows = (
                    len(np.unique(found.angles[:, i].round(9))) for i in (0, 1)
                )
                assert len(found.angles) == columns * rows
                assert min(columns, rows) > 1


def test_square_from_the_corner_is_what_a_ranged_loop_gives() -> None:
    found = pick(
        "square, step between neighbours", "from the lower left corner", "rectangle"
    )
    x, y = np.arange(-8, 8.01, 0.9), np.arange(-6, 6.01, 0.9)
    expected = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
    np.testing.assert_allclose(np.degrees(found.angles), expected, atol=1e-12)


def test_quincunx_of_eleven_by_seven_and_ten_by_six_fills_the_range() -> None:
    found = pick(
        "quincunx, stretched to the edges in 20 by 12 spacings", "centred", "rectangle"
    )
    angles = np.degrees(found.angles)
    even = np.stack(np.meshgrid(np.linspace(-8, 8, 11), np.linspace(-6, 6, 7)), axis=-1)
    odd = np.stack(
        np.meshgrid(np.linspace(-7.2, 7.2, 10), np.linspace(-5, 5, 6)), axis=-1
    )
    expected = np.concatenate([even.reshape(-1, 2), odd.reshape(-1, 2)])
    expected = expected[np.lexsort((expected[:, 0].round(6), expected[:, 1].round(6)))]
    np.testing.assert_allclose(angles, expected, atol=1e-12)


def test_the_list_of_arrangements_with_137_angles() -> None:
    names = [found.name for found in arrangements_with(137, HALF_X, HALF_Y, STEP)]
    circle = "circle of the smaller half range"
    assert names == [
        f"square, step between neighbours; centred; {circle}",
        f"square, step between neighbours; from the lower left corner; {circle}",
        f"quincunx, step between neighbours; centred; {circle}",
        "hexagonal, rows along x; from the lower left corner; diamond",
        "hexagonal, rows along y; half a row spacing along y; diamond",
        "hexagonal, rows along y; half a spacing along both; diamond",
        "hexagonal, rows along y; from the lower left corner; diamond",
        f"square, stretched to the edges; centred; {circle}",
        "quincunx, stretched to the edges in 20 by 12 spacings; centred; rectangle",
    ]


def test_every_arrangement_is_different_sorted_and_within_the_range() -> None:
    keys = {np.round(found.angles, 10).tobytes() for found in FAMILY}
    assert len(keys) == len(FAMILY)
    for found in FAMILY:
        assert (
            np.abs(found.angles) <= (HALF_X * (1 + 1e-8), HALF_Y * (1 + 1e-8))
        ).all()
        order = np.lexsort((found.angles[:, 0], found.angles[:, 1].round(12)))
        np.testing.assert_array_equal(order, np.arange(len(order)))


@pytest.mark.parametrize("window", ["inscribed ellipse", "diamond"])
def test_windows_lie_within_one_another(window: str) -> None:
    square = "square, step between neighbours"
    inner = {tuple(row) for row in pick(square, "centred", window).angles.round(9)}
    outer = {tuple(row) for row in pick(square, "centred", "rectangle").angles.round(9)}
    assert inner < outer


@pytest.mark.parametrize(
    ("window", "inside"),
    [
        ("rectangle", lambda i, j: True),
        ("rectangle without its border", lambda i, j: abs(i) < 10 and abs(j) < 5),
        ("inscribed ellipse", lambda i, j: i * i + 4 * j * j <= 100),
        ("circle of the smaller half range", lambda i, j: i * i + j * j <= 25),
        ("circle of the larger half range", lambda i, j: i * i + j * j <= 100),
        ("diamond", lambda i, j: abs(i) + 2 * abs(j) <= 10),
    ],
)
def test_windows_hold_the_whole_numbers_that_they_should_with_those_on_the_edge(
    window: str, inside: Callable[[int, int], bool]
) -> None:
    found = {
        a.window: a.angles
        for a in _arrangements(10.0, 5.0, 1.0)
        if (a.lattice, a.offset) == ("square, step between neighbours", "centred")
    }[window]
    expected = [(i, j) for j in range(-5, 6) for i in range(-10, 11) if inside(i, j)]
    np.testing.assert_allclose(found, expected, atol=1e-12)


def test_nearest_neighbours_are_a_step_apart_where_the_name_says_so() -> None:
    for lattice in (
        "square, step between neighbours",
        "quincunx, step between neighbours",
        "hexagonal, rows along x",
        "hexagonal, rows along y",
    ):
        angles = pick(lattice, "centred", "rectangle").angles
        gaps = np.linalg.norm(angles[:, None] - angles, axis=-1)
        gaps[np.diag_indices(len(gaps))] = np.inf
        np.testing.assert_allclose(gaps.min(axis=1), STEP, rtol=1e-12)


def test_points_of_a_row_are_a_step_apart_where_the_name_says_so() -> None:
    angles = pick("quincunx, step along a row", "centred", "rectangle").angles
    for height in np.unique(angles[:, 1].round(9)):
        row = np.sort(angles[np.isclose(angles[:, 1], height), 0])
        np.testing.assert_allclose(np.diff(row), STEP, rtol=1e-9)
    heights = np.unique(angles[:, 1].round(9))
    np.testing.assert_allclose(np.diff(heights), STEP / 2, rtol=1e-6)


def test_spacings_of_the_fitted_quincunxes_average_to_the_step() -> None:
    fitted = [
        found for found in _lattices(HALF_X, HALF_Y, STEP) if " by " in found.name
    ]
    assert [found.name.split(" in ")[1] for found in fitted] == [
        "16 by 15 spacings",
        "20 by 12 spacings",
    ]
    for found in fitted:
        assert (found.spacing_x + found.spacing_y) / 2 == pytest.approx(STEP, rel=1e-12)


def test_the_unit_of_the_angles_does_not_matter() -> None:
    degrees = [len(found.angles) for found in _arrangements(8.0, 6.0, 0.9)]
    assert degrees == [len(found.angles) for found in FAMILY]
