"""What the approximations of niu2024 cost with the printed parameters of Tables 1 and 4.

The pivot is off by what (10) leaves out: the source's principal point stands where green's belongs,
and they are as far apart as the tables print. Two of the five effects have a size that the paper
does not print; the stand-ins are ours:

* a detector is tilted about both axes by as much as it is printed to be turned in its plane;
* the second radial term carries what the printed share of the first one leaves, at the corner.
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
from reproduce.printed.given import Given, given

_APPROXIMATIONS = "niu2024/text-approximations"
_SHARE = f"{_APPROXIMATIONS}#first-term-share"
_TABLES = {"Table 1": simulation, "Table 4": experiment}
READS = (
    *experiment.CAMERAS,
    IMAGING,
    f"{simulation.TRUTH}#rotation.*",
    f"{OPTICS}#pixels-*",
    _SHARE,
)
_ACROSS = 200  # positions along either side of the detector
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
    given=[f"{IMAGING}#focal-length.*"],
    equations=["6"],
)
def scale_near_one(given: Given) -> Results:
    """The scale factor of Table 1 that lies farthest from one."""
    scales = scale_factors(given).values()
    return {"scale-approximation": max(scales, key=lambda scale: abs(scale - 1))}


@reproduces(
    _APPROXIMATIONS,
    cells=["parameters"],
    given=[
        f"{_APPROXIMATIONS}#parameters-per-channel",
        "niu2024/text-context#detectors",
    ],
)
def parameter_count(given: Given) -> Results:
    """Parameters of the whole model: those of one channel, for every channel but green."""
    registered = given.count("niu2024/text-context#detectors") - 1
    per_channel = given.count(f"{_APPROXIMATIONS}#parameters-per-channel")
    return {"parameters": float(registered * per_channel)}


def _half_size(door: Given) -> FloatArray:
    """Return half the sides of the detector, shape (2,), in metres."""
    return door.array(f"{OPTICS}#pixels-?") * door[f"{OPTICS}#pixel-pitch-x"] / 2


def _channels(door: Given, table: str, channel: str) -> Channels:
    """Return a channel beside green, with the printed parameters and our stand-ins."""
    place = simulation.CHANNELS.index(channel)
    cameras: list[Camera] = _TABLES[table].cameras(door)
    source, green = cameras[place], cameras[0]
    rotation = _TABLES[table].rotations(door)[place]
    lean = float(np.tan(abs(rotation)))
    # The second term takes the rest that the printed fraction leaves at the corner.
    rest = (1 / door[_SHARE] - 1) / np.square(_half_size(door)).sum()
    second, reference = (
        round(float(one.radial_distortion) * rest, 12) for one in (source, green)
    )
    x, y = (green.principal_point - source.principal_point).tolist()
    return Channels(source, green, rotation, (x, y), (lean, lean), (second, reference))


def _isolated(whole: Channels, effect: str, positions: FloatArray) -> FloatArray:
    """Return the error field of one effect alone."""
    found = error_field(whole.only(effect), positions)
    if effect == "coefficients":
        return found - error_field(whole.only("cube"), positions)
    return found


def _facts(door: Given) -> dict[str, Fact]:
    """Return what the coefficients and a tilt of Table 1 cost, and the noise over both axes."""
    errors = _errors(door).set_index(["Left out", "Parameters of", "Channel"])[
        "RMS (px)"
    ]
    return {
        f"{effect}-table-1-{channel}-rms": Fact(
            errors[_TITLES[effect], "Table 1", channel], ".2g", "px"
        )
        for effect, channel in product(("coefficients", "tilt"), REGISTERED)
    } | {"noise-rms": Fact(np.sqrt(2.0) * given([NOISE])[NOISE], ".2g", "px")}


@studied("niu2024/approximations", given=READS, named=_facts)
def _errors(door: Given) -> Iterator[tuple[object, ...]]:
    """How large each error is over the detector, and what a fit leaves of it."""
    positions = even_positions(_half_size(door), _ACROSS)
    for table, channel, effect in product(_TABLES, REGISTERED, EFFECTS):
        error = _isolated(_channels(door, table, channel), effect, positions)
        # The same projection that a fit makes: onto scale, rotation and shift of the positions.
        rest = fit_registration(positions * 1e6, positions * 1e6 + error, (0.0, 0.0))
        means = (
            float(np.sqrt(np.square(one).sum(axis=-1).mean()))
            for one in (error, rest.residuals)
        )
        yield (_TITLES[effect], table, channel, float(np.hypot(*error.T).max()), *means)
