"""The star catalogue against places anyone can look up."""

import numpy as np
import pytest

from reproduce.store import stars

# Hipparcos places (J2000, degrees) of four bright stars by Bright Star number.
KNOWN = {
    2491: (101.2872, -16.7161, -1.46),  # Sirius
    7001: (279.2347, 38.7837, 0.03),  # Vega
    424: (37.9546, 89.2641, 2.02),  # Polaris
    2061: (88.7929, 7.4071, 0.50),  # Betelgeuse
}


@pytest.mark.parametrize("number", KNOWN)
def test_known_stars_stand_where_they_should(number):
    found = stars.bright_stars()
    (row,) = np.flatnonzero(found.number == number)
    alpha, delta, magnitude = KNOWN[number]
    expected = [
        np.cos(np.radians(delta)) * np.cos(np.radians(alpha)),
        np.cos(np.radians(delta)) * np.sin(np.radians(alpha)),
        np.sin(np.radians(delta)),
    ]
    assert np.degrees(np.arccos(found.directions[row] @ expected)) < 0.002
    assert found.magnitude[row] == pytest.approx(magnitude, abs=0.06)


def test_the_catalogue_is_whole():
    found = stars.bright_stars()
    assert len(found.number) == 9096
    np.testing.assert_allclose(np.linalg.norm(found.directions, axis=1), 1.0)
    assert -1.5 < found.magnitude.min() < found.magnitude.max() < 8.0


def test_a_damaged_file_is_refused(tmp_path, monkeypatch):
    (tmp_path / "stars").mkdir()
    (tmp_path / "stars" / "bsc5.dat").write_bytes(b"\0" * 100)
    monkeypatch.setattr(stars, "data_folder", lambda: tmp_path)
    with pytest.raises(ValueError, match="restore the file"):
        stars.bright_stars.__wrapped__()
