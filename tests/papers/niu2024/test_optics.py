"""Tests of the camera of niu2024 against calculations by hand."""

import pytest

from reproduce.papers.niu2024 import optics
from reproduce.printed.inputs import load_inputs


def test_centre_wavelengths_under_both_readings():
    """By hand: bands of 400-500, 490-590 and 580-680 nm; starlight of 400-700 nm in thirds."""
    by_hand = {"band": (450, 540, 630), "third": (450, 550, 650)}
    for centre, expected in by_hand.items():
        computation = optics.centre_wavelengths.with_options({"centre": centre})
        found = computation(load_inputs(computation.inputs))
        values = [
            found[f"centre-wavelength-{band}"] * 1e9
            for band in ("blue", "green", "red")
        ]
        assert values == pytest.approx(expected)
