"""Number of frames to average and time to the next calibration, from the errors of chen2023.

All errors are one sigma about one axis. Nothing is sampled: the posterior of white noise and floor
is a sum over a grid, the scatter of Table V that of a few Gaussian numbers, and the simulated spots
have a closed form at small angles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaincinv, ndtri

from reproduce.inference.models import small_angle_posterior
from reproduce.papers.charts import INK, banded, logarithmic, named_below, pair
from reproduce.papers.chen2023 import accuracy, effectiveness, platform, satellite
from reproduce.papers.chen2023.posteriors import READS, drift
from reproduce.papers.declare import Fact, draws, studied
from reproduce.physics.attitude import averaged_error, moving_average
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import pandas as pd
    from matplotlib.figure import Figure

_ENDS = (0.025, 0.5, 0.975)
# The same in standard deviations.
_END_SIGMAS = np.asarray(ndtri(_ENDS))
_AXES = {"X": "misalignment-x", "Y": "misalignment-y"}
_COUNTED = f"{accuracy.TABLE}#*.frames"
_MARKS = tuple(f"{accuracy.TABLE}#*.{column}" for column in _AXES.values())
_STATES = tuple(
    f"{effectiveness.TABLE}#*.{what}-{a}"
    for what in ("monitoring", "reference")
    for a in "xy"
)
_FRAME_READS = (_COUNTED, *_MARKS, accuracy.FRAMES, *_STATES, effectiveness.FRAMES)
_SHOWN_COUNTS = (1, 4, 16, 25, 49, 100, 400, 1000)
# Images after the middle of a calibration.
_AGES_IMAGES = (0, 10, 20, 50, 100, 200, 400, 800)
# Scale of the floor's half-normal prior, in halves of the last digit of Table IV: at some tens of
# them averaging would not pay any more.
_FLOOR_SCALE = 20.0
# Nodes of the grid in each direction, and its bounds as fractions of the scatter of one frame; the
# posterior vanishes beyond them.
_GRID_NODES, _WHITE_BOUNDS, _FLOOR_BOUNDS = 160, (0.85, 1.18), (0.0, 0.3)


@cache
def _law(frames: int, counts: tuple[int, ...]) -> tuple[FloatArray, ...]:
    """Return the moments of the variances of running averages over some of all frames.

    Means for white noise of unit size and for the floor, (m,); traces of products for the
    white part and for the mixed part of their covariances, (m, m). The floor drifts linearly
    through the series, which no average removes.
    """
    drift = np.linspace(-1, 1, frames)
    drift = drift / drift.std(ddof=1)
    forms = []
    for count in counts:
        averages = moving_average(np.eye(frames), count)
        centred = averages - averages.mean(axis=1, keepdims=True)
        forms.append(centred @ centred.T / (averages.shape[1] - 1))
    stacked = np.stack(forms)
    bent = stacked @ drift
    pairs = np.tensordot(stacked, stacked, axes=([1, 2], [2, 1]))
    return np.trace(stacked, axis1=1, axis2=2), bent @ drift, pairs, bent @ bent.T


def _log_likelihood(
    inputs: Inputs, column: str, white: FloatArray, floor: FloatArray
) -> FloatArray:
    """Return the log likelihood of a column of Table IV, (n,), for white noises and floors, (n,).

    The averages come from the same frames, so their variances are strongly correlated quadratic
    forms in Gaussian numbers: mean and covariance are exact, and their roots nearly Gaussian.
    Rounding adds the variance of a uniform distribution over the last digit.
    """
    counts = tuple(int(n) for n in inputs.array(_COUNTED))
    printed, half = _printed(inputs, column)
    ones, drifts, pairs, bent = _law(inputs.count(accuracy.FRAMES), counts)
    a, b = np.square([white, floor])[..., None]
    mean = a * ones + b * drifts
    covariance = 2 * (a**2)[..., None] * pairs + 4 * (a * b)[..., None] * bent
    root, variance = np.sqrt(mean), np.diagonal(covariance, axis1=1, axis2=2)
    covariance = covariance / (4 * root[:, :, None] * root[:, None])
    factor = np.linalg.cholesky(covariance + half**2 / 3 * np.eye(len(counts)))
    off = printed - root * (1 - variance / mean**2 / 8)
    scaled = np.linalg.solve(factor, off[..., None])[..., 0]
    logs = np.log(np.diagonal(factor, axis1=1, axis2=2)) + 0.5 * scaled**2
    return np.asarray(-logs.sum(axis=1))


def _printed(inputs: Inputs, column: str) -> tuple[FloatArray, float]:
    """Return a column of Table IV and half its last digit, one sigma, in radians."""
    values = inputs.array(f"{accuracy.TABLE}#*.{column}")
    half = inputs.half_unit(f"{accuracy.TABLE}#1.{column}")
    return values / platform.SIGMAS, half / platform.SIGMAS


@dataclass(frozen=True, eq=False)
class _NoisePosterior:
    """Posterior of white noise and floor of one column: nodes in radians, and weights, (n,)."""

    white: FloatArray
    floor: FloatArray
    weights: FloatArray

    def quantiles(self, values: FloatArray) -> FloatArray:
        """Return low end, median and high end of a function, from its values at the nodes."""
        order = np.argsort(values)
        weights = self.weights[order]
        middles = np.cumsum(weights) - weights / 2
        return np.asarray(np.interp(_ENDS, middles, values[order]))


@cache
def _noise(inputs: Inputs, axis: str) -> _NoisePosterior:
    """Return the posterior of the noise about an axis from Table IV."""
    (single, *_), half = _printed(inputs, _AXES[axis])
    nodes, weights = np.polynomial.legendre.leggauss(_GRID_NODES)
    white, floor = (
        grid.ravel()
        for grid in np.meshgrid(
            *(
                single * (low + (nodes + 1) / 2 * (high - low))
                for low, high in (_WHITE_BOUNDS, _FLOOR_BOUNDS)
            ),
            indexing="ij",
        )
    )
    # No scale of the white noise is preferred; the floor may be zero.
    logs = np.log(np.outer(weights, weights)).ravel() - np.log(white)
    logs += _log_likelihood(inputs, _AXES[axis], white, floor)
    logs -= 0.5 * (floor / (_FLOOR_SCALE * half)) ** 2
    found = np.exp(logs - logs.max())
    return _NoisePosterior(white, floor, found / found.sum())


def _averages(inputs: Inputs, axis: str, counts: FloatArray) -> FloatArray:
    """Return low end, median and high end of the error of an average for each number, (3, n)."""
    noise = _noise(inputs, axis)
    errors = (averaged_error(n, noise.white, noise.floor) for n in counts)
    return np.stack([noise.quantiles(error) for error in errors], axis=-1)


def _differences(inputs: Inputs) -> tuple[float, int]:
    """Return the scatter of monitored minus reference angles of Table V, and its freedom.

    The scatter is about the mean of each axis. It does not depend on the order of the columns.
    """
    columns = [inputs.array(pattern) for pattern in _STATES]
    left = np.subtract(columns[:2], columns[2:])
    return float(np.sqrt(left.var(axis=1, ddof=1).mean())), left.size - len(left)


def _states(inputs: Inputs) -> FloatArray:
    """Return low end, median and high end of the noise of one state of Table V, (3,)."""
    scatter, freedom = _differences(inputs)
    # Quantiles of chi-squared.
    chi = 2 * gammaincinv(freedom / 2, _ENDS[::-1])
    return np.asarray(scatter * np.sqrt(freedom / chi))


def _stops(inputs: Inputs) -> FloatArray:
    """Return the number of frames whose white noise about X equals the noise of a state, (3,)."""
    noise = _noise(inputs, "X")
    return np.asarray((noise.weights @ noise.white / _states(inputs)[::-1]) ** 2)


def _with_ends(
    name: str, ends: FloatArray, form: str, unit: str = ""
) -> dict[str, Fact]:
    """Return facts of low end, median and high end."""
    names = (f"{name}-low", name, f"{name}-high")
    pairs = zip(names, ends.tolist(), strict=True)
    return {one: Fact(value, form, unit) for one, value in pairs}


def _frame_facts(inputs: Inputs) -> dict[str, Fact]:
    """Return the knees of averaging, and the limit by Table V."""
    noise = _states(inputs) * ARCSEC_PER_RADIAN
    found = _with_ends("stage-noise", noise, ".2g", "arcsec")
    found |= _with_ends("stage-frames", _stops(inputs), ".0f")
    for axis in _AXES:
        one = _noise(inputs, axis)
        knee = one.quantiles(np.square(one.white / one.floor))[0]
        found[f"knee-{axis.lower()}"] = Fact(float(knee), ".0f")
    scatter = _differences(inputs)[0] * ARCSEC_PER_RADIAN
    return found | {
        "state": Fact(inputs.count(effectiveness.FRAMES), "d"),
        "differences": Fact(scatter, ".2g", "arcsec"),
    }


@studied("chen2023/frames", inputs=_FRAME_READS, named=_frame_facts)
def _frames(inputs: Inputs) -> pd.DataFrame:
    """Number of frames to average."""
    found = [
        _averages(inputs, axis, np.array(_SHOWN_COUNTS))[[1, 0, 2]] for axis in _AXES
    ]
    table = np.concatenate(found).T * ARCSEC_PER_RADIAN
    rows = (
        (count, *row) for count, row in zip(_SHOWN_COUNTS, table.tolist(), strict=True)
    )
    return _frames.frame(
        rows, stops=_stops(inputs)[1], state=inputs.count(effectiveness.FRAMES)
    )


@draws("chen2023/drawing-frames", inputs=_FRAME_READS, marks=_MARKS)
def _draw_frames(figure: Figure, printed: Mapping[str, float], inputs: Inputs) -> None:
    """Error of the misalignment against frames averaged, and the scatter of Table V."""
    counts, noise = np.geomspace(1, 1000, 40), _states(inputs) * ARCSEC_PER_RADIAN
    panels = pair(figure, 3.9, 6.0, "error, one sigma (arcsec)")
    for axes, (axis, column) in zip(panels, _AXES.items(), strict=True):
        ends = _averages(inputs, axis, counts) * ARCSEC_PER_RADIAN
        banded(axes, counts, ends, "#0072B2", label="median, with 95 %")
        white = ends[1, 0] / np.sqrt(counts)
        axes.plot(counts, white, "--", color="#777777", label="white noise")
        values = [value for name, value in printed.items() if name.endswith(column)]
        axes.plot(
            inputs.array(_COUNTED),
            np.array(values) / platform.SIGMAS * ARCSEC_PER_RADIAN,
            "o",
            color=INK,
            markersize=4,
            label="Table IV",
        )
        belt = np.broadcast_to(noise[:, None], ends.shape)
        banded(axes, counts, belt, "#D55E00", "-.", label="one state of Table V")
        axes.set(
            title=f"about {axis}", xlabel="frames averaged (count)", ylim=(0.008, 0.6)
        )
        logarithmic(axes, (1, 10, 100, 1000), (0.01, 0.02, 0.05, 0.1, 0.2, 0.5))
    named_below(figure, 3)


@cache
def _drifting(inputs: Inputs) -> tuple[float, float, float]:
    """Return the error about X of the drifting group, the drift about X and its error, in rad."""
    model = drift(inputs)
    mean, covariance = small_angle_posterior(model)
    angle, moved = (model.names.index(f"{name}-x") for name in ("angle", "drift"))
    errors = np.sqrt(np.diagonal(covariance))
    return float(errors[angle]), float(mean[moved]), float(errors[moved])


def _age_facts(inputs: Inputs) -> dict[str, Fact]:
    """Return the images until the bias of a drift equals the error of one calibration."""
    error, moved, spread = _drifting(inputs)
    count = inputs.count(accuracy.FRAMES)
    ends = count * error / (moved + _END_SIGMAS[::-1] * spread)
    return _with_ends("images", ends, ".0f") | {
        "error": Fact(error * ARCSEC_PER_RADIAN, ".2g", "arcsec"),
        "ground": Fact(error * satellite.altitude(inputs), ".2g", "m"),
        "followed": Fact(count * error / spread, ".0f"),
        "group": Fact(count, "d"),
    }


@studied("chen2023/drift", inputs=READS, named=_age_facts)
def _ages(inputs: Inputs) -> Iterator[tuple[float, ...]]:
    """Time to the next calibration."""
    error, moved, spread = _drifting(inputs)
    # The middle first, then its ends and the error of a drift that is followed.
    drifts = np.array([moved, *(moved + _END_SIGMAS[[0, 2]] * spread), spread])
    for age in _AGES_IMAGES:
        row = np.hypot(error, drifts / inputs.count(accuracy.FRAMES) * age)
        yield (age, *(row * ARCSEC_PER_RADIAN).tolist())
