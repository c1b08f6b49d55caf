"""The rules that the posteriors end in, against other ways to the same numbers."""

import numpy as np
import pytest
from scipy import stats

import reproduce as rp
from reproduce.papers.catalogue import studies
from reproduce.papers.chen2023 import decisions as camera
from reproduce.papers.niu2024 import decisions as sensor
from reproduce.papers.niu2024.posteriors import true_centroids
from reproduce.papers.posteriors import posteriors
from reproduce.physics.attitude import scatter_of_averages
from reproduce.physics.ground import circular_error
from reproduce.physics.registration import fit_registration
from reproduce.printed.inputs import load_inputs
from reproduce.units import ARCSEC_PER_RADIAN

FRAMES = load_inputs(camera._FRAME_READS)
STARS = load_inputs(sensor.READS)


def fact(key, name):
    return studies()[key].facts()[name].value


@pytest.fixture(scope="module")
def white_and_floor():
    """Draws of both about X, by weighting draws of the prior with the likelihood of Table IV."""
    generator = np.random.default_rng(1)
    white = 0.38 * np.exp(0.12 * (2 * generator.random(60_000) - 1)) / ARCSEC_PER_RADIAN
    floor = np.abs(generator.normal(0, 0.1 / 3, len(white))) / ARCSEC_PER_RADIAN
    logs = camera._log_likelihood(FRAMES, "x", white, floor)
    shares = np.exp(logs - logs.max())
    chosen = generator.choice(len(white), 40_000, p=shares / shares.sum())
    return white[chosen], floor[chosen]


def test_the_law_of_table_4_is_that_of_simulated_series():
    """White noise and a floor that drifts evenly: mean and covariance of all six scatters."""
    generator, counts = np.random.default_rng(5), (1, 4, 16, 25, 49, 100)
    drift = np.linspace(-1, 1, 800)
    series = generator.normal(size=(4000, 800)) + 0.1 * drift / drift.std(ddof=1)
    squares = scatter_of_averages(series, counts) ** 2
    white, floor, pairs, bent = camera._moments(800, counts)
    np.testing.assert_allclose(squares.mean(axis=0), white + 0.1**2 * floor, rtol=0.02)
    covariance = 2 * pairs + 4 * 0.1**2 * bent
    np.testing.assert_allclose(np.cov(squares.T), covariance, rtol=0.15)


def test_the_knee_is_that_of_weighted_draws(white_and_floor):
    white, floor = white_and_floor
    expected = np.quantile((white / floor) ** 2, 0.025)
    assert fact("chen2023/frames", "knee-x") == pytest.approx(expected, rel=0.04)


def test_where_table_5_says_that_averaging_stops(white_and_floor):
    """From simulated scatters of the few printed differences, about a noise of any size."""
    white, _ = white_and_floor
    generator = np.random.default_rng(3)
    scatter = np.sqrt(
        np.mean(
            [np.var(generator.normal(size=(40_000, 4)), axis=1, ddof=1) for _ in "xy"],
            axis=0,
        )
    )
    noises = fact("chen2023/frames", "differences") / ARCSEC_PER_RADIAN / scatter
    for name, share in (("-low", 0.025), ("", 0.5), ("-high", 0.975)):
        told = fact("chen2023/frames", f"stage-noise{name}") / ARCSEC_PER_RADIAN
        assert told == pytest.approx(np.quantile(noises, share), rel=0.02)
        told = fact("chen2023/frames", f"stage-frames{name}")
        assert told == pytest.approx(
            np.quantile((white / noises) ** 2, share), rel=0.06
        )


def test_the_printed_angles_scatter_as_much_wherever_the_columns_belong():
    """The rule for frames does not rest on our reading of the columns."""
    cells = rp.table("chen2023/table-5").cells().set_index("cell")["printed"]
    columns = [
        [float(cells[f"chen2023/table-5#{n}.difference-{axis}"]) for n in range(2, 6)]
        for axis in "xy"
    ]
    told = fact("chen2023/frames", "differences")
    assert told == pytest.approx(
        np.sqrt(np.mean([stats.tvar(one) for one in columns])), rel=1e-9
    )


def test_the_average_of_frames(white_and_floor):
    white, floor = white_and_floor
    expected = np.quantile(np.hypot(white / 10, floor), (0.025, 0.5, 0.975))
    found = camera._noise(FRAMES, "x").averages(np.array([100]))[:, 0]
    np.testing.assert_allclose(found, expected, rtol=0.02)


