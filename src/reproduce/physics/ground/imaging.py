"""From a pixel to a position on the Earth: the imaging model, on the WGS84 ellipsoid.

Lengths are in metres, angles in radians. Positions are Earth-fixed (WGS84 axes: Z to the
pole, X to the meridian of zero longitude). The camera frame is that of `attitude.lasers`: Z along
the boresight, out of the camera. Leading axes are a batch.

How a position answers to errors of the model is known exactly (`ground_jacobian`): P = S + l u
stays on the ellipsoid whatever is varied, so its motion is that of the line of sight, dS + l du,
slid along the line until it lies in the tangent plane: with the surface's normal n,

    dP = (I - u n^T / n·u) (dS + l du).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.attitude.platform import _outward
from reproduce.physics.attitude.rotations import _cross_matrix, _unit
from reproduce.physics.validate import (
    Direction,
    Directions,
    FloatArray,
    Point,
    Points,
    Positive,
    Rotation,
    checked,
    common_batch,
    finite_array,
)


class EarthMissedError(ValueError):
    """A line of sight does not meet the ellipsoid."""


@dataclass(frozen=True)
class Ellipsoid:
    """An ellipsoid of revolution about the polar axis.

    Attributes
    ----------
    equatorial_radius : float, in metres
    flattening : float
        (equatorial - polar radius) / equatorial radius.
    """

    equatorial_radius: float
    flattening: float

    def __post_init__(self) -> None:
        if not (np.isfinite(self.equatorial_radius) and self.equatorial_radius > 0):
            raise ValueError(
                f"equatorial_radius: expected metres above zero, got {self.equatorial_radius}"
            )
        if not 0 <= self.flattening < 1:
            raise ValueError(
                f"flattening: expected from 0 (a sphere) to below 1, got {self.flattening}; "
                "pass the flattening, not its inverse"
            )

    @property
    def axes(self) -> FloatArray:
        """The semi-axes along X, Y and Z (towards the poles), shape (3,), in metres."""
        return self.equatorial_radius * np.array([1.0, 1.0, 1.0 - self.flattening])


# Defining constants of the World Geodetic System 1984 (NGA.STND.0036).
WGS84 = Ellipsoid(equatorial_radius=6378137.0, flattening=1.0 / 298.257223563)


@dataclass(frozen=True, eq=False)
class ImagedPoint:
    """Where lines of sight meet the ground.

    Attributes
    ----------
    position : ndarray, shape (..., n, 3)
        Earth-fixed, in metres.
    scale : ndarray, shape (..., n)
        The scale factor m: the length along the image vector, in units of its length.
    """

    position: FloatArray
    scale: FloatArray


@checked
def image_vectors(
    points: Points,
    focal_length: Positive,
    principal_point: Point = (0.0, 0.0),
    distortion: ArrayLike = (0.0, 0.0),
) -> FloatArray:
    """Return the bracket of the imaging model (1): the image point as seen from the lens.

    Parameters
    ----------
    points : array_like, shape (..., n, 2)
        Image coordinates (X, Y) on the focal plane, in metres.
    focal_length : array_like, shape (...)
        f_cam, in metres.
    principal_point : array_like, shape (..., 2)
        (X_0, Y_0), in metres.
    distortion : array_like, shape (..., n, 2) or (2,)
        (Delta X, Delta Y), what distortion adds to the image coordinates, in metres.

    Returns
    -------
    ndarray, shape (..., n, 3)
        [X - X_0 - Delta X, Y - Y_0 - Delta Y, -f_cam] in the camera frame, in metres. It
        points from the lens into the camera, against the line of sight.

    Examples
    --------
    >>> image_vectors([[0.03, 0.0]], focal_length=4.0)
    array([[ 0.03,  0.  , -4.  ]])
    """
    shift = finite_array("distortion", distortion, shape=(2,))
    common_batch(points=points.shape[:-1], distortion=shift.shape[:-1])
    return _outward(points - principal_point[..., np.newaxis, :] - shift, -focal_length)


@checked
def imaging_chain(
    earth_from_inertial: Rotation,
    inertial_from_tracker: Rotation,
    tracker_misalignment: Rotation,
    tracker_from_camera: Rotation,
) -> FloatArray:
    """Return the rotation chain of the imaging model (1).

    Parameters
    ----------
    earth_from_inertial, inertial_from_tracker : array_like, shape (..., 3, 3)
        R_J2000^WGS84 and R_star^J2000.
    tracker_misalignment : array_like, shape (..., 3, 3)
        R_U, the misalignment resolved in the tracker; see
        `attitude.misalignment.misalignment_in_tracker`.
    tracker_from_camera : array_like, shape (..., 3, 3)
        R_cam^star, the installation at the zero point.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        earth_from_camera.

    Examples
    --------
    >>> imaging_chain(np.eye(3), np.eye(3), np.eye(3), np.eye(3)).diagonal()
    array([1., 1., 1.])
    """
    return earth_from_inertial @ inertial_from_tracker @ tracker_misalignment @ tracker_from_camera


@checked
def imaged_position(
    vectors: Directions,
    satellite: Direction,
    earth_from_camera: Rotation,
    ellipsoid: Ellipsoid = WGS84,
) -> ImagedPoint:
    """Return the ground positions that image points show: the rigorous imaging model.

    Implements: chen2023 (1).

    The scale factor m is the one that puts the position on the ellipsoid. The image vector
    points into the camera, away from the target, so in the camera frame of (2) m is negative.

    Parameters
    ----------
    vectors : array_like, shape (..., n, 3)
        Image vectors in the camera frame, from `image_vectors`.
    satellite : array_like, shape (..., 3)
        Earth-fixed position of the camera, in metres, outside the ellipsoid.
    earth_from_camera : array_like, shape (..., 3, 3)
        The rotation chain, from `imaging_chain`.
    ellipsoid : Ellipsoid
        The surface of the Earth.

    Returns
    -------
    ImagedPoint
        Earth-fixed positions, in metres, and the scale factors m.

    Raises
    ------
    EarthMissedError
        If a line of sight passes the Earth, or looks away from it.

    Examples
    --------
    From 1000 km above zero latitude and longitude, straight down.

    >>> down = [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
    >>> imaged = imaged_position([[0, 0, -0.5]], [7378137.0, 0, 0], down)
    >>> np.round(imaged.position), imaged.scale
    (array([[6378137.,       0.,       0.]]), array([-2000000.]))
    """
    _, reach, position = _seen(vectors, satellite, earth_from_camera, ellipsoid)
    return ImagedPoint(position, -reach / np.linalg.norm(vectors, axis=-1))


@checked
def distance_to_ground(
    origin: Direction, directions: Direction, ellipsoid: Ellipsoid = WGS84
) -> FloatArray:
    """Return the distance along lines of sight to where they first meet the ellipsoid.

    Parameters
    ----------
    origin : array_like, shape (..., 3)
        Earth-fixed starting points, in metres, outside the ellipsoid.
    directions : array_like, shape (..., 3)
        Earth-fixed lines of sight, of any length; broadcast against the origins.
    ellipsoid : Ellipsoid
        The surface of the Earth.

    Returns
    -------
    ndarray, shape (...)
        Distances, in metres.

    Raises
    ------
    EarthMissedError
        If a line passes the ellipsoid, or meets it only backwards.

    Examples
    --------
    >>> float(distance_to_ground([0, 0, 5.0], [0, 0, -1], Ellipsoid(2.0, 0.5)))
    4.0
    """
    return _distance(origin, _unit("directions", directions), ellipsoid)


def _seen(
    vectors: FloatArray, satellite: FloatArray, chain: FloatArray, ellipsoid: Ellipsoid
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return unit lines of sight, Earth-fixed, how far they reach, and where they end."""
    sight = _unit("vectors", -(vectors @ chain.mT))
    origin = satellite[..., np.newaxis, :]
    reach = _distance(origin, sight, ellipsoid)
    return sight, reach, origin + reach[..., np.newaxis] * sight


def _distance(start: FloatArray, sight: FloatArray, ellipsoid: Ellipsoid) -> FloatArray:
    axes = ellipsoid.axes
    # In units of the axes the ellipsoid is a sphere of radius one.
    start, sight = start / axes, sight / axes
    height = np.einsum("...i,...i->...", start, start) - 1.0
    if (height <= 0).any():
        raise ValueError(
            "origin: expected points outside the ellipsoid, got one on it or inside; positions "
            "are in metres from the Earth's centre"
        )
    approach = -np.einsum("...i,...i->...", start, sight)
    square = np.einsum("...i,...i->...", sight, sight)
    # Lagrange's identity: no difference of large squares at grazing incidence.
    moment = np.cross(start, sight)
    discriminant = square - np.einsum("...i,...i->...", moment, moment)
    missed = (discriminant < 0) | (approach <= 0)
    if missed.any():
        away = int((missed & (approach <= 0)).sum())
        raise EarthMissedError(
            f"expected lines of sight that meet the Earth, got {int(missed.sum())} of "
            f"{missed.size} that miss it, {away} of them looking away from it; check the sign "
            "of the boresight and the order of the rotations, or drop these pixels"
        )
    return height / (approach + np.sqrt(discriminant))


@dataclass(frozen=True, eq=False)
class GroundJacobian:
    """Derivatives of Earth-fixed ground positions.

    Attributes
    ----------
    position : ndarray, shape (..., n, 3)
        The positions themselves, in metres.
    by_satellite : ndarray, shape (..., n, 3, 3)
        By the satellite's Earth-fixed position.
    by_turn : ndarray, shape (..., n, 3, 3)
        By a right-handed turn of the camera about its own X, Y, Z axes, in metres per radian: an
        error of the attitude and a misalignment act alike.
    by_image : ndarray, shape (..., n, 3, 3)
        By the image vector's X, Y and Z, per metre. A shift of the principal point or of the
        distortion enters with the opposite sign of the first two columns, a longer focal length
        with that of the third.
    """

    position: FloatArray
    by_satellite: FloatArray
    by_turn: FloatArray
    by_image: FloatArray


@checked
def ground_jacobian(
    vectors: Directions,
    satellite: Direction,
    earth_from_camera: Rotation,
    ellipsoid: Ellipsoid = WGS84,
) -> GroundJacobian:
    """Return ground positions with their derivatives by all terms of the imaging model.

    Arguments and errors are those of `imaged_position`.

    Returns
    -------
    GroundJacobian
        Exact to rounding.

    Examples
    --------
    Straight down from 1000 km, a turn about the camera's Y axis moves the ground by the altitude.

    >>> down = [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
    >>> found = ground_jacobian([[0, 0, -0.5]], [7378137.0, 0, 0], down)
    >>> found.by_turn[0, :, 1].round(3) + 0.0
    array([      0.,       0., 1000000.])
    """
    sight, reach, position = _seen(vectors, satellite, earth_from_camera, ellipsoid)
    lengths = np.linalg.norm(vectors, axis=-1)
    # The projection along the line of sight onto the tangent plane.
    normal = position / ellipsoid.axes**2
    steep = np.einsum("...i,...i->...", normal, sight)[..., np.newaxis, np.newaxis]
    slide = np.eye(3) - sight[..., :, np.newaxis] * normal[..., np.newaxis, :] / steep
    far = slide * reach[..., np.newaxis, np.newaxis]
    matrix = earth_from_camera[..., np.newaxis, :, :]
    # A turn by t moves the line by t × u, so du = -[u ×] R t for a turn about camera axes.
    by_turn = -far @ _cross_matrix(sight) @ matrix
    across = np.eye(3) - sight[..., :, np.newaxis] * sight[..., np.newaxis, :]
    by_image = -far @ across @ matrix / lengths[..., np.newaxis, np.newaxis]
    return GroundJacobian(position, slide, by_turn, by_image)
