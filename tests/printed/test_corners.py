"""Intervals of results at the corners of the rounding intervals of their inputs."""

import itertools

import numpy as np
import pytest

from reproduce.printed.corners import corner_intervals

MONOTONE = {
    "sum": lambda a, b, c: 2 * a - b + c,
    "product": lambda a, b, c: a * b / c,
    "largest of equal numbers": lambda a, b, c: max(a, a, b - b),
    "constant": lambda a, b, c: 1.0,
}


@pytest.mark.parametrize("name", MONOTONE)
def test_ends_are_those_of_all_corners(name):
    rng = np.random.default_rng(len(name))
    for middle, half in zip(
        rng.uniform(2, 5, (50, 3)), rng.uniform(0, 1, (50, 3)), strict=True
    ):

        def result(sides, middle=middle, half=half):
            moved = [sides.get(axis, 0) for axis in "abc"]
            return {name: MONOTONE[name](*(middle + half * moved))}

        corners = itertools.product((-1, 1), repeat=3)
        values = [result(dict(zip("abc", one, strict=True)))[name] for one in corners]
        found = corner_intervals(result, "abc")[name]
        assert found[:2] == pytest.approx((min(values), max(values)), rel=1e-12)


def test_ties_of_a_smallest_number_move_together():
    found = corner_intervals(
        lambda s: {"m": min(1 + s.get("a", 0), 1 + s.get("b", 0))}, "ab"
    )
    assert found["m"][:2] == (0.0, 2.0)


def test_an_input_that_only_raises_a_result_stays_as_printed_for_the_smallest_one():
    found = corner_intervals(
        lambda s: {"d": abs(s.get("a", 0) - 2 * s.get("b", 0))}, "ab"
    )
    assert found["d"][0] == 0.0


def test_inputs_without_effect_are_not_listed():
    found = corner_intervals(lambda s: {"x": s.get("a", 0), "y": s.get("b", 0)}, "abc")
    assert (found["x"][2], found["y"][2]) == (["a"], ["b"])
