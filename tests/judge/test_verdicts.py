"""Verdicts: what counts as exact, consistent and different, and with which numbers."""

import numpy as np
import pytest
from scipy import stats

from reproduce.judge.verdicts import (
    joint_probability,
    judge_prediction,
    judge_value,
    tail_mid_p,
)
from reproduce.printed.number import PrintedNumber


def normal(mean, sigma, size=20_000, seed=7):
    return np.random.default_rng(seed).normal(mean, sigma, size)


def test_a_value_that_rounds_to_the_print_is_exact():
    found = judge_value(PrintedNumber("0.9976"), 0.99762, (0.99762, 0.99762))
    assert (found.verdict, found.flags) == ("exact", ())
    assert found.share == pytest.approx(0.4)
    assert found.tolerance == pytest.approx(0.00005)


def test_agreement_through_rounding_alone_is_flagged():
    found = judge_value(PrintedNumber("44.6"), 44.69, (43.1, 46.3))
    assert (found.verdict, found.flags) == ("exact", ("rounding",))
    assert found.share == pytest.approx(1.8)


@pytest.mark.parametrize(
    ("qualifier", "printed", "value", "flags"),
    [
        ("about", "44.6", 44.62, ()),  # rounds to the digits within a narrow tolerance
        ("nominal", "44.6", 44.62, ()),
        ("about", "44.6", 44.69, ("tolerance",)),  # meets the tolerance only
        ("nominal", "44.6", 44.69, ("tolerance",)),
        (
            "about",
            "1",
            1.2,
            ("tolerance",),
        ),  # rounds to a digit whose tolerance is its value
    ],
)
def test_agreement_through_about_or_nominal_is_a_wide_tolerance(
    qualifier, printed, value, flags
):
    found = judge_value(
        PrintedNumber(printed, qualifier=qualifier), value, (value, value)
    )
    assert (found.verdict, found.flags) == ("exact", flags)


def test_agreement_through_an_input_printed_as_about_is_a_wide_tolerance():
    for value in (44.62, 44.69):
        found = judge_value(PrintedNumber("44.6"), value, (43.1, 46.3), wide=True)
        assert (found.verdict, found.flags) == ("exact", ("tolerance",)), (
            "never rounding"
        )
    missed = judge_value(PrintedNumber("44.6"), 49.0, (47.0, 51.0), wide=True)
    assert (missed.verdict, missed.flags) == ("differs", ())


def test_an_interval_that_misses_the_print_differs():
    found = judge_value(PrintedNumber("0.3"), 1.9, (1.35, 2.45))
    assert (found.verdict, found.share) == ("differs", None)


def test_a_bound_is_kept_or_broken():
    kept = judge_value(PrintedNumber("0.1", qualifier="within"), 0.091, (0.091, 0.091))
    broken = judge_value(PrintedNumber("0.1", qualifier="within"), 0.12, (0.12, 0.12))
    assert (kept.verdict, kept.flags, kept.share) == ("exact", ("bound",), None)
    assert broken.verdict == "differs"


def test_a_count_is_met_or_missed():
    assert judge_value(PrintedNumber("5", exact=True), 5.0, (5.0, 5.0)).share == 0.0
    assert (
        judge_value(PrintedNumber("5", exact=True), 5.4, (5.4, 5.4)).verdict
        == "differs"
    )


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_a_recomputation_must_be_finite(value):
    with pytest.raises(ValueError, match="computed value: expected a finite number"):
        judge_value(PrintedNumber("1"), value, (value, value))


@pytest.mark.parametrize("offset", [0.0, 1.0, 2.5, 3.5])
def test_the_probability_is_that_of_the_normal_law(offset):
    draws = normal(10.0, 0.5)
    found = judge_prediction(PrintedNumber(f"{10 + 0.5 * offset:.4f}"), draws)
    assert found.probability == pytest.approx(
        2 * stats.norm.sf(offset), abs=5 * found.mcse
    )
    assert found.verdict == ("consistent" if offset < 2.5758 else "differs")
    assert found.computed == pytest.approx(10.0, abs=0.02)
    assert found.tolerance == pytest.approx(2.5758 * 0.5, rel=0.05)


def test_the_rounding_interval_of_the_print_counts():
    draws = normal(1.36, 0.02)
    wide, narrow = PrintedNumber("1.3"), PrintedNumber("1.300")
    assert judge_prediction(wide, draws).verdict == "consistent"
    assert judge_prediction(narrow, draws).verdict == "differs"


def test_share_of_a_consistent_value():
    found = judge_prediction(PrintedNumber("10.5000"), normal(10.0, 0.5))
    assert found.share == pytest.approx((1 - found.probability) / 0.99)


def test_a_prediction_wider_than_the_number_is_wide():
    assert judge_prediction(PrintedNumber("1.0"), normal(1.0, 0.3)).flags == ("wide",)
    assert judge_prediction(PrintedNumber("1.0"), normal(1.0, 0.1)).flags == ()


@pytest.mark.parametrize("draws", [np.array([]), np.array([1.0, np.nan])])
def test_draws_must_be_finite(draws):
    with pytest.raises(ValueError, match="draws: expected finite numbers"):
        judge_prediction(PrintedNumber("1.0"), draws)


def test_the_monte_carlo_error_is_that_of_a_proportion():
    """Spread of the probability over repeated predictions against the error it states."""
    found = [
        judge_prediction(PrintedNumber("11.0000"), normal(10.0, 0.5, 2000, seed))
        for seed in range(200)
    ]
    spread = np.std([f.probability for f in found])
    assert spread == pytest.approx(np.mean([f.mcse for f in found]), rel=0.15)


def test_mid_p_counts_half_of_the_interval():
    ordered = np.arange(10.0)
    assert tail_mid_p(ordered, 1.5, 3.5) == pytest.approx(0.3)
    assert tail_mid_p(ordered, 20.0, 21.0) == 0.0


def test_the_error_of_a_median_is_the_spread_of_many():
    found = [
        judge_prediction(PrintedNumber("10.00"), normal(10.0, 0.5, 2000, seed))
        for seed in range(200)
    ]
    assert np.std([f.computed for f in found]) == pytest.approx(
        np.mean([f.error for f in found]), rel=0.15
    )


def test_cells_are_tested_together_and_not_one_by_one():
    """Two numbers that move as one, printed apart: each is likely, both together are not."""
    moved = np.random.default_rng(2).normal(40, 1, 4000)
    noise = np.random.default_rng(3).normal(0, 0.05, (2, 4000))
    half = np.array([-0.05, 0.05])
    for printed, least, most in (((40.5, 40.5), 0.3, 1.0), ((41.0, 39.0), 0.0, 0.01)):
        probability, _ = joint_probability(
            moved + noise, np.array(printed)[:, None] + half
        )
        assert least < probability < most
