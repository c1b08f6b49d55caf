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
from reproduce.physics.earth import earth_fixed, satellite_from_inertial
from reproduce.physics.errors_on_ground import circular_error, ellipse, ground_covariance
from reproduce.physics.imaging import imaged_position
from reproduce.physics.imaging_jacobian import GroundJacobian, ground_jacobian
from reproduce.physics.rotations import rotation_from_vector
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given

ARCSEC = np.pi / 180 / 3600
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

    Parameters
    ----------
    door : Given
        Holds the cells of `READS`.

    Returns
    -------
    tuple of Term
        One of each kind.
    """
    across = np.array([1.0, 1.0, 0.0])
    attitude = np.full(3, door[POINTING] / lasers.SIGMAS)
    averaged = monitoring_sigma(door, door.count(twin_study.SMOOTHED))
    single = monitoring_sigma(door, 1)
    pixel = door[twin_study.SATELLITE[1]]
    return (
        Term("attitude of the tracker, at its limit", "turn", attitude),
        Term("misalignment about X and Y, one frame", "turn", single * across),
        Term("misalignment about X and Y, averaged", "turn", averaged * across),
        Term("roll, one frame", "turn", single * (1 - across)),
        Term("roll, averaged", "turn", averaged * (1 - across)),
        Term("orbit", "satellite", np.full(3, ORBIT)),
        Term("principal point, one pixel", "image", pixel * across),
    )


@dataclass(frozen=True, eq=False)
class Look:
    """A line of sight of the satellite: image vector, place, rotation chain."""

    vectors: FloatArray
    satellite: FloatArray
    chain: FloatArray


def look(door: Given, tilt: float, off: float) -> Look:
    """Set the satellite up over a place of middle latitude.

    Parameters
    ----------
    door : Given
        Holds the satellite's line of Table I.
    tilt : float
        Of the boresight off the nadir, in degrees, about the direction of flight.
    off : float
        Distance of the image point from the centre on the ground, in metres, along X.

    Returns
    -------
    Look
        What `imaging.imaged_position` takes.
    """
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


def simulated(view: Look, term: Term, name: str) -> FloatArray:
    """Return the same covariance from draws through the whole imaging model."""
    noise = default_rng(seed_of(f"budget {name} {term.name}")).normal(size=(DRAWS, 3)) * term.sigma
    still = np.zeros((DRAWS, 3))
    satellite = view.satellite + (noise if term.kind == "satellite" else still)
    chain = view.chain @ rotation_from_vector(noise if term.kind == "turn" else still)
    moved = noise if term.kind == "image" else still
    vectors = view.vectors + moved[:, np.newaxis]
    found = imaged_position(vectors, satellite, chain).position[:, 0]
    jacobian = ground_jacobian(view.vectors, view.satellite, view.chain)
    # East and north of the true place for all draws.
    return ground_covariance(jacobian.position[0], np.eye(3), np.cov(found.T))


def budget() -> Study:
    """Error budget of SVGF-1 on the ground, term by term: formula and simulation.

    Returns
    -------
    Study
        One row per term; CE90 from the derivative, then from draws.
    """
    door = given(READS)
    rows = []
    for term in terms(door):
        unit = 1.0 / ARCSEC if term.kind == "turn" else 1e6 if term.kind == "image" else 1.0
        entries = [term.name, f"{term.sigma.max() * unit:.3g}"]
        for name, tilt, off in LOOKS:
            view = look(door, tilt, off)
            exact = analytic(ground_jacobian(view.vectors, view.satellite, view.chain), term)
            drawn = circular_error(simulated(view, term, name))
            shape = ellipse(exact)
            entries.append(
                f"{circular_error(exact):.3f}, {drawn:.3f} ({shape.major:.3f} × {shape.minor:.3f})"
            )
        rows.append(tuple(entries))
    head = ("Term", "σ (arcsec, m or µm)", *(f"{name} (m)" for name, _, _ in LOOKS))
    caption = (
        "Error on the ground: CE90 from the derivative, CE90 from draws, and in brackets the "
        f"semi-axes of the one-sigma ellipse. Altitude {twin_study.altitude(door) / 1e3:.0f} km."
    )
    return Study(caption, head, tuple(rows))
