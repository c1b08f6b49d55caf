"""The camera of niu2024: what its bands say of its colours, by hand."""

import numpy as np

from reproduce.papers.niu2024 import optics
from reproduce.printed.given import given


def test_centre_wavelengths_under_both_readings():
    """By hand: bands of 400-500, 490-590 and 580-680 nm; starlight of 400-700 nm in thirds."""
    door = given([*optics.centre_wavelengths.given])
    by_hand = {"blue": (450, 450), "green": (540, 550), "red": (630, 650)}
    for band, expected in by_hand.items():
        np.testing.assert_allclose(np.array(optics._middles(door, band)) * 1e9, expected)
