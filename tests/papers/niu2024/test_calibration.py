"""What theory says of the calibration, against its replicates and against no distortion."""

import numpy as np
import pytest

from reproduce.papers.niu2024 import calibration, readings, simulation, simulation_angles
from reproduce.physics.optics.camera import Camera
from reproduce.physics.optics.simulate import channel_centroids
from reproduce.physics.registration.calibration import registration_bound
from reproduce.physics.registration.transforms import similarity_between
from reproduce.printed.given import given


@pytest.fixture
def door():
    return given(readings.READS)


def test_the_scheme_reaches_the_cramer_rao_bound(door):
    """Within what 10,000 replicates can tell, for both channels and all parameters."""
    stored = readings.stored()
    literal = readings.readings(door).index(readings.literal(door))
    used = simulation.cameras(door)
    turns = simulation.rotations(door)
    true = channel_centroids(used, turns, simulation_angles.literal(door).angles)
    for position in (1, 2):
        truth = similarity_between(used[position], turns[position], used[0])
        bound = registration_bound(true[position], truth, 0.05, 0.05).diagonal()
        variance = stored.arrays["sd"][literal, position - 1, :4] ** 2
        np.testing.assert_allclose(variance / bound, 1, atol=5 * np.sqrt(2 / 10_000))


@pytest.mark.parametrize("channel", simulation.REGISTERED)
def test_only_unequal_distortions_bias_the_fit(door, channel, monkeypatch):
    """With distortion the scale alone is moved; without it the fit finds the truth."""
    bias = np.abs(calibration.precision(door, channel)[1])
    assert bias[0] > 1e-6
    assert bias[1:].max() < 1e-9
    cameras = simulation.cameras
    straight = [
        Camera(one.focal_length, one.principal_point, 0.0, one.pixel_pitch) for one in cameras(door)
    ]
    monkeypatch.setattr(simulation, "cameras", lambda *_: straight)
    assert np.abs(calibration.precision(door, channel)[1]).max() < 1e-9
