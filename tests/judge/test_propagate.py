"""The rounding of inputs, propagated to results."""

import numpy as np
import pytest

from reproduce.judge.propagate import numbers, result_intervals
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import reproduces
from reproduce.printed.given import given

RED, GREEN = (f"niu2024/table-1#focal-length.{channel}" for channel in ("red", "green"))


@reproduces("niu2024/table-2", given=[RED, GREEN])
def ratio(door):
    """Ratio of two focal lengths, falling in one and rising in the other."""
    return {"scale.red": door[GREEN] / door[RED], "scale.blue": 1.0}


def test_the_corners_of_a_ratio():
    low, high = result_intervals(ratio, given(ratio.given))["scale.red"]
    assert low == pytest.approx(24.99995 / 25.06015, rel=1e-14)
    assert high == pytest.approx(25.00005 / 25.06005, rel=1e-14)


def test_a_result_without_inputs_is_a_point():
    assert result_intervals(ratio, given(ratio.given))["scale.blue"] == (1.0, 1.0)


def test_stochastic_computations_are_refused():
    @reproduces("niu2024/table-3", replicates=10)
    def drawn(door, seed, replicates):
        return {}

    with pytest.raises(ValueError, match="expected a deterministic computation"):
        result_intervals(drawn, given(drawn.given))


DETERMINISTIC = [
    computation
    for item in catalogue().values()
    for computation in item.computations
    if not computation.replicates and computation.given
]


@pytest.mark.parametrize("computation", DETERMINISTIC, ids=lambda c: c.name.split(".", 2)[-1])
def test_no_point_inside_the_rounding_box_leaves_the_interval(computation):
    """The corners are the extremes: random points of the box stay between them."""
    door = given(computation.given)
    intervals = result_intervals(computation, door)
    rng = np.random.default_rng(5)
    addresses = [cell.address for cell in door.numbers()]
    for _ in range(40):
        shifts = dict(zip(addresses, rng.uniform(-1, 1, len(addresses)), strict=True))
        results = numbers(computation, door.shifted(shifts))
        for name, (low, high) in intervals.items():
            slack = 1e-12 * max(abs(low), abs(high))
            assert low - slack <= results[name] <= high + slack, name
