"""From misalignment to metres on the ground: the error budget of SVGF-1, and a year of orbits.

What no paper prints and we choose, here and nowhere else: centimetre orbits are 0.05 m along each
axis, the principal point moves by one panchromatic pixel, a calibration errs by half an arc second
at each sample, and heat behaves as in `physics.ground.thermal_series`. Angle errors of the
monitoring are those of the ground platform.

The paper argues for monitoring and does not compare. Here four ways to correct a thermal
misalignment, and none, get the same simulated year; the three methods without lasers are given more
calibrations than any ground segment has.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import default_rng

from reproduce.papers.chen2023 import accuracy, platform, satellite
from reproduce.papers.declare import Results, draws, reproduces, seed_of
from reproduce.papers.sketch import arrow, beside, box, canvas, label, line
from reproduce.papers.study import Fact, studied
from reproduce.papers.words import Column
from reproduce.physics.attitude import rotation_from_vector
from reproduce.physics.ground import (
    DAY,
    GroundJacobian,
    circular_error,
    earth_fixed,
    ground_covariance,
    ground_jacobian,
    imaged_position,
    last_orbits,
    local_axes,
    orbital_period,
    satellite_from_inertial,
    thermal_series,
    trend_and_fourier,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.units import RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from matplotlib.figure import Figure


POINTING = f"{satellite.SATELLITE}#tracker-pointing-accuracy.value"
MONITORING = (*platform.INSTRUMENT, f"{platform.SCATTER}#2-*", accuracy.SMOOTHED)
READS = (*MONITORING, *satellite.CAMERA, POINTING)
YEAR_READS = (*MONITORING, *satellite.CAMERA, accuracy.RATE)
ORBIT = 0.05
DRAWS = 20_000
SINGLE, AVERAGED = "one frame", "averaged"
# Where the satellite stands and how it looks: name, tilt off the nadir, image point off the centre.
LOOKS = (
    ("nadir, centre", 0.0, 0.0),
    ("nadir, 5 km off", 0.0, 5e3),
    ("30° aside, centre", 30.0, 0.0),
)
# What an error goes through, and the unit in which it is written.
UNITS = {"satellite": (1.0, "m"), "turn": (RADIANS_PER_ARCSEC, "arcsec"), "image": (1e-6, "µm")}
CALIBRATION = 0.5 * RADIANS_PER_ARCSEC
PER_ORBIT = 64
# Long enough for the trend to stand out from what wanders; a week makes it far worse.
CAMPAIGN_DAYS = 60.0
YEAR_DAYS = 365.0
AMPLITUDES = (0.5, 2.0, 10.0, 50.0)
# Days from the end of the campaign.
AGES = {
    "first day": (0.0, 1.0),
    "after a week": (6.0, 7.0),
    "after a month": (30.0, 31.0),
    "after a year": (364.0, 365.0),
}
WHOLE = "over the year"
# The year is looked at every so many samples where only a quantile of all of it is asked for.
STRIDE = 7
# Where the search for the amplitude that a correction still tolerates begins, and its steps.
LARGEST, HALVINGS = 4096.0, 40
UNCORRECTED, *CORRECTIONS = (
    "no correction",
    "one calibration",
    "trend and Fourier series of degree 2, fitted to the campaign",
    "Fourier series of degree 3 over the three last orbits",
    "star–laser monitoring, averaged",
)


@reproduces(
    "chen2023/text-positioning",
    cells=["*-resolution"],
    given=[f"{satellite.SATELLITE}#*ground-resolution.value"],
)
def quoted_resolution(given: Given) -> Results:
    """Ground resolutions of Table I, quoted again in the introduction."""
    return {
        f"{sensor}-resolution": given[f"{satellite.SATELLITE}#{sensor}-ground-resolution.value"]
        for sensor in ("panchromatic", "multispectral")
    }


@dataclass(frozen=True, eq=False)
class Term:
    """One error of the imaging model.

    Attributes
    ----------
    name : str
        What errs.
    kind : str
        ``satellite``, ``turn`` or ``image``: which derivative it goes through.
    sigma : ndarray, shape (3,)
        Standard deviations along or about X, Y, Z, in metres or radians.
    """

    name: str
    kind: str
    sigma: FloatArray


def terms(given: Given) -> tuple[Term, ...]:
    """Return the errors of the imaging model for SVGF-1.

    The misalignment axis by axis, for one frame and for the average of many.
    """
    attitude = np.full(3, given[POINTING] / platform.SIGMAS)
    turns = (
        Term(f"misalignment about {axis}, {mean}", "turn", sigma * unit)
        for frames, mean in ((1, SINGLE), (given.count(accuracy.SMOOTHED), AVERAGED))
        for sigma in [platform.angle_sigma(given, 2, frames)]
        for axis, unit in zip(("X", "Y", "Z (roll)"), np.eye(3), strict=True)
    )
    pixel = np.array([1.0, 1.0, 0.0]) * given[satellite.CAMERA[1]]
    return (
        Term("attitude of the tracker, at its limit", "turn", attitude),
        *turns,
        Term("orbit", "satellite", np.full(3, ORBIT)),
        Term("principal point, one pixel", "image", pixel),
    )


def together(given: Given) -> dict[str, tuple[Term, ...]]:
    """Return the whole budget twice: monitoring with one frame, and with the average of many."""
    return {
        f"all together, {mean}": tuple(t for t in terms(given) if not t.name.endswith(other))
        for mean, other in ((SINGLE, AVERAGED), (AVERAGED, SINGLE))
    }


def look(given: Given, tilt: float, off: float) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Set the satellite up over a place of middle latitude.

    Image vector, place and rotation chain, as the imaging model takes them.
    """
    height, focal = satellite.altitude(given), given[satellite.CAMERA[0]]
    place = earth_fixed([0.5, 0.8, height])
    flight = np.cross(np.cross(place, [0.0, 0.0, 1.0]), place)
    down = satellite_from_inertial(place, flight).T
    chain = down @ rotation_from_vector([np.radians(tilt), 0.0, 0.0])
    return np.array([[off / height * focal, 0.0, -focal]]), place, chain


