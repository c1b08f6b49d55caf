"""Axes that an error of the attitude is decomposed in (chen2023, II and III)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reproduce.papers.chen2023 import platform
from reproduce.papers.declare import studied
from reproduce.printed.inputs import Inputs
from reproduce.units import ARCSEC_PER_RADIAN

_PRINTED = "chen2023/table-4#1.transform-?"


@studied(
    "chen2023/orders",
    inputs=(*platform.INSTRUMENT, f"{platform.SCATTER}#1-*", _PRINTED),
)
def _orders(inputs: Inputs) -> list[tuple[str | float, ...]]:
    """Accuracy of a single frame in the axes of either instrument, for two principal points."""
    designed = platform.as_designed(inputs)
    points = {
        "centre of the detector": designed.principal_point,
        "middle of the spots": designed.spots.mean(axis=0),
    }
    rows: list[tuple[str | float, ...]] = []
    for name, point in points.items():
        design = replace(designed, principal_point=point)
        response = design.response(design.spots)
        # One small rotation, seen in the other frame: its vector turns with the laser transform.
        responses = (
            response,
            np.tensordot(design.transform(design.spots), response, axes=1),
        )
        for frame, response in zip(("camera", "tracker"), responses, strict=True):
            variance = (response**2 * platform.scatter(inputs, 1) ** 2).sum(
                axis=(-2, -1)
            )
            angles = platform.SIGMAS * np.sqrt(variance[:2])
            rows.append((name, frame, *map(float, angles * ARCSEC_PER_RADIAN)))
    return [
        *rows,
        ("printed", "", *map(float, inputs.array(_PRINTED) * ARCSEC_PER_RADIAN)),
    ]
