"""Equations run as printed: what they give, by a second way that needs no matrices."""

import math

import pytest

from reproduce.audit.report import audit_paper

AUDIT = audit_paper("chen2023")
SHOWN = {shown.name: shown for shown in AUDIT.equations}
ARCSEC = math.radians(1 / 3600)


def number(address):
    return AUDIT.cells[f"chen2023/{address}"].si


def test_a_misalignment_on_the_wrong_side_turns_the_boresight_by_half_as_much_again():
    """The tracker's Y is the camera's Y, but its boresight is 120 degrees off.

    On the camera's side a turn about Y moves the camera's boresight by the whole turn; on the
    tracker's side it moves the same line by the cosine of 120 degrees of it, the other way.
    """
    turn = number("text-effectiveness#simulated-angle")
    apart = turn * (1 - math.cos(number("text-design#boresight-angle")))
    assert SHOWN["misalignment-side"].printed == pytest.approx(apart / ARCSEC, rel=1e-3)


def test_two_mirrors_turn_the_beam_twice_as_far_and_three_leave_it():
    assert SHOWN["retroreflector"].printed == pytest.approx(2.0, rel=1e-6)
    assert SHOWN["retroreflector"].right == pytest.approx(0.0, abs=1e-9)


def test_a_roll_leaks_by_the_distance_of_the_spots_from_the_boresight():
    spots = [[number(f"text-extraction#spot-{i}-{a}") for a in "xy"] for i in "1234"]
    table = "table-2#tracker-"
    pixels = [number(f"{table}pixels-{a}.value") for a in "xy"]
    # The middle of 1024 pixels numbered from 0 is at 511.5.
    off = [sum(s[i] for s in spots) / 4 - (pixels[i] - 1) / 2 for i in (0, 1)]
    slope = number(f"{table}pixel-size.value") / number(f"{table}focal-length.value")
    leak = 60 * math.sin(math.hypot(*off) * slope)
    assert SHOWN["roll-leak"].printed == pytest.approx(leak, rel=1e-6)
