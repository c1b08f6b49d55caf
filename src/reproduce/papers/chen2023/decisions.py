"""What the errors of chen2023 decide: which there are, frames to average, when to calibrate again.

All errors are one sigma about one axis. Nothing is sampled: the posterior of white noise and floor
is a sum over a grid, the scatter of Table V that of a few Gaussian numbers, and the spots that we
simulate have a closed form at small angles.
"""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.special import gammaincinv, ndtri

from reproduce.inference.models import small_angle_posterior
from reproduce.papers.chen2023 import accuracy, effectiveness, platform, positioning, satellite
from reproduce.papers.chen2023.posteriors import READS, drift, misalignment
from reproduce.papers.declare import Fact, draws, studied
from reproduce.papers.sketch import INK, across, sized
from reproduce.physics.attitude import averaged_error
from reproduce.physics.ground import DAY
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from matplotlib.figure import Figure

_ENDS = (0.025, 0.5, 0.975)
_REACH = np.asarray(ndtri(_ENDS))  # the same in standard deviations
_AXES = {"X": "misalignment-x", "Y": "misalignment-y"}
_MARKS = tuple(f"{accuracy.TABLE}#*.{column}" for column in _AXES.values())
_AVERAGES = (f"{accuracy.TABLE}#*.frames", *_MARKS, accuracy.FRAMES)
_STATES = tuple(f"{effectiveness.TABLE}#*.{what}-{a}"
                for what in ("reference", "monitoring") for a in "xy")  # fmt: skip
_FRAME_READS = (*_AVERAGES, *_STATES, effectiveness.FRAMES, *satellite.CAMERA)
_ERROR_READS = tuple(dict.fromkeys((*_FRAME_READS, *READS)))
_AGE_READS = (*READS, accuracy.DURATION)
_COUNTS = (1, 4, 16, 25, 49, 100, 400, 1000)
# Images after the middle of a calibration.
_AGES = (0, 10, 20, 50, 100, 200, 400, 800)
_OFF_CENTRE = positioning.LOOKS[1][2]  # in metres on the ground
_HOUR = DAY / 24
BLUE, ORANGE = "#0072B2", "#D55E00"
# Scale of the floor's half-normal prior, in halves of the last digit of Table IV: at some tens of
# them averaging would stop to pay. How much wider a prior is tried.
_FLOOR, WIDE = 20.0, 4.0
# Nodes of either, over shares of the scatter of one frame: beyond them the posterior is nothing.
_NODES, _WHITES, _FLOORS = 160, (0.85, 1.18), (0.0, 0.3)


