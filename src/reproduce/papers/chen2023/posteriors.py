"""Posteriors of chen2023: the misalignment of the simulated platform, still or drifting.

The spots of single images are not published. The misalignments therefore take one simulation of
the platform, with the printed spots, their printed scatter and a seed of our own.

The images of a group of a user's spots are in the order of time, evenly spaced.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.random import PCG64, Generator

from reproduce.inference import Consequence, LogUniform, Model, Normal, Prior, models
from reproduce.papers.chen2023 import satellite
from reproduce.papers.chen2023.platform import INSTRUMENT, SCATTER, SIGMAS, as_designed
from reproduce.papers.posteriors import Declaration, File, data_stream
from reproduce.physics.attitude import Platform
from reproduce.physics.attitude.diagnosis import diagnose_spots
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.store.points import Table, TableFileError
from reproduce.store.spots import IMAGES, SPOTS, images_of, lost_spots
from reproduce.units import ARCSEC_PER_RADIAN

_FRAMES = "chen2023/text-accuracy#frames"
READS = (*INSTRUMENT, SCATTER, _FRAMES, *satellite.CAMERA)
# The misalignment of the simulation: as large as the text expects on orbit, with a roll.
_TRUTH = np.array([20.0, -15.0, 30.0]) / ARCSEC_PER_RADIAN
_DRIFT = np.array([1.0, 0.5, 0.0]) / ARCSEC_PER_RADIAN
# A prior this many times as wide as what the data show is hardly felt, yet proper.
_GENEROUS = 20.0
# Of the residual of least squares: ends of the noise, as good as none.
_NOISE = (1e-6, 1e3)
# Images of a group that tell its scatter.
_LEAST = 3


def _simulated_images(
    given: Given, turns: list[tuple[FloatArray, FloatArray]], stream: int
) -> models.SpotStatistics:
    """Simulate images of two groups, of which the second may drift."""
    generator, frames = (
        Generator(PCG64(data_stream(given, 2, stream))),
        given.count(_FRAMES),
    )
    design = as_designed(given)
    noise = np.sqrt(np.square(given.array(SCATTER) / SIGMAS).mean())
    # The printed spots fill less than the designed square: simulate what was printed.
    lasers = _pattern_scale(design) * design.lasers
    groups = []
    for first, last in turns:
        turn = first + np.linspace(0, 1, frames)[:, None] * (last - first)
        true = design.predicted(np.zeros((frames, 3)), turn[:, None], lasers)[:, 0]
        groups.append(true + noise * generator.normal(size=true.shape))
    first, last = turns[1]
    return models.SpotStatistics.of(groups, (False, bool((first != last).any())))


def _pattern_scale(design: Platform) -> float:
    sizes = [np.ptp(points, axis=0).mean() for points in (design.spots, design.lasers)]
    magnification = (
        design.tracker_focal_length / design.camera_focal_length / design.pixel_pitch
    )
    return float(sizes[0] / (sizes[1] * magnification))


@dataclass(frozen=True)
class _OnTheGround:
    """What an error of the misalignment costs on the ground, from an altitude in metres."""

    altitude: float

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Errors about the posterior mean, both axes together; and were the angles ignored."""
        angles = parameters[:, 3:5]
        error = np.hypot(*(angles - angles.mean(axis=0)).T)
        metres, shift = (self.altitude * one for one in (error, np.hypot(*angles.T)))
        return {
            "pointing error": Consequence(error * ARCSEC_PER_RADIAN, "arcsec"),
            "position error": Consequence(metres, "m"),
            "position error uncorrected": Consequence(shift, "m"),
        }


def _truth(given: Given, drift: bool = False) -> dict[str, float]:
    """The misalignment of the simulation, and how much it drifts through the group."""
    turns = {"angle": _TRUTH, "drift": _DRIFT} if drift else {"angle": _TRUTH}
    return {
        f"{name}-{axis}": float(angle)
        for name, angles in turns.items()
        for axis, angle in zip("xyz", angles, strict=True)
    }


def _misalignment(given: Given, drift: FloatArray | None = None) -> Model:
    """A misalignment after a calibration group, constant or drifting through its own group."""
    zero, half = np.zeros(3), np.zeros(3) if drift is None else drift / 2
    drifts = drift is not None
    spots = _simulated_images(
        given, [(zero, zero), (_TRUTH - half, _TRUTH + half)], int(drifts)
    )
    ground = _OnTheGround(satellite.altitude(given))
    return models.misalignment_model(
        as_designed(given), spots, drifts=drifts, derived=ground
    )


