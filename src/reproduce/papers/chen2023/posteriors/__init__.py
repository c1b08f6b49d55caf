"""Posteriors of chen2023: misalignment of the simulated platform, and two printed tables.

The spots of single images are not published. The misalignments therefore take one simulation of
the platform, with the printed spots, their printed scatter and a seed of our own; the tables are
taken as printed.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from reproduce.inference import HalfNormal, Model
from reproduce.inference.models import (
    AveragingLikelihood,
    ReferenceAngles,
    SpotLikelihood,
    SpotStatistics,
    StageTableLikelihood,
    averaging_model,
    errors_with_free_lasers,
    misalignment_model,
    table_model,
)
from reproduce.inference.quadrature import Summed, summed
from reproduce.papers.chen2023.platform import SIGMAS, TELESCOPE, as_designed
from reproduce.papers.chen2023.posteriors import (
    published,
    simulated_spots,
    users_spots,
)
from reproduce.papers.chen2023.posteriors.consequences import Averaged, OnTheGround, StageTest
from reproduce.papers.chen2023.posteriors.simulated_spots import images
from reproduce.papers.declare_posterior import Aside, Declaration
from reproduce.physics.ground import altitude_for_resolution
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN

__all__ = [
    "COLUMNS",
    "FLOORS",
    "READS",
    "under_floors",
]

SATELLITE = "chen2023/table-1"
AVERAGES = "chen2023/table-4"
STAGE = "chen2023/table-5"
FRAMES = "chen2023/text-accuracy#frames"
GROUND = tuple(
    f"{SATELLITE}#panchromatic-{what}.value"
    for what in ("focal-length", "pixel-size", "ground-resolution")
)
READS = (*simulated_spots.READS, FRAMES, *GROUND)
STAGE_READS = (
    *(f"{STAGE}#*.{what}" for what in ("position-?", "reference-?", "monitoring-?")),
    TELESCOPE,
    *GROUND,
)
# Columns of Table IV.
COLUMNS = ("transform-x", "transform-y", "misalignment-x", "misalignment-y")
AVERAGE_READS = (*(f"{AVERAGES}#*.{column}" for column in ("frames", *COLUMNS)), FRAMES, *GROUND)
# Scales of the floor's prior, over ours.
FLOORS = (0.25, 1.0, 4.0)
# Frames whose errors are predicted: one, the most of the table, and as many as it never tried.
SHOWN_COUNTS = (1, 100, 1000)
# Why a model takes no file.
PRINTED_TABLE = "its data are a printed table; for spots of your own take misalignment"
# The misalignment of the simulation: as large as the text expects on orbit, with a roll.
TRUTH = np.array([20.0, -15.0, 30.0]) / ARCSEC_PER_RADIAN
DRIFT = np.array([1.0, 0.5, 0.0]) / ARCSEC_PER_RADIAN


def _ground(given: Given, first: int = 3) -> OnTheGround:
    altitude = float(altitude_for_resolution(*(given[address] for address in GROUND)))
    return OnTheGround(altitude, first)


def _still(given: Given) -> SpotStatistics:
    """A calibration group, and a group after a constant turn."""
    zero = np.zeros(3)
    spots = images(given, [(zero, zero), (TRUTH, TRUTH)], given.count(FRAMES), 0)
    return SpotStatistics.of(spots, (False, False))


def truth(given: Given, drift: bool = False) -> dict[str, float]:
    """The misalignment of the simulation, and how much it drifts through the group."""
    turns = {"angle": TRUTH, "drift": DRIFT} if drift else {"angle": TRUTH}
    return {f"{name}-{axis}": float(angle) for name, angles in turns.items()
            for axis, angle in zip("xyz", angles, strict=True)}  # fmt: skip


def misalignment(given: Given) -> Model:
    """A constant misalignment after a calibration group."""
    return misalignment_model(as_designed(given), _still(given), derived=_ground(given))


def drift(given: Given) -> Model:
    """A misalignment that drifts through the monitoring group."""
    zero = np.zeros(3)
    turns = [(zero, zero), (TRUTH - DRIFT / 2, TRUTH + DRIFT / 2)]
    spots = images(given, turns, given.count(FRAMES), 1)
    statistics = SpotStatistics.of(spots, (False, True))
    return misalignment_model(as_designed(given), statistics, drifts=True, derived=_ground(given))


def stage_positions(given: Given) -> FloatArray:
    """Printed positions of the stage, shape (states, 2), in metres."""
    return np.stack([given.array(f"{STAGE}#*.position-{a}") for a in "xy"], axis=-1)


def _last_motion(given: Given) -> FloatArray:
    """Motion of the stage in its last state, shape (2,), in metres."""
    positions = stage_positions(given)
    return np.asarray(positions[-1] - positions[0])


def frame_averaging(given: Given) -> Model:
    """White noise and floor of every column of Table IV."""
    counts = tuple(int(n) for n in given.array(f"{AVERAGES}#*.frames"))
    printed = np.stack([given.array(f"{AVERAGES}#*.{column}") for column in COLUMNS]) / SIGMAS
    half = given.half_unit(f"{AVERAGES}#{counts[0]}.{COLUMNS[0]}") / SIGMAS
    likelihood = AveragingLikelihood(counts, printed, half, given.count(FRAMES), COLUMNS)
    consequences = Averaged(COLUMNS, SHOWN_COUNTS, _ground(given).altitude)
    return averaging_model(likelihood, derived=consequences)


def _floor_prior(model: Model) -> HalfNormal:
    prior = model.parameters[1].prior
    if not isinstance(prior, HalfNormal):
        raise TypeError(f"floor: expected a half-normal prior, got {prior}")
    return prior


def under_floors(model: Model) -> list[Summed]:
    """Sum one column of Table IV under every prior of the floor, in the order of `FLOORS`."""
    white, floor = model.parameters
    prior = _floor_prior(model)
    under = [
        replace(
            model, parameters=(white, replace(floor, prior=replace(prior, sigma=f * prior.sigma)))
        )
        for f in FLOORS
    ]
    # The widest prior reaches furthest; the others only weigh its nodes otherwise.
    wide = summed(under[-1])
    return [replace(wide, model=one) for one in under]


def reference_angles(given: Given) -> ReferenceAngles:
    """Positions and reference angles of Table V, in the blocks of print."""
    angles = np.stack([given.array(f"{STAGE}#*.reference-{a}") for a in "yx"], axis=-1)
    return ReferenceAngles(
        stage_positions(given),
        angles,
        given.half_unit(f"{STAGE}#2.position-x"),
        given.half_unit(f"{STAGE}#2.reference-y"),
    )


def table_5(given: Given) -> Model:
    """Focal length, bias and noise from Table V."""
    monitored = np.stack([given.array(f"{STAGE}#*.monitoring-{a}") for a in "yx"], axis=-1)
    nominal = given[TELESCOPE]
    model = table_model(StageTableLikelihood(reference_angles(given), monitored), nominal)
    consequences = StageTest(_ground(given).altitude, _last_motion(given), nominal)
    return replace(model, derived=consequences)


def with_free_lasers(model: Model) -> dict[str, Aside]:
    """How well the misalignment were known with the direction of every laser free."""
    likelihood = model.likelihood_of(SpotLikelihood)
    errors = errors_with_free_lasers(likelihood) * ARCSEC_PER_RADIAN
    names = (f"angle-{axis}-sd-lasers-free" for axis in "xyz")
    return {name: Aside(float(e), 0.0, "arcsec") for name, e in zip(names, errors, strict=True)}


POSTERIORS = (
    Declaration(
        "misalignment", "Constant misalignment from laser spots", "chen2023", READS, misalignment,
        users_spots.CONSTANT, truth, published.scatter, asides=with_free_lasers,
    ),
    Declaration(
        "misalignment-drift", "Drifting misalignment from laser spots", "chen2023", READS, drift,
        users_spots.DRIFT, partial(truth, drift=True), published.scatter, steps=330,
    ),
    Declaration(
        "frame-averaging", "White noise of one frame and the floor that averaging leaves",
        "chen2023", AVERAGE_READS, frame_averaging, PRINTED_TABLE,
        published=published.averaged, steps=650, walkers=120,
    ),
    Declaration(
        "table-5", "Effective focal length, angle bias and noise from the stage test", "chen2023",
        STAGE_READS, table_5, PRINTED_TABLE, published=published.stage_table,
        steps=450, walkers=80,
    ),
)  # fmt: skip