def analytic(jacobian: GroundJacobian, term: Term) -> FloatArray:
    """Return the covariance of east and north that a term causes, in square metres."""
    slopes = getattr(jacobian, f"by_{term.kind}")
    return np.asarray(ground_covariance(jacobian.position, slopes, np.diag(term.sigma**2))[0])


def simulated(
    view: tuple[FloatArray, FloatArray, FloatArray],
    errors: tuple[Term, ...],
    name: str,
    root: int | None,
) -> FloatArray:
    """Return errors on the ground from draws of several errors through the whole imaging model.

    Shape (draws, 2). East and north of the true place, in metres.
    """
    noise = dict.fromkeys(UNITS, np.zeros((DRAWS, 3)))
    for term in errors:
        generator = default_rng(seed_of(f"budget {name} {term.name}", root))
        noise[term.kind] = noise[term.kind] + term.sigma * generator.normal(size=(DRAWS, 3))
    vectors, place, chain = view
    found = imaged_position(
        vectors + noise["image"][:, np.newaxis],
        place + noise["satellite"],
        chain @ rotation_from_vector(noise["turn"]),
    )[:, 0]
    true = imaged_position(*view)[0]
    return np.asarray((found - true) @ local_axes(true)[:2].T)


@studied(
    "chen2023/budget",
    random=True,
    given=READS,
)
def _budget(given: Given) -> pd.DataFrame:
    """Error budget of SVGF-1 on the ground, term by term: formula and simulation."""
    rows = []
    lines = {term.name: (term,) for term in terms(given)} | together(given)
    for term, errors in lines.items():
        scale, unit = UNITS[errors[0].kind] if len(errors) == 1 else (np.nan, "")
        sigma = errors[0].sigma.max() / scale
        for name, tilt, off in LOOKS:
            view = look(given, tilt, off)
            jacobian, drawn = ground_jacobian(*view), simulated(view, errors, name, given.root)
            exact = sum((analytic(jacobian, error) for error in errors), np.zeros((2, 2)))
            radii = float(circular_error(exact)), _quantile(drawn)
            # Semi-axes of both ellipses, the major ones first.
            squares = [np.linalg.eigvalsh(c)[::-1] for c in (exact, np.cov(drawn.T))]
            axes = np.sqrt(np.maximum(squares, 0.0)).T.flat  # below zero is rounding alone
            rows.append((term, sigma, unit, name, *radii, *axes))
    return _budget.frame(rows, altitude=satellite.altitude(given) / 1e3)


