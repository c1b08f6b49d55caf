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
    even_phases,
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
    phases = even_phases(given.count(f"{STUDY}#phases"))
    trials, size = given.count(f"{STUDY}#trials"), resolution.window(given)
    light = resolution.light_for_table(given)
    radius = resolution.radii(given, resolution.resolutions(given))
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
    angles = resolution.resolutions(door)
    phases = even_phases(door.count(f"{STUDY}#phases"))
    radius, size = resolution.radii(door, angles), resolution.window(door)
    light = resolution.light_for_table(door)
    law = predicted_scatter(predicted_errors(phases, light, radius, size))
    return {
        "angles": angles,
        "simulated": monte_carlo(door),
        "predicted": law.total,
        "within": law.within,
        "bias": law.bias,
        "bound": bound(phases, light, radius, size),
    }


@draws("chen2023/fig-11a", given=resolution.READS, marks=MARKS_CENTROIDS)
def draw_centroids(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Centroiding accuracy against the angular resolution of the tracker."""
    axes, angles = _axes(figure, door)
    _curves(axes, door, angles, 1.0)
    (optimum, accuracy) = (printed[address] for address in MARKS_CENTROIDS)
    axes.plot(
        float(_arcsec(optimum)), accuracy, "*", markersize=13, color="#000000", label="printed best"
    )
    axes.set(ylabel="centroid error (1σ, px)")
    figure.legend(loc="outside lower center", ncols=3)


@draws("chen2023/fig-11b", given=resolution.READS, marks=MARKS_MONITORING)
def draw_monitoring(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Monitoring accuracy against the angular resolution of the tracker."""
    axes, angles = _axes(figure, door)
    lasers = door.count(f"{STUDY}#lasers")
    _curves(axes, door, angles, _arcsec(attitude_accuracy(1.0, lasers, compute(door)["angles"])))
    limit = float(_arcsec(printed[MARKS_MONITORING[0]]))
    axes.axvline(limit, color="#000000", linewidth=1, label="printed limit of gain")
    axes.set(ylabel="monitoring error (1σ, arcsec)")
    figure.legend(loc="outside lower center", ncols=3)


def _axes(figure: Figure, door: Given) -> tuple[Axes, FloatArray]:
    axes = figure.add_subplot()
    axes.set(xlabel="angular resolution (arcsec per px)", yscale="log")
    return axes, np.asarray(_arcsec(compute(door)["angles"]))


def _curves(axes: Axes, door: Given, angles: FloatArray, scale: FloatArray | float) -> None:
    content = compute(door)
    few = slice(None, None, 2)
    axes.plot(
        angles[few], (content["simulated"] * scale)[few], "o", markersize=4, label="Monte Carlo"
    )
    axes.plot(angles, content["predicted"] * scale, "-", label="closed form")
    axes.plot(angles, content["within"] * scale, "--", label="its scatter alone")
    axes.plot(angles, content["bias"] * scale, "-.", label="its bias alone")
    axes.plot(angles, content["bound"] * scale, ":", label="unbiased bound")
    low = float((content["bound"] * scale).min())
    axes.set_ylim(bottom=low / 4)


def _arcsec(angle: FloatArray | float) -> FloatArray:
    return np.asarray(angle * ARCSEC_PER_RADIAN)
