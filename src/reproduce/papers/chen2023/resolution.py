"""The study of the angular resolution: how large a pixel should be (chen2023, section V-D).

The readings, fixed before their result was known:

* the Gaussian radius is the standard deviation of the spot, the same on the detector for every
  angular resolution; the tracker's focal length stays, so the pixel pitch is resolution times
  focal length;
* the window has 5 by 5 pixels of that pitch, around the pixel that holds the spot; the centre of
  gravity takes all of them, without a threshold;
* the spot moves along x over one pixel of that pitch (the printed ends are those of one pixel of
  the tracker), to the middles of 50 equal parts; y stays at the middle of a pixel;
* the text names the Poisson noise and no other, so there is photon noise and no read noise;
* the light is not printed. "Close to those measured" is taken at its word: the light is the one
  that gives the mean variance of Table III, at the printed spots and the tracker's pixel;
* the centroiding accuracy (1 sigma) of a resolution is the standard deviation of the errors of all
  phases and trials together; the optimum is where it is least, at steps of one arc second;
* the monitoring accuracy is (11) with that accuracy. Refining "is not significant" below the
  coarsest resolution that no finer one beats by more than three standard errors of the study.

A study of the printed size is itself random. Its distribution follows from the closed-form bias
and variance: the Monte Carlo beside it agrees within its error.
"""

from __future__ import annotations

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers.chen2023 import lasers
from reproduce.papers.declare import Prediction, Results, reproduces
from reproduce.physics.averaging import attitude_accuracy
from reproduce.physics.centroid_theory import centre_of_gravity_error
from reproduce.physics.phase_study import (
    Light,
    even_phases,
    predicted_errors,
)
from reproduce.physics.simulate import spawned_streams
from reproduce.physics.spots import window_corners
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import RADIANS_PER_ARCSEC

STUDY = "chen2023/text-angular-resolution"
FOCAL_LENGTH = "chen2023/table-2#tracker-focal-length.value"
PIXEL = "chen2023/table-2#tracker-pixel-size.value"
READS = (
    *(f"{STUDY}#{name}" for name in ("spot-radius", "window-x", "resolution-low")),
    *(f"{STUDY}#{name}" for name in ("resolution-high", "phases", "trials", "lasers")),
    FOCAL_LENGTH,
    PIXEL,
    lasers.SPOTS,
    lasers.SCATTER,
)
STEP = RADIANS_PER_ARCSEC
REPLICATES = 2000
# What counts as significant, in standard errors of a difference.
SIGNIFICANT = 3.0


@reproduces(
    STUDY,
    cells=["spot-radius-pixels", "position-*", "optimum-radius"],
    given=[f"{STUDY}#spot-radius", f"{STUDY}#pixel-size", f"{STUDY}#optimum", FOCAL_LENGTH],
)
def spot(given: Given) -> Results:
    """Spot radius in pixels, here and at the optimum, and the ends of one pixel."""
    radius, pixel = given[f"{STUDY}#spot-radius"], given[f"{STUDY}#pixel-size"]
    pixel_at_optimum = given[f"{STUDY}#optimum"] * given[FOCAL_LENGTH]
    return {
        "spot-radius-pixels": radius / pixel,
        "position-low": -pixel / 2,
        "position-high": pixel / 2,
        "optimum-radius": radius / pixel_at_optimum,
    }


