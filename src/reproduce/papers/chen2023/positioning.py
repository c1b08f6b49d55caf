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
from reproduce.papers.chen2023.satellite import SCENE, STAR
from reproduce.papers.declare import (
    Column,
    Results,
    draws,
    reproduces,
    seed_of,
    studied,
)
from reproduce.papers.sketch import INK, Look, Sketch, beside, seen_from
from reproduce.physics import ground
from reproduce.physics.attitude import rotation_from_vector, unit
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    from collections.abc import Mapping

    import pandas as pd
    from matplotlib.figure import Figure


_POINTING = f"{satellite.SATELLITE}#tracker-pointing-accuracy.value"
_MONITORING = (*platform.INSTRUMENT, f"{platform.SCATTER}#2-*", accuracy.SMOOTHED)
READS = (*_MONITORING, *satellite.CAMERA, _POINTING)
_YEAR_READS = (*_MONITORING, *satellite.CAMERA, accuracy.RATE)
_ORBIT = 0.05
_SINGLE, _AVERAGED = "one frame", "averaged"
# Where the satellite stands and how it looks: name, tilt off the nadir, image point off the centre.
LOOKS = (
    ("nadir, centre", 0.0, 0.0),
    ("nadir, 5 km off", 0.0, 5e3),
    ("30° aside, centre", 30.0, 0.0),
)
# What an error goes through, and the unit in which it is written.
_UNITS = {
    "satellite": (1.0, "m"),
    "turn": (RADIANS_PER_ARCSEC, "arcsec"),
    "image": (1e-6, "µm"),
}
_CALIBRATION = 0.5 * RADIANS_PER_ARCSEC
_PER_ORBIT = 64
# Long enough for the trend to stand out from what wanders; a week makes it far worse.
_CAMPAIGN_DAYS = 60.0
_YEAR_DAYS = 365.0
_AMPLITUDES = (0.5, 2.0, 10.0, 50.0)
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
        f"{sensor}-resolution": given[
            f"{satellite.SATELLITE}#{sensor}-ground-resolution.value"
        ]
        for sensor in ("panchromatic", "multispectral")
    }


@dataclass(frozen=True, eq=False)
class _Term:
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


def _terms(given: Given) -> tuple[_Term, ...]:
    """Return the errors of the imaging model for SVGF-1.

    The misalignment axis by axis, for one frame and for the average of many.
    """
    attitude = np.full(3, given[_POINTING] / platform.SIGMAS)
    turns = (
        _Term(f"misalignment about {axis}, {mean}", "turn", sigma * unit)
        for frames, mean in ((1, _SINGLE), (given.count(accuracy.SMOOTHED), _AVERAGED))
        for sigma in [platform.angle_sigma(given, 2, frames)]
        for axis, unit in zip(("X", "Y", "Z (roll)"), np.eye(3), strict=True)
    )
    pixel = np.array([1.0, 1.0, 0.0]) * given[satellite.CAMERA[1]]
    return (
        _Term("attitude of the tracker, at its limit", "turn", attitude),
        *turns,
        _Term("orbit", "satellite", np.full(3, _ORBIT)),
        _Term("principal point, one pixel", "image", pixel),
    )


def _together(given: Given) -> dict[str, tuple[_Term, ...]]:
    """Return the whole budget twice: monitoring with one frame, and with the average of many."""
    return {
        f"all together, {mean}": tuple(
            t for t in _terms(given) if not t.name.endswith(other)
        )
        for mean, other in ((_SINGLE, _AVERAGED), (_AVERAGED, _SINGLE))
    }


