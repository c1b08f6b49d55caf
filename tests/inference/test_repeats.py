"""Published numbers in a posterior: closed forms, exact boxes, new stars."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from reproduce.inference import Published, Sampled, Share, repeats
from reproduce.inference.checks import tail_share
from reproduce.inference.models import (
    AveragingLikelihood,
    NewStars,
    averaging_model,
    distortion_model,
    registration_posterior,
    rmse_at,
    true_places,
)
from reproduce.inference.models.stage_table import log_same_hypothesis
from reproduce.inference.sampling import Plan, sample
from reproduce.papers.posteriors import posteriors
from reproduce.physics.registration import Registration, fit_registration

PIVOT = np.array([1030.0, 770.0])
# No paper prints what wrong matches, made on purpose, lead to.
PUBLISHED = [name for name in posteriors() if name != "registration-mixture"]


class Draws(Sampled):
    """Draws as they are: independent, so nothing is thinned."""

    time = 1.0


@pytest.fixture(scope="module")
def drawn(registration):
    """Exact draws of the registration's posterior."""
    data = registration.likelihood
    exact = registration_posterior(data.source, data.target, data.pivot)
    draws = exact.draw(np.random.default_rng(1), 6000)
    return exact, Draws(registration, 1, draws[None, :, None], draws[None, :, :1, None], (1.0,), ())


def test_same_digits_against_the_closed_form(registration, drawn):
    """The least-squares shift of a repeat is a Student-t twice as wide in variance."""
    exact, posterior = drawn
    data = registration.likelihood

    def repeat(parameters, generator):
        targets = np.stack([registration.simulate(one, generator) for one in parameters])
        return fit_registration(data.source, targets, data.pivot).parameters[:, 2:]

    half = 0.005
    printed = np.round(exact.mean[2:] / 0.01 + [0, 1]) * 0.01
    published = Published(("x", "y"), ("px", "px"), ("", ""), printed, np.full(2, half),
                          np.ones(2), repeat, ("shift-x", ""))  # fmt: skip
    rows, together = repeats(posterior, published)
    for i, row in enumerate(rows):
        # The spread of the posterior and that of the repeat's noise have one scale.
        width = np.sqrt(2 * exact.scale[2 + i, 2 + i])
        law = stats.t(exact.freedom, exact.mean[2 + i], width)
        expected = law.cdf(printed[i] + half) - law.cdf(printed[i] - half)
        assert 0.1 < expected < 0.7
        assert abs(row.same.value - expected) < 4 * row.same.error
        near = stats.norm(exact.mean[2 + i], width)
        gaussian = near.cdf(printed[i] + half) - near.cdf(printed[i] - half)
        assert abs(expected - gaussian) < 0.005
    # The shifts are nearly independent about the middle of the stars.
    assert abs(together.value - rows[0].same.value * rows[1].same.value) < 0.05
    tail = 2 * stats.t(exact.freedom, exact.mean[2], np.sqrt(exact.scale[2, 2])).cdf(
        -abs(printed[0] - exact.mean[2]) + exact.mean[2]
    )
    assert abs(rows[0].estimated.value - tail) < 4 * rows[0].estimated.error
    assert rows[1].estimated is None


def test_all_digits_at_once_counted_or_from_the_box():
    """A short table in coarse print: the likelihood's box is the share of repeats that agree."""
    likelihood = AveragingLikelihood((1, 4), np.array([[1.0, 0.5]]), 0.05, 100)
    model = averaging_model(likelihood, shown=1.0)
    posterior = sample(model, Plan(5, steps=400, warmup=150))

    def repeat(parameters, generator):
        return np.concatenate([model.repeat(one, generator) for one in parameters])

    columns = (("a", "b"), ("1", "1"), ("1.0", "0.5"), likelihood.printed[0], np.full(2, 0.05),
               np.ones(2), repeat, ("", ""))  # fmt: skip
    _, counted = repeats(posterior, Published(*columns))
    _, boxed = repeats(posterior, Published(*columns, model.log_likelihood))
    assert boxed.error < counted.error / 2
    assert abs(boxed.value - counted.value) < 4 * counted.error + 0.03 * boxed.value


def test_share_of_certain_outcomes_is_not_certain():
    assert Share.of(np.zeros(100)).error == pytest.approx(0.01)
    # None of a hundred on either side: a twentieth of the time each side may hold three.
    assert tail_share(np.arange(100.0), -1.0).bound == pytest.approx(0.06)
    share = Share.of(np.repeat([0.0, 1.0], [75, 25]))
    assert share.error == pytest.approx(np.sqrt(0.25 * 0.75 / 100))


