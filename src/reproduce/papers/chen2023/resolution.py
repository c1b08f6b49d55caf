"""The study of the angular resolution: the best size of a pixel (chen2023, section V-D).

All readings have in common:

* the spot is a Gaussian, and equal on the detector for every angular resolution. The focal length
  of the tracker is constant, so the pixel pitch is resolution times focal length;
* the window has 5 by 5 pixels of that pitch, around the pixel that contains the spot. The centre of
  gravity uses all of them, without a threshold;
* the spot moves along x over one pixel of that pitch (the printed ends are the ends of one pixel of
  the tracker), to the middles of 50 equal parts. In y it stays at the middle of a pixel;
* the flux is not printed. The paper calls the parameters close to the measured ones, so the flux is
  the one that gives the mean variance of Table III, at the printed spots and the tracker's pixel;
* the centroiding accuracy (1 sigma) of a resolution is the standard deviation of the errors of all
  phases and trials together. The optimum is its minimum, at steps of one arc second;
* the monitoring accuracy is (11) with that accuracy.

Options are the meaning of the radius of a Gaussian, the fraction of read noise in the noise of
EMVA 1288, the flux, and the gain that counts as significant: a finer resolution has no gain below
the coarsest resolution that no finer one improves by more than some standard errors of the study.
The ledger evaluates all combinations.

A study of the printed size is itself random. Its distribution follows from the closed-form bias
and variance: the Monte Carlo agrees with it within its error.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cache, lru_cache, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.random import SeedSequence, default_rng

from reproduce.papers.charts import Axes, Figure, legend_below, set_log_ticks, set_size
from reproduce.papers.chen2023.platform import (
    PIXEL,
    SIGMAS,
    SPOTS,
    TRACKER,
    TRACKER_FOCAL_LENGTH,
)
from reproduce.papers.declare import (
    Results,
    draws,
    item_text,
    reproduces,
    seed_of,
)
from reproduce.physics.attitude import attitude_accuracy
from reproduce.physics.images import (
    centre_of_gravity_error,
    cramer_rao_variance,
    simulated_errors,
    window_corners,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.units import ARCSEC_PER_RADIAN, RADIANS_PER_ARCSEC

SPOT_RADIUS = "chen2023/text-resolution#spot-radius"
_WINDOW = "chen2023/text-resolution#window-x"
PHASES = "chen2023/text-resolution#phases"
_TRIALS = "chen2023/text-resolution#trials"
_LASERS = "chen2023/text-resolution#lasers"
_OPTIMUM = "chen2023/text-resolution#optimum"
_ACCURACY = "chen2023/text-resolution#optimum-accuracy"
_SATURATION = "chen2023/text-resolution#saturation"
INPUTS = (
    SPOT_RADIUS,
    _WINDOW,
    *TRACKER,
    SPOTS,
    "chen2023/table-3",
    PHASES,
    _TRIALS,
    _LASERS,
    "chen2023/text-resolution#resolution-low",
    "chen2023/text-resolution#resolution-high",
)
_RADII = item_text("chen2023/text-resolution").options["radius"]
# Printed radius over the standard deviation of the Gaussian.
_WIDTHS = {
    "sigma": 1.0,
    "one-over-e": np.sqrt(2.0),
    "half": np.sqrt(2.0 * np.log(2.0)),
    "one-over-e2": 2.0,
}
# Fraction of the variance of Table III that is read noise.
_READ_FRACTIONS = {"photon": 0.0, "read": 0.9}
# More resolutions would only fill the memory.
_MAX_RESOLUTIONS = 1000
# Flux over the flux that gives the variance of Table III.
_FLUX_FACTORS = {"table-3": 1.0, "brighter": 1.1}


@reproduces(
    "chen2023/text-resolution",
    cells=["spot-radius-pixels", "position-*", "optimum-radius"],
    inputs=[
        SPOT_RADIUS,
        "chen2023/text-resolution#pixel-size",
        _OPTIMUM,
        TRACKER_FOCAL_LENGTH,
    ],
)
def spot(inputs: Inputs) -> Results:
    """Compute the spot radius in pixels, here and at the optimum, and the ends of one pixel."""
    radius, pixel = inputs[SPOT_RADIUS], inputs["chen2023/text-resolution#pixel-size"]
    return {
        "spot-radius-pixels": radius / pixel,
        "position-low": -pixel / 2,
        "position-high": pixel / 2,
        "optimum-radius": radius / (inputs[_OPTIMUM] * inputs[TRACKER_FOCAL_LENGTH]),
    }


@reproduces(
    "chen2023/text-resolution",
    cells=["optimum", "optimum-accuracy", "saturation"],
    inputs=INPUTS,
    replicates=2000,
)
def optimum(
    inputs: Inputs,
    seed: SeedSequence,
    replicates: int,
    *,
    radius: str,
    noise: str,
    light: str,
    threshold: str,
) -> Results:
    """Compute the best resolution, its centroid error, and the resolution without more gain.

    Implements: chen2023 (11).
    """
    angles = _resolutions(inputs)
    case = _WIDTHS[radius], _READ_FRACTIONS[noise], _FLUX_FACTORS[light]
    scatter = _replicated_scatter(inputs, seed, replicates, case)
    monitoring = attitude_accuracy(scatter, inputs.count(_LASERS), angles)
    gain = float(threshold) * _relative_error(inputs)
    return {
        "optimum": angles[scatter.argmin(axis=-1)],
        "optimum-accuracy": scatter.min(axis=-1),
        "saturation": angles[_saturation(monitoring, gain)],
    }


class _Setting(NamedTuple):
    """Arguments of the models of the centroid error, for a spot that moves along x.

    - `positions`: positions of the spot from the middle of its window, (phases, 2), in px.
    - `light`: flux, in electrons.
    - `radii`: standard deviation of the spot, (resolutions, 1), in px.
    - `corner`, `size`: first pixel and width of the window, in px.
    - `read_noise`: noise of a pixel without flux, in electrons.
    """

    positions: FloatArray
    light: float
    radii: FloatArray
    corner: FloatArray
    size: int
    read_noise: float


def _resolutions(inputs: Inputs) -> FloatArray:
    """Return the angular resolutions of the study, one arc second apart, in radians."""
    low, high = inputs.array("chen2023/text-resolution#resolution-*")
    count = round((high - low) / RADIANS_PER_ARCSEC) + 1
    if not 1 <= count <= _MAX_RESOLUTIONS:
        raise ValueError(
            f"chen2023/text-resolution#resolution-high: expected 1 to {_MAX_RESOLUTIONS:,} "
            f"resolutions, one arc second apart, got {count:.6g}. Choose a shorter range"
        )
    return np.linspace(low, high, count)


def _setting(
    inputs: Inputs,
    width: float = 1.0,
    read_fraction: float = 0.0,
    flux_factor: float = 1.0,
) -> _Setting:
    """Return the setting of one reading, by default of the literal one.

    A flux factor of one gives the mean variance of Table III.
    """
    sigma, size = inputs[SPOT_RADIUS] / width, inputs.count(_WINDOW)
    spots = inputs.pairs(SPOTS)
    radius, corners = sigma / inputs[PIXEL], window_corners(spots, size)
    # Photon variance is proportional to the inverse of the flux, read variance to its square.
    photon, both = (
        centre_of_gravity_error(spots, 1.0, radius, corners, size, noise)[1].mean()
        for noise in (0.0, 1.0)
    )
    target = np.square(inputs.array("chen2023/table-3") / SIGMAS).mean()
    flux = photon / ((1.0 - read_fraction) * target)
    read = flux * np.sqrt(read_fraction * target / (both - photon))
    # The middles of equal parts of one pixel.
    count = inputs.count(PHASES)
    phases = (np.arange(count) + 0.5) / count - 0.5
    radii = sigma / (_resolutions(inputs) * inputs[TRACKER_FOCAL_LENGTH])
    return _Setting(
        np.outer(phases, [1.0, 0.0]),
        flux_factor * flux,
        radii[:, None],
        np.full(2, -(size // 2.0)),
        size,
        read,
    )


def _predicted(setting: _Setting) -> FloatArray:
    """Return bias and variance along x in closed form, (2, resolutions, phases)."""
    return np.stack(centre_of_gravity_error(*setting))[..., 0]


def _total(bias: FloatArray, variance: FloatArray) -> FloatArray:
    """Return the standard deviation of the errors of all phases, with the bias."""
    return np.sqrt(variance.mean(axis=-1) + bias.var(axis=-1))


def _relative_error(inputs: Inputs) -> float:
    """Return the relative standard error of a standard deviation from all phases and trials."""
    return 1.0 / np.sqrt(2.0 * inputs.count(PHASES) * inputs.count(_TRIALS))


@lru_cache(maxsize=1)
def _replicated_scatter(
    inputs: Inputs, seed: SeedSequence, replicates: int, case: tuple[float, ...]
) -> FloatArray:
    """Return the results of studies of the printed size, from the closed form.

    Standard deviation of the errors of all phases and trials, (replicates, resolutions), in px.
    """
    trials = inputs.count(_TRIALS)
    bias, variance = _predicted(_setting(inputs, *case))
    generator, shape = default_rng(seed), (replicates, *bias.shape)
    # Mean and variance of normal errors within a phase are independent.
    means = generator.normal(bias, np.sqrt(variance / trials), shape)
    inside = variance * generator.chisquare(trials - 1, shape) / trials
    return _total(means, inside)


def _saturation(monitoring: FloatArray, gain: float) -> FloatArray:
    """Return the index of the coarsest resolution that no finer one improves significantly.

    Index along the last axis. A relative gain up to the given one is not significant.
    """
    finer = np.minimum.accumulate(monitoring, axis=-1)
    unbeaten = monitoring - finer <= gain * np.hypot(monitoring, finer)
    return monitoring.shape[-1] - 1 - unbeaten[..., ::-1].argmax(axis=-1)


@cache
def terms(inputs: Inputs) -> dict[str, FloatArray]:
    """Return the terms of the error in the literal reading by label, (resolutions,), in px.

    The total contains the noise, which is the scatter without bias, and the bias.
    """
    setting = _setting(inputs)
    (bias, variance), trials = _predicted(setting), inputs.count(_TRIALS)
    generator = default_rng(seed_of("chen2023/fig-11a", inputs.root))
    # The literal reading has no read noise.
    positions, light, radii, corner, size, _ = setting
    simulated = [
        simulated_errors(
            positions, light, radius, corner, size, trials, generator
        ).std()
        for radius in radii
    ]
    return {
        "total": _total(bias, variance),
        "noise": np.sqrt(variance.mean(axis=-1)),
        "bias": np.sqrt((bias**2).mean(axis=-1)),
        "Cramér–Rao bound": np.sqrt(
            cramer_rao_variance(*setting)[..., 0].mean(axis=-1)
        ),
        "Monte Carlo": np.array(simulated),
    }


@draws(
    "chen2023/fig-11a",
    inputs=INPUTS,
    marks=[_OPTIMUM, _ACCURACY],
)
def _draw_centroids(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the centroiding accuracy against the angular resolution of the tracker."""
    axes = _draw_radii(figure, inputs, 1.0, np.argmin)
    best = printed[_OPTIMUM] * ARCSEC_PER_RADIAN
    axes.axvline(best, color="k", lw=1, label="printed optimum")
    axes.axhline(printed[_ACCURACY], color="k", lw=1)
    axes.set(ylabel="centroid error (1σ, px)", ylim=(0.008, 0.1))
    legend_below(figure, 3)


