"""A user's laser spots: files of the misalignments.

The images of a group in the order of time, evenly spaced.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from reproduce.inference import LogUniform, Model, Normal, Prior
from reproduce.inference.models import (
    AXES,
    MOUNT,
    SpotLikelihood,
    SpotStatistics,
    misalignment_model,
    with_priors,
)
from reproduce.papers.chen2023.platform import INSTRUMENT, as_designed
from reproduce.papers.declare_posterior import File
from reproduce.physics.attitude import Platform
from reproduce.physics.attitude.diagnosis import diagnose, refuse, seen
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import given
from reproduce.store.points import Table, TableFileError
from reproduce.store.spots import COLUMNS, FRAMES, images_of

# A prior this many times as wide as what the data show is hardly felt, yet proper.
GENEROUS = 20.0
# Of the residual of least squares: ends of the noise, as good as none.
NOISE = (1e-6, 1e3)
# Images of a group that tell its scatter.
LEAST = 3


def model(table: Table, pivot: object, drifts: bool, design: Platform | None = None) -> Model:
    """A misalignment, constant or drifting through group 1, on the paper's platform or another."""
    instrument, images, _ = _measured(table, drifts, design)
    priors = _priors(instrument, images)
    if drifts:
        priors |= {key.replace("angle", "drift"): prior for key, prior in priors.items()}
    statistics = SpotStatistics.of(images, (False, drifts))
    return _noisy(misalignment_model(instrument, statistics, drifts=drifts, priors=priors))


def remarks(table: Table, pivot: object, drifts: bool, design: Platform | None = None) -> list[str]:
    """What a user should hear of the spots, as `reproduce.misalignment` says it."""
    return _measured(table, drifts, design)[2]


def _measured(
    table: Table, drifts: bool, design: Platform | None
) -> tuple[Platform, list[FloatArray], list[str]]:
    """Return the platform, whole images of every group, and what is to be said of them."""
    instrument = as_designed(given(INSTRUMENT)) if design is None else design
    pair, notes = images_of(table, len(instrument.lasers))
    instrument, pair, lights = seen(instrument, pair)
    found = diagnose(instrument, pair, drifts, lights)
    refuse(found, table.path)
    images = [one[np.isfinite(one).all(axis=(-2, -1))] for one in pair]
    if lost := sum(map(len, pair)) - sum(map(len, images)):
        notes.append(f"{lost} images that lack a spot are left out")
    if min(map(len, images)) < LEAST:
        raise TableFileError(
            f"{table.path}: expected three whole images or more in each group, got "
            f"{' and '.join(str(len(one)) for one in images)}; the scatter needs them"
        )
    if not any(np.ptp(one, axis=0).any() for one in images):
        raise TableFileError(
            f"{table.path}: expected spots that scatter from image to image, got the same ones in "
            "all images of a group: without noise there is nothing to sample"
        )
    instrument = replace(instrument, spots=images[0].mean(axis=0))
    return instrument, images, [*(one.text for one in found), *notes]


def _priors(instrument: Platform, images: list[FloatArray]) -> dict[str, Prior]:
    """Angles as wide as the pattern's motion against its own size allows, many times over."""
    means = [one.mean(axis=0) for one in images]
    size = float(np.ptp(means[0], axis=0).max())
    motion = float(np.abs(means[1] - means[0]).max() + images[0].std(axis=0).max())
    pixel = instrument.pixel_pitch / instrument.tracker_focal_length
    reason = "twenty times what the spots moved"
    across = Normal(0.0, GENEROUS * motion * pixel, reason)
    roll = Normal(0.0, GENEROUS * motion / size, reason + ", as a roll of the pattern")
    return {"angle-x": across, "angle-y": across, "angle-z": roll}


def _noisy(model: Model) -> Model:
    """The same, noise and zero attitude free on both sides of what least squares leaves."""
    likelihood = model.likelihood_of(SpotLikelihood)
    residual = likelihood.residual()
    noise = LogUniform(NOISE[0] * residual, NOISE[1] * residual, "no scale preferred: from a "
                       "millionth of what least squares leaves to a thousand times it")  # fmt: skip
    turn = GENEROUS * residual / float(np.ptp(likelihood.statistics.means[0], axis=0).max())
    mount = Normal(0.0, max(MOUNT, turn), "the zero attitude is laid over the spots to begin with: "
                   "a quarter of a degree, or twenty times what their noise turns it")  # fmt: skip
    priors: dict[str, Prior] = {"noise": noise, **{f"mount-{axis}": mount for axis in AXES}}
    return replace(model, parameters=with_priors(model.parameters, priors))


SPOTS = (
    "one spot per line, in px: group 0 at the zero point, 1 at the present; lasers from 1 in the "
    "order of the platform; the images of a group in the order of time, with a column frame where "
    "spots are lost"
)
CONSTANT, DRIFT = (
    File(COLUMNS, SPOTS, partial(model, drifts=drifts), partial(remarks, drifts=drifts),
         optional=FRAMES, platform=True)
    for drifts in (False, True)
)  # fmt: skip
