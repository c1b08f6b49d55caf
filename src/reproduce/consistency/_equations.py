"""Equations of the papers, run as extracted, on printed numbers.

Each has a property that can be tested: a matrix is a rotation, an identity holds, an iteration
converges, or a chain of frames closes. The form of this package runs next to the extracted form.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import KW_ONLY, dataclass
from math import isclose
from typing import Any

import numpy as np

from reproduce.physics import attitude, ground, optics, raytrace, registration
from reproduce.physics.attitude import rotation_from_vector
from reproduce.printed.cells import PrintedCell
from reproduce.printed.inputs import ROOT_SEED, Inputs
from reproduce.units import RADIANS_PER_ARCSEC

# Far above the noise of double precision, far below any printed digit.
_ZERO_TOLERANCE = 1e-9
_ITERATION_STEPS = 5
# Results of the extracted form and of the form of this package, and the correct result.
_Values = tuple[Any, Any, Any]


@dataclass(frozen=True)
class Demonstration:
    """An equation, run as extracted.

    - `name`: name of the equation.
    - `printed`, `right`, `wanted`: result of the extracted form, of the form of this package, and
      the correct result.
    - `place`: passage of the paper.
    - `asked`: the test.
    - `meaning`: the compared quantity.
    - `assumption`: assumption that the paper does not state.
    """

    name: str
    printed: float
    right: float
    wanted: float
    _: KW_ONLY
    place: str
    asked: str
    meaning: str
    assumption: str = ""

    @property
    def holds(self) -> bool:
        """Whether the extracted form gives the correct result."""
        return isclose(
            self.printed, self.wanted, rel_tol=_ZERO_TOLERANCE, abs_tol=_ZERO_TOLERANCE
        )


def demonstrations(
    cells: Mapping[str, PrintedCell], texts: Mapping[str, Any]
) -> list[Demonstration]:
    """Run the equations that a paper declares, with their texts by name."""
    inputs = Inputs(cells, ROOT_SEED)
    return [
        Demonstration(name, *map(float, _RUNS[name](inputs)), **text)
        for name, text in texts.items()
    ]


def _distortion_ratio(inputs: Inputs) -> _Values:
    k = inputs["niu2024/table-2#scale.red"]
    red, green, _ = inputs.array("niu2024/table-1#radial-distortion.*")
    right = optics.distortion_ratio(k, green, red)
    # The second line of (7) sets y'_g where the first line sets x'_b: one factor k is lost.
    return k**2 * green / red, right, right


def _turned_back(inputs: Inputs) -> _Values:
    angle = inputs["niu2024/table-2#rotation.red"]
    start = [[3.0, 4.0]]
    cosine, sine = np.cos(angle), np.sin(angle)
    turned = optics.turned_onto_detector(start, angle)
    back = turned @ [[cosine, sine], [-sine, cosine]]
    residual = np.abs(back - start).max()
    return residual, residual, 0.0


def _rotary_matrix(inputs: Inputs) -> _Values:
    turn = inputs["niu2024/text-simulation#range-x-high"]
    printed = np.linalg.det(optics.rotary_matrix_printed(0.0, turn))
    return printed, np.linalg.det(optics.rotary_matrix(0.0, turn)), 1.0


def _unit_circle(inputs: Inputs) -> _Values:
    turn = inputs["niu2024/table-2#rotation.red"]
    cosine, sine = np.cos(turn), np.sin(turn)
    return 2 * cosine**2 - 1, cosine**2 + sine**2 - 1, 0.0


def _iteration(inputs: Inputs) -> _Values:
    truth = inputs.array("niu2024/table-2#*.red")  # as the parameters of the model
    size = inputs.array("niu2024/text-optics#pixels-?")
    source = np.array([*np.ndindex(2, 2)]) * (size - 1)
    middle = optics.detector_centre(size)
    target = registration.Registration("similarity", truth, middle).apply(source)
    errors = []
    for step in (
        registration.gauss_newton_step_printed,
        registration.gauss_newton_step,
    ):
        estimate = np.eye(4)[0]
        for _ in range(_ITERATION_STEPS):
            estimate = step(estimate, source, target, middle)
        errors.append(np.linalg.norm((estimate - truth)[2:]))
    return errors[0], errors[1], 0.0


def _lasers(inputs: Inputs) -> tuple[Any, float]:
    """Return the positions of the lasers in the focal plane, and the focal length."""
    half = inputs["chen2023/text-hardware#laser-diagonal"] / 2
    positions = half * np.array([[0, -1], [-1, 0], [1, 0], [0, 1]])
    return positions, inputs["chen2023/table-2#telescope-focal-length.value"]


def _unit_vectors(inputs: Inputs) -> _Values:
    length = np.linalg.norm(attitude.emitted_directions(*_lasers(inputs))[0])
    return length, length, 1.0


def _chain(inputs: Inputs) -> _Values:
    """Close the chain (4), (6), (7), which must return the misalignment."""
    camera = attitude.emitted_directions(*_lasers(inputs))
    zero = rotation_from_vector([0.3, -1.2, 0.5])
    turned = rotation_from_vector([1e-5, -2e-5, 3e-5])
    seen = camera @ attitude.moved_laser_transform(zero, turned).T
    residual = np.abs(camera - seen @ (turned @ zero.T).T).max()
    return residual, residual, 0.0


def _retroreflector(inputs: Inputs) -> _Values:
    """Rotate the reflector of the satellite, a corner cube, about three axes."""
    beam = [0.0, 0.0, -1.0]
    straight = raytrace.mirror_train(raytrace.CORNER) @ beam
    turns = rotation_from_vector(RADIANS_PER_ARCSEC * np.eye(3))
    moved = raytrace.mirror_train(raytrace.CORNER @ turns.mT) @ beam - straight
    ratio = np.linalg.norm(moved, axis=-1).max() / RADIANS_PER_ARCSEC
    return ratio, ratio, 0.0


def _roll_leak(inputs: Inputs) -> _Values:
    """Roll the camera about its boresight, and compute (5) in both orders."""
    tracker = "chen2023/table-2#tracker-"
    spots = inputs.pairs("chen2023/text-platform#spot-*")
    size = inputs.array(f"{tracker}pixels-*")
    scale = (
        inputs[f"{tracker}pixel-size.value"] / inputs[f"{tracker}focal-length.value"]
    )
    across, along = (spots.mean(axis=0) - optics.detector_centre(size)) * scale
    reference = rotation_from_vector([-along, across, 0.0])
    rolled = reference @ rotation_from_vector([0.0, 0.0, 60 * RADIANS_PER_ARCSEC])
    forms = rolled @ reference.T, attitude.misalignment_between(rolled, reference)
    x, y, _ = attitude.misalignment_angles(forms).T
    return *(np.hypot(x, y) / RADIANS_PER_ARCSEC), 0.0


def _stage_angle(inputs: Inputs) -> _Values:
    travel = inputs["chen2023/text-effectiveness#maximum-travel"]
    focal = inputs["chen2023/text-effectiveness#focal-length"]
    forms = attitude.stage_angle_printed, attitude.stage_angle
    wanted = -np.arctan(travel / focal) / RADIANS_PER_ARCSEC
    return *(form(travel, focal) / RADIANS_PER_ARCSEC for form in forms), wanted


def _stage_signs(inputs: Inputs) -> _Values:
    """Move the lasers along Y, and measure the sense of the rotation with (5) and (7)."""
    positions, focal = _lasers(inputs)
    shift = inputs["chen2023/text-effectiveness#step"]
    before, after = (
        attitude.emitted_directions(positions + np.array([0.0, moved]), focal)
        for moved in (0.0, shift)
    )
    measured = attitude.misalignment(before, after, np.eye(3))
    return (
        np.sign(attitude.stage_angle(shift, focal)),
        np.sign(attitude.stage_angles([0.0, shift], focal)[0]),
        np.sign(attitude.misalignment_angles(measured)[0]),
    )


def _misalignment_side(inputs: Inputs) -> _Values:
    """Use the inverse of the matrix of (8) as R_U, and compare the lines of sight."""
    turn = inputs["chen2023/text-effectiveness#simulated-angle"]
    boresights = inputs["chen2023/text-satellite#boresight-angle"]
    installed = rotation_from_vector([boresights, 0.0, 0.0])
    moved = rotation_from_vector(turn * np.eye(2, 3))
    corrected = installed @ moved.mT  # (8), inverted
    forms = moved.mT, attitude.misalignment_in_tracker(moved, installed)
    gaps = [(form @ installed - corrected)[..., 2] for form in forms]
    return *(np.linalg.norm(gaps, axis=-1).max(axis=-1) / RADIANS_PER_ARCSEC), 0.0


def _line_of_sight(inputs: Inputs) -> _Values:
    """Compare the bracket of (1) with the direction (2) of one point of the focal plane."""
    positions, focal = _lasers(inputs)
    bracket = ground.image_vectors(positions[:1], focal)[0]
    emitted = attitude.emitted_directions(positions[:1], focal)[0]
    cosine = bracket @ emitted / np.linalg.norm(bracket)
    # With a negative scaling factor the bracket changes its sign.
    return cosine, -cosine, 1.0


def _mirrored_pattern(inputs: Inputs) -> _Values:
    """Transfer a direction of (2) to (3), by a corner cube and the dichroic mirror."""
    tilt = inputs["chen2023/text-satellite#dihedral-angle"]
    fold = raytrace.reflection([0.0, np.sin(tilt), np.cos(tilt)])
    # A received direction points back along the light.
    satellite = -fold @ raytrace.mirror_train(raytrace.CORNER)
    mirrored = satellite @ np.diag([1.0, -1.0, 1.0])  # the lasers of a mirrored pattern
    return np.linalg.det(satellite), np.linalg.det(mirrored), 1.0


_RUNS: dict[str, Callable[[Inputs], _Values]] = {
    "distortion-ratio": _distortion_ratio,
    "turned-back": _turned_back,
    "rotary-matrix": _rotary_matrix,
    "unit-circle": _unit_circle,
    "iteration": _iteration,
    "unit-vectors": _unit_vectors,
    "chain": _chain,
    "misalignment-side": _misalignment_side,
    "stage-angle": _stage_angle,
    "stage-signs": _stage_signs,
    "retroreflector": _retroreflector,
    "roll-leak": _roll_leak,
    "line-of-sight": _line_of_sight,
    "mirrored-pattern": _mirrored_pattern,
}
