"""The study of the angular resolution: how large a pixel should be (chen2023, section V-D).

What all readings share:

* the spot is a Gaussian, the same on the detector for every angular resolution; the tracker's focal
  length stays, so the pixel pitch is resolution times focal length;
* the window has 5 by 5 pixels of that pitch, around the pixel that holds the spot; the centre of
  gravity takes all of them, without a threshold;
* the spot moves along x over one pixel of that pitch (the printed ends are those of one pixel of
  the tracker), to the middles of 50 equal parts; y stays at the middle of a pixel;
* the light is not printed. The parameters are said to be close to those measured, so the light is
  the one that gives the mean variance of Table III, at the printed spots and the tracker's pixel;
* the centroiding accuracy (1 sigma) of a resolution is the standard deviation of the errors of all
  phases and trials together; the optimum is where it is least, at steps of one arc second;
* the monitoring accuracy is (11) with that accuracy.

Options are the meaning of the radius of a Gaussian, the fraction of read noise in the noise of
EMVA 1288, the flux, and the gain that counts as significant: refining stops to pay below the
coarsest resolution that no finer one beats by more than some standard errors of the study. The
ledger evaluates all combinations.

A study of the printed size is itself random. Its distribution follows from the closed-form bias
and variance: the Monte Carlo agrees with it within its error.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence, default_rng

from reproduce.papers import declare
from reproduce.papers.charts import named_below
from reproduce.papers.chen2023 import platform
from reproduce.physics.attitude import attitude_accuracy
from reproduce.physics.images import (
    CentroidError,
    Light,
    centre_of_gravity_error,
    least_variance,
    predicted_errors,
    simulated_errors,
    window_corners,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.units import ARCSEC_PER_RADIAN, RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

STUDY = "chen2023/text-resolution"
SPOT_RADIUS = f"{STUDY}#spot-radius"
# The spot on pixels of any size, with the light that Table III implies.
_WINDOW = f"{STUDY}#window-x"
_SPOT_READS = (
    SPOT_RADIUS,
    _WINDOW,
    *platform.TRACKER,
    platform.SPOTS,
    platform.SCATTER,
)
PHASES = f"{STUDY}#phases"
_STUDIED = ("trials", "lasers", "resolution-low", "resolution-high")
READS = (*_SPOT_READS, PHASES, *(f"{STUDY}#{name}" for name in _STUDIED))
_OPTIMUM = (f"{STUDY}#optimum", f"{STUDY}#optimum-accuracy")
_SATURATION = f"{STUDY}#saturation"
_REPLICATES = 2000


@dataclass(frozen=True)
class _Case:
    """Spot and noise of one reading of the study.

    - `width`: the printed radius over the standard deviation of the Gaussian.
    - `read_share`: fraction of the variance of Table III that is read noise.
    - `brighter`: the light over that which gives the variance of Table III.
    """

    width: float = 1.0
    read_share: float = 0.0
    brighter: float = 1.0


_WIDTHS = {
    "sigma": 1.0,
    "one-over-e": float(np.sqrt(2.0)),
    "half": float(np.sqrt(2.0 * np.log(2.0))),
    "one-over-e2": 2.0,
}
_READ_SHARES = {"photon": 0.0, "read": 0.9}
_BRIGHTNESS = {"table-3": 1.0, "brighter": 1.1}
_LITERAL = _Case()


@declare.reproduces(
    STUDY,
    cells=["spot-radius-pixels", "position-*", "optimum-radius"],
    inputs=[
        SPOT_RADIUS,
        f"{STUDY}#pixel-size",
        f"{STUDY}#optimum",
        platform.FOCAL_LENGTH,
    ],
)
def spot(inputs: Inputs) -> declare.Results:
    """Spot radius in pixels, here and at the optimum, and the ends of one pixel."""
    radius, pixel = inputs[SPOT_RADIUS], inputs[f"{STUDY}#pixel-size"]
    pixel_at_optimum = inputs[f"{STUDY}#optimum"] * inputs[platform.FOCAL_LENGTH]
    return {
        "spot-radius-pixels": radius / pixel,
        "position-low": -pixel / 2,
        "position-high": pixel / 2,
        "optimum-radius": radius / pixel_at_optimum,
    }


@declare.reproduces(
    STUDY,
    cells=["optimum", "optimum-accuracy", "saturation"],
    inputs=READS,
    equations=["11"],
    replicates=_REPLICATES,
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
) -> declare.Results:
    """Best resolution, its centroid error, and the resolution where refining stops to pay."""
    angles = resolutions(inputs)
    case = _Case(_WIDTHS[radius], _READ_SHARES[noise], _BRIGHTNESS[light])
    scatter = _replicated_scatter(inputs, seed, replicates, case)
    monitoring = attitude_accuracy(scatter, inputs.count(f"{STUDY}#lasers"), angles)
    saturation = _saturation(monitoring, _relative_error(inputs), float(threshold))
    return {
        "optimum": declare.Prediction(np.asarray(angles[scatter.argmin(axis=-1)])),
        "optimum-accuracy": declare.Prediction(np.asarray(scatter.min(axis=-1))),
        "saturation": declare.Prediction(np.asarray(angles[saturation])),
    }


def resolutions(inputs: Inputs) -> FloatArray:
    """Return the angular resolutions of the study, one arc second apart, in radians."""
    low, high = inputs[f"{STUDY}#resolution-low"], inputs[f"{STUDY}#resolution-high"]
    return np.asarray(
        np.linspace(low, high, round((high - low) / RADIANS_PER_ARCSEC) + 1)
    )


def _radii(inputs: Inputs, angles: FloatArray, case: _Case = _LITERAL) -> FloatArray:
    """Return the standard deviation of the spot in pixels that see the given angles."""
    sigma = inputs[SPOT_RADIUS] / case.width
    return np.asarray(sigma / (angles * inputs[platform.FOCAL_LENGTH]))


def spot_laws(spots: FloatArray, radius: float, size: int) -> list[CentroidError]:
    """Return the errors of spots of one electron: by photon noise, and with equal read noise."""
    corners = window_corners(spots, size)
    noises = (0.0, 1.0)
    return [
        centre_of_gravity_error(spots, 1.0, radius, corners, size, noise)
        for noise in noises
    ]


def _light_for_table(inputs: Inputs, case: _Case = _LITERAL) -> Light:
    """Return the light for the mean variance of Table III, or as much more as a case says."""
    radius = inputs[SPOT_RADIUS] / case.width / inputs[platform.PIXEL]
    laws = spot_laws(platform.printed_spots(inputs), radius, round(inputs[_WINDOW]))
    # Photon variance goes as one over the light, read variance as one over its square.
    photon, both = (law.variance.mean() for law in laws)
    target = ((inputs.array(platform.SCATTER) / platform.SIGMAS) ** 2).mean()
    signal = photon / ((1.0 - case.read_share) * target)
    read = signal * np.sqrt(case.read_share * target / (both - photon))
    return Light(float(case.brighter * signal), float(read))


def _setting(
    inputs: Inputs, case: _Case = _LITERAL
) -> tuple[FloatArray, Light, FloatArray, int]:
    """Return the phases, the light, the radii of the spot at all resolutions, and the window."""
    radius = _radii(inputs, resolutions(inputs), case)
    # The middles of so many equal parts of one pixel.
    phases = (np.arange(inputs.count(PHASES)) + 0.5) / inputs.count(PHASES) - 0.5
    return phases, _light_for_table(inputs, case), radius, round(inputs[_WINDOW])


def _relative_error(inputs: Inputs) -> float:
    """Return the relative standard error of a standard deviation from all phases and trials."""
    return float(
        1.0 / np.sqrt(2.0 * inputs.count(PHASES) * inputs.count(f"{STUDY}#trials"))
    )


@lru_cache(maxsize=1)
def _replicated_scatter(
    inputs: Inputs, seed: SeedSequence, replicates: int, case: _Case
) -> FloatArray:
    """Return the results of studies of the printed size, from the closed form.

    Shape (replicates, resolutions). Standard deviation of the errors of all phases and trials, in
    px.
    """
    trials = inputs.count(f"{STUDY}#trials")
    law = predicted_errors(*_setting(inputs, case))
    deviation = np.sqrt(law.variance / trials)
    generator, shape = default_rng(seed), (replicates, *law.bias.shape)
    # Mean and variance of normal errors within a phase are independent.
    means = law.bias + deviation * generator.standard_normal(shape)
    inside = law.variance * generator.chisquare(trials - 1, shape) / trials
    return np.asarray(np.sqrt(inside.mean(axis=-1) + means.var(axis=-1)))


def _saturation(monitoring: FloatArray, relative: float, errors: float) -> FloatArray:
    """Return the index of the coarsest resolution that no finer one beats significantly.

    Index along the last axis.
    """
    finer = np.minimum.accumulate(monitoring, axis=-1)
    error = errors * relative * np.hypot(monitoring, finer)
    unbeaten = monitoring - finer <= error
    return np.asarray(monitoring.shape[-1] - 1 - unbeaten[..., ::-1].argmax(axis=-1))


@cache
def curves(inputs: Inputs) -> dict[str, FloatArray]:
    """Return the curves of both panels of Figure 11, with the study simulated as described.

    ``angles`` in radians; ``simulated``, ``predicted`` (all errors together), ``within`` (scatter
    without bias), ``bias`` and ``bound`` in px; each of shape (resolutions,).
    """
    phases, light, radius, size = study = _setting(inputs)
    law, trials = predicted_errors(*study), inputs.count(f"{STUDY}#trials")
    generator = default_rng(declare.seed_of("chen2023/fig-11a", inputs.root))
    simulated = [
        simulated_errors(phases, light, wide, size, trials, generator).std()
        for wide in radius
    ]
    return {
        "angles": resolutions(inputs),
        "simulated": np.array(simulated),
        "predicted": law.total,
        "within": law.within,
        "bias": np.sqrt((law.bias**2).mean(axis=-1)),
        "bound": np.sqrt(least_variance(*study).mean(axis=-1)),
    }


@declare.draws("chen2023/fig-11a", inputs=READS, marks=_OPTIMUM, random=True)
def _draw_centroids(
    figure: Figure, printed: Mapping[str, float], inputs: Inputs
) -> None:
    """Centroiding accuracy against the angular resolution of the tracker."""
    axes = _curves(figure, curves(inputs), 1.0)
    optimum, accuracy = (printed[address] for address in _OPTIMUM)
    place = optimum * ARCSEC_PER_RADIAN
    axes.plot(
        place, accuracy, "*", markersize=13, color="#000000", label="printed best"
    )
    axes.set(ylabel="centroid error (1σ, px)")
    named_below(figure, 3)


@declare.draws("chen2023/fig-11b", inputs=READS, marks=[_SATURATION], random=True)
def _draw_monitoring(
    figure: Figure, printed: Mapping[str, float], inputs: Inputs
) -> None:
    """Monitoring accuracy against the angular resolution of the tracker."""
    content, lasers = curves(inputs), inputs.count(f"{STUDY}#lasers")
    scale = attitude_accuracy(1.0, lasers, content["angles"]) * ARCSEC_PER_RADIAN
    axes = _curves(figure, content, scale)
    limit = printed[_SATURATION] * ARCSEC_PER_RADIAN
    axes.axvline(limit, color="#000000", linewidth=1, label="printed limit of gain")
    axes.set(ylabel="monitoring error (1σ, arcsec)")
    named_below(figure, 3)


def _curves(
    figure: Figure, content: dict[str, FloatArray], scale: FloatArray | float
) -> Axes:
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
