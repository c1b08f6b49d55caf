"""Frames of reference for errors of the attitude (chen2023, II and III)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reproduce.papers.chen2023.platform import (
    INSTRUMENT,
    SIGMAS,
    angle_sigma,
    as_designed,
    scatter,
    square_ratio,
)
from reproduce.papers.declare import Results, Rows, studied
from reproduce.physics.registration import rmse
from reproduce.printed.inputs import Inputs
from reproduce.units import ARCSEC_PER_RADIAN

_PRINTED = "chen2023/table-4#1.transform-?"


def _platform_facts(inputs: Inputs) -> Results:
    """Return size and shape of the printed square of spots, and the error of the roll.

    In per cent smaller than the design, root mean square distance from a square of this size in px,
    and error about Z over error about X.
    """
    designed = as_designed(inputs)
    ratio = square_ratio(designed)
    scaled = designed.predicted(np.zeros(3), lasers=ratio * designed.lasers)
    x, _, z = angle_sigma(inputs, 1, 1)
    return {
        "square-smaller": 100 * (1 - ratio),
        "misfit": rmse(designed.spots, scaled),
        "roll": z / x,
    }


@studied(
    "chen2023/orders",
    inputs=(*INSTRUMENT, "chen2023/table-3#1-*", _PRINTED),
    named=_platform_facts,
)
def _orders(inputs: Inputs) -> Rows:
    """Compute the accuracy of a frame in the axes of both instruments, for two principal points."""
    designed = as_designed(inputs)
    for name, point in (
        ("centre of the detector", designed.principal_point),
        ("middle of the spots", designed.spots.mean(axis=0)),
    ):
        design = replace(designed, principal_point=point)
        camera = design.response(design.spots)
        # The laser transform rotates the vector of a small rotation into the other frame.
        tracker = np.tensordot(design.reference, camera, axes=1)
        for frame, response in (("camera", camera), ("tracker", tracker)):
            sigmas = np.linalg.norm(response * scatter(inputs, 1), axis=(1, 2))
            x, y, _ = SIGMAS * ARCSEC_PER_RADIAN * sigmas
            yield name, frame, x, y
    yield ("printed", "", *(inputs.array(_PRINTED) * ARCSEC_PER_RADIAN))
