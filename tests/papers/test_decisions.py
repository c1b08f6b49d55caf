"""The rules that the posteriors end in, against other ways to the same numbers."""

import numpy as np
import pytest
from scipy import stats

import reproduce as rp
from reproduce.inference.models import small_angle_posterior
from reproduce.judge.rerun import CannotChangeError, studies
from reproduce.papers.chen2023 import decisions as camera
from reproduce.papers.niu2024 import decisions as sensor
from reproduce.papers.niu2024.posteriors import true_centroids
from reproduce.papers.posteriors import posteriors
from reproduce.physics.attitude import scatter_of_averages
from reproduce.physics.ground import circular_error
from reproduce.physics.registration import fit_registration
from reproduce.printed.given import given
from reproduce.units import ARCSEC_PER_RADIAN

FRAMES = given(camera._FRAME_READS)
STARS = given(sensor.READS)


def fact(key, name):
    return studies()[key].facts()[name].value


@pytest.fixture(scope="module")
def white_and_floor():
    """Draws of both about X, by weighting draws of the prior with the likelihood of Table IV."""
    generator = np.random.default_rng(1)
    white = 0.38 * np.exp(0.12 * (2 * generator.random(60_000) - 1)) / ARCSEC_PER_RADIAN
    floor = np.abs(generator.normal(0, 0.1 / 3, len(white))) / ARCSEC_PER_RADIAN
    logs = camera._log_likelihood(FRAMES, "misalignment-x", white, floor)
    shares = np.exp(logs - logs.max())
    chosen = generator.choice(len(white), 40_000, p=shares / shares.sum())
    return white[chosen], floor[chosen]


def test_the_law_of_table_4_is_that_of_simulated_series():
    """White noise and a floor that drifts evenly: mean and covariance of all six scatters."""
    generator, counts = np.random.default_rng(5), (1, 4, 16, 25, 49, 100)
    drift = np.linspace(-1, 1, 800)
    series = generator.normal(size=(4000, 800)) + 0.1 * drift / drift.std(ddof=1)
    squares = scatter_of_averages(series, counts, axis=1) ** 2
    white, floor, pairs, bent = camera._law(800, counts)
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
    scatter = np.sqrt(np.mean(
        [np.var(generator.normal(size=(40_000, 4)), axis=1, ddof=1) for _ in "xy"], axis=0
    ))  # fmt: skip
    noises = fact("chen2023/frames", "differences") / ARCSEC_PER_RADIAN / scatter
    for name, share in (("-low", 0.025), ("", 0.5), ("-high", 0.975)):
        told = fact("chen2023/frames", f"stage-noise{name}") / ARCSEC_PER_RADIAN
        assert told == pytest.approx(np.quantile(noises, share), rel=0.02)
        told = fact("chen2023/frames", f"stage-frames{name}")
        assert told == pytest.approx(np.quantile((white / noises) ** 2, share), rel=0.06)


def test_the_printed_angles_scatter_as_much_wherever_the_columns_belong():
    """The rule for frames does not rest on our reading of the columns."""
    cells = rp.table("chen2023/table-5").cells().set_index("cell")["printed"]
    columns = [[float(cells[f"chen2023/table-5#{n}.difference-{axis}"]) for n in range(2, 6)]
               for axis in "xy"]  # fmt: skip
    told = fact("chen2023/frames", "differences")
    assert told == pytest.approx(np.sqrt(np.mean([stats.tvar(one) for one in columns])), rel=1e-9)


def test_the_average_of_frames(white_and_floor):
    white, floor = white_and_floor
    expected = np.quantile(np.hypot(white / 10, floor), (0.025, 0.5, 0.975))
    found = camera._averages(FRAMES, "X", np.array([100]))[:, 0]
    np.testing.assert_allclose(found, expected, rtol=0.02)


def test_the_age_of_a_calibration_is_that_of_least_squares():
    """A line through the angles frame by frame: its middle, its slope and their errors."""
    door = given(camera._AGE_READS)
    error, moved, spread = camera._drifting(door)
    frames = door.count("chen2023/text-accuracy#frames")
    # Over a group a slope errs by the root of twelve times its middle, and the angle about X holds
    # the error of the calibration group as well.
    assert spread == pytest.approx(np.sqrt(12 / 2) * error, rel=0.01)
    truth = posteriors()["misalignment-drift"].true_values()["drift-x"]
    assert abs(moved - truth) < 3 * spread
    images = fact("chen2023/drift", "images")
    assert images == pytest.approx(frames * error / moved)
    constant, followed = camera._age(door, np.array([images]))
    assert constant[1, 0] == pytest.approx(np.sqrt(2) * error)
    assert followed[0] == pytest.approx(np.hypot(error, spread * images / frames))
    # Whatever noise and drift are: at the end of its group, half of it after the middle.
    half = fact("chen2023/drift", "half")
    end = camera._age(door, np.array([half]))[1][0] / error
    assert half == frames / 2
    assert fact("chen2023/drift", "end-times") == pytest.approx(end)
    assert end == pytest.approx(np.sqrt(1 + 6 / 4), rel=0.01)


