"""Posteriors of chen2023: misalignment of the simulated platform, and two printed tables.

The spots of single images are not published. The misalignments therefore take one simulation of
the platform, with the printed spots, their printed scatter and a seed of our own; the tables are
taken as printed.

The images of a group of a user's spots are in the order of time, evenly spaced.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.random import PCG64, Generator

from reproduce.inference import Consequence, HalfNormal, LogUniform, Model, Normal, Prior, Published
from reproduce.inference.models import (
    AXES,
    MOUNT,
    AveragingLikelihood,
    ReferenceAngles,
    SpotLikelihood,
    SpotStatistics,
    StageTableLikelihood,
    averaging_model,
    errors_with_free_lasers,
    misalignment_model,
    table_model,
    with_priors,
)
from reproduce.inference.quadrature import Summed, summed
from reproduce.papers.chen2023.platform import INSTRUMENT, SCATTER, SIGMAS, TELESCOPE, as_designed
from reproduce.papers.declare_posterior import (
    OWN_DATA,
    Aside,
    Declaration,
    File,
    data_stream,
    published_cells,
    simulated,
)
from reproduce.physics.attitude import Platform, averaged_error, stage_angles
from reproduce.physics.attitude.diagnosis import diagnose, refuse, seen
from reproduce.physics.ground import altitude_for_resolution
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.store import spots as spot_files
from reproduce.store.points import Table, TableFileError
from reproduce.units import ARCSEC_PER_RADIAN

_SPOT_READS = (*INSTRUMENT, SCATTER)


def _simulated_images(
    given: Given, turns: list[tuple[FloatArray, FloatArray]], frames: int, stream: int
) -> list[FloatArray]:
    """Simulate spots of groups of images.

    Shape (frames, 4, 2). In px.
    """
    generator = Generator(PCG64(data_stream(given, 2, stream)))
    design = as_designed(given)
    noise = np.sqrt(np.square(given.array(SCATTER) / SIGMAS).mean())
    # The printed spots fill less than the designed square: simulate what was printed.
    lasers = _pattern_scale(design) * design.lasers
    groups = []
    for first, last in turns:
        turn = first + np.linspace(0, 1, frames)[:, None] * (last - first)
        true = design.predicted(np.zeros((frames, 3)), turn[:, None], lasers)[:, 0]
        groups.append(true + noise * generator.normal(size=true.shape))
    return groups


def _pattern_scale(design: Platform) -> float:
    sizes = [np.ptp(points, axis=0).mean() for points in (design.spots, design.lasers)]
    magnification = design.tracker_focal_length / design.camera_focal_length / design.pixel_pitch
    return float(sizes[0] / (sizes[1] * magnification))


@dataclass(frozen=True)
class OnTheGround:
    """What an error of the misalignment costs on the ground, from the satellite's altitude.

    Parameters
    ----------
    altitude : float
        In metres.
    first : int
        Column of the angle about X; that about Y follows.
    """

    altitude: float
    first: int = 3

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Errors about the posterior mean: pointing in arcsec, position in metres."""
        angles = parameters[:, self.first : self.first + 2]
        error = np.hypot(*(angles - angles.mean(axis=0)).T)
        metres = self.altitude * error
        shift = self.altitude * np.hypot(*angles.T)
        return {
            "pointing error": Consequence(
                error * ARCSEC_PER_RADIAN, "arcsec", "boresight, both axes together"
            ),
            "position error": Consequence(metres, "m", "on the ground, misalignment corrected"),
            "position error uncorrected": Consequence(
                shift, "m", "if the misalignment were ignored"
            ),
        }


@dataclass(frozen=True, eq=False)
class StageTest:
    """What bias, noise and a focal length other than the nominal one cost, after Table V.

    Parameters
    ----------
    altitude : float
        In metres.
    motion : ndarray, shape (2,)
        Of the stage in its last state, in metres.
    nominal : float
        Nominal focal length of the camera, in metres.
    """

    altitude: float
    motion: FloatArray
    nominal: float

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Error of one monitored state, and of the last state's angle with the nominal length."""
        noise, bias = parameters[:, 1], parameters[:, 2:4]
        # Rms over repeats of the noise about both axes; the bias stays.
        error = np.sqrt(np.square(bias).sum(axis=1) + 2 * noise**2)
        motions = np.broadcast_to(self.motion, (len(parameters), 2))
        true = stage_angles(motions, parameters[:, 0])
        believed = stage_angles(motions, np.full(len(parameters), self.nominal))
        wrong = np.linalg.norm(believed - true, axis=-1)
        return {
            "pointing error": Consequence(
                error * ARCSEC_PER_RADIAN, "arcsec", "one state, rms, both axes"
            ),
            "position error": Consequence(self.altitude * error, "m", "on the ground"),
            "last state, nominal focal length": Consequence(
                wrong * ARCSEC_PER_RADIAN,
                "arcsec",
                "error of its angle, were the focal length nominal",
            ),
        }


