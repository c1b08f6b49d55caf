"""Tests of Table 2 against calculations by hand from Table 1."""

import pytest

from reproduce.papers.niu2024 import registration
from reproduce.printed.inputs import load_inputs

FOCAL = {"red": 25.0601, "green": 25.0, "blue": 24.95}
POINTS = {"red": (1033.9, 774.3), "green": (1032.0, 772.0), "blue": (1030.6, 770.4)}


def test_scales_and_shifts_by_hand():
    inputs = load_inputs(["niu2024/table-1#*"])
    scales = registration.true_scale(inputs)
    shifts = registration.true_translation(inputs)
    for channel in ("red", "blue"):
        scale = FOCAL["green"] / FOCAL[channel]
        assert scales[f"scale.{channel}"] == pytest.approx(scale, rel=1e-12)
        for i, axis in enumerate("xy"):
            shift = POINTS[channel][i] - POINTS["green"][i]
            found = shifts[f"translation-{axis}.{channel}"]
            assert found == pytest.approx(shift, abs=1e-9)