def test_a_drift_of_a_readers_own():
    table = rp.table("chen2023/drift")
    slow, slower = (table.rerun(drift=rate).frame() for rate in (2, 1))
    error = slow["Taken as constant (arcsec)"][0]
    bias = [np.sqrt(one["Taken as constant (arcsec)"] ** 2 - error**2) for one in (slow, slower)]
    np.testing.assert_allclose(bias[0], 2 * bias[1], atol=1e-9)
    np.testing.assert_allclose(bias[1], slower["Time (s)"] / 3600, atol=1e-9)
    with pytest.raises(CannotChangeError, match=r"drift \(in arcsec an hour"):
        table.rerun(speed=1)
    with pytest.raises(ValueError, match="above zero"):
        table.rerun(drift="much")


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
    assert by_hand * np.sqrt(np.pi / 2) == pytest.approx({34: 0.026, 137: 0.013}[stars], abs=5e-4)
    if stars == len(red):
        generator = np.random.default_rng(4)
        pivot = sensor.posteriors.pivot(STARS, "red")
        noisy = green + noise * generator.normal(size=(20_000, *green.shape))
        transform = fit_registration(red, noisy, pivot).transform
        edge = np.hypot(*(red - pivot).T).argmax()
        length = np.hypot(*(transform.apply(red)[:, edge] - green[edge]).T)
        found = sensor._edge_errors(STARS, np.array([stars]))["similarity"][:, 0]
        np.testing.assert_allclose(np.quantile(length, sensor._ENDS), found, rtol=0.06)


def test_how_many_stars_are_enough():
    """Whatever the noise: it is measured by itself. The wanted error counts by its square."""
    table = rp.table("niu2024/stars")
    by_hand = 3 * (1 + 0.9976**2) * 0.05**2  # over n: the variance of one axis at the edge
    left = np.hypot(*sensor._left_out(STARS))
    needed = fact("niu2024/stars", "similarity-enough")
    within = stats.rice.cdf(0.05, left / np.sqrt(by_hand / needed), scale=np.sqrt(by_hand / needed))
    assert within == pytest.approx(0.975, abs=0.003)
    own = table.rerun({"niu2024/text-simulation#noise": "0.02 px"}, wanted=0.02, stars=52)
    told = [one.frame().attrs["caption"] for one in (table, own)]
    assert all("66 stars are with the distortions free" in one for one in told)
    assert f"{needed:.0f} stars are enough for a similarity" in told[0]
    assert 52 in own.frame()["Stars"].to_numpy()
    free = "distortions free"
    assert 4 * 65 < sensor._enough(STARS, 0.025)[free] <= 4 * 66
    # No number of stars helps against what is left out, and the largest tried is no answer.
    assert np.isinf(sensor._enough(STARS, 0.9 * left)["similarity"])
    by_square = 66 * (0.05 / (0.9 * left)) ** 2
    assert sensor._enough(STARS, 0.9 * left)[free] == pytest.approx(by_square, rel=0.03)
    assert np.isinf(sensor._enough(STARS, 1e-4)[free])
    assert "not even 100,000 stars" in table.rerun(wanted=0.01).frame().attrs["caption"]


def test_free_distortions_pay_from_their_number_of_stars_on():
    """Fewer stars fit a similarity better, more the distortions, with what it leaves out."""
    equal = fact("niu2024/stars", "free-from")
    for stars, better in ((0.8 * equal, "similarity"), (1.25 * equal, "distortions free")):
        squares = {name: np.trace(one.at_edge(np.array([stars]))[0])
                   for name, one in sensor._designs(STARS).items()}  # fmt: skip
        squares["similarity"] += np.sum(sensor._left_out(STARS) ** 2)
        assert min(squares, key=squares.get) == better


def test_errors_of_the_camera_by_hand():
    """The simulated ones on the ground."""
    frame = studies()["chen2023/instrument-errors"]().set_index("Error")
    model = posteriors()["misalignment"].model()
    draws = small_angle_posterior(model).draw(np.random.default_rng(6), 40_000)
    ground = fact("chen2023/instrument-errors", "calibrated-ground")
    # The page of the misalignment shows the mean distance, both axes together.
    both = model.derived(draws)["position error"].values.mean()
    assert both == pytest.approx(ground * np.sqrt(np.pi / 2), rel=0.01)
    roll = draws[:, model.names.index("angle-z")].std() * 5e3
    shown = frame.loc["Roll, 800 images, 5 km off centre", "on the ground (m)"]
    assert shown == pytest.approx(roll, rel=0.02)


def test_emcee_finds_the_same_at_the_edge():
    """At the printed number of stars, for both models: median and upper end."""
    from reproduce.views.posterior import book_posterior

    designs = sensor._designs(STARS)
    # The noise that our simulation shows stands in place of the stated one.
    shown = studies()["niu2024/instrument-errors"]().set_index("Error")["median (px)"]
    ratio = shown["Centroid noise, one image"] / 0.05
    for name, key in sensor._MODELS.items():
        found = book_posterior(key)
        likelihood = found.model.likelihood
        outermost = np.hypot(*(likelihood.source - likelihood.pivot).T).argmax()
        places = likelihood.elsewhere(likelihood.source[[outermost]]).places(found.draws)[:, 0]
        sampled = np.quantile(np.hypot(*(places - places.mean(axis=0)).T), sensor._ENDS)
        edge = designs[name].at_edge(np.array([137.0]))[0]
        scatter = [circular_error(edge, share) for share in sensor._ENDS[1:]]
        np.testing.assert_allclose(sampled[1:], ratio * np.array(scatter), rtol=0.05)
