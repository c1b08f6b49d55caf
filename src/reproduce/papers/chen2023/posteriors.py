"""Posteriors of chen2023: the misalignment of the simulated platform, constant or drifting.

The spots of single images are not published. The misalignments therefore take one simulation of
the platform, with the printed spots, their printed scatter and a seed of this project.

The images of a group of your spots are in the order of time, evenly spaced.
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
from reproduce.printed.inputs import Inputs, load_inputs
from reproduce.store.points import DataTable, TableFileError
from reproduce.store.spots import IMAGES, SPOTS, images_of, lost_spots
from reproduce.units import ARCSEC_PER_RADIAN

_FRAMES = "chen2023/text-accuracy#frames"
READS = (*INSTRUMENT, SCATTER, _FRAMES, *satellite.CAMERA)
# The misalignment of the simulation: as large as the text expects on orbit, with a roll.
_TRUTH = np.array([20.0, -15.0, 30.0]) / ARCSEC_PER_RADIAN
_DRIFT = np.array([1.0, 0.5, 0.0]) / ARCSEC_PER_RADIAN
# Width of a prior relative to the data: proper, with hardly any influence.
_PRIOR_WIDTHS = 20.0
# Images of a group that determine its scatter.
_MIN_IMAGES = 3


def _simulated_images(
    inputs: Inputs, turns: list[tuple[FloatArray, FloatArray]], drifts: bool
) -> models.SpotStatistics:
    """Simulate images of two groups, of which the second may drift."""
    generator = Generator(PCG64(data_stream(inputs, 2, int(drifts))))
    frames, design = inputs.count(_FRAMES), as_designed(inputs)
    noise = np.sqrt(np.square(inputs.array(SCATTER) / SIGMAS).mean())
    # The printed spots fill less than the designed square: simulate what was printed.
    printed, designed = (
        np.ptp(points, axis=0).mean() for points in (design.spots, design.lasers)
    )
    magnification = (
        design.tracker_focal_length / design.camera_focal_length / design.pixel_pitch
    )
    lasers = printed / (designed * magnification) * design.lasers
    groups = []
    for first, last in turns:
        turn = first + np.linspace(0, 1, frames)[:, None] * (last - first)
        true = design.predicted(np.zeros((frames, 3)), turn[:, None], lasers)[:, 0]
        groups.append(true + noise * generator.normal(size=true.shape))
    return models.SpotStatistics.of(groups, (False, drifts))


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


def _truth(inputs: Inputs, drifts: bool = False) -> dict[str, float]:
    """Return the misalignment of the simulation, and its drift through the group."""
    values = np.append(_TRUTH, _DRIFT if drifts else ())
    names = (f"{name}-{axis}" for name in ("angle", "drift") for axis in models.AXES)
    return dict(zip(names, values.tolist(), strict=False))


def _misalignment(inputs: Inputs, drifts: bool = False) -> Model:
    """Return a misalignment after a calibration group, constant or with a drift."""
    zero, half = np.zeros(3), _DRIFT / 2 if drifts else np.zeros(3)
    turns = [(zero, zero), (_TRUTH - half, _TRUTH + half)]
    return models.misalignment_model(
        as_designed(inputs),
        _simulated_images(inputs, turns, drifts),
        drifts=drifts,
        derived=(_OnTheGround(satellite.altitude(inputs)),),
    )


def drift(inputs: Inputs) -> Model:
    """Return a misalignment that drifts through the monitoring group."""
    return _misalignment(inputs, drifts=True)


def _your_model(
    table: DataTable, inputs: Mapping[str, Any], drifts: bool
) -> tuple[Model, list[str]]:
    """Return a misalignment, constant or with a drift in group 1, and remarks on the spots.

    The platform is that of the paper by default. The remarks are those of `reproduce.misalignment`.
    """
    instrument, images, remarks = _measured(table, drifts, inputs.get("platform"))
    statistics = models.SpotStatistics.of(images, (False, drifts))
    model = models.misalignment_model(instrument, statistics, drifts=drifts)
    return model.with_priors(_priors(model, images)), remarks


def _measured(
    table: DataTable, drifts: bool, design: Platform | None
) -> tuple[Platform, list[FloatArray], list[str]]:
    """Return the platform, whole images of each group, and remarks."""
    instrument = as_designed(load_inputs(INSTRUMENT)) if design is None else design
    pair = images_of(table, len(instrument.lasers))
    found = diagnose_spots(instrument, pair, drifts)
    notes = [*(one.text for one in found.findings), *lost_spots(pair)]
    images = [one[np.isfinite(one).all(axis=(-2, -1))] for one in found.images]
    counts = [len(one) for one in images]
    if lost := sum(map(len, found.images)) - sum(counts):
        notes.append(f"{lost} images that lack a spot are left out")
    if min(counts) < _MIN_IMAGES:
        raise TableFileError(
            f"{table.path}: expected {_MIN_IMAGES} whole images or more in each group, got "
            f"{' and '.join(map(str, counts))}. Add images, which determine the scatter"
        )
    if not any(np.ptp(one, axis=0).any() for one in images):
        raise TableFileError(
            f"{table.path}: expected spots that scatter from image to image, got the same ones in "
            "all images of a group. Without noise there is nothing to sample"
        )
    return replace(found.platform, spots=images[0].mean(axis=0)), images, notes


def _priors(model: Model, images: list[FloatArray]) -> dict[str, Prior]:
    """Return priors on the scale of the motion of your spots and of their residuals."""
    likelihood = model.likelihood_of(models.SpotLikelihood)
    platform, residual = likelihood.platform, likelihood.residual()
    first, last = likelihood.statistics.means
    size = float(np.ptp(first, axis=0).max())
    motion = float(np.abs(last - first).max() + images[0].std(axis=0).max())
    pixel = platform.pixel_pitch / platform.tracker_focal_length
    reason = "twenty times what the spots moved"
    across = Normal(0.0, _PRIOR_WIDTHS * motion * pixel, reason)
    reason += ", as a roll of the pattern"
    roll = Normal(0.0, _PRIOR_WIDTHS * motion / size, reason)
    mount = Normal(
        0.0,
        max(models.MOUNT_SIGMA, _PRIOR_WIDTHS * residual / size),
        "the zero attitude is fitted to the spots first: a quarter of a degree, or twenty times "
        "the rotation by their noise",
    )
    noise = LogUniform(
        1e-6 * residual,
        1e3 * residual,
        "no scale preferred: a millionth to a thousand times the residual of least squares",
    )
    found: dict[str, Prior] = {"noise": noise}
    for axis in models.AXES:
        turn = roll if axis == "z" else across
        found |= {f"mount-{axis}": mount, f"angle-{axis}": turn, f"drift-{axis}": turn}
    return {name: prior for name, prior in found.items() if name in model.names}


_SPOT_LINES = (
    "one spot per line, in px: group 0 at the zero point, 1 at the present; lasers from 1 in the "
    "order of the platform; the images of a group in the order of time, with a column frame where "
    "spots are lost"
)


def _file(drifts: bool) -> File:
    read = partial(_your_model, drifts=drifts)
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
        summary={
            **{f"angle-{axis}": f"Misalignment about {axis.upper()}" for axis in "xyz"},
            "position error": "Position on the ground, corrected",
        },
    ),
    Declaration(
        "misalignment-drift",
        "Drifting misalignment from laser spots",
        "chen2023",
        READS,
        drift,
        _file(drifts=True),
        partial(_truth, drifts=True),
        steps=330,
        summary={f"drift-{axis}": f"Drift about {axis.upper()}" for axis in "xyz"},
    ),
)
