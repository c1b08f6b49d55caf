"""Verdicts: exact, consistent and different results, and their numbers."""

import numpy as np
import pytest
from numpy.random import default_rng
from scipy import stats

from reproduce.judge.verdicts import (
    joint_probability,
    judge_prediction,
    judge_value,
)
from reproduce.printed.number import PrintedNumber

NAN, INF = float("nan"), float("inf")


def normal(mean, sigma, size=20_000, seed=7):
    return default_rng(seed).normal(mean, sigma, size)


@pytest.mark.parametrize(
    ("printed", "qualifier", "value", "interval", "wide", "verdict", "flags", "share"),
    [
        ("0.9976", "", 0.99762, (), False, "exact", (), 0.4),
        ("44.6", "", 44.69, (43.1, 46.3), False, "exact", ("rounding",), 1.8),
        # Within the tolerance of a qualifier.
        ("44.6", "about", 44.62, (), False, "exact", (), 0.04),
        ("44.6", "about", 44.69, (), False, "exact", ("tolerance",), None),
        # An input is printed as about: never rounding.
        ("44.6", "", 44.62, (43.1, 46.3), True, "exact", ("tolerance",), None),
        ("44.6", "", 49.0, (47.0, 51.0), True, "differs", (), None),
        ("0.3", "", 1.9, (1.35, 2.45), False, "differs", (), None),
        ("0.1", "within", 0.091, (), False, "exact", ("bound",), None),
        ("0.1", "within", 0.12, (), False, "differs", ("bound",), None),
        ("5", "count", 5.0, (), False, "exact", (), 0.0),
        ("5", "count", 5.4, (), False, "differs", (), None),
    ],
)
def test_values(printed, qualifier, value, interval, wide, verdict, flags, share):
    count = qualifier == "count"
    number = PrintedNumber(printed, count, "" if count else qualifier)
    found = judge_value(number, value, interval or (value, value), wide=wide)
    assert (found.verdict, found.flags) == (verdict, flags)
    if share is not None and qualifier in {"", "count"}:
        assert found.share == pytest.approx(share)
    if verdict == "differs" or "bound" in flags:
        assert found.share is None


def test_a_number_at_the_end_of_the_central_part_is_consistent():
    """Ten of 2,000 draws are below it: both tails together have one per cent."""
    ends, beyond = (
        judge_prediction(PrintedNumber(text), np.arange(2000.0))
        for text in ("9.5", "8.5")
    )
    assert (ends.probability, ends.verdict) == (0.01, "consistent")
    assert beyond.verdict == "differs"


def test_results_must_be_finite():
    for value in (NAN, INF):
        with pytest.raises(ValueError, match="computed value: "):
            judge_value(PrintedNumber("1"), value, (value, value))
    for draws in (np.array([]), np.array([1.0, NAN])):
        with pytest.raises(ValueError, match="draws: "):
            judge_prediction(PrintedNumber("1.0"), draws)


@pytest.mark.parametrize("offset", [0.0, 1.0, 2.5, 3.5])
def test_the_probability_is_that_of_the_normal_distribution(offset):
    found = judge_prediction(
        PrintedNumber(f"{10 + 0.5 * offset:.4f}"), normal(10.0, 0.5)
    )
    expected = 2 * stats.norm.sf(offset)
    assert found.probability == pytest.approx(expected, abs=5 * found.mcse)
    assert found.verdict == ("consistent" if offset < 2.5758 else "differs")
    assert found.computed == pytest.approx(10.0, abs=0.02)
    assert found.tolerance == pytest.approx(2.5758 * 0.5, rel=0.05)
    if offset < 2.5758:
        assert found.share == pytest.approx((1 - found.probability) / 0.99)


def test_a_prediction_is_compared_with_the_rounding_interval():
    for printed, verdict in (("1.3", "consistent"), ("1.300", "differs")):
        found = judge_prediction(PrintedNumber(printed), normal(1.36, 0.02))
        assert found.verdict == verdict
    # A prediction that is wider than the number is wide.
    for sigma, flags in ((0.3, ("wide",)), (0.1, ())):
        found = judge_prediction(PrintedNumber("1.0"), normal(1.0, sigma))
        assert found.flags == flags
    # Three draws are below 2.5 to 3.5, one is inside.
    for printed, probability in (("3", 0.7), ("20", 0.0), ("4.5", 1.0)):
        found = judge_prediction(PrintedNumber(printed), np.arange(10.0))
        assert found.probability == pytest.approx(probability)


def test_monte_carlo_errors_are_the_spread_of_repeated_predictions():
    found = [
        judge_prediction(PrintedNumber("11.0000"), normal(10.0, 0.5, 2000, seed))
        for seed in range(200)
    ]
    for name, error in (("probability", "mcse"), ("computed", "error")):
        spread = np.std([getattr(one, name) for one in found])
        errors = [getattr(one, error) for one in found]
        assert spread == pytest.approx(np.mean(errors), rel=0.15)
    # No draw is so far out, which is half a draw of 2,001.
    far = judge_prediction(PrintedNumber("20.00"), normal(10.0, 0.5, 2000))
    assert far.probability == 0
    assert far.mcse == pytest.approx(2 * np.sqrt(0.5 / 2001 / 2000), rel=1e-3)


def test_cells_are_tested_together_and_not_one_by_one():
    """Two correlated numbers: each is likely, both together are not."""
    moved = default_rng(2).normal(40, 1, 4000)
    noise = default_rng(3).normal(0, 0.05, (2, 4000))
    for printed, least, most in (((40.5, 40.5), 0.3, 1.0), ((41.0, 39.0), 0.0, 0.01)):
        intervals = np.array(printed)[:, None] + [-0.05, 0.05]
        probability, error = joint_probability(moved + noise, intervals)
        assert least < probability < most
        assert error == pytest.approx(np.sqrt(probability * (1 - probability) / 4000))
