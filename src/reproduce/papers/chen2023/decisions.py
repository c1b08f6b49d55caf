"""What the errors of chen2023 decide: how many frames to average, when to calibrate again.

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
from reproduce.papers.charts import INK, banded, logarithmic, named_below, pair
from reproduce.papers.chen2023 import accuracy, effectiveness, platform, satellite
from reproduce.papers.chen2023.posteriors import READS, drift
from reproduce.papers.declare import Fact, draws, studied
from reproduce.physics.attitude import averaged_error
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import pandas as pd
    from matplotlib.figure import Figure

_ENDS = (0.025, 0.5, 0.975)
_REACH = np.asarray(ndtri(_ENDS))  # the same in standard deviations
_AXES = {"X": "misalignment-x", "Y": "misalignment-y"}
_MARKS = tuple(f"{accuracy.TABLE}#*.{column}" for column in _AXES.values())
_AVERAGES = (f"{accuracy.TABLE}#*.frames", *_MARKS, accuracy.FRAMES)
_STATES = tuple(
    f"{effectiveness.TABLE}#*.{what}-{a}"
    for what in ("reference", "monitoring")
    for a in "xy"
)
_FRAME_READS = (*_AVERAGES, *_STATES, effectiveness.FRAMES)
_COUNTS = (1, 4, 16, 25, 49, 100, 400, 1000)
# Images after the middle of a calibration.
_AGES = (0, 10, 20, 50, 100, 200, 400, 800)
# Scale of the floor's half-normal prior, in halves of the last digit of Table IV: at some tens of
# them averaging would stop to pay.
_FLOOR = 20.0
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


def _log_likelihood(
    door: Given, column: str, white: FloatArray, floor: FloatArray
) -> FloatArray:
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
        return np.asarray(
            np.interp(_ENDS, np.cumsum(shares) - shares / 2, values[order])
        )


@cache
def _column(door: Given, axis: str) -> Column:
    """Return what Table IV says of the misalignment about an axis."""
    name = _AXES[axis]
    (single, *_), half = _printed(door, name)
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    axes = [
        single * (low + (nodes + 1) / 2 * (high - low))
        for low, high in (_WHITES, _FLOORS)
    ]
    white, floor = (one.ravel() for one in np.meshgrid(*axes, indexing="ij"))
    logs = np.add.outer(np.log(weights), np.log(weights)).ravel()
    logs += _log_likelihood(door, name, white, floor)
    # No scale of the white noise is preferred; the floor may well be nothing.
    logs -= np.log(white) + 0.5 * (floor / (_FLOOR * half)) ** 2
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
    """Return the knees of averaging, and where Table V stops."""
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
        one = _column(door, axis)
        knee = one.quantiles(np.square(one.white / one.floor))[0]
        found[f"knee-{axis.lower()}"] = Fact(float(knee), ".0f")
    return found | {
        "state": Fact(door.count(effectiveness.FRAMES), "d"),
        "differences": Fact(_differences(door)[0] * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
    }


@studied("chen2023/frames", given=_FRAME_READS, named=_frame_facts)
def _frames(door: Given) -> pd.DataFrame:
    """How many frames to average."""
    found = [_averages(door, axis, np.array(_COUNTS))[[1, 0, 2]] for axis in _AXES]
    table = np.concatenate(found).T * ARCSEC_PER_RADIAN
    rows = ((count, *row) for count, row in zip(_COUNTS, table.tolist(), strict=True))
    return _frames.frame(
        rows, stops=_stops(door)[1], state=door.count(effectiveness.FRAMES)
    )


@draws("chen2023/drawing-frames", given=_FRAME_READS, marks=_MARKS)
def _draw_frames(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Error of the misalignment against frames averaged, and the scatter of Table V."""
    counts, noise = np.geomspace(1, 1000, 40), _states(door) * ARCSEC_PER_RADIAN
    panels = pair(figure, 3.9, 6.0, "error, one sigma (arcsec)")
    for axes, (axis, column) in zip(panels, _AXES.items(), strict=True):
        ends = _averages(door, axis, counts) * ARCSEC_PER_RADIAN
        banded(axes, counts, ends, "#0072B2", label="median, with 95 %")
        axes.plot(
            counts,
            ends[1, 0] / np.sqrt(counts),
            "--",
            color="#777777",
            label="white noise",
        )
        cells = {
            a: a.split("#")[1].split(".")[0] for a in printed if a.endswith(column)
        }
        values = (
            np.array([printed[a] for a in cells]) / platform.SIGMAS * ARCSEC_PER_RADIAN
        )
        numbers = [int(n) for n in cells.values()]
        axes.plot(numbers, values, "o", color=INK, markersize=4, label="Table IV")
        belt = np.broadcast_to(noise[:, None], ends.shape)
        banded(axes, counts, belt, "#D55E00", "-.", label="one state of Table V")
        axes.set(
            title=f"about {axis}", xlabel="frames averaged (count)", ylim=(0.008, 0.6)
        )
        logarithmic(axes, (1, 10, 100, 1000), (0.01, 0.02, 0.05, 0.1, 0.2, 0.5))
    named_below(figure, 3)


@cache
def _drifting(door: Given) -> tuple[float, float, float]:
    """Of the drifting group: the error about X, the drift about X and its error, in radians."""
    model = drift(door)
    mean, covariance = small_angle_posterior(model)
    angle, moved = (model.names.index(f"{name}-x") for name in ("angle", "drift"))
    errors = np.sqrt(np.diagonal(covariance))
    return float(errors[angle]), float(mean[moved]), float(errors[moved])


def _age_facts(door: Given) -> dict[str, Fact]:
    """Return when the bias of a drift is as large as the error of one calibration."""
    error, moved, spread = _drifting(door)
    count = door.count(accuracy.FRAMES)
    ends = count * error / (moved + _REACH[::-1] * spread)
    names = ("images-low", "images", "images-high")
    return {
        name: Fact(n, ".0f") for name, n in zip(names, ends.tolist(), strict=True)
    } | {
        "error": Fact(error * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
        "ground": Fact(error * satellite.altitude(door), ".2g", "m"),
        "followed": Fact(count * error / spread, ".0f"),
        "group": Fact(count, "d"),
    }


@studied("chen2023/drift", given=READS, named=_age_facts)
def _ages(door: Given) -> Iterator[tuple[float, ...]]:
    """When to calibrate again."""
    count = door.count(accuracy.FRAMES)
    error, moved, spread = _drifting(door)
    for age in _AGES:
        low, middle, high = np.hypot(error, (moved + _REACH * spread) / count * age)
        followed = np.hypot(error, spread / count * age)
        row = np.array([middle, low, high, followed]) * ARCSEC_PER_RADIAN
        yield (age, *row.tolist())