@dataclass(frozen=True)
class Averaged:
    """Errors of averages over some numbers of frames.

    Parameters
    ----------
    columns : tuple of str
        Whose white noise and floor the parameters are.
    counts : tuple of int
        Frames.
    altitude : float
        In metres.
    """

    columns: tuple[str, ...]
    counts: tuple[int, ...]
    altitude: float

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Three-sigma errors, as the table prints them: in arcsec, and in metres on the ground."""
        found = {}
        for i, column in enumerate(self.columns):
            white, floor = parameters[:, 2 * i : 2 * i + 2].T
            for count in self.counts:
                error = SIGMAS * averaged_error(count, white, floor)
                name = f"{column}, error of {count} frame{'s' if count > 1 else ''}"
                found[name] = Consequence(error * ARCSEC_PER_RADIAN, "arcsec", "three sigma")
                found[f"{name}, position"] = Consequence(
                    self.altitude * error, "m", "three sigma, on the ground"
                )
        return found


SATELLITE = "chen2023/table-1"
AVERAGES = "chen2023/table-4"
STAGE = "chen2023/table-5"
FRAMES = "chen2023/text-accuracy#frames"
GROUND = tuple(
    f"{SATELLITE}#panchromatic-{what}.value"
    for what in ("focal-length", "pixel-size", "ground-resolution")
)
READS = (*_SPOT_READS, FRAMES, *GROUND)
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
    spots = _simulated_images(given, [(zero, zero), (TRUTH, TRUTH)], given.count(FRAMES), 0)
    return SpotStatistics.of(spots, (False, False))


def _truth(given: Given, drift: bool = False) -> dict[str, float]:
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
    spots = _simulated_images(given, turns, given.count(FRAMES), 1)
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


def _reference_angles(given: Given) -> ReferenceAngles:
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
    model = table_model(StageTableLikelihood(_reference_angles(given), monitored), nominal)
    consequences = StageTest(_ground(given).altitude, _last_motion(given), nominal)
    return replace(model, derived=consequences)


def _with_free_lasers(model: Model) -> dict[str, Aside]:
    """How well the misalignment were known with the direction of every laser free."""
    likelihood = model.likelihood_of(SpotLikelihood)
    errors = errors_with_free_lasers(likelihood) * ARCSEC_PER_RADIAN
    names = (f"angle-{axis}-sd-lasers-free" for axis in "xyz")
    return {name: Aside(float(e), 0.0, "arcsec") for name, e in zip(names, errors, strict=True)}


_MOVED = (2, 3, 4, 5)
# Of the angles about Y and about X, against the right hand.
# Rows of print, and the two blocks of the table: motion along X, then along Y.
_MONITORED = tuple(f"{STAGE}#{state}.monitoring-{axis}" for state in _MOVED for axis in "yx")
_REFERENCE = tuple(f"{STAGE}#{state}.reference-{axis}" for state in _MOVED for axis in "yx")
_SCATTERED = tuple(f"{SCATTER}#{g}-{i}.{a}" for g in (1, 2) for i in range(1, 5) for a in "xy")


def _published_scatter(given: Given, model: Model) -> Published:
    """Table III: the scatter of every spot, as the noise of the model would leave it."""
    note = (
        "The noise of the simulation is the rms of these very numbers, so their size proves "
        "nothing; that some lie outside tells against one noise for all spots."
    )
    freedom = given.count(FRAMES) - 1
    noise = model.names.index("noise")

    def repeat(parameters: FloatArray, generator: Generator) -> FloatArray:
        squares = generator.chisquare(freedom, (len(parameters), len(_SCATTERED))) / freedom
        return np.asarray(SIGMAS * parameters[:, noise, None] * np.sqrt(squares))

    return published_cells(given, _SCATTERED, repeat, note=note)


def _published_averaged(given: Given, model: Model) -> Published:
    """Table IV, which is the data of the model; its likelihood gives all digits at once."""
    likelihood = model.likelihood_of(AveragingLikelihood)
    addresses = [f"{AVERAGES}#{n}.{column}" for column in likelihood.names
                 for n in likelihood.counts]  # fmt: skip

    def repeat(parameters: FloatArray, generator: Generator) -> FloatArray:
        tables = simulated(model, parameters, generator)
        return SIGMAS * tables.reshape(len(tables), -1)

    return published_cells(given, addresses, repeat, whole=model.log_likelihood, note=OWN_DATA)


def _published_stage_table(given: Given, model: Model) -> Published:
    """Reference and monitored angles of Table V, which are the data of the model."""
    likelihood = model.likelihood_of(StageTableLikelihood)

    return published_cells(
        given, (*_REFERENCE, *_MONITORED), _both(model), whole=likelihood.log_same, note=OWN_DATA
    )


def _both(model: Model) -> Callable[[FloatArray, Generator], FloatArray]:
    """Repeats of a model whose data are two arrays, both of which are printed."""

    def repeat(parameters: FloatArray, generator: Generator) -> FloatArray:
        pairs = [model.repeat(one, generator) for one in parameters]
        return np.stack([np.concatenate([part.ravel() for part in pair]) for pair in pairs])

    return repeat


# A prior this many times as wide as what the data show is hardly felt, yet proper.
_GENEROUS = 20.0
# Of the residual of least squares: ends of the noise, as good as none.
_NOISE = (1e-6, 1e3)
# Images of a group that tell its scatter.
_LEAST = 3


def _users_model(
    table: Table, pivot: object, drifts: bool, design: Platform | None = None
) -> Model:
    """A misalignment, constant or drifting through group 1, on the paper's platform or another."""
    instrument, images, _ = _measured(table, drifts, design)
    priors = _priors(instrument, images)
    if drifts:
        priors |= {key.replace("angle", "drift"): prior for key, prior in priors.items()}
    statistics = SpotStatistics.of(images, (False, drifts))
    return _noisy(misalignment_model(instrument, statistics, drifts=drifts, priors=priors))


