"""From misalignment to metres on the ground: the error budget of SVGF-1.

The paper does not print the following values, which are assumed: centimetre orbits are 0.05 m along
each axis, and the principal point moves by one panchromatic pixel. Angle errors of the monitoring
are the errors of the ground platform.
"""

from __future__ import annotations

import erfa
import numpy as np

from reproduce.papers.chen2023.accuracy import SMOOTHED
from reproduce.papers.chen2023.platform import INSTRUMENT, SIGMAS, angle_sigma
from reproduce.papers.chen2023.satellite import CAMERA, CAMERA_FOCAL_LENGTH, altitude
from reproduce.papers.declare import Results, Rows, by_cell, reproduces, studied
from reproduce.physics.attitude import rotation_from_vector
from reproduce.physics.ground import (
    circular_error,
    ground_jacobian,
    local_axes,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.units import RADIANS_PER_ARCSEC

_POINTING = "chen2023/table-1#tracker-pointing-accuracy.value"
_MONITORING = (*INSTRUMENT, "chen2023/table-3#2-*", SMOOTHED)
INPUTS = (*_MONITORING, *CAMERA, _POINTING)
_ORBIT_ERROR_M = 0.05
_SINGLE, _AVERAGED = "one frame", "averaged"
# Views of the satellite: tilt off the nadir in deg, distance of the target from it in m.
LOOKS = ((0.0, 0.0), (0.0, 5e3), (30.0, 0.0))
# Kinds of errors, with their displayed unit.
_UNITS = {
    "satellite": (1.0, "m"),
    "turn": (RADIANS_PER_ARCSEC, "arcsec"),
    "image": (1e-6, "µm"),
}
# Fraction of the errors below CE90.
_LEVEL = 0.9


@reproduces(
    "chen2023/text-positioning",
    cells=["*-resolution"],
    inputs=["chen2023/table-1#*ground-resolution.value"],
)
def quoted_resolution(inputs: Inputs) -> Results:
    """Return the ground resolutions of Table I, which the introduction quotes."""
    return by_cell(
        "{}-resolution",
        inputs.array("chen2023/table-1#*ground-resolution.value"),
        ("panchromatic", "multispectral"),
    )


def _terms(inputs: Inputs) -> dict[str, tuple[str, FloatArray]]:
    """Return the errors of the imaging model for SVGF-1, by name.

    Each has a kind, ``satellite``, ``turn`` or ``image``, for its derivative, and standard
    deviations along or about X, Y, Z, in metres or radians. The misalignment is given axis by axis,
    for one frame and for the average of many.
    """
    limit = np.full(3, inputs[_POINTING] / SIGMAS)
    terms = {"attitude of the tracker, at its limit": ("turn", limit)}
    for frames, mean in ((1, _SINGLE), (inputs.count(SMOOTHED), _AVERAGED)):
        sigmas = np.diag(angle_sigma(inputs, 2, frames))
        for axis, sigma in zip(("X", "Y", "Z (roll)"), sigmas, strict=True):
            terms[f"misalignment about {axis}, {mean}"] = ("turn", sigma)
    terms["orbit"] = ("satellite", np.full(3, _ORBIT_ERROR_M))
    pixel = np.array([1.0, 1.0, 0.0]) * inputs[CAMERA[1]]
    terms["principal point, one pixel"] = ("image", pixel)
    return terms


def _look(
    inputs: Inputs, tilt: float, off: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return image vector, position and rotation of the satellite at a middle latitude."""
    height, focal = altitude(inputs), inputs[CAMERA_FOCAL_LENGTH]
    below = erfa.gd2gc(erfa.WGS84, 0.5, 0.8, 0.0)
    # X along a flight to the north, Z down.
    east, north, up = local_axes(below)
    at_rest = np.stack([north, east, -up], axis=-1)
    chain = at_rest @ rotation_from_vector([np.radians(tilt), 0.0, 0.0])
    return np.array([[off / height * focal, 0.0, -focal]]), below + height * up, chain


def _covariances(inputs: Inputs) -> dict[str, FloatArray]:
    """Return the covariances of east and north of each term, (looks, 2, 2), in square metres.

    The last two are the covariances of all terms, with one frame and with the average of many.
    """
    looks = zip(*(_look(inputs, *look) for look in LOOKS), strict=True)
    positions, derivatives = ground_jacobian(*map(np.stack, looks))
    level, covariances = local_axes(positions[:, 0])[:, :2], {}
    for name, (kind, sigma) in _terms(inputs).items():
        errors = level @ derivatives[kind][:, 0] * sigma
        covariances[name] = errors @ errors.mT
    for mean, other in ((_SINGLE, _AVERAGED), (_AVERAGED, _SINGLE)):
        parts = [cov for name, cov in covariances.items() if not name.endswith(other)]
        covariances[f"all together, {mean}"] = np.sum(parts, axis=0)
    return covariances


@studied(
    "chen2023/budget",
    inputs=INPUTS,
    # In kilometres, and in %.
    named=lambda inputs: {
        "altitude": altitude(inputs) / 1e3,
        "level": 100 * _LEVEL,
    },
)
def _budget(inputs: Inputs) -> Rows:
    """Compute the error budget of SVGF-1 on the ground, term by term."""
    terms = _terms(inputs)
    for name, covariances in _covariances(inputs).items():
        size, unit = np.nan, ""
        if name in terms:
            kind, sigma = terms[name]
            scale, unit = _UNITS[kind]
            size = sigma.max() / scale
        yield (name, size, unit, *circular_error(covariances))
