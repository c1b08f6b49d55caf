"""The simulation of niu2024 against answers that do not come from it."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from reproduce.papers.niu2024 import angles, simulation
from reproduce.physics.registration import fit_similarity
from reproduce.physics.simulate import channel_centroids, noisy_centroids
from reproduce.printed.given import given

DOOR = given(simulation.calibrated_parameters.given)
SEED = np.random.SeedSequence(99)
ROWS = ("scale", "rotation", "translation-x", "translation-y")


@pytest.fixture(scope="module")
def prediction():
    return simulation.calibrated_parameters(DOOR, 1000)


def noiseless():
    table = angles.literal(DOOR).angles
    return channel_centroids(simulation.cameras(DOOR), simulation.rotations(DOOR), table)


def test_the_arrangement_has_the_printed_count_and_the_zero_position():
    found = angles.literal(DOOR).angles
    assert len(found) == 137
    assert np.isclose(found, 0).all(axis=1).sum() == 1
    steps = np.degrees(np.diff(np.unique(found[:, 0].round(12))))
    np.testing.assert_allclose(steps, 0.9, atol=1e-9)


def test_figure_4_shows_the_set_that_the_simulation_uses(monkeypatch):
    """The points drawn are those whose centroids are calibrated, to the last bit."""
    used = []

    def seen(cameras, rotations, table):
        used.append(np.array(table))
        return channel_centroids(cameras, rotations, table)

    monkeypatch.setattr(simulation, "channel_centroids", seen)
    simulation.calibrations(DOOR, SEED, 1)
    figure = Figure()
    angles.draw(figure, {})
    points = figure.axes[0].lines[0]
    drawn = np.column_stack([points.get_xdata(), points.get_ydata()])
    np.testing.assert_array_equal(drawn, np.degrees(used[0]))


def test_the_arrangements_with_137_angles():
    """Pencil and paper: lattice points in a circle of radius 6/0.9, and 11 x 7 + 10 x 6."""
    names = [(c.lattice.split(",")[0], c.offset, c.window) for c in angles.candidates(DOOR)]
    assert len(names) == 9
    assert names[0] == ("square", "centred", "circle of the smaller half range")
    lattice = [
        (i, j) for i in range(-9, 10) for j in range(-9, 10) if i * i + j * j <= (6 / 0.9) ** 2
    ]
    assert len(lattice) == 137
    assert names[-1] == ("quincunx", "centred", "rectangle")
    assert 11 * 7 + 10 * 6 == 137


def test_no_full_rectangle_has_137_angles():
    assert all(137 % n for n in range(2, 12)), "137 is prime"
    assert all(
        "rectangle" not in c.window or "quincunx" in c.lattice for c in angles.candidates(DOOR)
    )


def test_the_iteration_ends_at_the_closed_form():
    table = angles.literal(DOOR).angles
    zero = np.flatnonzero(np.isclose(table, 0).all(axis=1)).item()
    noisy = noisy_centroids(noiseless(), 0.05, SEED, 20)
    found = simulation.calibrations(DOOR, SEED, 20)
    for position, channel in enumerate(("red", "blue"), start=1):
        source, green = noisy[:, position], noisy[:, 0]
        closed = fit_similarity(source, green, source[:, zero])
        np.testing.assert_allclose(found[channel].parameters, closed.parameters, rtol=0, atol=2e-9)


@pytest.mark.parametrize("channel", ["red", "blue"])
def test_the_predictions_centre_is_the_fit_without_noise(prediction, channel):
    """The distortion biases the scale; noise of this size adds no bias of its own."""
    true = noiseless()
    position = ("green", "red", "blue").index(channel)
    zero = np.flatnonzero(np.isclose(angles.literal(DOOR).angles, 0).all(axis=1)).item()
    clean = fit_similarity(true[position], true[0], true[position, zero]).parameters
    for row, value in zip(ROWS, clean, strict=True):
        draws = prediction[f"{row}.{channel}"].draws
        assert abs(draws.mean() - value) < 4.5 * draws.std() / np.sqrt(draws.size), row


@pytest.mark.parametrize("channel", ["red", "blue"])
def test_the_predictions_width_is_that_of_linear_theory(prediction, channel):
    """Noise in both channels adds up: k^2 + 1 times the variance of one coordinate."""
    true = noiseless()
    position = ("green", "red", "blue").index(channel)
    points = true[position] - true[position].mean(axis=0)
    spread = (points**2).sum()
    sigma = 0.05 * np.sqrt(2)
    expected = {"scale": sigma / np.sqrt(spread), "rotation": sigma / np.sqrt(spread)}
    for row, value in expected.items():
        draws = prediction[f"{row}.{channel}"].draws
        assert draws.std() == pytest.approx(value, rel=0.08), row


def test_both_channels_share_the_noise_of_green(prediction):
    """Two fits against the same green centroids correlate by about one half."""
    red, blue = (prediction[f"scale.{channel}"].draws for channel in ("red", "blue"))
    assert np.corrcoef(red, blue)[0, 1] == pytest.approx(0.5, abs=0.08)


def test_the_residual_after_registration_is_four_times_the_variance_of_a_coordinate():
    """Two channels, two axes; what the distortion leaves adds to it."""
    found = simulation.registration_rmse(given(simulation.registration_rmse.given), 400)
    floor = np.sqrt(4 * 0.05**2)
    for channel in ("red", "blue"):
        median = np.median(found[f"rmse-after-{channel}"].draws)
        assert floor < median < 1.25 * floor


def test_the_shift_of_table_1_alone_exceeds_the_printed_rmse():
    """Why the RMSE before registration cannot be as printed: a lower bound by hand."""
    found = simulation.registration_rmse(given(simulation.registration_rmse.given), 400)
    by_hand = {"red": np.hypot(1.9, 2.3), "blue": np.hypot(1.4, 1.6)}
    for channel, shift in by_hand.items():
        assert found[f"rmse-before-{channel}"].draws.min() > 0.9 * shift
