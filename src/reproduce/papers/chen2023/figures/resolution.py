"""Figure 11: accuracy of the centroids and of the monitoring against the angular resolution."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.chen2023 import resolution
from reproduce.papers.declare import draws, seed_of
from reproduce.physics.attitude.averaging import attitude_accuracy
from reproduce.physics.images.phase_study import (
    bound,
    observed_scatter,
    predicted_errors,
    predicted_scatter,
    simulated_errors,
)
from reproduce.physics.optics.simulate import spawned_streams
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["compute", "monte_carlo"]

STUDY = resolution.STUDY
MARKS_CENTROIDS = (f"{STUDY}#optimum", f"{STUDY}#optimum-accuracy")
MARKS_MONITORING = (f"{STUDY}#saturation",)
Curves = dict[str, FloatArray]


def monte_carlo(given: Given) -> FloatArray:
    """Simulate the study as described: the error of all phases and trials at every resolution."""
    phases, light, radius, size = resolution.setting(given)
    trials = given.count(f"{STUDY}#trials")
    streams = spawned_streams(seed_of("chen2023/fig-11a"), len(radius))
    errors = (
        simulated_errors(phases, light, float(sigma), size, trials, stream)
        for sigma, stream in zip(radius, streams, strict=True)
    )
    return np.array([observed_scatter(drawn).total for drawn in errors])


@cache
def compute(door: Given) -> Curves:
    """Compute what both panels of Figure 11 show.

    ``angles`` in radians; ``simulated``, ``predicted`` (all errors together), ``within`` (scatter
    without bias), ``bias`` and ``bound`` in px; each of shape (resolutions,).
    """
    study = resolution.setting(door)
    law = predicted_scatter(predicted_errors(*study))
    return {
        "angles": resolution.resolutions(door),
        "simulated": monte_carlo(door),
        "predicted": law.total,
        "within": law.within,
        "bias": law.bias,
        "bound": bound(*study),
    }


@draws("chen2023/fig-11a", given=resolution.READS, marks=MARKS_CENTROIDS)
def draw_centroids(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Centroiding accuracy against the angular resolution of the tracker."""
    axes = _curves(figure, compute(door), 1.0)
    optimum, accuracy = (printed[address] for address in MARKS_CENTROIDS)
    place = optimum * ARCSEC_PER_RADIAN
    axes.plot(place, accuracy, "*", markersize=13, color="#000000", label="printed best")
    axes.set(ylabel="centroid error (1σ, px)")
    figure.legend(loc="outside lower center", ncols=3)


@draws("chen2023/fig-11b", given=resolution.READS, marks=MARKS_MONITORING)
def draw_monitoring(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Monitoring accuracy against the angular resolution of the tracker."""
    content, lasers = compute(door), door.count(f"{STUDY}#lasers")
    scale = attitude_accuracy(1.0, lasers, content["angles"]) * ARCSEC_PER_RADIAN
    axes = _curves(figure, content, scale)
    limit = printed[MARKS_MONITORING[0]] * ARCSEC_PER_RADIAN
    axes.axvline(limit, color="#000000", linewidth=1, label="printed limit of gain")
    axes.set(ylabel="monitoring error (1σ, arcsec)")
    figure.legend(loc="outside lower center", ncols=3)


def _curves(figure: Figure, content: Curves, scale: FloatArray | float) -> Axes:
    axes = figure.add_subplot()
    angles, few = content["angles"] * ARCSEC_PER_RADIAN, slice(None, None, 2)
    simulated = (content["simulated"] * scale)[few]
    axes.plot(angles[few], simulated, "o", markersize=4, label="Monte Carlo")
    for name, line, what in (
        ("predicted", "-", "closed form"),
        ("within", "--", "its scatter alone"),
        ("bias", "-.", "its bias alone"),
        ("bound", ":", "unbiased bound"),
    ):
        axes.plot(angles, content[name] * scale, line, label=what)
    axes.set(xlabel="angular resolution (arcsec per px)", yscale="log")
    axes.set_ylim(bottom=float((content["bound"] * scale).min()) / 4)
    return axes
