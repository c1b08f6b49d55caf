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

What the text leaves open, and the results depend on, are the `CASES`: what the radius of a Gaussian
is, and how much of the noise of EMVA 1288 is read noise. How large a gain is significant is open
too: refining stops to pay below the coarsest resolution that no finer one beats by more than some
standard errors of the study, `THRESHOLDS`. The first case and three standard errors were chosen
first and came into the history together with their verdicts; the others were added when their
results were known. All of them are judged side by side.

A study of the printed size is itself random. Its distribution follows from the closed-form bias
and variance: the Monte Carlo beside it agrees within its error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers.chen2023 import lasers
from reproduce.papers.declare import Blocked, Prediction, Reading, Results, reproduces
from reproduce.physics.attitude.averaging import attitude_accuracy
from reproduce.physics.images.centroid_theory import CentroidError, centre_of_gravity_error
from reproduce.physics.images.phase_study import (
    Light,
    even_phases,
    predicted_errors,
)
from reproduce.physics.images.spots import window_corners
from reproduce.physics.optics.simulate import spawned_streams
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import RADIANS_PER_ARCSEC

STUDY = "chen2023/text-resolution"
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
# What may count as significant, in standard errors of a difference; the first one chosen.
THRESHOLDS, CHOSEN = (1.0, 2.0, 3.0, 5.0), 3.0


@dataclass(frozen=True)
class Case:
    """One reading of what the study takes as its spot and its noise.

    Attributes
    ----------
    name : str
        In a few words.
    place : str
        Where the text leaves room for it.
    width : float
        The printed radius over the standard deviation of the Gaussian.
    read_share : float
        Share of the variance of Table III that is read noise.
    brighter : float
        The light over that which gives the variance of Table III.
    """

    name: str
    place: str
    width: float = 1.0
    read_share: float = 0.0
    brighter: float = 1.0

    @property
    def choices(self) -> dict[str, str]:
        """What the case chooses of what the text leaves open."""
        return {
            "radius": RADII[self.width],
            "noise": "read" if self.read_share else "photon",
            "light": "brighter" if self.brighter > 1.0 else "table-3",
        }