@draws("chen2023/fig-11b", inputs=INPUTS, marks=[_SATURATION])
def _draw_monitoring(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the monitoring accuracy against the angular resolution of the tracker."""
    angles = _resolutions(inputs) * ARCSEC_PER_RADIAN
    scale = attitude_accuracy(1.0, inputs.count(_LASERS), angles)
    limit = partial(_saturation, gain=3.0 * _relative_error(inputs))
    axes = _draw_radii(figure, inputs, scale, limit)
    finest = printed[_SATURATION] * ARCSEC_PER_RADIAN
    axes.axvline(finest, color="k", lw=1, label="printed limit")
    axes.set(ylabel="monitoring error (1σ, arcsec)", ylim=(0.25, 4))
    legend_below(figure, 3)


def _draw_radii(
    figure: Figure,
    inputs: Inputs,
    scale: FloatArray | float,
    marked: Callable[[FloatArray], Any],
) -> Axes:
    """Draw the error for each meaning of the radius, with one marked point; return the axes."""
    errors = {}
    for name, width in _WIDTHS.items():
        label = _RADII[name].text.removeprefix("radius: ").removesuffix(" of the spot")
        errors[label] = _total(*_predicted(_setting(inputs, width))) * scale
    return _draw_curves(figure, inputs, errors, marked)


def _draw_curves(
    figure: Figure,
    inputs: Inputs,
    errors: Mapping[str, FloatArray],
    marked: Callable[[FloatArray], Any] | None = None,
) -> Axes:
    """Draw named curves against the resolution, with one marked point; return the axes."""
    set_size(figure, 4.4, 4.4)
    axes, angles = figure.add_subplot(), _resolutions(inputs) * ARCSEC_PER_RADIAN
    looks = ("C0o-", "C1s--", "C2D-.", "C3^:")
    for (label, curve), look in zip(errors.items(), looks, strict=True):
        marks = [marked(curve)] if marked else []
        size = 9 * len(marks)
        axes.plot(angles, curve, look, markersize=size, markevery=marks, label=label)
    axes.set_xlabel("angular resolution (arcsec per px)")
    set_log_ticks(axes, (10, 20, 40, 80), (0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2))
    return axes


@draws("chen2023/drawing-terms", inputs=INPUTS, random=True)
def _draw_terms(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the terms of the centroid error in the literal reading."""
    *lines, (label, simulated) = terms(inputs).items()
    axes = _draw_curves(figure, inputs, dict(lines))
    angles = _resolutions(inputs) * ARCSEC_PER_RADIAN
    axes.plot(angles, simulated, "ko", ms=3, markevery=2, label=label)
    axes.set(ylabel="centroid error (1σ, px)", ylim=(0.004, 0.1))
    legend_below(figure, 3)
