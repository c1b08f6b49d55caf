"""Table IV against answers that do not come from it."""

import numpy as np
import pytest

from reproduce.papers.chen2023 import accuracy
from reproduce.papers.chen2023.platform import scatter
from reproduce.physics.attitude import attitude_accuracy
from reproduce.printed.inputs import load_inputs

INPUTS = load_inputs(accuracy.INPUTS)


@pytest.fixture(scope="module")
def predicted():
    return accuracy.frame_averaging(INPUTS, 400)


def test_a_single_frame_agrees_with_the_papers_formula(predicted):
    """(11) with the mean scatter of Table III, per axis: about X the error is that along Y."""
    pixel = np.arctan2(13e-6, 60e-3)
    for group, matrix in ((1, "transform"), (2, "misalignment")):
        spots = scatter(INPUTS, group)
        for axis, across in (("x", 1), ("y", 0)):
            delta = 3 * np.sqrt((spots[:, across] ** 2).mean())
            formula = float(attitude_accuracy(delta, 4, pixel))
            draws = predicted[f"1.{matrix}-{axis}"]
            assert np.median(draws) == pytest.approx(formula, rel=0.02)


def test_long_averages_are_uncertain_by_themselves(predicted):
    """Few averages over 100 of 800 frames are independent: scatter of the scatter."""
    for count, low, high in ((1, 0.02, 0.03), (49, 0.12, 0.19), (100, 0.17, 0.28)):
        draws = predicted[f"{count}.transform-x"]
        assert low < draws.std() / draws.mean() < high
