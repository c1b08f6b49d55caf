"""What the posteriors of chen2023 decide: its errors, frames to average, when to calibrate again.

All errors are one sigma about one axis. Nothing is sampled: Tables IV and V are summed, and the
spots that we simulate have a closed form at small angles; emcee agrees with both within its error.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import ndtri

from reproduce.inference.models import TableResult, by_column, interchanged, small_angle_posterior
from reproduce.inference.quadrature import Summed
from reproduce.papers.chen2023 import accuracy, effectiveness, platform, positioning, satellite
from reproduce.papers.chen2023.posteriors import (
    AVERAGE_READS,
    COLUMNS,
    FLOORS,
    READS,
    STAGE_READS,
    drift,
    frame_averaging,
    misalignment,
    stage_positions,
    table_5,
    under_floors,
)
from reproduce.papers.declare import Fact, draws, studied
from reproduce.papers.sketch import INK, again, sized
from reproduce.physics.attitude import averaged_error, stage_angle
from reproduce.physics.ground import DAY
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    import pandas as pd
    from matplotlib.figure import Figure

ENDS = (0.025, 0.5, 0.975)
REACH = np.asarray(ndtri(ENDS))  # the same in standard deviations
AXES = {"X": "misalignment-x", "Y": "misalignment-y"}
TABLE = "chen2023/table-4"
FRAME_READS = tuple(dict.fromkeys((*AVERAGE_READS, *STAGE_READS, effectiveness.FRAMES)))
ERROR_READS = tuple(dict.fromkeys((*FRAME_READS, *READS)))
AGE_READS = (*READS, accuracy.DURATION)
MARKS = tuple(f"{TABLE}#*.{column}" for column in AXES.values())
COUNTS = (1, 4, 16, 25, 49, 100, 400, 1000)
# Images after the middle of a calibration.
AGES = (0, 10, 20, 50, 100, 200, 400, 800)
OFF_CENTRE = positioning.LOOKS[1][2]  # in metres on the ground
# Nodes that hold less than this are left out where they meet every noise of Table V.
RARE = 1e-7
HOUR = DAY / 24
BLUE, ORANGE = "#0072B2", "#D55E00"


def _columns(door: Given) -> dict[str, list[Summed]]:
    """The misalignment's columns of Table IV by axis, under every prior of the floor."""
    return _summed_columns(door.narrowed(AVERAGE_READS))


@cache
def _summed_columns(door: Given) -> dict[str, list[Summed]]:
    models = dict(zip(COLUMNS, by_column(frame_averaging(door)), strict=True))
    return {axis: under_floors(models[column]) for axis, column in AXES.items()}


def _column(door: Given, axis: str) -> Summed:
    return _columns(door)[axis][FLOORS.index(1.0)]


def averages(door: Given, axis: str, counts: FloatArray) -> FloatArray:
    """Error of an average: low end, median and high end for every number of frames, (3, n)."""
    one = _column(door, axis)
    errors = (averaged_error(n, *one.points.T) for n in counts)
    return np.stack([one.quantiles(error, ENDS) for error in errors], axis=-1)


def stage(door: Given) -> TableResult:
    """What Table V says with its columns of X and Y interchanged."""
    return _summed_stage(door.narrowed(STAGE_READS))


@cache
def _summed_stage(door: Given) -> TableResult:
    return interchanged(table_5(door))


def _with_stage(
    door: Given, value: Callable[[FloatArray, FloatArray, FloatArray], FloatArray], floors: float
) -> tuple[FloatArray, FloatArray]:
    """What white noise and floor about X and the noise of Table V make, sorted, and its shares.

    `floors` is the prior of the floor, in widths of ours.
    """
    one, noises = _columns(door)["X"][FLOORS.index(floors)], np.array(stage(door).noises)
    kept = one.probabilities > RARE
    white, floor = one.points[kept].T
    values = value(white[:, None], floor[:, None], noises)
    weights = np.broadcast_to(one.probabilities[kept, None], values.shape).ravel()
    order = np.argsort(values.ravel())
    shares = np.cumsum(weights[order])
    return values.ravel()[order], shares / shares[-1]


def _excess(door: Given, floors: float = 1.0) -> tuple[FloatArray, FloatArray]:
    """What Table V has beyond an average of its images, in radians, zero where nothing; shares."""
    count = door.count(effectiveness.FRAMES)
    return _with_stage(
        door,
        lambda a, b, noise: np.sqrt(np.maximum(noise**2 - averaged_error(count, a, b) ** 2, 0)),
        floors,
    )


def _ends(values: FloatArray, shares: FloatArray) -> FloatArray:
    return np.asarray(np.interp(ENDS, shares, values))


