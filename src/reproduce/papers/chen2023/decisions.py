"""Number of frames to average, from the printed errors of chen2023.

All errors are one sigma about one axis. No sampler is needed: the posterior of white noise and
floor is a sum over a grid.
"""

from __future__ import annotations

from functools import cache, partial
from itertools import product

import numpy as np
from scipy.special import softmax

from reproduce.papers.charts import (
    LEVELS,
    Figure,
    legend_below,
    plot_band,
    set_log_ticks,
    two_panels,
)
from reproduce.papers.chen2023.accuracy import COUNTS, FRAMES
from reproduce.papers.chen2023.effectiveness import FRAMES_PER_STATE
from reproduce.papers.chen2023.platform import SIGMAS
from reproduce.papers.chen2023.published import averaging
from reproduce.papers.declare import Results, Rows, draws, studied
from reproduce.physics.attitude import averaged_error
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.units import ARCSEC_PER_RADIAN

_MARKS = ("chen2023/table-4#*.misalignment-x", "chen2023/table-4#*.misalignment-y")
_FRAME_INPUTS = (
    COUNTS,
    *_MARKS,
    FRAMES,
    FRAMES_PER_STATE,
)
_SHOWN_COUNTS = np.array([1, 4, 16, 25, 49, 100, 400, 1000])
# White noise and floor as fractions of the scatter of one frame: the middles of equal parts of 0.85
# to 1.18, and of 0 to 0.3. The posterior vanishes beyond them.
_PARTS = (np.arange(300) + 0.5) / 300
_GRID = np.array([*product(0.85 + 0.33 * _PARTS, 0.3 * _PARTS)])

# Low end, median and high end of values with weights along the last axis.
_quantiles = partial(np.quantile, q=LEVELS, axis=-1, method="inverted_cdf")


@cache
def _noise(inputs: Inputs, axis: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return white noise and floor of Table IV on a grid, in radians, and their weights, (n,)."""
    model = averaging(inputs, axis)
    single = model.likelihood.start()[0][0]
    points = single * _GRID
    white, floor = points.T
    return white, floor, softmax(model.log_posterior(points))


def _averages(inputs: Inputs, axis: str, counts: FloatArray) -> FloatArray:
    """Return low end, median and high end of the error of averages, (3, n), in arcsec."""
    white, floor, weights = _noise(inputs, axis)
    errors = averaged_error(counts[:, None], white, floor)
    return _quantiles(errors, weights=weights) * ARCSEC_PER_RADIAN


def _frame_facts(inputs: Inputs) -> Results:
    """Return frames at which the floor equals the white noise, and the white noise of a state."""
    knees = {}
    for axis in "xy":
        white, floor, weights = _noise(inputs, axis)
        knees[f"knee-{axis}"] = _quantiles((white / floor) ** 2, weights=weights)[0]
    white, _, weights = _noise(inputs, "x")
    averaged = weights @ white / np.sqrt(inputs[FRAMES_PER_STATE])
    return {
        **knees,
        "state-white": averaged * ARCSEC_PER_RADIAN,
        "interval": 100 * (LEVELS[2] - LEVELS[0]),
        "upper-end": 100 * LEVELS[2],
    }


@studied("chen2023/frames", inputs=_FRAME_INPUTS, named=_frame_facts)
def _frames(inputs: Inputs) -> Rows:
    """Compute the error of averages over several numbers of frames."""
    columns = [_averages(inputs, axis, _SHOWN_COUNTS)[[1, 0, 2]] for axis in "xy"]
    yield from zip(_SHOWN_COUNTS, *np.concatenate(columns), strict=True)


@draws("chen2023/drawing-frames", inputs=_FRAME_INPUTS, marks=_MARKS)
def _draw_frames(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the error of the misalignment against the number of averaged frames."""
    counts = np.geomspace(1, 1000, 40)
    panels = two_panels(figure, 3.9, 6.0, "error, one sigma (arcsec)")
    for axes, axis, mark in zip(panels, "xy", _MARKS, strict=True):
        ends = _averages(inputs, axis, counts)
        plot_band(axes, counts, ends, "C0-", "median, with 95 %")
        white = ends[1, 0] / np.sqrt(counts)
        axes.plot(counts, white, "C6--", label="white noise")
        shown = inputs.array(COUNTS)
        points = printed.array(mark) / SIGMAS * ARCSEC_PER_RADIAN
        axes.plot(shown, points, "ko", markersize=4, label="Table IV")
        axes.set(
            title=f"about {axis.upper()}",
            xlabel="frames averaged (count)",
            ylim=(0.008, 0.6),
        )
        set_log_ticks(axes, (1, 10, 100, 1000), (0.01, 0.02, 0.05, 0.1, 0.2, 0.5))
    legend_below(figure, 3)
