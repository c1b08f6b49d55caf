"""From misalignment to metres on the ground: the error budget of SVGF-1, and a year of orbits.

What no paper prints and we choose, here and nowhere else: centimetre orbits are 0.05 m along each
axis, the principal point moves by one panchromatic pixel, a calibration errs by half an arc second,
and heat behaves as `physics.orbits.Thermal` says by default. Angle errors of the monitoring are
those of the ground platform.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import default_rng

from reproduce.papers.chen2023 import design, lasers, twin_study
from reproduce.papers.declare import seed_of
from reproduce.papers.study import Study
from reproduce.physics.attitude.rotations import rotation_from_vector
from reproduce.physics.ground.earth import earth_fixed, local_axes, satellite_from_inertial
from reproduce.physics.ground.errors import circular_error, ellipse, ground_covariance
from reproduce.physics.ground.imaging import GroundJacobian, ground_jacobian, imaged_position
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.units import RADIANS_PER_ARCSEC

POINTING = f"{design.SATELLITE}#tracker-pointing-accuracy.value"
READS = (
    *lasers.READS,
    f"{lasers.SCATTER}#2-*",
    twin_study.SMOOTHED,
    *twin_study.SATELLITE,
    POINTING,
)
ORBIT = 0.05
DRAWS = 20_000
ONE, MANY = "one frame", "averaged"
# Where the satellite stands and how it looks: name, tilt off the nadir, image point off the centre.
LOOKS = (
    ("nadir, centre", 0.0, 0.0),
    ("nadir, 5 km off", 0.0, 5e3),
    ("30° aside, centre", 30.0, 0.0),
)


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


def monitoring_sigma(door: Given, frames: int) -> FloatArray:
    """Return the standard deviation of the monitored angles about X, Y and Z, in radians."""
    response = lasers.turn_response(door)
    spots = lasers.scatter(door, 2)
    return np.asarray(np.sqrt((response**2 * spots**2).sum(axis=(1, 2)) / frames))


def terms(door: Given) -> tuple[Term, ...]:
    """Return the errors of the imaging model for SVGF-1.

    The misalignment axis by axis, for one frame and for the average of many.
    """
    pixel = np.array([1.0, 1.0, 0.0]) * door[twin_study.SATELLITE[1]]
    turns = [("attitude of the tracker, at its limit", np.full(3, door[POINTING] / lasers.SIGMAS))]
    for frames, said in ((1, ONE), (door.count(twin_study.SMOOTHED), MANY)):
        sigma = monitoring_sigma(door, frames)
        turns += [
            (f"misalignment about {axis}, {said}", sigma * unit)
            for axis, unit in zip(("X", "Y", "Z (roll)"), np.eye(3), strict=True)
        ]
    return (
        *(Term(name, "turn", sigma) for name, sigma in turns),
        Term("orbit", "satellite", np.full(3, ORBIT)),
        Term("principal point, one pixel", "image", pixel),
    )


def together(door: Given) -> dict[str, tuple[Term, ...]]:
    """Return the whole budget twice: monitoring with one frame, and with the average of many."""
    every = terms(door)
    return {
        f"all together, {said}": tuple(term for term in every if not term.name.endswith(other))
        for said, other in ((ONE, MANY), (MANY, ONE))
    }


@dataclass(frozen=True, eq=False)
class Look:
    """A line of sight of the satellite: image vector, place, rotation chain."""

    vectors: FloatArray
    satellite: FloatArray
    chain: FloatArray


def look(door: Given, tilt: float, off: float) -> Look:
    """Set the satellite up over a place of middle latitude."""
    height = twin_study.altitude(door)
    focal = door[twin_study.SATELLITE[0]]
    satellite = earth_fixed([0.5, 0.8, height])
    flight = np.cross(np.cross(satellite, [0.0, 0.0, 1.0]), satellite)
    down = satellite_from_inertial(satellite, flight).T
    chain = down @ rotation_from_vector([np.radians(tilt), 0.0, 0.0])
    return Look(np.array([[off / height * focal, 0.0, -focal]]), satellite, chain)


def analytic(jacobian: GroundJacobian, term: Term) -> FloatArray:
    """Return the covariance of east and north that a term causes, in square metres."""
    slopes = {
        "satellite": jacobian.by_satellite,
        "turn": jacobian.by_turn,
        "image": jacobian.by_image,
    }[term.kind]
    return np.asarray(ground_covariance(jacobian.position, slopes, np.diag(term.sigma**2))[0])


def simulated(view: Look, errors: tuple[Term, ...], name: str) -> FloatArray:
    """Return errors on the ground from draws of several errors through the whole imaging model.

    Shape (draws, 2). East and north of the true place, in metres.
    """
    noise = dict.fromkeys(("satellite", "turn", "image"), np.zeros((DRAWS, 3)))
    for term in errors:
        generator = default_rng(seed_of(f"budget {name} {term.name}"))
        noise[term.kind] = noise[term.kind] + term.sigma * generator.normal(size=(DRAWS, 3))
    chain = view.chain @ rotation_from_vector(noise["turn"])
    vectors = view.vectors + noise["image"][:, np.newaxis]
    found = imaged_position(vectors, view.satellite + noise["satellite"], chain).position[:, 0]
    true = imaged_position(view.vectors, view.satellite, view.chain).position[0]
    return np.asarray((found - true) @ local_axes(true)[:2].T)


def budget() -> Study:
    """Error budget of SVGF-1 on the ground, term by term: formula and simulation."""
    door = given(READS)
    rows = []
    lines = {term.name: (term,) for term in terms(door)} | together(door)
    for label, errors in lines.items():
        entries = [label, _sigma(errors[0]) if len(errors) == 1 else ""]
        for name, tilt, off in LOOKS:
            view = look(door, tilt, off)
            jacobian = ground_jacobian(view.vectors, view.satellite, view.chain)
            exact = sum((analytic(jacobian, term) for term in errors), np.zeros((2, 2)))
            drawn = simulated(view, errors, name)
            radii = circular_error(exact), np.quantile(np.linalg.norm(drawn, axis=1), 0.9)
            shapes = ellipse(exact), ellipse(np.cov(drawn.T))
            entries.append(
                ", ".join(f"{radius:.2f}" for radius in radii)
                + f" ({', '.join(f'{s.major:.2f} × {s.minor:.2f}' for s in shapes)})"
            )
        rows.append(tuple(entries))
    head = ("Term", "σ", *(f"{name} (m)" for name, _, _ in LOOKS))
    caption = (
        "Error on the ground: CE90 from the derivative and from draws, and in brackets the semi-"
        "axes of the one-sigma ellipse from both. Altitude "
        f"{twin_study.altitude(door) / 1e3:.0f} km."
    )
    return Study(caption, head, tuple(rows))


def _sigma(term: Term) -> str:
    largest = float(term.sigma.max())
    if term.kind == "turn":
        return f"{largest / RADIANS_PER_ARCSEC:.3g} arcsec"
    return f"{largest * 1e6:.3g} µm" if term.kind == "image" else f"{largest:.3g} m"
