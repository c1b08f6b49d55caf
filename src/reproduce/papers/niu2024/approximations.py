"""Errors of the approximations of niu2024 with the printed parameters of Tables 1 and 4.

The error of the pivot is the term that (10) neglects: the principal point of the source replaces
the principal point of green, and the tables give their distance. The paper does not print the size
of two of the five effects. The assumed values are:

* the tilt of a detector about both axes is the printed angle of its rotation in its plane;
* the second radial term is the remainder that the printed fraction of the first term leaves at the
  corner.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from itertools import product

import numpy as np

from reproduce.papers.declare import Results, Rows, reproduces, studied
from reproduce.papers.niu2024 import experiment, simulation
from reproduce.papers.niu2024.registration import scale_factors
from reproduce.papers.niu2024.simulation import NOISE, REGISTERED
from reproduce.physics.optics import Camera, channel_centroids
from reproduce.physics.registration import error_field, fit_registration, rmse
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.units import ARCSEC_PER_RADIAN

_FIRST_TERM_FRACTION = "niu2024/text-approximations#first-term-share"
_INSTRUMENTS = {"Table 1": simulation.instrument, "Table 4": experiment.instrument}
INPUTS = (
    *experiment.CAMERAS,
    "niu2024/table-1",
    "niu2024/table-2#rotation.*",
    "niu2024/text-optics#pixels-*",
    _FIRST_TERM_FRACTION,
)
# Middles of 200 equal parts of either side of the detector, in half sides from its centre.
_MIDDLES = (np.arange(200) + 0.5) / 100 - 1


@reproduces(
    "niu2024/text-approximations",
    cells=["scale-approximation"],
    inputs=["niu2024/table-1#focal-length.*"],
)
def scale_near_one(inputs: Inputs) -> Results:
    """Compute the scale factor of Table 1 that is farthest from one.

    Implements: niu2024 (6).
    """
    scales = scale_factors(inputs)
    return {"scale-approximation": max(scales, key=lambda scale: abs(scale - 1))}


@reproduces(
    "niu2024/text-approximations",
    cells=["parameters"],
    inputs=[
        "niu2024/text-approximations#parameters-per-channel",
        "niu2024/text-context#detectors",
    ],
)
def parameter_count(inputs: Inputs) -> Results:
    """Compute the number of parameters of all channels except green."""
    registered = inputs["niu2024/text-context#detectors"] - 1
    per_channel = inputs["niu2024/text-approximations#parameters-per-channel"]
    return {"parameters": registered * per_channel}


def _error_fields(
    source: Camera, green: Camera, second_ratio: float, positions: FloatArray
) -> dict[str, FloatArray]:
    """Return the error of each effect at positions in a channel, (n, 2), in px, by its name.

    The effects have the printed parameters and the assumed values. The ratio is that of the second
    radial coefficient to the first.
    """
    field = partial(error_field, positions=positions)
    both = source, green
    straight = [replace(camera, radial_distortion=0.0) for camera in both]
    distortions = np.array([camera.radial_distortion for camera in both])
    cube = field(source, replace(green, radial_distortion=distortions[0]))
    moved = green.principal_point - source.principal_point
    return {
        "unequal coefficients": field(*both) - cube,
        "k³ for k": cube,
        "green's pivot": field(*straight, pivot_error=moved),
        "tilt": field(*straight, tilt=np.tan(np.abs([source.rotation] * 2))),
        "second radial term": field(*straight, second_term=second_ratio * distortions),
    }


def _facts(inputs: Inputs) -> Results:
    """Return effects on the scales, the noise over both axes, and the angle of a pixel.

    Effects on the fitted scales of the simulation are multiples of their scatter. The noise of two
    channels moves a scale by √2 σ over the root of the summed squared radii.
    """
    angles = simulation.arrangement(inputs)
    green, *_ = cameras = simulation.instrument(inputs)
    true = channel_centroids(cameras, angles)
    radii = np.linalg.norm(true[0] - green.principal_point, axis=-1)
    noise = np.sqrt(2.0) * inputs[NOISE]
    scatter = noise / np.linalg.norm(radii)
    points = simulation.registered_points(true, angles)
    fitted = fit_registration(*points).transform.scale
    actual, scales = (
        inputs.array(f"niu2024/table-{table}#scale.*") for table in (2, 3)
    )
    half = inputs.half_unit("niu2024/table-3#scale.red")
    bias = np.abs(fitted - scale_factors(inputs)) / scatter
    return {
        "outermost": radii.max(),
        "bias-least": bias.min(),
        "bias-most": bias.max(),
        "distance": (np.abs(scales - fitted) - half).min() / scatter,
        "rounding": 200.0 * half / abs(scales - actual)[0],
        "noise-rms": noise,
        "pixel-angle": np.arctan(green.pixel_pitch / green.focal_length)
        * ARCSEC_PER_RADIAN,
    }


@studied(
    "niu2024/approximations",
    inputs=(
        *INPUTS,
        *simulation.ANGLES,
        NOISE,
        "niu2024/table-2#scale.*",
        "niu2024/table-3#scale.*",
    ),
    named=_facts,
)
def _errors(inputs: Inputs) -> Rows:
    """Compute the size of each error over the detector, and its residual after a fit."""
    grid = np.array([*product(_MIDDLES, repeat=2)])
    pitch = inputs["niu2024/text-optics#pixel-pitch-x"]
    half = inputs.array("niu2024/text-optics#pixels-?") * pitch / 2
    positions = grid * half
    # The second term is the remainder that the printed fraction leaves at the corner.
    second_ratio = (1 / inputs[_FIRST_TERM_FRACTION] - 1) / np.square(half).sum()
    # A fit removes the scale, rotation and shift of the positions.
    stars = positions * 1e6
    for table, instrument in _INSTRUMENTS.items():
        green, *others = instrument(inputs)
        for channel, source in zip(REGISTERED, others, strict=True):
            fields = _error_fields(source, green, second_ratio, positions)
            for effect, error in fields.items():
                fit = fit_registration(stars, stars + error, (0.0, 0.0))
                largest = np.hypot(*error.T).max()
                whole, rest = rmse([error, fit.residuals], 0 * error)
                yield effect, table, channel, largest, whole, rest
