"""Errors of the approximations of niu2024 with the printed parameters of Tables 1 and 4.

The error of the pivot is the term that (10) neglects: the principal point of the source takes the
place of green's, and the tables give their distance. The paper does not print the size of two of
the five effects. The assumed values are:

* a detector is tilted about both axes by the printed angle of its rotation in its plane;
* the second radial term is the rest that the printed fraction of the first term leaves at the
  corner.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np

from reproduce.papers.declare import Fact, Results, reproduces, studied
from reproduce.papers.niu2024 import experiment, simulation
from reproduce.papers.niu2024.registration import scale_factors
from reproduce.papers.niu2024.simulation import IMAGING, NOISE, OPTICS, REGISTERED
from reproduce.physics.optics import Camera
from reproduce.physics.registration import (
    EFFECTS,
    Channels,
    error_field,
    even_positions,
    fit_registration,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs, load_inputs

_APPROXIMATIONS = "niu2024/text-approximations"
_FIRST_TERM_FRACTION = f"{_APPROXIMATIONS}#first-term-share"
_TABLES = {"Table 1": simulation, "Table 4": experiment}
READS = (
    *experiment.CAMERAS,
    IMAGING,
    f"{simulation.TRUTH}#rotation.*",
    f"{OPTICS}#pixels-*",
    _FIRST_TERM_FRACTION,
)
_POSITIONS_ACROSS = 200  # positions along either side of the detector
_TITLES = {
    "coefficients": "unequal coefficients",
    "cube": "k³ for k",
    "pivot": "green's pivot",
    "tilt": "tilt",
    "second term": "second radial term",
}


@reproduces(
    _APPROXIMATIONS,
    cells=["scale-approximation"],
    inputs=[f"{IMAGING}#focal-length.*"],
    equations=["6"],
)
def scale_near_one(inputs: Inputs) -> Results:
    """The scale factor of Table 1 that lies farthest from one."""
    scales = scale_factors(inputs).values()
    return {"scale-approximation": max(scales, key=lambda scale: abs(scale - 1))}


@reproduces(
    _APPROXIMATIONS,
    cells=["parameters"],
    inputs=[
        f"{_APPROXIMATIONS}#parameters-per-channel",
        "niu2024/text-context#detectors",
    ],
)
def parameter_count(inputs: Inputs) -> Results:
    """Parameters of the whole model: those of one channel, for every channel but green."""
    registered = inputs.count("niu2024/text-context#detectors") - 1
    per_channel = inputs.count(f"{_APPROXIMATIONS}#parameters-per-channel")
    return {"parameters": float(registered * per_channel)}


def _half_size(inputs: Inputs) -> FloatArray:
    """Return half the sides of the detector, shape (2,), in metres."""
    return inputs.array(f"{OPTICS}#pixels-?") * inputs[f"{OPTICS}#pixel-pitch-x"] / 2


def _channels(inputs: Inputs, table: str, channel: str) -> Channels:
    """Return a channel and green, with the printed parameters and the assumed values."""
    place = simulation.CHANNELS.index(channel)
    cameras: list[Camera] = _TABLES[table].cameras(inputs)
    source, green = cameras[place], cameras[0]
    rotation = _TABLES[table].rotations(inputs)[place]
    lean = float(np.tan(abs(rotation)))
    # The second term takes the rest that the printed fraction leaves at the corner.
    rest = (1 / inputs[_FIRST_TERM_FRACTION] - 1) / np.square(_half_size(inputs)).sum()
    second, reference = (
        round(float(one.radial_distortion) * rest, 12) for one in (source, green)
    )
    x, y = (green.principal_point - source.principal_point).tolist()
    return Channels(source, green, rotation, (x, y), (lean, lean), (second, reference))


def _isolated(whole: Channels, effect: str, positions: FloatArray) -> FloatArray:
    """Return the error field of one effect only."""
    found = error_field(whole.only(effect), positions)
    if effect == "coefficients":
        return found - error_field(whole.only("cube"), positions)
    return found


def _facts(inputs: Inputs) -> dict[str, Fact]:
    """Return what the coefficients and a tilt of Table 1 cost, and the noise over both axes."""
    errors = _errors(inputs).set_index(["Left out", "Parameters of", "Channel"])[
        "RMS (px)"
    ]
    return {
        f"{effect}-table-1-{channel}-rms": Fact(
            errors[_TITLES[effect], "Table 1", channel], ".2g", "px"
        )
        for effect, channel in product(("coefficients", "tilt"), REGISTERED)
    } | {"noise-rms": Fact(np.sqrt(2.0) * load_inputs([NOISE])[NOISE], ".2g", "px")}


@studied("niu2024/approximations", inputs=READS, named=_facts)
def _errors(inputs: Inputs) -> Iterator[tuple[object, ...]]:
    """Size of each error over the detector, and its residual after a fit."""
    positions = even_positions(_half_size(inputs), _POSITIONS_ACROSS)
    for table, channel, effect in product(_TABLES, REGISTERED, EFFECTS):
        error = _isolated(_channels(inputs, table, channel), effect, positions)
        # The same projection that a fit makes: onto scale, rotation and shift of the positions.
        rest = fit_registration(positions * 1e6, positions * 1e6 + error, (0.0, 0.0))
        means = (
            float(np.sqrt(np.square(one).sum(axis=-1).mean()))
            for one in (error, rest.residuals)
        )
        yield (_TITLES[effect], table, channel, float(np.hypot(*error.T).max()), *means)