def drift(given: Given) -> Model:
    """A misalignment that drifts through the monitoring group."""
    return _misalignment(given, _DRIFT)


def _users_model(
    table: Table, given: Mapping[str, Any], drifts: bool
) -> tuple[Model, list[str]]:
    """Return a misalignment, constant or drifting through group 1, and the remarks on the spots.

    The platform is that of the paper by default. The remarks are those of `reproduce.misalignment`.
    """
    instrument, images, remarks = _measured(table, drifts, given.get("platform"))
    priors = _priors(instrument, images)
    if drifts:
        priors |= {
            key.replace("angle", "drift"): prior for key, prior in priors.items()
        }
    statistics = models.SpotStatistics.of(images, (False, drifts))
    model = models.misalignment_model(instrument, statistics, drifts=drifts)
    return _noisy(model.with_priors(priors)), remarks


def _measured(
    table: Table, drifts: bool, design: Platform | None
) -> tuple[Platform, list[FloatArray], list[str]]:
    """Return the platform, whole images of every group, and what is to be said of them."""
    instrument = as_designed(given(INSTRUMENT)) if design is None else design
    pair = images_of(table, len(instrument.lasers))
    notes = lost_spots(pair)
    found = diagnose_spots(instrument, pair, drifts)
    instrument, pair = found.platform, found.images
    images = [one[np.isfinite(one).all(axis=(-2, -1))] for one in pair]
    if lost := sum(map(len, pair)) - sum(map(len, images)):
        notes.append(f"{lost} images that lack a spot are left out")
    if min(map(len, images)) < _LEAST:
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
    return instrument, images, [*(one.text for one in found.findings), *notes]


def _priors(instrument: Platform, images: list[FloatArray]) -> dict[str, Prior]:
    """Angles as wide as the pattern's motion against its own size allows, many times over."""
    means = [one.mean(axis=0) for one in images]
    size = float(np.ptp(means[0], axis=0).max())
    motion = float(np.abs(means[1] - means[0]).max() + images[0].std(axis=0).max())
    pixel = instrument.pixel_pitch / instrument.tracker_focal_length
    reason = "twenty times what the spots moved"
    across = Normal(0.0, _GENEROUS * motion * pixel, reason)
    roll = Normal(0.0, _GENEROUS * motion / size, reason + ", as a roll of the pattern")
    return {"angle-x": across, "angle-y": across, "angle-z": roll}


def _noisy(model: Model) -> Model:
    """The same, noise and zero attitude free on both sides of what least squares leaves."""
    likelihood = model.likelihood_of(models.SpotLikelihood)
    residual = likelihood.residual()
    noise = LogUniform(
        _NOISE[0] * residual,
        _NOISE[1] * residual,
        "no scale preferred: from a "
        "millionth of what least squares leaves to a thousand times it",
    )
    turn = (
        _GENEROUS
        * residual
        / float(np.ptp(likelihood.statistics.means[0], axis=0).max())
    )
    mount = Normal(
        0.0,
        max(models.MOUNT, turn),
        "the zero attitude is laid over the spots to "
        "begin with: a quarter of a degree, or twenty times what their noise turns "
        "it",
    )
    priors: dict[str, Prior] = {
        "noise": noise,
        **{f"mount-{axis}": mount for axis in models.AXES},
    }
    return model.with_priors(priors)


_SPOT_LINES = (
    "one spot per line, in px: group 0 at the zero point, 1 at the present; lasers from 1 in the "
    "order of the platform; the images of a group in the order of time, with a column frame where "
    "spots are lost"
)


def _file(drifts: bool) -> File:
    read = partial(_users_model, drifts=drifts)
    return File(SPOTS, _SPOT_LINES, read, ("platform",), IMAGES)


POSTERIORS = (
    Declaration(
        "misalignment",
        "Constant misalignment from laser spots",
        "chen2023",
        READS,
        _misalignment,
        _file(drifts=False),
        _truth,
    ),
    Declaration(
        "misalignment-drift",
        "Drifting misalignment from laser spots",
        "chen2023",
        READS,
        drift,
        _file(drifts=True),
        partial(_truth, drift=True),
        steps=330,
    ),
)
