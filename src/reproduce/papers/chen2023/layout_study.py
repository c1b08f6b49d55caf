"""Which number and placement of lasers would err least on the ground, roll included (II-B).

The tracker stays: its pixel, its focal length, and for a spot as bright as on the ground platform
the scatter of Table III. Two ways to add lasers: each as bright as now, or all together as bright
as the printed ones, with photon noise. What the paper does not print: how wide the image is (ten
kilometres here), and how much of the tracker's field the lasers may take (the box around the
printed spots, or all of the detector). Spots keep apart by the diagonal of the window around one.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.random import default_rng

from reproduce.papers.chen2023 import lasers, twin, twin_study
from reproduce.papers.declare import seed_of
from reproduce.papers.study import Study
from reproduce.physics.errors_on_ground import circular_error
from reproduce.physics.laser_layout import Field, best_layout, image_error, layout_covariance
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.units import RADIANS_PER_ARCSEC

READS = (*twin.READS, twin_study.SMOOTHED, *twin_study.SATELLITE)
COUNTS = range(2, 9)
HALF_IMAGE = 5e3
FIELDS = ("box of the printed spots", "whole detector")


def printed_layout(door: Given) -> FloatArray:
    """Return the printed spots about their middle, in px, of shape (4, 2)."""
    spots = door.array(lasers.SPOTS).reshape(-1, 2)
    return np.asarray(spots - spots.mean(axis=0))


def fields(door: Given) -> dict[str, Field]:
    """Return the two fields in which lasers may lie.

    Parameters
    ----------
    door : Given
        Holds the cells of `READS`.

    Returns
    -------
    dict
        Name to field.
    """
    window = door[twin.WINDOW]
    pixels = float(door.array(f"{lasers.PLATFORM}#tracker-pixels-*.value").min())
    widths = (np.abs(printed_layout(door)).max(), (pixels - window) / 2)
    return {
        name: Field(
            float(width),
            window * 2**0.5,
            door[f"{lasers.PLATFORM}#tracker-pixel-size.value"],
            door[f"{lasers.PLATFORM}#tracker-focal-length.value"],
            twin_study.altitude(door),
            HALF_IMAGE,
        )
        for name, width in zip(FIELDS, widths, strict=True)
    }


def variance(door: Given) -> float:
    """Return the variance of a centroid averaged over frames, at the printed light, in px^2."""
    return float((lasers.scatter(door, 2) ** 2).mean() / door.count(twin_study.SMOOTHED))


@functools.cache
def optima() -> dict[tuple[str, int], FloatArray]:
    """Return the best layout for every field and number of lasers, in px."""
    door = given(READS)
    return {
        (name, count): best_layout(count, field, default_rng(seed_of(f"layout {name} {count}")))
        for name, field in fields(door).items()
        for count in COUNTS
    }


def layouts() -> Study:
    """Number and placement of lasers that make the error over an image least.

    Returns
    -------
    Study
        The printed layout, then the best one of each number.
    """
    door = given(READS)
    known, noise, now = fields(door), variance(door), printed_layout(door)
    chosen = [("4, as printed", [now, now])]
    chosen += [(f"{n}", [optima()[name, n] for name in FIELDS]) for n in COUNTS]
    rows = []
    for label, spots in chosen:
        entries = []
        for name, layout in zip(FIELDS, spots, strict=True):
            covariance = noise * layout_covariance(layout, known[name])
            each = 3.0 * float(image_error(covariance, known[name]))
            roll = 3.0 * float(np.sqrt(covariance[2, 2])) / RADIANS_PER_ARCSEC
            entries += [f"{each:.2f}", f"{each * (len(layout) / len(now)) ** 0.5:.2f}",
                        f"{roll:.1f}"]  # fmt: skip
        rows.append((label, *entries))
    head = (
        "Lasers",
        *(
            f"{name}: {what}"
            for name in FIELDS
            for what in (
                "as bright each (m)",
                "as bright together (m)",
                "roll, as bright each (arcsec)",
            )
        ),
    )
    caption = (
        "Three-sigma error on the ground of the averaged misalignment, root mean square over an "
        f"image {2 * HALF_IMAGE / 1e3:g} km wide, for the best placement of each number of lasers."
    )
    return Study(caption, head, tuple(rows))


def placements() -> Study:
    """Where the best layouts put their lasers, and what they gain against the printed one.

    Returns
    -------
    Study
        One row per layout; CE90 at points of the image.
    """
    door = given(READS)
    known, noise = fields(door), variance(door)
    rows = []
    for label, name, layout in (
        ("printed", FIELDS[0], printed_layout(door)),
        *((f"best four, {name}", name, optima()[name, 4]) for name in FIELDS),
        *((f"best eight, {name}", name, optima()[name, 8]) for name in FIELDS),
    ):
        covariance = noise * layout_covariance(layout, known[name])
        errors = [_ce90(covariance, off, known[name].altitude) for off in twin_study.OFF_CENTRE]
        width = np.abs(layout).max()
        corners = int((np.abs(layout).min(axis=1) > 0.5 * width).sum())
        rows.append((label, f"{corners} of {len(layout)}", *(f"{e:.2f}" for e in errors)))
    head = (
        "Layout",
        "near the corners",
        *(f"{off / 1e3:g} km off centre (m)" for off in twin_study.OFF_CENTRE),
    )
    caption = "CE90 on the ground of the averaged misalignment, every laser as bright as now."
    return Study(caption, head, tuple(rows))


def _ce90(covariance: FloatArray, off: float, altitude: float) -> float:
    """Return CE90 at a point `off` metres from the centre of the image, along X."""
    # The turn theta moves the point seen along a = (off, 0, altitude) by theta × a.
    moved = np.array([[0.0, altitude, 0.0], [-altitude, 0.0, off]])
    return float(circular_error(moved @ covariance @ moved.T))
