"""Equations of the papers that fail as extracted, run on printed numbers.

Each violates a property: a matrix is not a rotation, an identity is wrong, or an iteration
diverges. The corrected result is from the form in this package.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from reproduce.physics import attitude, ground, optics, raytrace, registration
from reproduce.physics.attitude import rotation_from_vector
from reproduce.printed.cells import PrintedCell
from reproduce.printed.number import si_factor

_ITERATION_STEPS = 5
_ARCSEC = si_factor("arcsec")
# Returns the number of a printed cell in SI units.
_Number = Callable[[str], float]
# Results of the extracted form and of the corrected form.
_Values = tuple[Any, Any]


@dataclass(frozen=True)
class Demonstration:
    """An equation, run as extracted.

    - `name`: name of the equation.
    - `printed`, `right`: result of the extracted form, and of the corrected form.
    - `place`: passage of the paper.
    - `asked`: the test.
    - `meaning`: the compared quantity.
    - `assumption`: assumption that the paper does not state.
    """

    name: str
    printed: float
    right: float
    place: str
    asked: str
    meaning: str
    assumption: str = ""


def demonstrations(
    cells: Mapping[str, PrintedCell], texts: Mapping[str, Any]
) -> tuple[Demonstration, ...]:
    """Run the equations that a paper declares, with their texts by name."""
    return tuple(
        Demonstration(name, float(printed), float(right), **text)
        for name, text in texts.items()
        for printed, right in [_RUNS[name](lambda a: cells[a].si)]
    )


def _distortion_ratio(number: _Number) -> _Values:
    k = number("niu2024/table-2#scale.red")
    green, red = (
        number(f"niu2024/table-1#radial-distortion.{c}") for c in ("green", "red")
    )
    right = optics.distortion_ratio(k, green, red)
    # The second line of (7) sets y'_g where the first line sets x'_b: one factor k is lost.
    return k**2 * green / red, right


def _rotary_matrix(number: _Number) -> _Values:
    turn = number("niu2024/text-simulation#range-x-high")
    printed = np.linalg.det(optics.rotary_matrix_printed(0.0, turn))
    return printed, np.linalg.det(optics.rotary_matrix(0.0, turn))


def _unit_circle(number: _Number) -> _Values:
    turn = number("niu2024/table-2#rotation.red")
    cosine, sine = np.cos(turn), np.sin(turn)
    return 2 * cosine**2 - 1, cosine**2 + sine**2 - 1


def _iteration(number: _Number) -> _Values:
    rows = ("scale", "rotation", "translation-x", "translation-y")
    truth = np.array([number(f"niu2024/table-2#{row}.red") for row in rows])
    size = np.array([number(f"niu2024/text-optics#pixels-{a}") for a in "xy"])
    source = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]) * (size - 1)
    middle = optics.detector_centre(size)
    target = registration.Registration("similarity", truth, middle).apply(source)
    errors = []
    for step in (
        registration.gauss_newton_step_printed,
        registration.gauss_newton_step,
    ):
        estimate = np.array([1.0, 0.0, 0.0, 0.0])
        for _ in range(_ITERATION_STEPS):
            estimate = step(estimate, source, target, middle)
        errors.append(np.linalg.norm((estimate - truth)[2:]))
    return errors[0], errors[1]


def _lasers(number: _Number) -> tuple[Any, float]:
    """Return the positions of the lasers in the focal plane, and the focal length."""
    half = number("chen2023/text-hardware#laser-diagonal") / 2
    positions = half * np.array([[0.0, -1.0], [-1.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    return positions, number("chen2023/table-2#telescope-focal-length.value")


def _roll_leak(number: _Number) -> _Values:
    """Roll the camera about its boresight, and compute (5) in both orders."""
    tracker = "chen2023/table-2#tracker-"
    spots = np.array(
        [[number(f"chen2023/text-platform#spot-{i}-{a}") for a in "xy"] for i in "1234"]
    )
    size = [number(f"{tracker}pixels-{a}.value") for a in "xy"]
    scale = number(f"{tracker}pixel-size.value") / number(
        f"{tracker}focal-length.value"
    )
    across, along = (spots.mean(axis=0) - optics.detector_centre(size)) * scale
    reference = rotation_from_vector(np.array([-along, across, 0.0]))
    rolled = reference @ rotation_from_vector(np.array([0.0, 0.0, 60 * _ARCSEC]))
    forms = rolled @ reference.T, attitude.misalignment_between(rolled, reference)
    angles = [attitude.misalignment_angles(form) for form in forms]
    first, second = (np.hypot(*angle[:2]) / _ARCSEC for angle in angles)
    return first, second


def _stage_angle(number: _Number) -> _Values:
    travel = number("chen2023/text-effectiveness#maximum-travel")
    focal = number("chen2023/text-effectiveness#focal-length")
    printed = attitude.stage_angle_printed(travel, focal)
    return printed / _ARCSEC, attitude.stage_angle(travel, focal) / _ARCSEC


def _stage_signs(number: _Number) -> _Values:
    """Move the lasers along Y. The sense of the rotation follows from (5) and (7)."""
    positions, focal = _lasers(number)
    shift = number("chen2023/text-effectiveness#step")
    before, after = (
        attitude.emitted_directions(positions + np.array([0.0, moved]), focal)
        for moved in (0.0, shift)
    )
    measured = attitude.misalignment(before, after, np.eye(3))
    angle = attitude.misalignment_angles(measured)[0]
    return np.sign(attitude.stage_angle(shift, focal)), np.sign(angle)


def _misalignment_side(number: _Number) -> _Values:
    """Use the inverse of the matrix of (8) as R_U, and compare the lines of sight."""
    turn = number("chen2023/text-effectiveness#simulated-angle")
    boresights = number("chen2023/text-satellite#boresight-angle")
    installed = rotation_from_vector(np.array([boresights, 0.0, 0.0]))
    gaps = []
    for axis in np.eye(2, 3):
        moved = rotation_from_vector(turn * axis)
        corrected = installed @ moved.T  # (8), inverted
        forms = moved.T, attitude.misalignment_in_tracker(moved, installed)
        gaps.append(
            [np.linalg.norm((form @ installed - corrected)[:, 2]) for form in forms]
        )
    printed, right = np.max(gaps, axis=0) / _ARCSEC
    return printed, right


def _line_of_sight(number: _Number) -> _Values:
    """Compare the bracket of (1) with the direction (2) of one point of the focal plane."""
    positions, focal = _lasers(number)
    bracket = ground.image_vectors(positions[:1], focal)[0]
    emitted = attitude.emitted_directions(positions[:1], focal)[0]
    cosine = bracket @ emitted / np.linalg.norm(bracket)
    # With a negative scaling factor the bracket changes its sign.
    return cosine, -cosine


def _mirrored_pattern(number: _Number) -> _Values:
    """Transfer a direction of (2) to (3), by a corner cube and the dichroic mirror."""
    tilt = number("chen2023/text-satellite#dihedral-angle")
    fold = raytrace.reflection([0.0, np.sin(tilt), np.cos(tilt)])
    # A received direction points back along the light.
    satellite = -fold @ raytrace.mirror_train(raytrace.CORNER)
    mirrored = satellite @ np.diag([1.0, -1.0, 1.0])  # the lasers of a mirrored pattern
    return np.linalg.det(satellite), np.linalg.det(mirrored)


_RUNS: dict[str, Callable[[_Number], _Values]] = {
    "distortion-ratio": _distortion_ratio,
    "rotary-matrix": _rotary_matrix,
    "unit-circle": _unit_circle,
    "iteration": _iteration,
    "misalignment-side": _misalignment_side,
    "stage-angle": _stage_angle,
    "stage-signs": _stage_signs,
    "roll-leak": _roll_leak,
    "line-of-sight": _line_of_sight,
    "mirrored-pattern": _mirrored_pattern,
}
