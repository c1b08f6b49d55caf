"""Posteriors of chen2023: misalignment of the simulated platform, and three printed tables.

The spots of single images are not published. The misalignments therefore take one simulation of
the platform, with the printed spots, their printed scatter and a seed of our own; the tables are
taken as printed.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from numpy.random import PCG64, Generator, SeedSequence

from reproduce.inference.averaging import AveragingLikelihood, averaging_model
from reproduce.inference.directions import directions_model
from reproduce.inference.geometry import GeometryLikelihood, geometry_model
from reproduce.inference.lasers import Platform, SpotStatistics
from reproduce.inference.misalignment import drift_model, misalignment_model
from reproduce.inference.model import Model
from reproduce.inference.reference_angles import HYPOTHESES, ReferenceAngles
from reproduce.inference.stage_table import StageTableLikelihood, table_model
from reproduce.inference.states import states_model
from reproduce.inference.table_readings import Reading, hypotheses
from reproduce.papers.chen2023 import lasers, published
from reproduce.papers.chen2023.consequences import (
    Averaged,
    LastState,
    NominalTracker,
    OnTheGround,
    StageTest,
)
from reproduce.papers.declare import ROOT_SEED
from reproduce.papers.posteriors import Declared
from reproduce.physics.attitude.misalignment import stage_angles
from reproduce.physics.ground.errors import altitude_for_resolution
from reproduce.physics.optics.camera import detector_centre
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.units import ARCSEC_PER_RADIAN

DATA_SEED = (ROOT_SEED, 2)
SATELLITE = "chen2023/table-1"
AVERAGES = "chen2023/table-4"
STAGE = "chen2023/table-5"
FRAMES = "chen2023/text-accuracy#frames"
STATE_FRAMES = "chen2023/text-effectiveness#frames-per-state"
GROUND = tuple(
    f"{SATELLITE}#panchromatic-{what}.value"
    for what in ("focal-length", "pixel-size", "ground-resolution")
)
READS = (*lasers.READS, lasers.SCATTER, FRAMES, *GROUND, f"{STAGE}#*.position-?", STATE_FRAMES)
STAGE_READS = (f"{STAGE}#*.position-?", f"{STAGE}#*.reference-?", lasers.READS[2], *GROUND)
# Frames whose errors are predicted: one, the most of the table, and as many as it never tried.
SHOWN_COUNTS = (1, 100, 1000)
# The misalignment of the simulation: as large as the text expects on orbit, with a roll.
TRUTH = np.array([20.0, -15.0, 30.0]) / ARCSEC_PER_RADIAN
DRIFT = np.array([1.0, 0.5, 0.0]) / ARCSEC_PER_RADIAN


def platform(given: Given) -> Platform:
    """The platform as designed, with the centre of the detector for the principal point."""
    spots = given.array(lasers.SPOTS).reshape(-1, 2)
    pixels = given.array(f"{lasers.PLATFORM}#tracker-pixels-*.value")
    return Platform(
        lasers.designed_positions(spots, given[lasers.DIAGONAL]),
        given[f"{lasers.PLATFORM}#telescope-focal-length.value"],
        given[f"{lasers.PLATFORM}#tracker-focal-length.value"],
        given[f"{lasers.PLATFORM}#tracker-pixel-size.value"],
        detector_centre(pixels),
        spots,
    )


def images(
    given: Given, turns: list[tuple[FloatArray, FloatArray]], frames: int, stream: int
) -> list[FloatArray]:
    """Simulate spots of groups of images.

    Parameters
    ----------
    given : Given
        Holds the cells of `READS`.
    turns : list of tuple of ndarray, shape (3,)
        Misalignment at the start and at the end of each group, in radians.
    frames : int
        Images in each group.
    stream : int
        Which of the streams of random numbers.

    Returns
    -------
    list of ndarray, shape (frames, 4, 2)
        In px.
    """
    seed = SeedSequence(DATA_SEED[0], spawn_key=(DATA_SEED[1], stream))
    generator = Generator(PCG64(seed))
    design = platform(given)
    noise = np.sqrt(np.square(given.array(lasers.SCATTER) / lasers.SIGMAS).mean())
    # The printed spots fill less than the designed square: simulate what was printed.
    scale = np.full(frames, _pattern_scale(design))
    groups = []
    for first, last in turns:
        turn = first + np.linspace(0, 1, frames)[:, None] * (last - first)
        true = design.predicted(
            np.zeros((frames, 3)), turn[:, None], scale, design.camera_focal_length
        )[:, 0]
        groups.append(true + noise * generator.normal(size=true.shape))
    return groups


def _pattern_scale(design: Platform) -> float:
    sizes = [np.ptp(points, axis=0).mean() for points in (design.spots, design.lasers)]
    magnification = design.tracker_focal_length / design.camera_focal_length / design.pixel_pitch
    return float(sizes[0] / (sizes[1] * magnification))


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


def states_truth(given: Given) -> dict[str, float]:
    """The focal length and the stage of the simulation: as designed."""
    return {"focal-length": platform(given).camera_focal_length, "stage-scale": 1.0}


def misalignment(given: Given) -> Model:
    """A constant misalignment after a calibration group."""
    return misalignment_model(platform(given), _still(given), derived=_ground(given))


def directions(given: Given) -> Model:
    """The same images, the direction of every laser free."""
    return directions_model(platform(given), _still(given), derived=_ground(given, 0))


def drift(given: Given) -> Model:
    """A misalignment that drifts through the monitoring group."""
    zero = np.zeros(3)
    turns = [(zero, zero), (TRUTH - DRIFT / 2, TRUTH + DRIFT / 2)]
    spots = images(given, turns, given.count(FRAMES), 1)
    statistics = SpotStatistics.of(spots, (False, True))
    return drift_model(platform(given), statistics, derived=_ground(given))


def states(given: Given) -> Model:
    """The five states of the stage, with the printed positions."""
    positions = stage_positions(given)
    motions = positions - positions[0]
    design = platform(given)
    turns = [(angle, angle) for angle in stage_angles(motions, design.camera_focal_length)]
    spots = images(given, turns, given.count(STATE_FRAMES), 2)
    statistics = SpotStatistics.of(spots, (False,) * len(motions))
    consequences = LastState(_ground(given, 0), motions[-1])
    return states_model(design, statistics, motions, derived=consequences)


def stage_positions(given: Given) -> FloatArray:
    """Printed positions of the stage, shape (states, 2), in metres."""
    return np.stack([given.array(f"{STAGE}#*.position-{a}") for a in "xy"], axis=-1)


def _last_motion(given: Given) -> FloatArray:
    """Motion of the stage in its last state, shape (2,), in metres."""
    positions = stage_positions(given)
    return np.asarray(positions[-1] - positions[0])


def frame_averaging(given: Given, column: str, floor: bool = True) -> Model:
    """White noise and floor of one column of Table IV."""
    counts = tuple(int(n) for n in given.array(f"{AVERAGES}#*.frames"))
    addresses = [f"{AVERAGES}#{count}.{column}" for count in counts]
    printed = np.array([given[a] for a in addresses]) / lasers.SIGMAS
    half = given.half_unit(addresses[0]) / lasers.SIGMAS
    likelihood = AveragingLikelihood(counts, printed, half, given.count(FRAMES), floor)
    name = "frame-averaging" if column == COLUMNS[0] else f"frame-averaging-{column}"
    derived = Averaged(SHOWN_COUNTS, _ground(given).altitude) if floor else None
    return averaging_model(likelihood, name if floor else f"{name}-without-floor", derived=derived)


def reference_angles(given: Given) -> ReferenceAngles:
    """Positions and reference angles of Table V, in the blocks of print."""
    angles = np.stack([given.array(f"{STAGE}#*.reference-{a}") for a in "yx"], axis=-1)
    return ReferenceAngles(
        stage_positions(given),
        angles,
        given.half_unit(f"{STAGE}#2.position-x"),
        given.half_unit(f"{STAGE}#2.reference-y"),
    )


def table_5(given: Given, hypothesis: int | None = None) -> Model:
    """Focal length, bias and noise from Table V."""
    monitored = np.stack([given.array(f"{STAGE}#*.monitoring-{a}") for a in "yx"], axis=-1)
    likelihood = StageTableLikelihood(reference_angles(given), monitored, hypothesis)
    nominal = given[lasers.READS[2]]
    model = table_model(likelihood, nominal)
    if hypothesis is None:
        consequences = StageTest(_ground(given).altitude, _last_motion(given), nominal)
        return replace(model, derived=consequences)
    return replace(model, name=f"{model.name}, {HYPOTHESES[hypothesis]}")


def readings() -> list[Reading]:
    """Return the readings of Table V: the orders of its columns, positions or motions that hold.

    The motions, which no model reads, reach the readings alone.
    """
    door = given((f"{STAGE}#*.position-?", f"{STAGE}#*.motion-?"))
    printed = stage_positions(door)
    motions = np.stack([door.array(f"{STAGE}#*.motion-{a}") for a in "xy"], axis=-1)
    return hypotheses(printed, printed[0] + motions, door.half_unit(f"{STAGE}#2.motion-x"))


def geometry(given: Given) -> Model:
    """Focal lengths and laser spacing from spots and stage test."""
    design = platform(given)
    likelihood = GeometryLikelihood(
        design.spots,
        design.lasers / (given[lasers.DIAGONAL] / 2),
        given.half_unit("chen2023/text-extraction#spot-1-x"),
        design.pixel_pitch,
        reference_angles(given),
        (design.camera_focal_length, design.tracker_focal_length, given[lasers.DIAGONAL]),
    )
    camera, tracker, _ = likelihood.design
    largest = float(np.linalg.norm(stage_angles(_last_motion(given), camera)))
    model = geometry_model(likelihood, float(2 * design.principal_point[0] + 1))
    return replace(model, derived=NominalTracker(_ground(given).altitude, largest, tracker))


COLUMNS = ("transform-x", "transform-y", "misalignment-x", "misalignment-y")
POSTERIORS = (
    Declared("misalignment", "chen2023", READS, misalignment, True, (directions,),
             published.scatter, truth=truth),
    Declared("misalignment-directions", "chen2023", READS, directions, True,
             published=published.scatter, truth=truth),
    Declared("misalignment-states", "chen2023", READS, states, True,
             published=published.monitored, compared=published.MONITORED, truth=states_truth),
    Declared("misalignment-drift", "chen2023", READS, drift, True, published=published.scatter,
             truth=partial(truth, drift=True)),
    *(
        Declared(
            "frame-averaging" if column == COLUMNS[0] else f"frame-averaging-{column}",
            "chen2023",
            (f"{AVERAGES}#*.frames", f"{AVERAGES}#*.{column}", FRAMES, *GROUND),
            partial(frame_averaging, column=column),
            False,
            (partial(frame_averaging, column=column, floor=False),),
            partial(published.averaged, column=column),
        )
        for column in COLUMNS
    ),
    Declared(
        "table-5", "chen2023", (*STAGE_READS, f"{STAGE}#*.monitoring-?"), table_5, False,
        (partial(table_5, hypothesis=0), partial(table_5, hypothesis=1)), published.stage_table,
    ),
    Declared("geometry", "chen2023", (*lasers.READS, *STAGE_READS), geometry, False,
             published=published.spots_and_stage),
)  # fmt: skip
