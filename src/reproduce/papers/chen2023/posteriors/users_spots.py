"""A user's laser spots: files of the misalignments.

One spot per line, in px: ``group`` (0 at the zero point, 1 at the present), ``laser`` (from 1, in
the order of the platform), ``x``, ``y``; the images of a group in the order of time, evenly spaced.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.special import fdtrc

from reproduce.inference.model import Model
from reproduce.inference.models.lasers import Platform, SpotStatistics
from reproduce.inference.models.misalignment import (
    AXES,
    MOUNT,
    SpotLikelihood,
    misalignment_model,
)
from reproduce.inference.models.registration import with_priors
from reproduce.inference.priors import LogUniform, Normal, Prior
from reproduce.papers.chen2023.posteriors.simulated_spots import READS, platform
from reproduce.papers.declare_posterior import File
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import given
from reproduce.store.points import Table, TableFileError

__all__ = ["COLUMNS", "from_table", "moving"]

COLUMNS = ("group", "laser", "x", "y")
GROUPS = 2
# A prior this many times as wide as what the data show is hardly felt, yet proper.
GENEROUS = 20.0
# Of the residual of least squares: ends of the noise, as good as none.
NOISE = (1e-6, 1e3)
# Spots are mirrored if the mirrored lasers explain so many times more of them.
MIRRORED = 3.0
# Fewer images do not tell motion from noise.
FEW = 5
# Still spots seem to move so much one time in so many.
ALARM = 1e-4


def model(table: Table, pivot: object, drifts: bool) -> Model:
    """A misalignment, constant or drifting through group 1."""
    instrument, images = _measured(table)
    priors = _priors(instrument, images)
    if drifts:
        priors |= {key.replace("angle", "drift"): prior for key, prior in priors.items()}
    statistics = SpotStatistics.of(images, (False, drifts))
    return _noisy(misalignment_model(instrument, statistics, drifts=drifts, priors=priors))


def _measured(table: Table) -> tuple[Platform, list[FloatArray]]:
    instrument = platform(given(READS))
    images = _images(table, len(instrument.lasers))
    if not any(np.ptp(one, axis=0).any() for one in images):
        raise TableFileError(
            f"{table.path}: expected spots that scatter from image to image, got the same ones in "
            "all images of a group: without noise there is nothing to sample"
        )
    spots = images[0].mean(axis=0)
    _refuse_mirrored(table, instrument, spots)
    return replace(instrument, spots=spots), images


def from_table(table: Table) -> list[FloatArray]:
    """Return the images at the zero point and at the present, each of shape (frames, lasers, 2)."""
    return _measured(table)[1]


def remarks(table: Table, pivot: object, drifts: bool) -> list[str]:
    """What a user should hear of the spots: groups that move though the model holds them still."""
    images = _measured(table)[1]
    return moving({0: images[0]} if drifts else dict(enumerate(images)))


def moving(groups: Mapping[int, FloatArray]) -> list[str]:
    """Name groups of images, (frames, lasers, 2), within which the spots move evenly."""
    found = []
    for group, images in groups.items():
        if len(images) < FEW:
            continue
        line = SpotStatistics.of([images], (True,))
        count, slopes = line.slopes.size, line.slopes[0]
        spread = line.squares / line.freedom
        if not spread:
            continue
        if fdtrc(count, line.freedom, line.levers[0] * np.square(slopes).mean() / spread) < ALARM:
            way = 2 * np.hypot(*slopes.T).max()  # the slope is that over half of the group
            follow = "; misalignment-drift follows it" if group else ""
            found.append(
                f"the spots move within group {group}, by {way:.2g} px from its first image to its "
                f"last: its mean is that of its middle, and no error counts the motion{follow}"
            )
    return found


def _refuse_mirrored(table: Table, instrument: Platform, spots: FloatArray) -> None:
    """Refuse spots whose mirror image fits the lasers, as they stand in the order of the file."""
    lasers, pattern = (
        (one - one.mean(axis=0)) @ np.array([1, 1j]) for one in (instrument.lasers, spots)
    )
    # The share of the pattern that a similarity of the lasers, or of their mirror image, explains.
    straight, mirrored = abs(lasers.conj() @ pattern), abs(lasers @ pattern)
    if mirrored > MIRRORED * straight:
        raise TableFileError(
            f"{table.path}: the spots are mirrored: in the order of the lasers they turn the other "
            "way round; change the sign of x, or correct the numbers of the lasers"
        )


def _images(table: Table, count: int) -> list[FloatArray]:
    """Spots of every group, shape (frames, lasers, 2), in the order of the file."""
    for name, allowed in (("group", range(GROUPS)), ("laser", range(1, count + 1))):
        for row, value in enumerate(table.column(name)):
            if value not in allowed:
                raise table.wrong(row, name, f"expected a whole number from {allowed[0]} to "
                                  f"{allowed[-1]}")  # fmt: skip
    images = []
    for one in range(GROUPS):
        spots = table.values[table.column("group") == one]
        lasers = [spots[spots[:, 1] == laser, 2:4] for laser in range(1, count + 1)]
        lengths = [len(spot) for spot in lasers]
        if len(set(lengths)) != 1 or lengths[0] < 3:
            last = int(np.flatnonzero(table.column("group") == one)[-1]) if len(spots) else -1
            raise TableFileError(
                f"{table.at(last, 'laser')}: expected as many {table.kind}s for each laser "
                f"from 1 to {count} in group {one}, three or more, got {lengths} by here; add or "
                "remove some"
            )
        images.append(np.stack(lasers, axis=1))
    return images


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
    "order of the platform; the images of a group in the order of time"
)
CONSTANT, DRIFT = (
    File(COLUMNS, SPOTS, partial(model, drifts=drifts), partial(remarks, drifts=drifts))
    for drifts in (False, True)
)
