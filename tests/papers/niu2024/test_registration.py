"""Table 2 against the print of Table 1, by hand."""

import pytest

from reproduce.papers.niu2024 import registration
from reproduce.printed.given import given

FOCAL = {"red": 25.0601, "green": 25.0, "blue": 24.95}
POINTS = {"red": (1033.9, 774.3), "green": (1032.0, 772.0), "blue": (1030.6, 770.4)}


@pytest.fixture
def door():
    return given(["niu2024/table-1#*"])


@pytest.mark.parametrize("channel", ["red", "blue"])
def test_the_scale_is_greens_focal_length_over_the_channels(door, channel):
    found = registration.true_scale(door)
    assert found[f"scale.{channel}"] == pytest.approx(
        FOCAL["green"] / FOCAL[channel], rel=1e-12
    )


@pytest.mark.parametrize("channel", ["red", "blue"])
def test_the_shift_leads_from_greens_principal_point_to_the_channels(door, channel):
    found = registration.true_translation(door)
    shift = [found[f"translation-{axis}.{channel}"] for axis in "xy"]
    by_hand = [a - b for a, b in zip(POINTS[channel], POINTS["green"], strict=True)]
    assert shift == pytest.approx(by_hand, abs=1e-9)