@lru_cache(maxsize=1)  # a year is large
def year(height: float, root: int | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Simulate the campaign and the year after it at an altitude, for a thermal amplitude of one.

    Shape (samples,). In days, zero at the end of the campaign. Shape (samples, 2). Misalignment
    about X and Y over the amplitude. Shape (samples, 2). Standard normal numbers for the errors of
    calibrations and of the monitoring.
    """
    period = float(orbital_period(height))
    orbits = int(np.ceil((YEAR_DAYS + CAMPAIGN_DAYS) * DAY / period))
    generator = default_rng(seed_of("chen2023/year", root))
    times, angles = thermal_series(period, PER_ORBIT, orbits, generator)
    return times - CAMPAIGN_DAYS, angles, generator.standard_normal(angles.shape)


def residuals(given: Given, amplitude: float) -> dict[str, FloatArray]:
    """Return what each correction leaves of the misalignment, from the end of the campaign on.

    Name to errors of shape (samples, 2), in radians.
    """
    return _residuals(given.narrowed(YEAR_READS), amplitude)


@lru_cache(maxsize=8)
def _residuals(given: Given, amplitude: float) -> dict[str, FloatArray]:
    times, unit, noise = year(satellite.altitude(given), given.root)
    true, known = amplitude * unit, int(np.searchsorted(times, 0.0))
    measured = true + CALIBRATION * noise
    # The lasers give the misalignment half an average late, with its noise.
    count = given.count(accuracy.SMOOTHED)
    late = times - 0.5 * count / given[accuracy.RATE] / DAY
    delayed = np.stack([np.interp(late, times, angle) for angle in true.T], axis=-1)
    estimates = (
        np.zeros_like(true),
        measured[known - 1],
        trend_and_fourier(times, np.arange(len(times)) / PER_ORBIT, measured, known),
        last_orbits(measured, PER_ORBIT),
        delayed + platform.angle_sigma(given, 2, count)[:2] * noise,
    )
    names = (UNCORRECTED, *CORRECTIONS)
    return {name: (true - found)[known:] for name, found in zip(names, estimates, strict=True)}


def _quantile(errors: FloatArray) -> float:
    """Return the length that nine tenths of errors of shape (n, 2) stay within."""
    return float(np.quantile(np.linalg.norm(errors, axis=1), 0.9))


@studied(
    "chen2023/strategies",
    random=True,
    given=YEAR_READS,
    columns=(
        Column("Correction"),
        *(Column(f"at {amplitude:g} arcsec (m)", ".2f") for amplitude in AMPLITUDES),
    ),
    caption="CE90 on the ground from the thermal misalignment that is left, over the "
    f"year after a campaign of {CAMPAIGN_DAYS:g} days, by amplitude of the first thermal harmonic.",
)
def strategies(given: Given) -> list[tuple[str | float, ...]]:
    """Positioning error over a year, for four corrections and four thermal amplitudes."""
    height = satellite.altitude(given)
    left = [residuals(given, amplitude * RADIANS_PER_ARCSEC) for amplitude in AMPLITUDES]
    return [
        (name, *(_quantile(errors[name]) * height for errors in left))
        for name in (UNCORRECTED, *CORRECTIONS)
    ]


def spans(given: Given) -> dict[str, slice]:
    """Return the samples of each age, from the end of the campaign on; last, the whole year."""
    times = year(satellite.altitude(given), given.root)[0]
    times = times[np.searchsorted(times, 0.0) :]
    ages = {name: slice(*np.searchsorted(times, days)) for name, days in AGES.items()}
    return {**ages, WHOLE: slice(0, None, STRIDE)}


@studied(
    "chen2023/ages",
    random=True,
    given=YEAR_READS,
    columns=(
        Column("Correction"),
        Column("Amplitude (arcsec)", "g"),
        *(Column(f"{name} (m)", ".2f") for name in AGES),
    ),
)
def ages(given: Given) -> list[tuple[str | float, ...]]:
    """Positioning error against the time since calibration, for every thermal amplitude."""
    height, samples = satellite.altitude(given), spans(given)
    left = {amplitude: residuals(given, amplitude * RADIANS_PER_ARCSEC) for amplitude in AMPLITUDES}
    return [
        (name, amplitude, *(_quantile(errors[name][samples[age]]) * height for age in AGES))
        for name in CORRECTIONS
        for amplitude, errors in left.items()
    ]


@studied(
    "chen2023/suffices",
    random=True,
    given=(*READS, accuracy.RATE),
    columns=(
        Column("Correction"),
        Column("limit"),
        Column("limit (m)", ".2f"),
        *(Column(f"{name} (arcsec)", ".2g", missing="none") for name in (*AGES, WHOLE)),
    ),
)
def suffices(given: Given) -> list[tuple[str | float, ...]]:
    """Up to which thermal amplitude each correction suffices, by age of the calibration."""
    height, samples = satellite.altitude(given), spans(given).values()
    # Every correction is linear in what is true and in the noise: two runs tell all amplitudes.
    noise, whole = residuals(given, 0.0), residuals(given, RADIANS_PER_ARCSEC)
    # Errors on the ground that a correction may be asked to keep below, in metres.
    attitude = analytic(ground_jacobian(*look(given, 0.0, 0.0)), terms(given)[0])
    limits = {
        "panchromatic pixel": given[satellite.CAMERA[2]],
        "what the tracker itself errs by": float(circular_error(attitude)),
    }
    rows: list[tuple[str | float, ...]] = []
    for name in CORRECTIONS:
        pairs = [(whole[name][s] - noise[name][s], noise[name][s]) for s in samples]
        for what, limit in limits.items():
            amplitudes = (largest_amplitude(*pair, limit / height) for pair in pairs)
            rows.append((name, what, limit, *amplitudes))
    return rows


def largest_amplitude(slope: FloatArray, noise: FloatArray, limit: float) -> float:
    """Return the amplitude at which nine tenths of the errors just stay within a limit.

    In the unit of the slope, from 0 to `LARGEST`; not a number if noise alone goes beyond.
    """
    if _quantile(noise) > limit:
        return float("nan")
    low, high = 0.0, LARGEST
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        within = _quantile(middle * slope + noise) <= limit
        low, high = (middle, high) if within else (low, middle)
    return low


_FRAMES = "chen2023/table-4#100.frames"
_SCENE_READS = (*satellite.CAMERA, satellite.ACCURACY, _FRAMES)
# Of the drawing: units to a metre of the ground.
_METRE = 3.4


def _on_the_ground(door: Given) -> tuple[float, float, float]:
    """Return metres on the ground: an arc second, a pixel, the larger printed error (3σ)."""
    height = satellite.altitude(door)
    error = float(door.array(satellite.ACCURACY).max())
    return (
        height * float(np.tan(RADIANS_PER_ARCSEC)),
        door[satellite.CAMERA[2]],
        height * float(np.tan(error)),
    )


def _ground_facts() -> Mapping[str, Fact]:
    """Return what the drawing shows, in numbers."""
    door = given(_SCENE_READS)
    second, pixel, error = _on_the_ground(door)
    return {
        "height": Fact(satellite.altitude(door) / 1e3, ".0f", "km"),
        "second": Fact(second, ".1f", "m"),
        "pixel": Fact(pixel, ".2f", "m"),
        "pixels": Fact(second / pixel, ".0f"),
        "error": Fact(error, ".2f", "m"),
        "frames": Fact(door.count(_FRAMES), "d"),
    }


@draws("chen2023/drawing-arc-second", given=_SCENE_READS, named=_ground_facts)
def _draw_ground(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """An arc second on the ground, from the height of the paper's satellite, to scale."""
    second, pixel, error = _on_the_ground(door)
    axes = canvas(figure, 10.4, 8.2)
    left, right, ground = 0.9, 0.9 + _METRE * second, 3.4
    top = np.array([(left + right) / 2, 7.2])
    box(axes, beside(top, 0.0, 0.45), (2.6, 0.9), "satellite")
    for foot in (left, right):
        line(axes, np.array([top, (foot, ground)]), 1.0)
    label(axes, beside(top, 0.0, -1.6), "1″")
    label(axes, (9.0, 5.6), f"{satellite.altitude(door) / 1e3:.0f} km up,\nnot to scale")
    side = _METRE * pixel
    for start in np.arange(left, right, side):
        box(axes, (start + side / 2, ground - 0.5), (side, side), width=0.8)
    for y, length, text in (
        (1.9, second, f"an arc second: {second:.1f} m"),
        (1.2, pixel, f"a pixel of the camera: {pixel:.2f} m"),
        (0.4, error, f"misalignment, mean of {door.count(_FRAMES)} frames, 3σ: {error:.2f} m"),
    ):
        arrow(axes, (left, y), (left + _METRE * length, y), style="<|-|>")
        if length is second:
            label(axes, ((left + right) / 2, y + 0.28), text)
        else:
            label(axes, (left + _METRE * length + 0.3, y), text, ha="left")