def _users_remarks(
    table: Table, pivot: object, drifts: bool, design: Platform | None = None
) -> list[str]:
    """What a user should hear of the spots, as `reproduce.misalignment` says it."""
    return _measured(table, drifts, design)[2]


def _measured(
    table: Table, drifts: bool, design: Platform | None
) -> tuple[Platform, list[FloatArray], list[str]]:
    """Return the platform, whole images of every group, and what is to be said of them."""
    instrument = as_designed(given(INSTRUMENT)) if design is None else design
    pair, notes = spot_files.images_of(table, len(instrument.lasers))
    instrument, pair, lights = seen(instrument, pair)
    found = diagnose(instrument, pair, drifts, lights)
    refuse(found, table.path)
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
    return instrument, images, [*(one.text for one in found), *notes]


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
    likelihood = model.likelihood_of(SpotLikelihood)
    residual = likelihood.residual()
    noise = LogUniform(_NOISE[0] * residual, _NOISE[1] * residual, "no scale preferred: from a "
                       "millionth of what least squares leaves to a thousand times it")  # fmt: skip
    turn = _GENEROUS * residual / float(np.ptp(likelihood.statistics.means[0], axis=0).max())
    mount = Normal(0.0, max(MOUNT, turn), "the zero attitude is laid over the spots to begin with: "
                   "a quarter of a degree, or twenty times what their noise turns it")  # fmt: skip
    priors: dict[str, Prior] = {"noise": noise, **{f"mount-{axis}": mount for axis in AXES}}
    return replace(model, parameters=with_priors(model.parameters, priors))


_SPOT_LINES = (
    "one spot per line, in px: group 0 at the zero point, 1 at the present; lasers from 1 in the "
    "order of the platform; the images of a group in the order of time, with a column frame where "
    "spots are lost"
)
_CONSTANT_FILE, _DRIFT_FILE = (
    File(
        spot_files.COLUMNS,
        _SPOT_LINES,
        partial(_users_model, drifts=drifts),
        partial(_users_remarks, drifts=drifts),
        optional=spot_files.FRAMES,
        platform=True,
    )
    for drifts in (False, True)
)


POSTERIORS = (
    Declaration(
        "misalignment", "Constant misalignment from laser spots", "chen2023", READS, misalignment,
        _CONSTANT_FILE, _truth, _published_scatter, asides=_with_free_lasers,
    ),
    Declaration(
        "misalignment-drift", "Drifting misalignment from laser spots", "chen2023", READS, drift,
        _DRIFT_FILE, partial(_truth, drift=True), _published_scatter, steps=330,
    ),
    Declaration(
        "frame-averaging", "White noise of one frame and the floor that averaging leaves",
        "chen2023", AVERAGE_READS, frame_averaging, PRINTED_TABLE,
        published=_published_averaged, steps=650, walkers=120,
    ),
    Declaration(
        "table-5", "Effective focal length, angle bias and noise from the stage test", "chen2023",
        STAGE_READS, table_5, PRINTED_TABLE, published=_published_stage_table,
        steps=450, walkers=80,
    ),
)  # fmt: skip