@reproduces(
    STUDY,
    cells=["optimum", "optimum-accuracy", "saturation"],
    given=READS,
    equations=["11"],
    replicates=REPLICATES,
)
def optimum(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """Where centroiding is best, how good it is there, and where refining stops to pay."""
    angles = resolutions(given)
    scatter = replicated_scatter(given, seed, replicates)
    monitoring = attitude_accuracy(scatter, given.count(f"{STUDY}#lasers"), angles)
    best = scatter.argmin(axis=-1)
    return {
        "optimum": Prediction(angles[best]),
        "optimum-accuracy": Prediction(scatter.min(axis=-1)),
        "saturation": Prediction(angles[saturation(monitoring, relative_error(given))]),
    }


def resolutions(given: Given) -> FloatArray:
    """Return the angular resolutions of the study, one arc second apart, in radians."""
    low, high = given[f"{STUDY}#resolution-low"], given[f"{STUDY}#resolution-high"]
    return np.asarray(np.linspace(low, high, round((high - low) / STEP) + 1))


def radii(given: Given, angles: FloatArray) -> FloatArray:
    """Return the radius of the spot in pixels that see the given angles."""
    return np.asarray(given[f"{STUDY}#spot-radius"] / (angles * given[FOCAL_LENGTH]))


def light_for_table(given: Given, read_share: float = 0.0) -> Light:
    """Return the light that gives the mean variance of Table III.

    Parameters
    ----------
    given : Given
        Holds Table III, the spots, and the sizes of spot, pixel and window.
    read_share : float
        Share of that variance that is read noise, from 0 to below 1. The study's literal reading
        has none; other shares are shown beside it.

    Returns
    -------
    Light
        Signal and read noise, in electrons.
    """
    printed = (given.array(lasers.SCATTER) / lasers.SIGMAS) ** 2
    spots = given.array(lasers.SPOTS).reshape(-1, 2)
    size = window(given)
    radius = given[f"{STUDY}#spot-radius"] / given[PIXEL]
    corners = window_corners(spots, size)
    # Photon variance goes as one over the light, read variance as one over its square.
    photon = centre_of_gravity_error(spots, 1.0, radius, corners, size).variance.mean()
    both = centre_of_gravity_error(spots, 1.0, radius, corners, size, 1.0).variance.mean()
    target = printed.mean()
    signal = photon / ((1.0 - read_share) * target)
    return Light(float(signal), float(signal * np.sqrt(read_share * target / (both - photon))))


def window(given: Given) -> int:
    """Return the width of the window, in px."""
    return round(given[f"{STUDY}#window-x"])


def relative_error(given: Given) -> float:
    """Return the relative standard error of a standard deviation from all phases and trials."""
    return float(
        1.0 / np.sqrt(2.0 * given.count(f"{STUDY}#phases") * given.count(f"{STUDY}#trials"))
    )


def replicated_scatter(given: Given, seed: SeedSequence, replicates: int) -> FloatArray:
    """Return what studies of the printed size would find, from the closed form.

    Parameters
    ----------
    given : Given
        Holds the cells of `READS`.
    seed : numpy.random.SeedSequence
        One child for each study.
    replicates : int
        How many studies.

    Returns
    -------
    ndarray, shape (replicates, resolutions)
        Standard deviation of the errors of all phases and trials, in px.
    """
    phases, trials = even_phases(given.count(f"{STUDY}#phases")), given.count(f"{STUDY}#trials")
    radius = radii(given, resolutions(given))
    law = predicted_errors(phases, light_for_table(given), radius, window(given))
    found = np.empty((replicates, len(radius)))
    for row, stream in zip(found, spawned_streams(seed, replicates), strict=True):
        # Mean and variance of normal errors within a phase are independent.
        means = law.bias + np.sqrt(law.variance / trials) * stream.standard_normal(law.bias.shape)
        inside = law.variance * stream.chisquare(trials - 1, law.bias.shape) / trials
        row[...] = np.sqrt(inside.mean(axis=-1) + means.var(axis=-1))
    return found


def saturation(monitoring: FloatArray, relative: float) -> FloatArray:
    """Return the index of the coarsest resolution that no finer one beats significantly.

    Parameters
    ----------
    monitoring : ndarray, shape (..., n)
        Monitoring accuracy from fine to coarse, in any unit.
    relative : float
        Relative standard error of each.

    Returns
    -------
    ndarray of int, shape (...)
        Index along the last axis.
    """
    finer = np.minimum.accumulate(monitoring, axis=-1)
    error = SIGNIFICANT * relative * np.hypot(monitoring, finer)
    unbeaten = monitoring - finer <= error
    return np.asarray(monitoring.shape[-1] - 1 - unbeaten[..., ::-1].argmax(axis=-1))