def test_rmse_at_new_stars_is_the_chi_square_one(registration, drawn):
    """Known transform, known noise: the squared sum is chi square with two degrees per star."""
    _, posterior = drawn
    source = np.random.default_rng(3).uniform((0, 0), (2064, 1544), (52, 2))
    stars = registration.likelihood.elsewhere(source)
    truth = np.repeat(posterior.draws[:1], 4000, axis=0)
    k, theta, *shift = truth[0, :4]
    registered = Registration.similarity(k, theta, shift, PIVOT).apply(source)
    found = rmse_at(stars, registered, truth, np.random.default_rng(4))
    law = stats.chi2(2 * len(source))
    scaled = np.square(found / truth[0, 4]) * len(source)
    assert stats.kstest(scaled, law.cdf).pvalue > 0.001


def test_consequences_at_new_stars_follow_the_noise_and_the_error_of_the_transform(
    registration, drawn
):
    _, posterior = drawn
    data = registration.likelihood
    fit = fit_registration(data.source, data.target, data.pivot)
    source = np.random.default_rng(3).uniform((0, 0), (2064, 1544), (52, 2))
    consequence = NewStars(data.elsewhere(source), fit.transform.apply(source), 28.5)
    found = consequence(posterior.draws)
    rmse = found["test points, RMSE"].values
    # Noise of both axes, and a little more: four fitted numbers over so many stars.
    expected = np.sqrt(2) * posterior.draws[:, 4].mean()
    assert 1 < np.sqrt(np.square(rmse).mean()) / expected < 1.03
    angle = found["test points, pointing error"].values
    np.testing.assert_allclose(angle / rmse, 28.5)
    assert (consequence(posterior.draws)["test points, RMSE"].values == rmse).all()


def test_a_variant_knows_its_places_and_noise_elsewhere(registration):
    """At the stars of the fit, new stars are those that the likelihood simulates."""
    likelihood = distortion_model(registration).likelihood
    same = likelihood.elsewhere(likelihood.source)
    truth = np.append(likelihood.start()[0][:5], [0.6] * (len(likelihood.start()[0]) - 5))
    rows = np.repeat(truth[None], 2, axis=0)
    places = true_places(same, rows)
    noise = same.scatter(rows, np.random.default_rng(1))
    simulated = likelihood.simulate(truth, np.random.default_rng(1))
    np.testing.assert_allclose(places[0] + noise[0], simulated, atol=1e-9)
    assert not np.allclose(noise[0], noise[1])
    # Half as far out the field is the same field: its edge does not follow the stars.
    inner = likelihood.elsewhere(likelihood.pivot + 0.5 * (likelihood.source - likelihood.pivot))
    np.testing.assert_allclose(inner.radius, 0.5 * likelihood.radius)


@pytest.mark.parametrize("name", PUBLISHED)
def test_every_published_number_can_be_repeated(name):
    """Two repeats each: as many finite numbers as cells, in their units, near the print."""
    declared = posteriors()[name]
    model = declared.model()
    published = declared.printed(model)
    assert published is not None
    point = model.likelihood.start()[0]
    found = published.repeat(np.stack([point, point]), np.random.default_rng(1))
    assert found.shape == (2, len(published.names))
    assert np.isfinite(found).all()
    printed = published.printed * published.shown
    assert [float(text) for text in published.texts] == pytest.approx(printed)
    # In their units: no column is off by a power of ten.
    assert np.abs(found).max() < 20 * np.abs(published.printed).max()
    assert {p for p in published.parameters if p} <= set(model.names)
    if published.whole is not None:
        assert (published.whole(point[None]) <= 1e-9).all(), "a probability"


@pytest.mark.parametrize("name", PUBLISHED)
def test_comparisons_say_what_they_cannot_show(name):
    """Data simulated from the print, or the print itself: no comparison is a proof by itself."""
    declared = posteriors()[name]
    assert "." in declared.printed(declared.model()).note


def better(stage):
    """The hypothesis that leaves less of the angles over."""
    return int(stage.fit(1)[1] < stage.fit(0)[1])


def test_the_hypothesis_of_a_repeat_is_that_of_the_data():
    """Simulations draw either order of the columns; repeats keep the one that the print tells."""
    model = posteriors()["table-5"].model()
    point, stage, angles = model.likelihood.start()[0], model.likelihood.reference, {}
    for kind, draw in (("simulated", model.simulate), ("repeated", model.repeat)):
        drawn = [draw(point, np.random.default_rng(seed))[0] for seed in range(12)]
        angles[kind] = {better(replace(stage, angles=one)) for one in drawn}
    assert angles == {"simulated": {0, 1}, "repeated": {1}}


def test_same_digits_again_under_the_hypothesis_that_they_tell_of():
    both = np.log([[0.2, 0.2], [0.3, 1e-30], [0.2, 0.1]])
    found = np.exp(log_same_hypothesis(both))
    np.testing.assert_allclose(found, [0.2, 0.3, (0.2 * 0.2 + 0.1 * 0.1) / 0.3], rtol=1e-12)