def test_the_age_of_a_calibration_is_that_of_least_squares():
    """A line through the angles frame by frame: its middle, its slope and their errors."""
    inputs = load_inputs(camera.READS)
    error, moved, spread = camera._drifting(inputs)
    frames = inputs.count("chen2023/text-accuracy#frames")
    # Over a group a slope errs by the root of twelve times its middle, and the angle about X holds
    # the error of the calibration group as well.
    assert spread == pytest.approx(np.sqrt(12 / 2) * error, rel=0.01)
    truth = posteriors()["misalignment-drift"].true_values()["drift-x"]
    assert abs(moved - truth) < 3 * spread
    assert fact("chen2023/drift", "images") == pytest.approx(frames * error / moved)
    assert fact("chen2023/drift", "followed") == pytest.approx(frames * error / spread)
    shown = studies()["chen2023/drift"]().set_index("Images") / ARCSEC_PER_RADIAN
    # Whatever the noise: at the end of its group, half of it after the middle, a drift that is
    # followed makes the error larger by the root of 1 + 6 / 4.
    followed = shown.loc[frames // 2, "Drift in the model (arcsec)"]
    assert followed == pytest.approx(np.sqrt(1 + 6 / 4) * error, rel=0.01)
    constant = shown.loc[100, "Taken as constant (arcsec)"]
    assert constant == pytest.approx(np.hypot(error, moved * 100 / frames))


@pytest.mark.parametrize("stars", [34, 137])
def test_the_edge_by_hand_and_by_monte_carlo(stars):
    """On an even disc an axis errs by the noise times the root of three over n at the edge."""
    one = sensor._designs(STARS)["similarity"]
    green, red, _ = true_centroids(STARS)
    noise = 0.05 * np.hypot(1, 0.9976)
    by_hand = noise * np.sqrt(3 / stars)
    covariance = one.at_edge(np.array([stars]))[0]
    assert np.sqrt(np.trace(covariance) / 2) == pytest.approx(by_hand, rel=0.02)
    # The mean distance that the review of the posteriors measured.
    assert by_hand * np.sqrt(np.pi / 2) == pytest.approx(
        {34: 0.026, 137: 0.013}[stars], abs=5e-4
    )
    if stars == len(red):
        generator = np.random.default_rng(4)
        pivot = sensor.posteriors.pivot(STARS, "red")
        noisy = green + noise * generator.normal(size=(20_000, *green.shape))
        transform = fit_registration(red, noisy, pivot).transform
        edge = np.hypot(*(red - pivot).T).argmax()
        length = np.hypot(*(transform.apply(red)[:, edge] - green[edge]).T)
        found = sensor._edge_errors(STARS, np.array([stars]))["similarity"][:, 0]
        np.testing.assert_allclose(
            np.quantile(length, sensor._QUANTILES), found, rtol=0.06
        )


def test_how_many_stars_are_enough():
    """Whatever the noise: it is measured by itself. The wanted error counts by its square."""
    by_hand = (
        3 * (1 + 0.9976**2) * 0.05**2
    )  # over n: the variance of one axis at the edge
    left = np.hypot(*sensor._neglected(STARS))
    needed = sensor._sufficient(STARS)
    count = needed["similarity"]
    within = stats.rice.cdf(
        0.05, left / np.sqrt(by_hand / count), scale=np.sqrt(by_hand / count)
    )
    assert within == pytest.approx(0.975, abs=0.003)
    assert needed["distortions free"] == 66
    assert fact("niu2024/stars", "distortions-enough") == 66
    quiet = STARS.changed({sensor.NOISE: 0.02})
    assert sensor._sufficient(quiet)["distortions free"] == pytest.approx(66, abs=1)
    # No number of stars helps against what is left out.
    assert np.isinf(
        sensor._sufficient(STARS.changed({sensor.NOISE: 0.9 * left}))["similarity"]
    )


def test_free_distortions_pay_from_their_number_of_stars_on():
    """Fewer stars fit a similarity better, more the distortions, with what it leaves out."""
    equal = fact("niu2024/stars", "free-from")
    for stars, better in (
        (0.8 * equal, "similarity"),
        (1.25 * equal, "distortions free"),
    ):
        squares = {
            name: np.trace(one.at_edge(np.array([stars]))[0])
            for name, one in sensor._designs(STARS).items()
        }
        squares["similarity"] += np.sum(sensor._neglected(STARS) ** 2)
        assert min(squares, key=squares.get) == better


def test_emcee_finds_the_same_at_the_edge():
    """At the printed number of stars, for both models: median and upper end."""
    from reproduce.views.posterior import book_posterior

    designs = sensor._designs(STARS)
    # The noise that our simulation shows stands in place of the stated one.
    data = posteriors()["registration"].model().likelihood
    fit = fit_registration(data.source, data.target, data.pivot)
    shown = np.sqrt(fit.chi_square / stats.chi2(fit.degrees_of_freedom).median())
    ratio = shown / (0.05 * np.hypot(1, fit.parameters[0]))
    for name, key in sensor._MODELS.items():
        found = book_posterior(key)
        likelihood = found.model.likelihood
        outermost = np.hypot(*(likelihood.source - likelihood.pivot).T).argmax()
        star = likelihood.source[[outermost]]
        places = likelihood.places(found.draws, star)[:, 0]
        sampled = np.quantile(
            np.hypot(*(places - places.mean(axis=0)).T), sensor._QUANTILES
        )
        edge = designs[name].at_edge(np.array([137.0]))[0]
        scatter = [circular_error(edge, share) for share in sensor._QUANTILES[1:]]
        np.testing.assert_allclose(sampled[1:], ratio * np.array(scatter), rtol=0.05)
