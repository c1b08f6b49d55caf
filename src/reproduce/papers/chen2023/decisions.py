"""Number of frames to average and time to the next calibration, from the errors of chen2023.

All errors are one sigma about one axis. No sampler is needed: the posterior of white noise and
floor is a sum over a grid, the scatter of Table V depends on a few Gaussian numbers, and the
simulated spots have a closed form at small angles.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import gammaincinv, ndtri

from reproduce.inference.models import small_angle_posterior
from reproduce.papers.charts import legend_below, plot_band, set_log_ticks, two_panels
from reproduce.papers.chen2023 import accuracy, effectiveness, platform, satellite
from reproduce.papers.chen2023.posteriors import INPUTS, drift
from reproduce.papers.declare import Marks, Rows, draws, studied
from reproduce.physics.attitude import averaged_error, moving_average
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Low end of the central 95 %, median, high end.
_ENDS = (0.025, 0.5, 0.975)
_END_SIGMAS = ndtri(_ENDS)
_STATES = (
    "chen2023/table-5#*.monitoring-x",
    "chen2023/table-5#*.monitoring-y",
    "chen2023/table-5#*.reference-x",
    "chen2023/table-5#*.reference-y",
)
_MARKS = ("chen2023/table-4#*.misalignment-x", "chen2023/table-4#*.misalignment-y")
_FRAME_INPUTS = (
    accuracy.COUNTS,
    *_MARKS,
    accuracy.FRAMES,
    *_STATES,
    effectiveness.FRAMES,
)
_SHOWN_COUNTS = (1, 4, 16, 25, 49, 100, 400, 1000)
# Images after the middle of a calibration.
_AGES_IMAGES = (0, 10, 20, 50, 100, 200, 400, 800)
# Scale of the floor's half-normal prior, in halves of the last digit of Table IV: with a floor of
# some tens of them averaging would have no gain.
_FLOOR_SCALE = 20.0
# Nodes of the grid in each direction, and its bounds as fractions of the scatter of one frame. The
# posterior vanishes beyond them.
_GRID_NODES, _WHITE_BOUNDS, _FLOOR_BOUNDS = 160, (0.85, 1.18), (0.0, 0.3)


@cache
def _moments(frames: int, counts: tuple[int, ...]) -> tuple[FloatArray, ...]:
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
    inputs: Inputs, axis: str, white: FloatArray, floor: FloatArray
) -> FloatArray:
    """Return the log likelihood of a column of Table IV for white noises and floors, (n,).

    The averages come from the same frames, so their variances are strongly correlated quadratic
    forms in Gaussian numbers: mean and covariance are exact, and their roots nearly Gaussian.
    Rounding adds the variance of a uniform distribution over the last digit.
    """
    counts = tuple(inputs.array(accuracy.COUNTS).astype(int).tolist())
    printed, half = _printed(inputs, axis)
    ones, drifts, pairs, bent = _moments(inputs.count(accuracy.FRAMES), counts)
    a, b = np.square([white, floor])[..., None]
    mean = a * ones + b * drifts
    covariance = 2 * (a**2)[..., None] * pairs + 4 * (a * b)[..., None] * bent
    root, variance = np.sqrt(mean), np.diagonal(covariance, axis1=1, axis2=2)
    covariance = covariance / (4 * root[:, :, None] * root[:, None])
    factor = np.linalg.cholesky(covariance + half**2 / 3 * np.eye(len(counts)))
    misses = printed - root * (1 - variance / mean**2 / 8)
    scaled = np.linalg.solve(factor, misses[..., None])[..., 0]
    logs = np.log(np.diagonal(factor, axis1=1, axis2=2)) + 0.5 * scaled**2
    return -logs.sum(axis=1)


def _printed(inputs: Inputs, axis: str) -> tuple[FloatArray, float]:
    """Return a column of Table IV and half its last digit, one sigma, in radians."""
    values = inputs.array(f"chen2023/table-4#*.misalignment-{axis}")
    half = inputs.half_unit(f"chen2023/table-4#1.misalignment-{axis}")
    return values / platform.SIGMAS, half / platform.SIGMAS


@dataclass(frozen=True, eq=False)
class _NoisePosterior:
    """Posterior of white noise and floor of one column: nodes in radians, and weights, (n,)."""

    white: FloatArray
    floor: FloatArray
    weights: FloatArray

    def quantiles(self, values: FloatArray) -> FloatArray:
        """Return low end, median and high end of a function from its values at the nodes, (3,)."""
        order = np.argsort(values)
        weights = self.weights[order]
        return np.interp(_ENDS, np.cumsum(weights) - weights / 2, values[order])

    def averages(self, counts: FloatArray) -> FloatArray:
        """Return low end, median and high end of the error of averages, (3, n), in radians."""
        errors = (averaged_error(n, self.white, self.floor) for n in counts)
        return np.stack([self.quantiles(error) for error in errors], axis=-1)


@cache
def _noise(inputs: Inputs, axis: str) -> _NoisePosterior:
    """Return the posterior of the noise about an axis from Table IV."""
    (single, *_), half = _printed(inputs, axis)
    nodes, weights = np.polynomial.legendre.leggauss(_GRID_NODES)
    bounds = single * np.array([_WHITE_BOUNDS, _FLOOR_BOUNDS])
    grids = bounds[:, :1] + (nodes + 1) / 2 * np.diff(bounds)
    white, floor = (grid.ravel() for grid in np.meshgrid(*grids, indexing="ij"))
    # No scale of the white noise is preferred; the floor may be zero.
    logs = np.log(np.outer(weights, weights)).ravel() - np.log(white)
    logs += _log_likelihood(inputs, axis, white, floor)
    logs -= 0.5 * (floor / (_FLOOR_SCALE * half)) ** 2
    density = np.exp(logs - logs.max())
    return _NoisePosterior(white, floor, density / density.sum())


def _differences(inputs: Inputs) -> tuple[float, int]:
    """Return the scatter of monitored minus reference angles of Table V, and its freedom.

    The scatter is about the mean of each axis. It does not depend on the order of the columns.
    """
    columns = [inputs.array(pattern) for pattern in _STATES]
    differences = np.subtract(columns[:2], columns[2:])
    scatter = np.sqrt(differences.var(axis=1, ddof=1).mean())
    return scatter, differences.size - len(differences)


def _state_noise(inputs: Inputs) -> FloatArray:
    """Return low end, median and high end of the noise of one state of Table V, (3,)."""
    scatter, freedom = _differences(inputs)
    # Quantiles of chi-squared.
    chi_square = 2 * gammaincinv(freedom / 2, _ENDS[::-1])
    return scatter * np.sqrt(freedom / chi_square)


def _with_ends(name: str, ends: FloatArray) -> dict[str, float]:
    """Return low end, median and high end as facts."""
    return dict(zip((f"{name}-low", name, f"{name}-high"), ends.tolist(), strict=True))


def _frame_facts(inputs: Inputs) -> dict[str, float]:
    """Return the number of frames where averaging stops, by the floor and by Table V."""
    noises, states = {axis: _noise(inputs, axis) for axis in "xy"}, _state_noise(inputs)
    # Frames whose white noise about X equals the noise of a state.
    frames = (noises["x"].weights @ noises["x"].white / states[::-1]) ** 2
    knees = {
        f"knee-{axis}": noise.quantiles(np.square(noise.white / noise.floor))[0]
        for axis, noise in noises.items()
    }
    return {
        **_with_ends("stage-noise", states * ARCSEC_PER_RADIAN),
        **_with_ends("stage-frames", frames),
        **knees,
        "state": inputs.count(effectiveness.FRAMES),
        "interval": 100 * (_ENDS[2] - _ENDS[0]),
        "upper-end": 100 * _ENDS[2],
        "differences": _differences(inputs)[0] * ARCSEC_PER_RADIAN,
    }


@studied("chen2023/frames", inputs=_FRAME_INPUTS, named=_frame_facts)
def _frames(inputs: Inputs) -> Rows:
    """Compute the error of averages over several numbers of frames."""
    counts = np.array(_SHOWN_COUNTS)
    columns = [_noise(inputs, axis).averages(counts)[[1, 0, 2]] for axis in "xy"]
    table = np.concatenate(columns) * ARCSEC_PER_RADIAN
    yield from zip(_SHOWN_COUNTS, *table.tolist(), strict=True)


@draws("chen2023/drawing-frames", inputs=_FRAME_INPUTS, marks=_MARKS)
def _draw_frames(figure: Figure, printed: Marks, inputs: Inputs) -> None:
    """Draw the error of the misalignment against frames averaged, and the scatter of Table V."""
    counts, states = np.geomspace(1, 1000, 40), _state_noise(inputs) * ARCSEC_PER_RADIAN
    panels = two_panels(figure, 3.9, 6.0, "error, one sigma (arcsec)")
    values = np.array([*printed.values()]).reshape(2, -1)
    points = values / platform.SIGMAS * ARCSEC_PER_RADIAN
    for axes, axis, column in zip(panels, "xy", points, strict=True):
        ends = _noise(inputs, axis).averages(counts) * ARCSEC_PER_RADIAN
        plot_band(axes, counts, ends, "C0", "-", "median, with 95 %")
        white = ends[1, 0] / np.sqrt(counts)
        axes.plot(counts, white, "C6--", label="white noise")
        shown = inputs.array(accuracy.COUNTS)
        axes.plot(shown, column, "ko", markersize=4, label="Table IV")
        belt = np.broadcast_to(states[:, None], ends.shape)
        plot_band(axes, counts, belt, "C1", "-.", "one state of Table V")
        axes.set(title=f"about {axis.upper()}", ylim=(0.008, 0.6))
        axes.set_xlabel("frames averaged (count)")
        set_log_ticks(axes, (1, 10, 100, 1000), (0.01, 0.02, 0.05, 0.1, 0.2, 0.5))
    legend_below(figure, 3)


@cache
def _drifting(inputs: Inputs) -> tuple[float, float, float]:
    """Return the error about X of the drifting group, the drift about X and its error, in rad."""
    model = drift(inputs)
    mean, covariance = small_angle_posterior(model)
    angle, moved = map(model.names.index, ("angle-x", "drift-x"))
    errors = np.sqrt(np.diagonal(covariance))
    return errors[angle], mean[moved], errors[moved]


def _age_facts(inputs: Inputs) -> dict[str, float]:
    """Return the images until the bias of a drift equals the error of one calibration."""
    error, moved, spread = _drifting(inputs)
    count = inputs.count(accuracy.FRAMES)
    ends = count * error / (moved + _END_SIGMAS[::-1] * spread)
    return {
        **_with_ends("images", ends),
        "error": error * ARCSEC_PER_RADIAN,
        "ground": error * satellite.altitude(inputs),
        "followed": count * error / spread,
        "group": count,
    }


@studied("chen2023/drift", inputs=INPUTS, named=_age_facts)
def _ages(inputs: Inputs) -> Rows:
    """Compute the error after a calibration by its age."""
    error, moved, spread = _drifting(inputs)
    # The middle first, then its ends and the error of a drift that is part of the model.
    low, _, high = _END_SIGMAS * spread
    drifts = np.array([moved, moved + low, moved + high, spread])
    for age in _AGES_IMAGES:
        errors = np.hypot(error, drifts / inputs.count(accuracy.FRAMES) * age)
        yield (age, *(errors * ARCSEC_PER_RADIAN).tolist())