def _none(values: FloatArray, shares: FloatArray) -> Fact:
    """The probability that nothing is in excess."""
    zero = np.searchsorted(values, 0.0, side="right")
    return Fact(100 * float(shares[zero - 1]) if zero else 0.0, ".1g", "%")


def _stops(door: Given) -> FloatArray:
    """Frames whose white noise is as large as the noise of Table V, (3,)."""
    return _ends(*_with_stage(door, lambda a, b, noise: (a / noise) ** 2 + 0 * b, 1.0))


def _frame_facts(door: Given) -> dict[str, Fact]:
    """Return the knees of averaging, where Table V stops, and errors that pages compare."""
    height, count, table = satellite.altitude(door), door.count(effectiveness.FRAMES), stage(door)
    excess = _ends(*_excess(door))
    triples = {
        "stage-noise": (np.quantile(table.noises, ENDS) * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
        "stage-frames": (_stops(door), ".0f", ""),
        "excess": (excess * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
        "stage-error": (excess * table.means[0] * 1e6, ".1f", "µm"),
    }
    found = {
        name + what: Fact(value, form, unit)
        for name, (ends, form, unit) in triples.items()
        for what, value in zip(("-low", "", "-high"), ends.tolist(), strict=True)
    }
    for axis, under in _columns(door).items():
        for what, one in (("", under[FLOORS.index(1.0)]), ("-wide", under[-1])):
            knee = one.quantiles(np.square(one.points[:, 0] / one.points[:, 1]), ENDS)[0]
            found[f"knee-{axis.lower()}{what}"] = Fact(float(knee), ".0f")
    single, many = averages(door, "X", np.array([1, 100]))[1].tolist()
    # About one axis, the mean square of both: noise, and the bias wherever it lies.
    squares = np.square(table.means[1:]) + np.square(table.deviations[1:])
    state = float(np.sqrt(squares[0] + squares[1:].mean()))
    white = float(_column(door, "X").means[0] / np.sqrt(count))
    # As printed, with a bias about each axis: this does not ask which columns belong where.
    monitored, known = (
        np.stack([door.array(f"{effectiveness.TABLE}#*.{what}-{a}") for a in "xy"])
        for what in ("monitoring", "reference")
    )
    differences = float(np.sqrt((monitored - known).var(axis=1, ddof=1).mean()))
    return found | {
        "state": Fact(count, "d"),
        "excess-none": _none(*_excess(door)),
        "excess-none-wide": _none(*_excess(door, FLOORS[-1])),
        "differences": Fact(differences * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
        "white-alone": Fact(white * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
        "error-100": Fact(many * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
        "ground-1": Fact(single * height, ".2f", "m"),
        "ground-100": Fact(many * height, ".2f", "m"),
        "stage-ground": Fact(state * height, ".2f", "m"),
    }


@studied(
    "chen2023/frames",
    given=FRAME_READS,
    named=_frame_facts,
)  # fmt: skip
def frames(door: Given) -> pd.DataFrame:
    """How many frames to average."""
    found = [averages(door, axis, np.array(COUNTS))[[1, 0, 2]] for axis in AXES]
    ground = found[0][:1] * satellite.altitude(door) / ARCSEC_PER_RADIAN
    rows = np.concatenate([*found, ground]).T * ARCSEC_PER_RADIAN
    return frames.frame(
        ((count, *row) for count, row in zip(COUNTS, rows.tolist(), strict=True)),
        stops=_stops(door)[1], excess=_ends(*_excess(door))[1] * ARCSEC_PER_RADIAN,
        state=door.count(effectiveness.FRAMES),
    )  # fmt: skip


@draws("chen2023/drawing-frames", given=FRAME_READS, marks=MARKS)
def _draw_frames(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Error of the misalignment against frames averaged, and the scatter of Table V."""
    counts, noise = np.geomspace(1, 1000, 40), np.quantile(stage(door).noises, ENDS)
    narrow = sized(figure, 6.4, 3.9, 6.0)
    panels = figure.subplots(*((2, 1) if narrow else (1, 2)), sharex=True, sharey=True)
    for axes, (axis, column) in zip(panels, AXES.items(), strict=True):
        low, median, high = averages(door, axis, counts) * ARCSEC_PER_RADIAN
        axes.fill_between(counts, low, high, facecolor=(BLUE, 0.25), edgecolor=BLUE,
                          linewidth=0.6, label="95 % of the posterior")  # fmt: skip
        axes.plot(counts, median, color=BLUE, label="median")
        axes.plot(counts, median[0] / np.sqrt(counts), "--", color="#777777", label="white noise")
        cells = {a: a.split("#")[1].split(".")[0] for a in printed if a.endswith(column)}
        values = np.array([printed[a] for a in cells]) / platform.SIGMAS * ARCSEC_PER_RADIAN
        axes.plot([int(n) for n in cells.values()], values, "o", color=INK, markersize=4,
                  label="Table IV")  # fmt: skip
        axes.axhspan(*(noise[[0, 2]] * ARCSEC_PER_RADIAN), facecolor=(ORANGE, 0.15),
                     edgecolor=ORANGE, linewidth=0.6)  # fmt: skip
        axes.axhline(noise[1] * ARCSEC_PER_RADIAN, color=ORANGE, linestyle="-.",
                     label="one state of Table V")  # fmt: skip
        axes.set(xscale="log", yscale="log", title=f"about {axis}", ylim=(0.008, 0.6))
        axes.set_xticks((1, 10, 100, 1000), ("1", "10", "100", "1000"))
        axes.set_yticks((0.01, 0.02, 0.05, 0.1, 0.2, 0.5))
        axes.set_yticklabels(("0.01", "0.02", "0.05", "0.1", "0.2", "0.5"))
        axes.minorticks_off()
    for axes in panels if narrow else panels[:1]:
        axes.set_ylabel("error, one sigma (arcsec)")
    for axes in panels[-1:] if narrow else panels:
        axes.set_xlabel("frames averaged (count)")
    for axes in panels if narrow else panels[1:]:
        again(axes, "y", "on the ground (m)", satellite.altitude(door) / ARCSEC_PER_RADIAN)
    handles = panels[0].get_legend_handles_labels()
    figure.legend(*handles, loc="outside lower center", ncols=2 if narrow else 3)


@cache
def _drifting(door: Given) -> tuple[float, float, float]:
    """Of the drifting group: the error about X, the drift about X and its error, in radians."""
    model = drift(door)
    found = small_angle_posterior(model)
    angle, moved = (model.names.index(f"{name}-x") for name in ("angle", "drift"))
    errors = np.sqrt(np.diagonal(found.covariance))
    return float(errors[angle]), float(found.mean[moved]), float(errors[moved])


def age(door: Given, ages: FloatArray, rate: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Error about X so many images after the middle of a calibration, in radians.

    Low end, median and high end if the angle is taken as constant, (3, n); and if the drift is
    followed, (n,). `rate` takes the place of the drift found, in radians from image to image.
    """
    count = door.count(accuracy.FRAMES)
    error, moved, spread = _drifting(door)
    drifts = moved / count + spread / count * REACH[:, None]
    drifts = np.full((3, 1), rate) if rate else drifts
    return np.hypot(error, drifts * ages), np.hypot(error, spread / count * ages)


def _age_facts(door: Given) -> dict[str, Fact]:
    """Return when the bias of a drift is as large as the error of one calibration."""
    error, moved, spread = _drifting(door)
    count, time = door.count(accuracy.FRAMES), door[accuracy.DURATION]
    ends = count * error / (moved + REACH[::-1] * spread)
    low, middle, high = ends.tolist()
    followed = count * error / spread
    height = satellite.altitude(door)
    return {
        "error": Fact(error * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
        "ground": Fact(error * height, ".2g", "m"),
        "images": Fact(middle, ".0f"),
        "images-low": Fact(low, ".0f"),
        "images-high": Fact(high, ".0f"),
        "seconds": Fact(middle * time / count, ".1f", "s"),
        "followed": Fact(followed, ".0f"),
        "followed-seconds": Fact(followed * time / count, ".0f", "s"),
        "rate": Fact(moved / time * HOUR * ARCSEC_PER_RADIAN, ".0f", "arcsec/h"),
        "group": Fact(count, "d"),
        "half": Fact(count // 2, "d"),
        # At the end of its group, which is half of it after its middle.
        "end-times": Fact(float(np.hypot(1.0, spread / error / 2)), ".1f"),
    }


@studied(
    "chen2023/drift",
    given=AGE_READS,
    named=_age_facts,
)
def _last(door: Given, drift: float = 0.0) -> pd.DataFrame:
    """When to calibrate again."""
    error, moved, _ = _drifting(door)
    pace = door[accuracy.DURATION] / door.count(accuracy.FRAMES)
    rate = drift / ARCSEC_PER_RADIAN / HOUR * pace
    constant, followed = age(door, np.array(AGES), rate)
    shown = rate or moved / door.count(accuracy.FRAMES)
    rows = zip(
        AGES, np.array(AGES) * pace, *(constant[[1, 0, 2]] * ARCSEC_PER_RADIAN),
        constant[1] * satellite.altitude(door), followed * ARCSEC_PER_RADIAN, strict=True,
    )  # fmt: skip
    told = shown / pace * HOUR * ARCSEC_PER_RADIAN
    return _last.frame(rows, rate=told, images=error / abs(shown))


@draws("chen2023/drawing-drift", given=AGE_READS)
def _draw_drift(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Error about X against the age of a calibration, while the camera drifts."""
    ages = np.geomspace(1, 800, 60)
    constant, followed = age(door, ages)
    low, median, high = constant * ARCSEC_PER_RADIAN
    narrow = sized(figure, 6.0, 3.6, 4.0)
    axes = figure.subplots()
    axes.fill_between(ages, low, high, facecolor=(ORANGE, 0.25), edgecolor=ORANGE,
                      linewidth=0.6)  # fmt: skip
    axes.plot(ages, median, color=ORANGE, label="taken as constant, with 95 %")
    axes.plot(ages, followed * ARCSEC_PER_RADIAN, "-.", color=BLUE, label="drift followed")
    error = _drifting(door)[0] * ARCSEC_PER_RADIAN
    axes.axhline(error, color="#777777", linestyle="--", label="error of one calibration")
    axes.set(xscale="log", yscale="log", ylim=(0.01, 1.5),
             xlabel="images since the middle of the calibration (count)",
             ylabel="error about X (arcsec)")  # fmt: skip
    axes.set_xticks((1, 10, 100, 800), ("1", "10", "100", "800"))
    axes.set_yticks((0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1), "0.01 0.02 0.05 0.1 0.2 0.5 1".split())
    axes.minorticks_off()
    again(axes, "y", "on the ground (m)", satellite.altitude(door) / ARCSEC_PER_RADIAN)
    figure.legend(loc="outside lower center", ncols=1 if narrow else 2)


@cache
def _calibrated(door: Given) -> tuple[FloatArray, FloatArray]:
    """Errors of misalignment about X and of roll after a group: ends and median, in radians."""
    model = misalignment(door)
    exact = small_angle_posterior(model)
    spread = np.sqrt(np.diagonal(exact.covariance))
    # The errors are in proportion to the noise, which the posterior knows too.
    relative = 1 + REACH * spread[-1] / exact.mean[-1]
    x, z = (spread[model.names.index(f"angle-{axis}")] * relative for axis in "xz")
    return x, z


def _error_facts(door: Given) -> dict[str, Fact]:
    """Return the error of one calibration on the ground."""
    height = satellite.altitude(door)
    return {"calibrated-ground": Fact(float(_calibrated(door)[0][1] * height), ".2g", "m")}


@studied(
    "chen2023/instrument-errors",
    given=ERROR_READS,
    named=_error_facts,
)
def errors(door: Given) -> pd.DataFrame:
    """Every error of the pointing, and how well it is known."""
    height = satellite.altitude(door)
    found: dict[tuple[str, str], FloatArray] = {}
    for n, what in enumerate(("White noise of one frame", "Floor that averaging leaves")):
        for axis in AXES:
            one = _column(door, axis)
            found[f"{what}, {axis}", "Table IV"] = one.quantiles(one.points[:, n], ENDS)
    focal, focal_error = stage(door).means[0], stage(door).deviations[0]
    count = door.count(effectiveness.FRAMES)
    found[f"Mean of {count} frames, X (extrapolated)", "Table IV"] = averages(
        door, "X", np.array([count])
    )[:, 0]
    found["Scatter of one state of Table V", "Table V"] = np.quantile(stage(door).noises, ENDS)
    found["Excess of Table V over that mean", "Tables IV, V"] = _ends(*_excess(door))
    travel = float(np.abs(stage_positions(door)[-1] - stage_positions(door)[0]).max())
    largest = abs(float(stage_angle(travel, focal)))
    known = largest * focal_error / focal
    nominal = abs(float(stage_angle(travel, door[platform.TELESCOPE]))) - largest
    found["Focal length taken as nominal", "Table V"] = REACH * known + nominal
    found["Focal length as fitted", "Table V"] = np.full(3, known)
    angle, roll = _calibrated(door)
    group = f"{door.count(accuracy.FRAMES)} images"
    found[f"Misalignment X, {group}", "simulated"] = angle
    found[f"Roll, {group}, {OFF_CENTRE / 1e3:g} km off centre", "simulated"] = (
        roll * OFF_CENTRE / height
    )
    rows = [
        (*names, *(ends[[1, 0, 2]] * ARCSEC_PER_RADIAN).tolist(), float(ends[1] * height))
        for names, ends in found.items()
    ]
    return errors.frame(rows, altitude=height / 1e3)
