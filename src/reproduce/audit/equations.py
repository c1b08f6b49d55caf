"""Equations cross-examined with themselves: each is run as extracted, on printed numbers.

A matrix that should be a rotation, an identity, a dimension, an iteration that should converge, a
chain of frames that should close. Where our text of it fails, the right form runs beside it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from reproduce.audit.rounding import Sheet
from reproduce.physics import attitude, light, optics, registration
from reproduce.physics.attitude import rotation_from_vector
from reproduce.physics.optics import (
    detector_centre,
    rotary_matrix,
    rotary_matrix_printed,
    turned_onto_detector,
)
from reproduce.physics.registration import constraint, constraint_printed
from reproduce.physics.validate import FloatArray
from reproduce.printed.units import si_factor

# Far above the noise of double precision, far below any digit of print.
_ZERO = 1e-9
STEPS = 5


@dataclass(frozen=True)
class Demonstration:
    """An equation run as printed: what it was asked, what it gives, and what it should give.

    `right` is what the form that the library uses gives, `meaning` what the numbers are, and
    `supposition` what the run supposes that the paper does not say; empty where it supposes
    nothing.
    """

    name: str
    place: str
    asked: str
    printed: float
    right: float
    wanted: float
    meaning: str
    supposition: str = ""

    @property
    def holds(self) -> bool:
        """Whether the printed form does what it must."""
        return abs(self.printed - self.wanted) <= _ZERO * max(1.0, abs(self.wanted))

    @property
    def mended(self) -> bool:
        """Whether the form that the library uses does."""
        return abs(self.right - self.wanted) <= _ZERO * max(1.0, abs(self.wanted))


def _distortion_ratio(cells: Sheet) -> Demonstration:
    k = cells["niu2024/table-2#scale.red"].si
    ours, theirs = (cells[f"niu2024/table-1#radial-distortion.{c}"].si for c in ("green", "red"))
    right = float(optics.distortion_ratio(k, ours, theirs))
    # The second line of (7) sets y'_g where the first line sets x'_b: one factor k is lost.
    printed = k**2 * ours / theirs
    asked = "the ratio of distortions must be the same along x and y"
    return Demonstration("distortion-ratio", "(7)", asked, printed, right, right, "ratio along y")


def _turned_back(cells: Sheet) -> Demonstration:
    angle = cells["niu2024/table-2#rotation.red"].si
    start = np.array([[3.0, 4.0]])
    cosine, sine = np.cos(angle), np.sin(angle)
    back = turned_onto_detector(start, angle) @ np.array([[cosine, -sine], [sine, cosine]]).T
    left = float(np.abs(back - start).max())
    asked = "the rotation of (13) must undo that of (22) and (23)"
    return Demonstration("turned-back", "(13), (22), (23)", asked, left, left, 0.0, "what is left")


def _rotary(cells: Sheet) -> Demonstration:
    turn = cells["niu2024/text-simulation#range-x-high"].si
    printed, right = (
        float(np.linalg.det(form(0.0, turn))) for form in (rotary_matrix_printed, rotary_matrix)
    )
    asked = "a rotation matrix must have determinant one"
    meaning = "determinant at the largest angle"
    return Demonstration("rotary-matrix", "(20)", asked, printed, right, 1.0, meaning)


def _constraint(cells: Sheet) -> Demonstration:
    turn = cells["niu2024/table-2#rotation.red"].si
    printed, right = float(constraint_printed(turn)), float(constraint(turn))
    asked, meaning = "cosine and sine must lie on the unit circle", "excess at a printed angle"
    return Demonstration("unit-circle", "section 3.2", asked, printed, right, 0.0, meaning)


def _corners(cells: Sheet) -> tuple[FloatArray, FloatArray]:
    """Return the corners of the detector, and its middle."""
    size = np.array([cells[f"niu2024/text-optics#pixels-{a}"].si for a in "xy"])
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]]) * (size - 1)
    return corners, detector_centre(size)


def _iteration(cells: Sheet) -> Demonstration:
    rows = ("scale", "rotation", "translation-x", "translation-y")
    truth = np.array([cells[f"niu2024/table-2#{row}.red"].si for row in rows])
    source, middle = _corners(cells)
    target = registration.Registration("similarity", truth, middle).apply(source)
    errors = []
    for step in (registration.gauss_newton_step_printed, registration.gauss_newton_step):
        found = np.array([1.0, 0.0, 0.0, 0.0])
        for _ in range(STEPS):
            found = step(found, source, target, middle)
        errors.append(float(np.linalg.norm((found - truth)[2:])))
    asked = f"an iteration must approach the solution; after {STEPS} steps the error must be gone"
    meaning = "error of the translation in pixels"
    return Demonstration("iteration", "(24), (25)", asked, errors[0], errors[1], 0.0, meaning)


def _laser_geometry(cells: Sheet) -> tuple[FloatArray, float]:
    half = cells["chen2023/text-hardware#laser-diagonal"].si / 2
    places = np.array([[0.0, -half], [-half, 0.0], [half, 0.0], [0.0, half]])
    return places, cells["chen2023/table-2#telescope-focal-length.value"].si


def _unit_vectors(cells: Sheet) -> Demonstration:
    length = float(np.linalg.norm(attitude.emitted_directions(*_laser_geometry(cells)), axis=-1)[0])
    asked = "a direction must have length one"
    return Demonstration("unit-vectors", "(2), (3)", asked, length, length, 1.0, "length")


def _chain(cells: Sheet) -> Demonstration:
    """Close the chain (4), (6), (7): the misalignment put in must come out."""
    camera = attitude.emitted_directions(*_laser_geometry(cells))
    zero = rotation_from_vector(np.array([0.3, -1.2, 0.5]))
    turned = rotation_from_vector(np.array([1e-5, -2e-5, 3e-5]))
    moved = attitude.moved_laser_transform(zero, turned)
    seen = camera @ moved.T  # w = T v, one row for each laser
    left = float(np.abs(camera - seen @ (turned @ zero.T).T).max())
    asked = "the misalignment put in by (6) must make (7) vanish"
    return Demonstration("chain", "(4), (6), (7)", asked, left, left, 0.0, "largest residual")


def _retroreflector(cells: Sheet) -> Demonstration:
    """Turn the reflector of the satellite, read as a corner cube, about three axes."""
    beam, turn = np.array([0.0, 0.0, -1.0]), si_factor("arcsec")
    straight = light.mirror_train(light.CORNER) @ beam
    turns = [rotation_from_vector(turn * axis) for axis in np.eye(3)]
    returned = [light.mirror_train(light.CORNER @ turned.T) @ beam for turned in turns]
    moved = max(float(np.linalg.norm(one - straight)) / turn for one in returned)
    asked = "the returning beam must not turn with the retroreflector, about whatever axis"
    meaning = "arcseconds by which the beam turns for each of the reflector, about the worst axis"
    return Demonstration("retroreflector", "II-B", asked, moved, moved, 0.0, meaning)


def _roll_leak(cells: Sheet) -> Demonstration:
    """Roll the camera about its boresight, and take the error of (5) in the two orders."""
    t = "chen2023/table-2#tracker-"
    spots = np.array(
        [[cells[f"chen2023/text-platform#spot-{i}-{a}"].si for a in "xy"] for i in "1234"]
    )
    middle = detector_centre([cells[f"{t}pixels-{a}.value"].si for a in "xy"])
    scale = cells[f"{t}pixel-size.value"].si / cells[f"{t}focal-length.value"].si
    across, along = (spots.mean(axis=0) - middle) * scale
    reference = rotation_from_vector(np.array([-along, across, 0.0]))
    rolled = reference @ rotation_from_vector(np.array([0.0, 0.0, 60 * si_factor("arcsec")]))
    errors = [
        float(np.hypot(*attitude.misalignment_angles(form(rolled, reference))[:2]))
        / si_factor("arcsec")
        for form in (attitude.transform_error_printed, attitude.misalignment_between)
    ]
    asked = "a roll of the camera must not count as an error about X and Y"
    meaning = "arcseconds about X and Y for a roll of one arcminute"
    place, supposed = "V-B, behind Fig. 8", "the tracker's boresight meets its detector's centre"
    return Demonstration("roll-leak", place, asked, errors[0], errors[1], 0.0, meaning, supposed)


def _stage_angle(cells: Sheet) -> Demonstration:
    travel = cells["chen2023/text-effectiveness#maximum-travel"].si
    focal = cells["chen2023/text-effectiveness#focal-length"].si
    arcsec = si_factor("arcsec")
    printed, right = (
        float(form(travel, focal)) / arcsec
        for form in (attitude.stage_angle_printed, attitude.stage_angle)
    )
    asked = "a length moved behind a focal length must turn the beam by their ratio"
    wanted = -float(np.arctan(travel / focal)) / arcsec
    meaning = "angle in arcseconds, the printed form with metres"
    return Demonstration("stage-angle", "(10)", asked, printed, right, wanted, meaning)


def _stage_signs(cells: Sheet) -> Demonstration:
    """Move the lasers along Y and let (5) and (7) measure which way the camera seems to turn."""
    places, focal = _laser_geometry(cells)
    shift = cells["chen2023/text-effectiveness#step"].si
    before, after = (
        attitude.emitted_directions(places + np.array([0.0, moved]), focal)
        for moved in (0.0, shift)
    )
    found = attitude.misalignment(before, after, np.eye(3))
    angles = (
        attitude.stage_angle(shift, focal),
        attitude.stage_angles([0.0, shift], focal)[0],
        attitude.misalignment_angles(found)[0],
    )
    printed, right, wanted = (float(np.sign(float(angle))) for angle in angles)
    asked = "with right-handed axes (10) must have the sign that (7) measures about X"
    supposed = "the angles about X and Y are both right-handed"
    meaning = "sign of the angle about X"
    return Demonstration("stage-signs", "(10)", asked, printed, right, wanted, meaning, supposed)


def _misalignment_side(cells: Sheet) -> Demonstration:
    """Set the inverse of the matrix of (8) in the place of R_U, and compare the lines of sight."""
    turn = cells["chen2023/text-effectiveness#simulated-angle"].si
    boresights = cells["chen2023/text-satellite#boresight-angle"].si
    installed = rotation_from_vector(np.array([boresights, 0.0, 0.0]))
    gaps = []
    for axis in np.eye(2, 3):
        moved = rotation_from_vector(turn * axis)
        corrected = installed @ moved.T  # (8), inverted
        forms = moved.T, attitude.misalignment_in_tracker(moved, installed)
        gaps.append([np.linalg.norm((form @ installed - corrected)[:, 2]) for form in forms])
    printed, right = (float(gap) for gap in np.max(gaps, axis=0) / si_factor("arcsec"))
    asked = (
        "the inverse of the matrix of (8), in the place of R_U, must give the same line of sight"
    )
    supposed = "R_U of (1) is the matrix of (8), or its inverse"
    meaning = "arcseconds between the lines of sight, for the simulated angle about the worse axis"
    return Demonstration(
        "misalignment-side", "(1), (8)", asked, printed, right, 0.0, meaning, supposed
    )


_RUNS: dict[str, tuple[Callable[[Sheet], Demonstration], ...]] = {
    "niu2024": (_distortion_ratio, _turned_back, _rotary, _constraint, _iteration),
    "chen2023": (
        *(_unit_vectors, _chain, _misalignment_side),
        *(_stage_angle, _stage_signs, _retroreflector, _roll_leak),
    ),
}


def demonstrations(paper: str, cells: Sheet) -> list[Demonstration]:
    """Run the equations of a paper as printed, in order of print; none if none are declared."""
    return [run(cells) for run in _RUNS.get(paper, ())]
