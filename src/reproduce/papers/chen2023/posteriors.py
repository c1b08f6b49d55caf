"""Posteriors of chen2023: the misalignment of the simulated platform, constant or drifting.

The spots of single images are not published. The misalignments therefore take one simulation of
the platform, with the printed spots, their printed scatter and a seed of this project.

The column time of your spots (or else frame) contains the time of an image, in any unit. Without
both, the images of a group are in the order of time, evenly spaced.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.random import default_rng

from reproduce.inference import LogUniform, Model, Normal, Quantity
from reproduce.inference.models import (
    SpotLikelihood,
    misalignment_model,
)
from reproduce.papers.chen2023 import published, satellite
from reproduce.papers.chen2023.platform import (
    INSTRUMENT,
    SIGMAS,
    as_designed,
    platform_of,
    square_ratio,
)
from reproduce.papers.posteriors import Declaration, Supplied, book_plan
from reproduce.physics.attitude import Platform
from reproduce.physics.attitude.diagnosis import diagnose_spots
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.store.files import FilePath
from reproduce.store.points import read_table
from reproduce.store.spots import IMAGES, SPOTS, images_of
from reproduce.units import ARCSEC_PER_RADIAN

_FRAMES = "chen2023/text-accuracy#frames"
INPUTS = (*INSTRUMENT, "chen2023/table-3", _FRAMES, *satellite.CAMERA)
# Misalignment of the simulation, of the size that the text expects in orbit, with a roll.
_TRUTH = np.array([20.0, -15.0, 30.0]) / ARCSEC_PER_RADIAN
_DRIFT = np.array([1.0, 0.5, 0.0]) / ARCSEC_PER_RADIAN
# Prior of the angles of your platform, in arcsec.
_ANGLE_PRIOR = Normal(0.0, 20_000.0, "far wider than any angle of a platform")
# Images of a group that determine its scatter.
_MIN_IMAGES = 3


def _on_the_ground(parameters: FloatArray, altitude: float) -> dict[str, Quantity]:
    """Return errors on the ground about the posterior mean, and without correction.

    The altitude is in metres. Both axes count together.
    """
    angles = parameters[:, 3:5]
    error = np.hypot(*(angles - angles.mean(axis=0)).T)
    return {
        "pointing error": Quantity(error * ARCSEC_PER_RADIAN, "arcsec"),
        "position error": Quantity(altitude * error, "m"),
        "position error uncorrected": Quantity(altitude * np.hypot(*angles.T), "m"),
    }


def _misalignment(inputs: Inputs, drifts: bool = False) -> Model:
    """Return a misalignment after a calibration group, constant or with a drift.

    The images of both groups are simulated.
    """
    generator = default_rng(inputs.seed(2, drifts))
    frames = inputs.count(_FRAMES)
    design = as_designed(inputs)
    noise = np.sqrt(np.square(inputs.array("chen2023/table-3") / SIGMAS).mean())
    # The printed spots are closer together than the designed square: simulate the printed ones.
    lasers = square_ratio(design) * design.lasers
    zero = np.zeros(3)
    groups = []
    for middle, half in ((zero, zero), (_TRUTH, drifts * _DRIFT / 2)):
        angles = np.linspace(middle - half, middle + half, frames)
        true = design.predicted(angles, lasers=lasers)
        groups.append(true + noise * generator.normal(size=true.shape))
    times = 0.0, drifts * np.linspace(-1, 1, frames)
    model = misalignment_model(SpotLikelihood.of(design, groups, times))
    # Angles, and drifts if they are fitted, come after the mount and before scale and noise.
    truth = zip(model.names[3:-2], [*_TRUTH, *_DRIFT], strict=False)
    return replace(
        model,
        consequences=partial(_on_the_ground, altitude=satellite.altitude(inputs)),
        truth=dict(truth),
    )


def _your_model(
    data: Any,
    drifts: bool = False,
    platform: Platform | FilePath | None = None,
    sep: str | None = None,
) -> Supplied:
    """Return your spots, a misalignment, constant or with a drift in group 1, and remarks.

    The default platform is the platform of the paper. The remarks are the remarks of
    `reproduce.misalignment`, except on lost spots.
    """
    table = read_table(data, SPOTS, IMAGES, sep)
    design = platform_of(platform)
    pair, labels = images_of(table, len(design.lasers))
    diagnosis = diagnose_spots(design, pair, drifts)
    # The posterior omits images that lack a spot.
    remarks = [one.text for one in diagnosis.findings if one.kind != "lost"]
    whole = [np.isfinite(group).all(axis=(-2, -1)) for group in diagnosis.images]
    images = [group[seen] for group, seen in zip(diagnosis.images, whole, strict=True)]
    counts = [len(group) for group in images]
    if lost := sum(map(len, diagnosis.images)) - sum(counts):
        remarks.append(f"{lost} images that lack a spot are omitted")
    if min(counts) < _MIN_IMAGES:
        raise ValueError(
            f"data: expected {_MIN_IMAGES} or more images with all spots in each group, "
            f"got {' and '.join(map(str, counts))}. Add images, which determine the scatter."
        )
    if not any(np.ptp(group, axis=0).any() for group in images):
        raise ValueError(
            "data: expected spots that scatter from image to image, got equal spots in "
            "all images of a group. Add images with noise."
        )
    instrument = replace(diagnosis.platform, spots=images[0].mean(axis=0))
    u: Any = 0.0
    if drifts:
        times = labels[whole[1]].to_numpy(float)
        if not np.ptp(times):
            raise ValueError(
                "data: expected images at different times for a drift, got one time. Correct "
                "the column time, or use the posterior misalignment"
            )
        u = 2 * (times - times.mean()) / np.ptp(times)
    likelihood = SpotLikelihood.of(instrument, images, (0.0, u))
    model = misalignment_model(likelihood)
    scatter = likelihood.start()[0][-1]
    *angles, _, noise = model.names
    wide = LogUniform(
        1e-6 * scatter,
        1e6 * scatter,
        "no scale preferred: a millionth to a million times the scatter of the spots",
    )
    priors = dict.fromkeys(angles, _ANGLE_PRIOR)
    return table, model.with_priors({**priors, noise: wide}), remarks


_SPOTS = partial(
    Declaration,
    paper="chen2023",
    inputs=INPUTS,
    meaning="one spot per line, in px: group 0 at the zero point, 1 at the present; lasers from 1 "
    "in the order of the platform; the images of a group in the order of time, with a column "
    "frame or time if spots are lost or the times are uneven",
    columns=SPOTS,
    accepts=("platform",),
)

POSTERIORS = (
    *published.POSTERIORS,
    _SPOTS(
        "misalignment",
        "Constant misalignment from laser spots",
        build=_misalignment,
        read=_your_model,
        summary={
            **{f"angle-{axis}": f"Misalignment about {axis.upper()}" for axis in "xyz"},
            "position error": "Position on the ground, corrected",
        },
    ),
    _SPOTS(
        "misalignment-drift",
        "Drifting misalignment from laser spots",
        build=partial(_misalignment, drifts=True),
        read=partial(_your_model, drifts=True),
        plan=book_plan(steps=330),
        summary={f"drift-{axis}": f"Drift about {axis.upper()}" for axis in "xyz"},
    ),
)
