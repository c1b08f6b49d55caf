"""The law of draws against laws that are known exactly, far beyond what draws could count."""

import numpy as np
import pytest
from scipy import stats

import laws
from reproduce.judge.verdicts import joint_probability, judge_prediction
from reproduce.printed.number import PrintedNumber

DRAWS = 20_000
GENERATOR = np.random.default_rng(8)
PLAIN = np.zeros(1, dtype=bool)


def point(*values):
    """Intervals of no width."""
    return np.array([[value, value] for value in values])


def test_a_gaussian_tail_far_out():
    law = laws.fitted([5 + 2 * GENERATOR.standard_normal(DRAWS)], PLAIN)
    for z in (1.0, 3.0, 6.0, 8.0):
        exact = np.log10(2 * stats.norm.sf(z))
        # The standard deviation is good to 1 / sqrt(2 n), and a tail goes with exp(-z^2 / 2).
        error = 5 * z**2 / np.sqrt(2 * DRAWS) / np.log(10) + 0.02
        for side in (-1, 1):
            found = laws.log_tails(law, point(5 + side * 2 * z))[0]
            assert found == pytest.approx(exact, abs=error), (z, side)


@pytest.mark.parametrize("freedom", [52, 104])
def test_the_tail_of_a_root_mean_square_far_out(freedom):
    """A root mean square of so many Gaussian numbers is a root of chi-square."""
    draws = np.sqrt(GENERATOR.chisquare(freedom, DRAWS) / freedom)
    law = laws.fitted([draws], ~PLAIN)
    assert law.power[0] == pytest.approx(2 / 3, abs=0.3)  # Wilson and Hilferty
    for probability in (1e-2, 1e-5, 1e-8):
        for exact in (
            stats.chi2.ppf(probability / 2, freedom),
            stats.chi2.isf(probability / 2, freedom),
        ):
            found = laws.log_tails(law, point(np.sqrt(exact / freedom)))[0]
            assert found == pytest.approx(np.log10(probability), rel=0.08)


def test_a_wide_interval_of_rounding_counts_half():
    law = laws.fitted([GENERATOR.standard_normal(DRAWS)], PLAIN)
    assert 10 ** laws.log_tails(law, np.array([[-50.0, 50.0]]))[0] == pytest.approx(1, abs=1e-6)
    for interval in ([1.5, 50.0], [-50.0, -1.5]):
        half = 10 ** laws.log_tails(law, np.array([interval]))[0]
        assert half == pytest.approx(stats.norm.sf(1.5), rel=0.05)


def correlated(rho):
    base = GENERATOR.standard_normal((2, DRAWS))
    return [base[0], rho * base[0] + np.sqrt(1 - rho**2) * base[1]]


def test_the_joint_probability_knows_the_correlation():
    """Two numbers of a correlation of 0.9: by hand, x^2 - 2 r x y + y^2 over 1 - r^2."""
    columns = correlated(0.9)
    law, both = laws.fitted(columns, np.zeros(2, dtype=bool)), np.ones(2, dtype=bool)
    for x, y in ((2.0, 2.0), (2.0, -2.0), (0.0, 1.0)):
        squared = (x * x - 1.8 * x * y + y * y) / 0.19
        counted, law_found, distance = laws.joint(law, columns, point(x, y), both)
        assert distance**2 == pytest.approx(squared, rel=0.06)
        exact = stats.chi2.logsf(squared, 2) / np.log(10)
        assert law_found == pytest.approx(exact, rel=0.06)
        assert counted == pytest.approx(10**exact, abs=5 * np.sqrt(10**exact / DRAWS) + 1e-3)


def test_rounding_speaks_for_the_print():
    """The nearest of all values that round to the print counts, so no draw's own table is rarer."""
    columns = correlated(0.5)
    law, both = laws.fitted(columns, np.zeros(2, dtype=bool)), np.ones(2, dtype=bool)
    inside = laws.joint(law, columns, np.array([[-1.0, 1.0], [-0.1, 3.0]]), both)
    assert inside[0] == 1.0
    assert inside[2] == pytest.approx(0, abs=1e-9)
    for x, y in GENERATOR.normal(scale=2, size=(50, 2)):
        step = np.array([[np.floor(x), np.floor(x) + 1], [np.floor(y), np.floor(y) + 1]])
        rounded = laws.joint(law, columns, step, both)
        assert rounded[2] <= laws.joint(law, columns, point(x, y), both)[2] + 1e-9


def test_draws_themselves_follow_the_law():
    """Of tables from the law, one in twenty has a probability below one in twenty."""
    columns = [np.sqrt(GENERATOR.chisquare(52, DRAWS)), *correlated(0.7)]
    squares, every = np.array([True, False, False]), np.ones(3, dtype=bool)
    law = laws.fitted(columns, squares)
    tables = np.stack(columns, axis=-1)[:600]
    found = [laws.joint(law, columns, point(*table), every)[1] for table in tables]
    rare = (np.array(found) < np.log10(0.05)).mean()
    assert rare == pytest.approx(0.05, abs=4 * np.sqrt(0.05 * 0.95 / 600))


def test_cells_that_depend_on_each_other_are_no_obstacle():
    columns = [GENERATOR.standard_normal(DRAWS)] * 2
    law, both = laws.fitted(columns, np.zeros(2, dtype=bool)), np.ones(2, dtype=bool)
    agreeing = laws.joint(law, columns, point(1.0, 1.0), both)
    assert agreeing[1] > -1
    contradicting = laws.joint(law, columns, point(1.0, -1.0), both)
    assert contradicting[1] < -50
    assert contradicting[0] == 0


def intervals(numbers):
    return np.array([number.interval() for number in numbers])


def test_the_joint_probability_of_the_truth_is_uniform():
    """A table drawn from its own prediction, with correlated cells, is as likely as any."""
    rng = np.random.default_rng(3)
    mixing = np.array([[1.0, 0.0], [0.9, 0.4]])
    draws = rng.normal(size=(2000, 2)) @ mixing.T
    found = []
    for _ in range(300):
        table = rng.normal(size=2) @ mixing.T
        printed = [PrintedNumber(f"{value:.3f}") for value in table]
        found.append(joint_probability(draws.T, intervals(printed))[0])
    assert stats.kstest(found, "uniform").pvalue > 0.01


def test_the_joint_probability_sees_what_single_cells_do_not():
    """Six cells each at two standard deviations: none differs alone, the table does."""
    rng = np.random.default_rng(4)
    draws = list(rng.normal(size=(6, 4000)))
    printed = [PrintedNumber("2.000")] * 6
    for number, values in zip(printed, draws, strict=True):
        assert judge_prediction(number, values).verdict == "consistent"
    assert joint_probability(np.stack(draws), intervals(printed))[0] < 0.01


def test_simulated_tables_are_rounded_like_the_print():
    """A print of 1 to the unit is as surprising as every table that prints 1, -1 or beyond."""
    half = np.random.default_rng(7).normal(0.0, 0.6, DRAWS)
    draws = np.concatenate([half, -half])
    found, mcse = joint_probability(draws[None], intervals([PrintedNumber("1")]))
    assert found == pytest.approx(2 * stats.norm.sf(0.5 / 0.6), abs=5 * mcse)
