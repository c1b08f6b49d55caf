"""The calibration: where the table moves the star, and what theory says of the scheme."""

import numpy as np
import pytest

from reproduce.papers.niu2024 import readings, simulation
from reproduce.physics.optics import Camera, channel_centroids, ideal_positions, starlight
from reproduce.physics.registration import registration_bound, similarity_between
from reproduce.printed.given import given

DOOR = given(readings.READS)


def test_the_table_moves_the_star_as_the_page_says():
    """External frame: towards positive y; middle frame: towards negative x."""
    external, middle = ideal_positions(starlight([0.1, 0.0], [0.0, 0.1]), 1.0)
    np.testing.assert_allclose(external, [0.0, np.tan(0.1)], atol=1e-12)
    np.testing.assert_allclose(middle, [-np.tan(0.1), 0.0], atol=1e-12)


def test_the_scheme_reaches_the_cramer_rao_bound():
    """Within what 10,000 replicates can tell, for both channels and all parameters."""
    stored = readings.stored()
    literal = readings.readings(DOOR).index(readings.literal(DOOR))
    used = simulation.cameras(DOOR)
    turns = simulation.rotations(DOOR)
    true = channel_centroids(used, turns, simulation.literal(DOOR).angles)
    for position in (1, 2):
        truth = similarity_between(used[position], turns[position], used[0])
        bound = registration_bound(true[position], truth, 0.05, 0.05).diagonal()
        variance = stored.arrays["sd"][literal, position - 1, :4] ** 2
        np.testing.assert_allclose(variance / bound, 1, atol=5 * np.sqrt(2 / 10_000))


@pytest.mark.parametrize("channel", simulation.REGISTERED)
def test_only_unequal_distortions_bias_the_fit(channel, monkeypatch):
    """With distortion the scale alone is moved; without it the fit finds the truth."""
    bias = np.abs(readings.precision(DOOR, channel)[1])
    assert bias[0] > 1e-6
    assert bias[1:].max() < 1e-9
    cameras = simulation.cameras
    straight = [
        Camera(one.focal_length, one.principal_point, 0.0, one.pixel_pitch) for one in cameras(DOOR)
    ]
    monkeypatch.setattr(simulation, "cameras", lambda *_: straight)
    assert np.abs(readings.precision(DOOR, channel)[1]).max() < 1e-9