def _look(
    given: Given, tilt: float, off: float
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Set the satellite up over a place of middle latitude.

    Image vector, place and rotation chain, as the imaging model takes them.
    """
    height, focal = satellite.altitude(given), given[satellite.CAMERA[0]]
    place = ground.earth_fixed([0.5, 0.8, height])
    flight = np.cross(np.cross(place, [0.0, 0.0, 1.0]), place)
    down = ground.satellite_from_inertial(place, flight).T
    chain = down @ rotation_from_vector([np.radians(tilt), 0.0, 0.0])
    return np.array([[off / height * focal, 0.0, -focal]]), place, chain


def _analytic(jacobian: ground.GroundJacobian, term: _Term) -> FloatArray:
    """Return the covariance of east and north that a term causes, in square metres."""
    slopes = getattr(jacobian, f"by_{term.kind}")
    return np.asarray(
        ground.ground_covariance(jacobian.position, slopes, np.diag(term.sigma**2))[0]
    )


@studied("chen2023/budget", given=READS)
def _budget(given: Given) -> pd.DataFrame:
    """Error budget of SVGF-1 on the ground, term by term."""
    jacobians = [
        ground.ground_jacobian(*_look(given, tilt, off)) for _, tilt, off in LOOKS
    ]
    rows = []
    for name, errors in (
        {term.name: (term,) for term in _terms(given)} | _together(given)
    ).items():
        scale, unit = _UNITS[errors[0].kind] if len(errors) == 1 else (np.nan, "")
        exact = (sum(_analytic(one, error) for error in errors) for one in jacobians)
        radii = (
            float(ground.circular_error(np.asarray(covariance))) for covariance in exact
        )
        rows.append((name, errors[0].sigma.max() / scale, unit, *radii))
    return _budget.frame(rows, altitude=satellite.altitude(given) / 1e3)


@lru_cache(maxsize=1)  # a year is large
def _year(height: float, root: int | None) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Simulate the campaign and the year after it at an altitude, for a thermal amplitude of one.

    Shape (samples,). In days, zero at the end of the campaign. Shape (samples, 2). Misalignment
    about X and Y over the amplitude. Shape (samples, 2). Standard normal numbers for the errors of
    calibrations and of the monitoring.
    """
    period = float(ground.orbital_period(height))
    orbits = int(np.ceil((_YEAR_DAYS + _CAMPAIGN_DAYS) * ground.DAY_SECONDS / period))
    generator = default_rng(seed_of("chen2023/year", root))
    times, angles = ground.thermal_series(period, _PER_ORBIT, orbits, generator)
    return times - _CAMPAIGN_DAYS, angles, generator.standard_normal(angles.shape)


def _residuals(given: Given, amplitude: float) -> dict[str, FloatArray]:
    """Return what each correction leaves of the misalignment, from the end of the campaign on.

    Name to errors of shape (samples, 2), in radians.
    """
    times, unit, noise = _year(satellite.altitude(given), given.root)
    true, known = amplitude * unit, int(np.searchsorted(times, 0.0))
    measured = true + _CALIBRATION * noise
    # The lasers give the misalignment half an average late, with its noise.
    count = given.count(accuracy.SMOOTHED)
    late = times - 0.5 * count / given[accuracy.RATE] / ground.DAY_SECONDS
    delayed = np.stack([np.interp(late, times, angle) for angle in true.T], axis=-1)
    estimates = (
        np.zeros_like(true),
        measured[known - 1],
        ground.trend_and_fourier(
            times, np.arange(len(times)) / _PER_ORBIT, measured, known
        ),
        ground.last_orbits(measured, _PER_ORBIT),
        delayed + platform.angle_sigma(given, 2, count)[:2] * noise,
    )
    names = (UNCORRECTED, *CORRECTIONS)
    return {
        name: (true - found)[known:]
        for name, found in zip(names, estimates, strict=True)
    }


@studied(
    "chen2023/strategies",
    random=True,
    given=_YEAR_READS,
    columns=(
        Column("Correction"),
        *(Column(f"at {amplitude:g} arcsec (m)", ".2f") for amplitude in _AMPLITUDES),
    ),
    caption="CE90 on the ground from the thermal misalignment that is left, over the year after "
    f"a campaign of {_CAMPAIGN_DAYS:g} days, by amplitude of the first thermal harmonic.",
)
def _strategies(given: Given) -> list[tuple[str | float, ...]]:
    """Positioning error over a year, for four corrections and four thermal amplitudes."""
    height = satellite.altitude(given)
    left = [
        _residuals(given, amplitude * RADIANS_PER_ARCSEC) for amplitude in _AMPLITUDES
    ]
    lengths = {name: [np.hypot(*errors[name].T) for errors in left] for name in left[0]}
    return [
        (name, *(np.quantile(lengths[name], 0.9, axis=1) * height)) for name in lengths
    ]


# The drawn satellite, its target, and the side they are seen from.
_INERTIAL = Look("J2000", INK, "--")
_DATE = "2023-09-22T03:30:00"
_EARTH = ground.EARTH_RADIUS
_ABOVE = np.array([np.radians(104.0), np.radians(24.0), 1.25 * _EARTH])
_TARGET = np.array([np.radians(66.0), np.radians(50.0), 0.0])
_VIEW = seen_from(36.0, 20.0, (4.6, 3.2), 2.8 / _EARTH)


def _scene(door: Given) -> tuple[FloatArray, FloatArray, dict[str, FloatArray]]:
    """Return a satellite that looks at a target, and what the imaging model makes of it.

    Position of the satellite; where equation (1) puts the middle of the image; three frames whose
    columns are their axes. All Earth-fixed, in metres.
    """
    turning = ground.earth_from_inertial(_DATE, ut1_utc=0.0)
    place = ground.earth_fixed(_ABOVE)
    z = unit("boresight", ground.earth_fixed(_TARGET) - place)
    x = unit("level", np.cross([0.0, 0.0, 1.0], z))
    looking = np.stack([x, np.cross(z, x), z], axis=-1)
    # The tracker looks away from the Earth: the camera, turned about the X that both share.
    tracker_from_camera = rotation_from_vector([door[satellite.BORESIGHT], 0.0, 0.0])
    inertial_from_tracker = turning.T @ looking @ tracker_from_camera.T
    chain = turning @ inertial_from_tracker @ tracker_from_camera
    centre = ground.image_vectors([(0.0, 0.0)], focal_length=1.0)
    frames = {
        "camera": chain,
        "tracker": turning @ inertial_from_tracker,
        "stars": turning,
    }
    return place, ground.imaged_position(centre, place, chain)[0], frames


@draws("chen2023/fig-1a", given=[satellite.BORESIGHT])
def _draw_scene(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Frames of the imaging model, from a point of the image to a place on the Earth."""
    sketch = Sketch.on(figure, 14.0, 9.6, 6.6)
    (above, imaged, frames), origin = _scene(door), np.zeros(3)
    around = np.linspace(0.0, 2.0 * np.pi, 240)
    circle = _EARTH * np.stack([np.cos(around), np.sin(around), 0 * around], axis=-1)
    sketch.line(np.asarray(_VIEW.centre) + _VIEW.scale * circle[:, :2], 1.3)
    sketch.line(_VIEW.point(circle), 0.7, ":")
    names = [r"$X_\mathrm{WGS84}$", r"$Y_\mathrm{WGS84}$", "$Z$ of both"]
    sketch.triad(_VIEW, origin, np.diag([1.6, 1.6, 1.3]) * _EARTH, names, width=1.8)
    names, stars = [r"$X_\mathrm{J2000}$", r"$Y_\mathrm{J2000}$"], frames["stars"].T
    sketch.triad(_VIEW, origin, 1.6 * _EARTH * stars[:2], names, look=_INERTIAL)
    turn = float(-np.arctan2(stars[0, 1], stars[0, 0]))
    sketch.sense(_VIEW, origin, [0.0, 0.0, 1.0], 0.6 * _EARTH * stars[0], turn)
    place, target = _VIEW.point(above), _VIEW.point(imaged)
    sketch.arrow(_VIEW.point(origin), place, width=0.8)
    sketch.path([target, place], SCENE)
    sketch.mark(target, SCENE, 7)
    # Beside the camera's frame on the paper, so that both can be read.
    tracker = above + _EARTH * np.array([0.65, 0.8]) @ _VIEW.matrix
    for foot, name, names in (
        (above, "camera", ["$X_c$", "$Y_c$", ""]),
        (tracker, "tracker", ["$X_s$", "$Y_s$", "$Z_s$"]),
    ):
        sketch.triad(_VIEW, foot, 0.4 * _EARTH * frames[name].T, names, width=1.8)
    # The line of sight runs along the camera's boresight: its name stands above.
    tip = _VIEW.point(above + 0.4 * _EARTH * frames["camera"][:, 2])
    sketch.label(beside(tip, -0.1, 0.4), "$Z_c$")
    boresight = _EARTH * frames["tracker"][:, 2]
    sketch.path([_VIEW.point(tracker + s * boresight) for s in (1.25, 0.7)], STAR)
    sketch.label(beside(place, 0.7, 0.2), "camera", ha="left")
    sketch.label(beside(_VIEW.point(tracker), -0.45, 0.1), "tracker", ha="right")
    sketch.label(beside(target, -0.2, 0.45), "target")
    sketch.key((SCENE, STAR, _INERTIAL))
