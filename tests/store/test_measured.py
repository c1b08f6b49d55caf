"""Catalogue stars and spectra, compared with other catalogues and calibrations."""

import numpy as np
import pytest

from reproduce.store import measured

# Hipparcos places (J2000, degrees) of four bright stars by Bright Star number.
KNOWN = {
    2491: (101.2872, -16.7161, -1.46),  # Sirius
    7001: (279.2347, 38.7837, 0.03),  # Vega
    424: (37.9546, 89.2641, 2.02),  # Polaris
    2061: (88.7929, 7.4071, 0.50),  # Betelgeuse
}


@pytest.mark.parametrize("number", KNOWN)
def test_known_stars_stand_where_they_should(number):
    numbers, directions, magnitudes = measured.bright_stars()
    (row,) = np.flatnonzero(numbers == number)
    alpha, delta, magnitude = KNOWN[number]
    expected = [
        np.cos(np.radians(delta)) * np.cos(np.radians(alpha)),
        np.cos(np.radians(delta)) * np.sin(np.radians(alpha)),
        np.sin(np.radians(delta)),
    ]
    assert np.degrees(np.arccos(directions[row] @ expected)) < 0.002
    assert magnitudes[row] == pytest.approx(magnitude, abs=0.06)


def test_entries_without_a_place_are_no_stars():
    """The catalogue has 9,110 entries; 14 of them are novae, clusters and nebulae."""
    numbers, directions, _ = measured.bright_stars()
    assert numbers.max() == 9110
    assert len(numbers) == len(directions) == 9110 - 14


def test_vega_is_as_bright_as_its_calibration_says():
    """3.47e-9 erg/(s cm^2 angstrom) at 555.6 nm (Megessier 1995), in photons; V of the Sun."""
    wavelength, vega = measured.spectra()["vega"]
    expected = 3.47e-2 / (6.62607015e-34 * 299792458 / 555.6e-9)
    at = np.interp(555.6e-9, wavelength, vega)
    assert at == pytest.approx(expected, rel=0.01)
    _, sun = measured.spectra()["sun"]
    ratio = np.interp(550e-9, wavelength, sun) / np.interp(550e-9, wavelength, vega)
    assert -2.5 * np.log10(ratio) == pytest.approx(-26.75 - 0.03, abs=0.06)