@cache
def _law(frames: int, counts: tuple[int, ...]) -> tuple[FloatArray, ...]:
    """Law of the variances of running averages over so many of all frames.

    Their means for white noise of unit size and for the floor, (m,); traces of products for the
    white part and for the mixed part of their covariances, (m, m). The floor drifts evenly through
    the series, which no average removes.
    """
    drifted = np.linspace(-1, 1, frames)
    drifted = drifted / drifted.std(ddof=1)
    averages, forms = [], []
    for count in counts:
        runs = frames - count + 1
        average = ((np.arange(frames) - np.arange(runs)[:, None]) // count == 0) / count
        centred = (average - average.mean(axis=0)) / np.sqrt(runs - 1)
        forms.append(centred.T @ centred)
        averages.append(centred @ drifted)
    stacked = np.stack(forms)
    floor = np.array([float(one @ one) for one in averages])
    pairs = np.einsum("kij,lij->kl", stacked, stacked, optimize=True)
    bent = stacked @ drifted
    return np.einsum("kii->k", stacked), floor, pairs, bent @ bent.T


def _log_likelihood(door: Given, column: str, white: FloatArray, floor: FloatArray) -> FloatArray:
    """Log likelihood of a column of Table IV, (n,), for white noises and floors, (n,).

    The averages come from the same frames, so their variances are strongly correlated quadratic
    forms in Gaussian numbers: mean and covariance are exact, and their roots nearly Gaussian.
    Rounding adds the variance of an even distribution over the last digit.
    """
    counts = tuple(int(n) for n in door.array(f"{accuracy.TABLE}#*.frames"))
    printed, half = _printed(door, column)
    ones, evens, pairs, bent = _law(door.count(accuracy.FRAMES), counts)
    a, b = white[:, None], floor[:, None]
    mean = a**2 * ones + b**2 * evens
    covariance = 2 * a[..., None] ** 4 * pairs + 4 * (a * b)[..., None] ** 2 * bent
    root = np.sqrt(mean)
    variance = np.diagonal(covariance, axis1=-2, axis2=-1)
    covariance = covariance / (4 * root[:, :, None] * root[:, None, :])
    factor = np.linalg.cholesky(covariance + half**2 / 3 * np.eye(len(counts)))
    off = printed - root * (1 - variance / mean**2 / 8)
    squares = np.square(np.linalg.solve(factor, off[..., None])[..., 0])
    logs = np.log(np.diagonal(factor, axis1=-2, axis2=-1)) + 0.5 * squares
    return np.asarray(-logs.sum(axis=1))


def _printed(door: Given, column: str) -> tuple[FloatArray, float]:
    """A column of Table IV and half its last digit, one sigma, in radians."""
    values = door.array(f"{accuracy.TABLE}#*.{column}")
    half = door.half_unit(f"{accuracy.TABLE}#1.{column}")
    return values / platform.SIGMAS, half / platform.SIGMAS


class Column(NamedTuple):
    """The posterior of white noise and floor of one column: nodes in radians, and shares, (n,)."""

    white: FloatArray
    floor: FloatArray
    shares: FloatArray

    def quantiles(self, values: FloatArray) -> FloatArray:
        """Low end, median and high end of what both make, from its values at the nodes."""
        order = np.argsort(values)
        shares = self.shares[order]
        return np.asarray(np.interp(_ENDS, np.cumsum(shares) - shares / 2, values[order]))


def _column(door: Given, axis: str, wider: float = 1.0) -> Column:
    """Return what Table IV says of the misalignment about an axis, or under a wider prior."""
    return _summed(door.narrowed(_AVERAGES), _AXES[axis], wider)


@cache
def _summed(door: Given, name: str, wider: float) -> Column:
    (single, *_), half = _printed(door, name)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    axes = [single * (low + (nodes + 1) / 2 * (high - low)) for low, high in (_WHITES, _FLOORS)]
    white, floor = (one.ravel() for one in np.meshgrid(*axes, indexing="ij"))
    logs = np.add.outer(np.log(weights), np.log(weights)).ravel()
    logs += _log_likelihood(door, name, white, floor)
    # No scale of the white noise is preferred; the floor may well be nothing.
    logs -= np.log(white) + 0.5 * (floor / (wider * _FLOOR * half)) ** 2
    shares = np.exp(logs - logs.max())
    return Column(white, floor, shares / shares.sum())


def _averages(door: Given, axis: str, counts: FloatArray) -> FloatArray:
    """Error of an average: low end, median and high end for every number of frames, (3, n)."""
    one = _column(door, axis)
    errors = (averaged_error(n, one.white, one.floor) for n in counts)
    return np.stack([one.quantiles(error) for error in errors], axis=-1)


def _differences(door: Given) -> tuple[float, int]:
    """Scatter of Table V's angles, monitored less reference, about their means; their freedom.

    As printed: this does not ask which columns belong where.
    """
    monitored, known = (
        np.stack([door.array(f"{effectiveness.TABLE}#*.{what}-{a}") for a in "xy"])
        for what in ("monitoring", "reference")
    )
    left = monitored - known
    return float(np.sqrt(left.var(axis=1, ddof=1).mean())), left.size - len(left)


def _states(door: Given) -> FloatArray:
    """Noise of one state of Table V in the differences: low end, median and high end, (3,)."""
    scatter, freedom = _differences(door)
    chi = 2 * gammaincinv(freedom / 2, _ENDS[::-1])  # quantiles of chi-squared
    return np.asarray(scatter * np.sqrt(freedom / chi))


def _stops(door: Given) -> FloatArray:
    """Frames whose white noise about X is as large as the noise of one state, (3,)."""
    one = _column(door, "X")
    return np.asarray((one.shares @ one.white / _states(door)[::-1]) ** 2)


def _frame_facts(door: Given) -> dict[str, Fact]:
    """Return the knees of averaging, where Table V stops, and errors that pages compare."""
    height, count = satellite.altitude(door), door.count(effectiveness.FRAMES)
    triples = {
        "stage-noise": (_states(door) * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
        "stage-frames": (_stops(door), ".0f", ""),
    }
    found = {
        name + what: Fact(value, form, unit)
        for name, (ends, form, unit) in triples.items()
        for what, value in zip(("-low", "", "-high"), ends.tolist(), strict=True)
    }
    for axis in _AXES:
        for what, wider in (("", 1.0), ("-wide", WIDE)):
            one = _column(door, axis, wider)
            knee = one.quantiles(np.square(one.white / one.floor))[0]
            found[f"knee-{axis.lower()}{what}"] = Fact(float(knee), ".0f")
    single, many = _averages(door, "X", np.array([1, 100]))[1].tolist()
    about_x = _column(door, "X")
    white = float(about_x.shares @ about_x.white / np.sqrt(count))
    return found | {
        "state": Fact(count, "d"),
        "differences": Fact(_differences(door)[0] * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
        "white-alone": Fact(white * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
        "error-100": Fact(many * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
        "ground-1": Fact(single * height, ".2f", "m"),
        "ground-100": Fact(many * height, ".2f", "m"),
    }


@studied("chen2023/frames", given=_FRAME_READS, named=_frame_facts)
def _frames(door: Given) -> pd.DataFrame:
    """How many frames to average."""
    found = [_averages(door, axis, np.array(_COUNTS))[[1, 0, 2]] for axis in _AXES]
    ground = found[0][:1] * satellite.altitude(door) / ARCSEC_PER_RADIAN
    rows = np.concatenate([*found, ground]).T * ARCSEC_PER_RADIAN
    return _frames.frame(
        ((count, *row) for count, row in zip(_COUNTS, rows.tolist(), strict=True)),
        stops=_stops(door)[1], state=door.count(effectiveness.FRAMES),
    )  # fmt: skip


@draws("chen2023/drawing-frames", given=_FRAME_READS, marks=_MARKS)
def _draw_frames(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Error of the misalignment against frames averaged, and the scatter of Table V."""
    counts, noise = np.geomspace(1, 1000, 40), _states(door)
    narrow = sized(figure, 6.4, 3.9, 6.0)
    panels = figure.subplots(*((2, 1) if narrow else (1, 2)), sharex=True, sharey=True)
    for axes, (axis, column) in zip(panels, _AXES.items(), strict=True):
        low, median, high = _averages(door, axis, counts) * ARCSEC_PER_RADIAN
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
        across(axes, "on the ground (m)", satellite.altitude(door) / ARCSEC_PER_RADIAN)
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


def _age(door: Given, ages: FloatArray, rate: float = 0.0) -> tuple[FloatArray, FloatArray]:
    """Error about X so many images after the middle of a calibration, in radians.

    Low end, median and high end if the angle is taken as constant, (3, n); and if the drift is
    followed, (n,). `rate` takes the place of the drift found, in radians from image to image.
    """
    count = door.count(accuracy.FRAMES)
    error, moved, spread = _drifting(door)
    drifts = moved / count + spread / count * _REACH[:, None]
    drifts = np.full((3, 1), rate) if rate else drifts
    return np.hypot(error, drifts * ages), np.hypot(error, spread / count * ages)


def _age_facts(door: Given) -> dict[str, Fact]:
    """Return when the bias of a drift is as large as the error of one calibration."""
    error, moved, spread = _drifting(door)
    count, time = door.count(accuracy.FRAMES), door[accuracy.DURATION]
    ends = count * error / (moved + _REACH[::-1] * spread)
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
        "rate": Fact(moved / time * _HOUR * ARCSEC_PER_RADIAN, ".0f", "arcsec/h"),
        "group": Fact(count, "d"),
        "half": Fact(count // 2, "d"),
        # At the end of its group, which is half of it after its middle.
        "end-times": Fact(float(np.hypot(1.0, spread / error / 2)), ".1f"),
    }


@studied("chen2023/drift", given=_AGE_READS, named=_age_facts)
def _last(door: Given, drift: float = 0.0) -> pd.DataFrame:
    """When to calibrate again."""
    error, moved, _ = _drifting(door)
    pace = door[accuracy.DURATION] / door.count(accuracy.FRAMES)
    rate = drift / ARCSEC_PER_RADIAN / _HOUR * pace
    constant, followed = _age(door, np.array(_AGES), rate)
    shown = rate or moved / door.count(accuracy.FRAMES)
    rows = zip(
        _AGES, np.array(_AGES) * pace, *(constant[[1, 0, 2]] * ARCSEC_PER_RADIAN),
        constant[1] * satellite.altitude(door), followed * ARCSEC_PER_RADIAN, strict=True,
    )  # fmt: skip
    told = shown / pace * _HOUR * ARCSEC_PER_RADIAN
    return _last.frame(rows, rate=told, images=error / abs(shown))


@draws("chen2023/drawing-drift", given=_AGE_READS)
def _draw_drift(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Error about X against the age of a calibration, while the camera drifts."""
    ages = np.geomspace(1, 800, 60)
    constant, followed = _age(door, ages)
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
    across(axes, "on the ground (m)", satellite.altitude(door) / ARCSEC_PER_RADIAN)
    figure.legend(loc="outside lower center", ncols=1 if narrow else 2)


@cache
def _calibrated(door: Given) -> tuple[FloatArray, FloatArray]:
    """Errors of misalignment about X and of roll after a group: ends and median, in radians."""
    model = misalignment(door)
    exact = small_angle_posterior(model)
    spread = np.sqrt(np.diagonal(exact.covariance))
    # The errors are in proportion to the noise, which the posterior knows too.
    relative = 1 + _REACH * spread[-1] / exact.mean[-1]
    x, z = (spread[model.names.index(f"angle-{axis}")] * relative for axis in "xz")
    return x, z


def _error_facts(door: Given) -> dict[str, Fact]:
    """Return the error of one calibration on the ground."""
    height = satellite.altitude(door)
    return {"calibrated-ground": Fact(float(_calibrated(door)[0][1] * height), ".2g", "m")}


@studied("chen2023/instrument-errors", given=_ERROR_READS, named=_error_facts)
def _errors(door: Given) -> pd.DataFrame:
    """Every error of the pointing, and how well it is known."""
    height = satellite.altitude(door)
    found: dict[tuple[str, str], FloatArray] = {}
    for n, what in enumerate(("White noise of one frame", "Floor that averaging leaves")):
        for axis in _AXES:
            one = _column(door, axis)
            found[f"{what}, {axis}", "Table IV"] = one.quantiles(one[n])
    count = door.count(effectiveness.FRAMES)
    found[f"Mean of {count} frames, X (extrapolated)", "Table IV"] = _averages(
        door, "X", np.array([count])
    )[:, 0]
    found["Scatter of one state of Table V", "Table V"] = _states(door)
    angle, roll = _calibrated(door)
    group = f"{door.count(accuracy.FRAMES)} images"
    found[f"Misalignment X, {group}", "simulated"] = angle
    found[f"Roll, {group}, {_OFF_CENTRE / 1e3:g} km off centre", "simulated"] = (
        roll * _OFF_CENTRE / height
    )
    rows = [
        (*names, *(ends[[1, 0, 2]] * ARCSEC_PER_RADIAN).tolist(), float(ends[1] * height))
        for names, ends in found.items()
    ]
    return _errors.frame(rows, altitude=height / 1e3)
