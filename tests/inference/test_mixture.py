"""Stars that are rightly or wrongly matched: densities, the start, and each star's probability."""

import numpy as np
import pytest
from exact import registration_posterior
from scipy import stats

from reproduce.inference.models import (
    mixture_model,
    probability_false,
    registration_model,
)
from reproduce.inference.sampling import Plan, sample
from reproduce.physics.registration import Registration

FIELD = np.array([2064.0, 1544.0])
PIVOT = FIELD / 2
TRUTH = {
    "scale": 1.0006,
    "rotation": 0.002,
    "shift-x": 3.0,
    "shift-y": 1.0,
    "noise": 0.1,
}
PLAN = Plan(5, steps=400, warmup=150, walkers=96)


def stars(wrong, count=60, seed=1):
    """Stars of known truth, the first of them matched with each other's partners."""
    generator = np.random.default_rng(seed)
    source = generator.uniform((0, 0), FIELD, (count, 2))
    scale, rotation, *shift, noise = TRUTH.values()
    target = Registration.similarity(scale, rotation, shift, PIVOT).apply(source)
    target = target + noise * generator.normal(size=target.shape)
    target[:wrong] = np.roll(target[:wrong], 1, axis=0)
    return source, target


def mixture(*points):
    return mixture_model(registration_model(*points, PIVOT))


@pytest.fixture(scope="module")
def sampled():
    return {wrong: sample(mixture(*stars(wrong)), PLAN) for wrong in (0, 18)}


@pytest.mark.parametrize("wrong", [0, 18])
def test_three_wrong_matches_in_ten_are_named_and_move_nothing(sampled, wrong):
    found = sampled[wrong]
    for row, parameter in zip(found.rows, found.model.parameters, strict=True):
        if parameter.name in TRUTH:
            assert (
                abs(row.mean - TRUTH[parameter.name] * parameter.shown)
                < 4 * row.deviation
            )
    false = probability_false(found)
    assert (false[:wrong] > 0.9).all()
    assert (false[wrong:] < 0.1).all()


@pytest.mark.parametrize("wrong", [0, 18])
def test_draws_are_those_of_the_closed_form_of_the_true_stars(sampled, wrong):
    """Where no star is in doubt: a Student-t of the rest, and a beta of their number."""
    found, (source, target) = sampled[wrong], stars(wrong)
    exact = registration_posterior(source[wrong:], target[wrong:], PIVOT)
    law = stats.t(exact.freedom, exact.mean, np.sqrt(np.diagonal(exact.scale)))
    linear = found.draws[:, 0] * np.exp(1j * found.draws[:, 1])
    columns = np.column_stack([linear.real, linear.imag, found.draws[:, 2:4]])
    np.testing.assert_allclose(
        (columns.mean(axis=0) - exact.mean) / law.std(), 0, atol=0.05
    )
    np.testing.assert_allclose(columns.std(axis=0) / law.std(), 1, atol=0.05)
    share = stats.beta(wrong + 1, 60 - wrong + 1)  # half of all is far out
    assert abs(found.draws[:, 5].mean() - share.mean()) < 0.05 * share.std()
    assert abs(found.draws[:, 5].std() / share.std() - 1) < 0.05


def test_a_density_is_the_sum_of_both_cases():
    model = mixture(*stars(6, 20))
    likelihood = model.likelihood
    rows = model.start(np.random.default_rng(1), 12)
    left = (likelihood.target - likelihood.places(rows)) @ [1, 1j]
    noise, share = rows[:, 4:5], rows[:, 5:]
    right = (1 - share) * stats.norm.pdf(left.real, scale=noise)
    right = right * stats.norm.pdf(left.imag, scale=noise)
    both = right + share / likelihood.side**2
    np.testing.assert_allclose(likelihood(rows), np.log(both).sum(axis=1), rtol=1e-10)
    np.testing.assert_allclose(likelihood.false(rows), 1 - right / both, atol=1e-10)
    # Beyond the square there are no false stars.
    far = likelihood.with_data(likelihood.target + 3 * likelihood.side)
    assert (far.false(rows) == 0).all()


@pytest.mark.parametrize("wrong", [0, 18, 27])
def test_the_start_takes_the_true_stars(wrong):
    """Though almost half of all are false, in a hundred fields."""
    for seed in range(100):
        model = mixture(*stars(wrong, seed=seed))
        assert not model.likelihood.agreeing[:wrong].any()
        assert model.likelihood.agreeing[wrong:].sum() >= 59 - wrong
        start = model.start(np.random.default_rng(seed), 4)
        assert np.isfinite(model.log_posterior(start)).all()
        # The outermost stars may be false too: against next to no noise all are.
        start[:, 4] = 1e-9
        assert (model.likelihood.false(start) > 0.5).all()


def test_false_stars_are_drawn_as_often_and_as_far_as_the_model_says():
    likelihood = mixture(*stars(18)).likelihood
    point = likelihood.start()[0]
    point[5] = 0.3
    generator = np.random.default_rng(2)
    drawn = np.stack([likelihood.simulate(point, generator) for _ in range(400)])
    false = np.abs(drawn - stars(0)[1]).max(axis=-1) > 2.0
    assert abs(false.mean() - 0.3) < 4 * np.sqrt(0.21 / false.size)
    places = (drawn[false] - likelihood.corner) / likelihood.side
    assert stats.kstest(places.ravel(), "uniform").pvalue > 0.001
    # In a repeat those that the data tell to be false are so again, and no other.
    again = np.stack([likelihood.repeat(point, generator) for _ in range(100)])
    false = np.abs(again - stars(0)[1]).max(axis=-1) > 2.0
    assert false[:, :18].mean() > 0.99
    assert not false[:, 18:].any()
