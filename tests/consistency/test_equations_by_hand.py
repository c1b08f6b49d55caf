"""Results of equations, run as extracted, computed again without matrices."""

import math

import pytest
from made_up import finding

from reproduce.consistency.report import audit_paper

AUDIT = audit_paper("chen2023")
SHOWN = {shown.name: shown for shown in AUDIT.equations}
ARCSEC = math.radians(1 / 3600)


def number(address):
    return AUDIT.cells[f"chen2023/{address}"].si


def test_a_roll_leaks_by_the_distance_of_the_spots_from_the_boresight():
    spots = [[number(f"text-platform#spot-{i}-{a}") for a in "xy"] for i in "1234"]
    table = "table-2#tracker-"
    pixels = [number(f"{table}pixels-{a}.value") for a in "xy"]
    # The middle of 1024 pixels, the first at zero, is at 511.5.
    off = [sum(s[i] for s in spots) / 4 - (pixels[i] - 1) / 2 for i in (0, 1)]
    slope = number(f"{table}pixel-size.value") / number(f"{table}focal-length.value")
    leak = 60 * math.sin(math.hypot(*off) * slope)
    assert SHOWN["roll-leak"].printed == pytest.approx(leak, rel=1e-6)


def test_a_misalignment_on_the_wrong_side_turns_about_another_axis():
    """The installation tilts the axes of camera and tracker about X."""
    turn, angle = (
        number(f"text-{cell}")
        for cell in ("effectiveness#simulated-angle", "satellite#boresight-angle")
    )
    off = turn * (1 - math.cos(angle)) / ARCSEC
    assert SHOWN["misalignment-side"].printed == pytest.approx(off, rel=1e-6)
    assert SHOWN["misalignment-side"].assumption


def test_the_bracket_of_the_imaging_model_is_the_negative_of_an_emitted_direction():
    """Difference of coordinates and −f against its negative and +f, multiplied out by hand."""
    shown, y = SHOWN["line-of-sight"], -number("text-hardware#laser-diagonal") / 2
    focal = number("table-2#telescope-focal-length.value")
    cosine = (y * -y - focal * focal) / (y**2 + focal**2)
    assert shown.printed == pytest.approx(cosine)
    assert shown.assumption


def test_four_mirrors_are_no_rotation_and_three_are():
    """A rotation keeps right-handed triples; reflections and the reversal of light swap them."""
    reversal, dichroic = -1, -1
    assert SHOWN["mirrored-pattern"].printed == pytest.approx(
        reversal * dichroic * (-1) ** 3
    )
    assert reversal * dichroic * (-1) ** 2 == SHOWN["mirrored-pattern"].wanted


def test_the_laser_lies_in_one_band_of_the_camera_only():
    laser = number("text-satellite#laser-wavelength")
    names = ["panchromatic-band", *(f"multispectral-band-{i}" for i in "1234")]
    edges = {
        n: [number(f"table-1#{n}-{e}.value") for e in ("low", "high")] for n in names
    }
    assert [n for n, (low, high) in edges.items() if low <= laser <= high] == [
        names[-1]
    ]
    assert finding(AUDIT, "band-4-below-laser").outcome == "contradicts"
