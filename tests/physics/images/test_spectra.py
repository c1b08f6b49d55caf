"""Spectra against radiation laws written down elsewhere, and bad tables."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.constants import c, h, k
from scipy.integrate import quad

from reproduce.physics.images import blackbody_band, tabulated_star
from reproduce.physics.images.detector import _ZERO_MAGNITUDE, _blackbody_photons


def planck(wavelength, temperature):
    """Photon radiance, up to a constant."""
    return wavelength**-4 / (np.exp(h * c / (wavelength * k * temperature)) - 1)


def test_the_band_is_the_integral():
    value, _ = quad(lambda x: planck(x * 1e-9, 4500) / planck(550e-9, 4500), 580, 680)
    expected = _ZERO_MAGNITUDE * 1e-9 * value
    assert blackbody_band(0.0, 4500, 580e-9, 680e-9) == pytest.approx(
        expected, rel=1e-9
    )


def test_the_zero_point_is_about_a_thousand_photons_per_square_centimetre_and_angstrom():
    """The figure of the textbooks, 1000 photons/(s cm^2 angstrom) at V = 0."""
    per_square_centimetre_and_angstrom = _ZERO_MAGNITUDE * 1e-4 * 1e-10
    assert per_square_centimetre_and_angstrom == pytest.approx(1000, rel=0.02)


def test_very_cool_stars_do_not_overflow():
    assert 0 <= _blackbody_photons(400e-9, 10.0) < 1e-100


@pytest.mark.parametrize(
    ("wavelength", "low", "high", "message"),
    [
        ([600e-9, 400e-9], 410e-9, 420e-9, "^wavelength: "),
        ([400e-9, 600e-9], 410e-9, 700e-9, "^wavelength: "),
        ([400e-9, 600e-9], 450e-9, 410e-9, "^low: "),
    ],
)
def test_bad_tables_are_refused(wavelength, low, high, message):
    with pytest.raises(ValueError, match=message):
        tabulated_star(0.0, wavelength, [1.0, 1.0], low, high)


def test_a_tabulated_blackbody_is_the_blackbody():
    """Whatever the unit of its table; but for the curvature of the spectrum over 10 nm."""
    wavelength = np.linspace(390e-9, 690e-9, 3001)
    for temperature in (3500.0, 15000.0):
        table = 7e11 * planck(wavelength, temperature)
        for edges in ((400e-9, 500e-9), (580e-9, 680e-9)):
            found = tabulated_star([3.0, 5.0], wavelength, table, *edges)
            expected = blackbody_band([3.0, 5.0], temperature, *edges)
            assert_allclose(found, expected, rtol=1e-3)


def test_a_table_without_light_at_550_nm_is_refused():
    with pytest.raises(ValueError, match="photons"):
        tabulated_star(0.0, [400e-9, 700e-9], [0.0, 0.0], 400e-9, 500e-9)
    with pytest.raises(ValueError, match=r"^wavelength: "):
        tabulated_star(0.0, [600e-9, 700e-9], [1.0, 1.0], 600e-9, 700e-9)
