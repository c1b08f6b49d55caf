"""The image sensor against its own photon transfer curve and against its limits."""

import numpy as np
import pytest
from numpy.random import default_rng

from reproduce.physics.images import Detector, expose

SENSOR = Detector(
    quantum_efficiency=0.6,
    gain=0.8,
    dark_signal=30.0,
    read_noise=9.0,
    offset=200.0,
    bits=14,
)
TRIALS = 40_000


@pytest.mark.parametrize("photons", [0.0, 20.0, 1500.0])
def test_exposures_have_the_mean_and_the_variance_of_the_model(photons):
    draws = expose(np.full(TRIALS, photons), SENSOR, default_rng(5))
    # Shot noise of light and dark charge, read noise and rounding: the photon transfer curve.
    variance = 0.8**2 * (0.6 * photons + 30.0 + 9.0**2) + 1 / 12
    mean = 0.8 * (0.6 * photons + 30.0) + 200.0
    assert draws.mean() == pytest.approx(mean, abs=4 * np.sqrt(variance / TRIALS))
    assert draws.var() == pytest.approx(variance, rel=4 * np.sqrt(2 / TRIALS))


def test_the_output_is_whole_and_stays_within_its_bits():
    sensor = Detector(gain=1.0, read_noise=20.0, offset=10.0, bits=8)
    draws = expose(np.repeat([0.0, 1e4], 500), sensor, default_rng(1))
    assert (draws == np.rint(draws)).all()
    assert draws.min() == 0
    assert draws.max() == 255
    assert (draws[500:] == 255).all()


def test_a_full_pixel_holds_no_more():
    sensor = Detector(full_well=1000.0)
    assert (expose(np.full(50, 1e5), sensor, default_rng(1)) == 1000.0).all()


def test_the_noise_of_a_dark_pixel_has_three_parts():
    assert SENSOR.noise_electrons() == pytest.approx(np.sqrt(30 + 81 + 1 / 12 / 0.64))
    assert Detector(read_noise=2.0).noise_electrons() == 2.0


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ({"quantum_efficiency": 60.0}, "not a percentage"),
        ({"gain": 0.0}, "gain"),
        ({"read_noise": -1.0}, "read_noise"),
        ({"bits": 0}, "bits"),
        ({"bits": 33}, "bits"),
        ({"full_well": -5.0}, "full_well"),
    ],
)
def test_impossible_sensors_are_refused(setting, message):
    with pytest.raises(ValueError, match=message):
        Detector(**setting)


def test_bad_light_is_refused():
    with pytest.raises(ValueError, match="photons"):
        expose([-1.0], SENSOR, default_rng(1))