ONE_OVER_E, HALF_HEIGHT = float(np.sqrt(2.0)), float(np.sqrt(2.0 * np.log(2.0)))
RADIUS = "V-D does not say which radius of the Gaussian is meant"
NOISE = "V-D draws noise after EMVA 1288, which has read noise too, and prints no parameters"
CASES = (
    Case("radius: one standard deviation; photon noise", RADIUS),
    Case("radius: light down to 1/e; photon noise", RADIUS, ONE_OVER_E),
    Case("radius: light down to one half; photon noise", RADIUS, HALF_HEIGHT),
    Case("radius: light down to 1/e²; photon noise", RADIUS, 2.0),
    Case("radius: one standard deviation; 90 % read noise", NOISE, read_share=0.9),
    Case("radius: light down to one half; 90 % read noise", NOISE, HALF_HEIGHT, 0.9),
    Case(
        "radius: light down to one half; 90 % read noise; 1.1 times the light",
        "V-D: parameters close to those measured, not equal",
        HALF_HEIGHT,
        0.9,
        1.1,
    ),
)
LITERAL = CASES[0]
RADII = {1.0: "sigma", ONE_OVER_E: "one-over-e", HALF_HEIGHT: "half", 2.0: "one-over-e2"}
OPTIONS = {
    "radius": {
        "sigma": "one standard deviation of the spot",
        "one-over-e": "where the light has fallen to 1/e",
        "half": "where the light has fallen to one half",
        "one-over-e2": "where the light has fallen to 1/e²",
    },
    "noise": {"photon": "photon noise alone", "read": "90 % of the variance is read noise"},
    "light": {
        "table-3": "as much as gives the variance of Table III",
        "brighter": "1.1 times as much",
    },
    "threshold": {
        f"{errors:g}": f"a gain counts beyond {errors:g} standard error{'s' * (errors > 1)}"
        for errors in THRESHOLDS
    },
}


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
    options=OPTIONS,
)
def optimum(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """Where centroiding is best, how good it is there, and where refining stops to pay."""
    angles = resolutions(given)
    scatter = replicated_scatter(given, seed, replicates, CASES)
    monitoring = attitude_accuracy(scatter, given.count(f"{STUDY}#lasers"), angles)
    relative = relative_error(given)

    def by_case(results: FloatArray, **more: str) -> tuple[Reading, ...]:
        return tuple(
            Reading(case.name, case.place, Prediction(draws), case.choices | more)
            for case, draws in zip(CASES, results, strict=True)
        )

    by_threshold = tuple(
        Reading(
            f"gain counts beyond {errors:g} standard error{'s' * (errors > 1)}; as the first below",
            "V-D does not say which gain is significant",
            Prediction(angles[saturation(monitoring[0], relative, errors)]),
            LITERAL.choices | {"threshold": f"{errors:g}"},
        )
        for errors in THRESHOLDS
    )
    chosen = f"{CHOSEN:g}"
    others = by_case(angles[saturation(monitoring, relative, CHOSEN)], threshold=chosen)[1:]
    found = {
        "optimum": by_case(angles[scatter.argmin(axis=-1)]),
        "optimum-accuracy": by_case(scatter.min(axis=-1)),
        "saturation": (*by_threshold, *others),
    }
    literal = {
        "optimum": found["optimum"][0],
        "optimum-accuracy": found["optimum-accuracy"][0],
        "saturation": by_threshold[THRESHOLDS.index(CHOSEN)],
    }
    return {
        name: Blocked(MISSING[name], _median(literal[name]), readings)
        for name, readings in found.items()
    }


MISSING = {
    "optimum": "what the radius of the spot means, and on the light and the noise of the study",
    "optimum-accuracy": "what the radius of the spot means, and on the light and the noise",
    "saturation": "which gain counts as significant, and on the spot and the noise",
}


def _median(reading: Reading) -> float:
    if not isinstance(reading.result, Prediction):
        raise TypeError(f"expected a Prediction, got {type(reading.result).__name__}")
    return float(np.median(reading.result.draws))


def resolutions(given: Given) -> FloatArray:
    """Return the angular resolutions of the study, one arc second apart, in radians."""
    low, high = given[f"{STUDY}#resolution-low"], given[f"{STUDY}#resolution-high"]
    return np.asarray(np.linspace(low, high, round((high - low) / STEP) + 1))


def radii(given: Given, angles: FloatArray, case: Case = LITERAL) -> FloatArray:
    """Return the standard deviation of the spot in pixels that see the given angles."""
    sigma = given[f"{STUDY}#spot-radius"] / case.width
    return np.asarray(sigma / (angles * given[FOCAL_LENGTH]))


def light_for_table(given: Given, case: Case = LITERAL) -> Light:
    """Return the light for the mean variance of Table III, or as much more as a case says."""
    printed = (given.array(lasers.SCATTER) / lasers.SIGMAS) ** 2
    spots = given.array(lasers.SPOTS).reshape(-1, 2)
    size = window(given)
    radius = given[f"{STUDY}#spot-radius"] / case.width / given[PIXEL]
    corners = window_corners(spots, size)
    # Photon variance goes as one over the light, read variance as one over its square.
    photon = centre_of_gravity_error(spots, 1.0, radius, corners, size).variance.mean()
    both = centre_of_gravity_error(spots, 1.0, radius, corners, size, 1.0).variance.mean()
    target = printed.mean()
    signal = photon / ((1.0 - case.read_share) * target)
    read = signal * np.sqrt(case.read_share * target / (both - photon))
    return Light(float(case.brighter * signal), float(read))


def law(given: Given, case: Case = LITERAL) -> CentroidError:
    """Return bias and variance of every resolution and phase, shape (resolutions, phases)."""
    phases = even_phases(given.count(f"{STUDY}#phases"))
    radius = radii(given, resolutions(given), case)
    return predicted_errors(phases, light_for_table(given, case), radius, window(given))


def window(given: Given) -> int:
    """Return the width of the window, in px."""
    return round(given[f"{STUDY}#window-x"])


def relative_error(given: Given) -> float:
    """Return the relative standard error of a standard deviation from all phases and trials."""
    return float(
        1.0 / np.sqrt(2.0 * given.count(f"{STUDY}#phases") * given.count(f"{STUDY}#trials"))
    )


def replicated_scatter(
    given: Given, seed: SeedSequence, replicates: int, cases: tuple[Case, ...] = CASES
) -> FloatArray:
    """Return what studies of the printed size would find, from the closed form.

    Shape (cases, replicates, resolutions). Standard deviation of the errors of all phases and
    trials, in px.
    """
    trials, laws = given.count(f"{STUDY}#trials"), [law(given, case) for case in cases]
    shape = laws[0].bias.shape
    found = np.empty((len(cases), replicates, shape[0]))
    for place, stream in enumerate(spawned_streams(seed, replicates)):
        # Mean and variance of normal errors within a phase are independent.
        noise, spread = stream.standard_normal(shape), stream.chisquare(trials - 1, shape)
        for row, one in zip(found[:, place], laws, strict=True):
            means = one.bias + np.sqrt(one.variance / trials) * noise
            inside = one.variance * spread / trials
            row[...] = np.sqrt(inside.mean(axis=-1) + means.var(axis=-1))
    return found


def saturation(monitoring: FloatArray, relative: float, errors: float = CHOSEN) -> FloatArray:
    """Return the index of the coarsest resolution that no finer one beats significantly.

    Index along the last axis.
    """
    finer = np.minimum.accumulate(monitoring, axis=-1)
    error = errors * relative * np.hypot(monitoring, finer)
    unbeaten = monitoring - finer <= error
    return np.asarray(monitoring.shape[-1] - 1 - unbeaten[..., ::-1].argmax(axis=-1))
