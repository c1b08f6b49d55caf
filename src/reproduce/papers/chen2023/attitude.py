"""The axes in which an error of the laser transform is decomposed (chen2023, III)."""

from __future__ import annotations

import numpy as np

from reproduce.papers.chen2023 import platform
from reproduce.papers.study import Column, studied
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN

__all__ = ["orders"]

PRINTED = "chen2023/table-4#1.transform-?"


@studied(
    "chen2023/orders",
    given=(*platform.INSTRUMENT, f"{platform.SCATTER}#1-*", PRINTED),
    columns=(
        Column("Principal point"),
        Column("axes of the error"),
        Column("about X (arcsec)", ".2f"),
        Column("about Y (arcsec)", ".2f"),
    ),
    caption="Accuracy of the laser transform from one frame (3σ), by the scatter of Table III, for "
    "two principal points of the tracker and both orders of the product.",
)
def orders(given: Given) -> list[tuple[str | float, ...]]:
    """Accuracy of a single frame in the axes of either instrument, for two principal points."""
    points = {
        "centre of the detector": platform.tracker_centre(given),
        "middle of the spots": platform.printed_spots(given).mean(axis=0),
    }
    rows: list[tuple[str | float, ...]] = []
    for name, point in points.items():
        responses = platform.responses(given, point)
        for frame, response in zip(("camera", "tracker"), responses, strict=True):
            variance = (response**2 * platform.scatter(given, 1) ** 2).sum(axis=(-2, -1))
            angles = platform.SIGMAS * np.sqrt(variance[:2])
            rows.append((name, frame, *map(float, angles * ARCSEC_PER_RADIAN)))
    return [*rows, ("printed", "", *map(float, given.array(PRINTED) * ARCSEC_PER_RADIAN))]
