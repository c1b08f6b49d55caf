"""From a pixel to a position on the Earth: the imaging model, on the WGS84 ellipsoid.

Lengths are in metres, angles in radians. Positions are Earth-fixed (WGS84 axes: Z to the
pole, X to the meridian of zero longitude). The camera frame is that of `attitude.platform`: Z along
the boresight, out of the camera. Leading axes are a batch.

The derivatives of a position are exact (`ground_jacobian`). P = S + l u stays on the ellipsoid, so
its motion is the motion dS + l du of the line of sight, projected along the line onto the tangent
plane with the normal n:

    dP = (I - u n^T / n·u) (dS + l du).

A resolution is at nadir. Covariances are those of east and north on the ground, in m^2.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from reproduce.physics.attitude import unit
from reproduce.physics.ground.earth import EARTH_AXES
from reproduce.physics.validate import (
    Direction,
    Directions,
    FloatArray,
    Point,
    Points,
    Positive,
    Rotation,
    Size,
    checked,
    valid,
)

_Plane = Annotated[Any, (2, 2)]
# Directions over which a normal distribution in the plane is integrated.
_SECTORS = 256


@checked
def image_vectors(
    points: Points,
    focal_length: Size,
    principal_point: Point = (0.0, 0.0),
    distortion: Points = None,
) -> FloatArray:
    """Return the bracket of the imaging model (1): vectors from the lens to image points.

    Parameters
    ----------
    points : array_like, shape (..., n, 2)
        Image coordinates (X, Y) on the focal plane, in metres.
    focal_length : float
        Focal length f_cam, in metres.
    principal_point : array_like, shape (..., 2)
        Principal point (X_0, Y_0), in metres.
    distortion : array_like, shape (..., n, 2), optional
        Displacements (Delta X, Delta Y) by distortion, in metres.

    Returns
    -------
    ndarray, shape (..., n, 3)
        [X - X_0 - Delta X, Y - Y_0 - Delta Y, -f_cam] in the camera frame, in metres, opposite to
        the line of sight.

    Examples
    --------
    >>> image_vectors([[0.03, 0.0]], focal_length=4.0)
    array([[ 0.03,  0.  , -4.  ]])
    """
    offsets = points - principal_point[..., None, :]
    if distortion is not None:
        offsets = offsets - distortion
    return np.insert(offsets, 2, -focal_length, axis=-1)


@checked
def imaged_position(
    vectors: Directions,
    satellite: Direction,
    earth_from_camera: Rotation,
) -> FloatArray:
    """Return the ground positions of image points by the rigorous imaging model.

    Implements: chen2023 (1).

    The scale factor m follows from the ellipsoid: it is minus the distance over the length of the
    image vector, which is opposite to the line of sight.

    Parameters
    ----------
    vectors : array_like, shape (..., n, 3)
        Image vectors in the camera frame, from `image_vectors`.
    satellite : array_like, shape (..., 3)
        Earth-fixed position of the camera, in metres, outside the ellipsoid.
    earth_from_camera : array_like, shape (..., 3, 3)
        The rotation chain ``earth_from_inertial @ inertial_from_tracker @ tracker_misalignment @
        tracker_from_camera``: R_J2000^WGS84, R_star^J2000, R_U as from
        `attitude.misalignment_in_tracker`, and R_cam^star, the installation at the zero point.

    Returns
    -------
    ndarray, shape (..., n, 3)
        Earth-fixed positions, in metres.

    Raises
    ------
    ValueError
        If a line of sight does not meet the Earth.

    Examples
    --------
    Nadir from 1000 km above zero latitude and longitude.

    >>> down = [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
    >>> imaged_position([[0, 0, -0.5]], [7378137.0, 0, 0], down).round()
    array([[6378137.,       0.,       0.]])
    """
    line = unit("vectors", -(vectors @ earth_from_camera.mT))
    origin = satellite[..., None, :]
    # In units of the semi-axes the ellipsoid is a sphere of radius one.
    start, sight = origin / EARTH_AXES, line / EARTH_AXES
    height = np.vecdot(start, start) - 1.0
    valid("satellite", height, height > 0, "a height above the ellipsoid, in metres")
    approach = -np.vecdot(start, sight)
    # Lagrange's identity: no difference of large squares at grazing incidence.
    moment = np.cross(start, sight)
    discriminant = np.vecdot(sight, sight) - np.vecdot(moment, moment)
    missed = (discriminant < 0) | (approach <= 0)
    if missed.any():
        raise ValueError(
            f"vectors: expected lines of sight that meet the Earth, got {missed.sum()} of "
            f"{missed.size} that miss it, {(approach <= 0).sum()} of them in the opposite "
            "direction. Check the sign of the boresight and the order of the rotations"
        )
    reach = height / (approach + np.sqrt(discriminant))
    return origin + reach[..., None] * line


@checked
def ground_jacobian(
    vectors: Directions,
    satellite: Direction,
    earth_from_camera: Rotation,
) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return ground positions with their derivatives by all terms of the imaging model.

    Parameters and errors are those of `imaged_position`.

    Returns
    -------
    positions : ndarray, shape (..., n, 3)
        Earth-fixed positions, in metres.
    derivatives : dict of str to ndarray, shape (..., n, 3, 3)
        Exact except for rounding errors. ``satellite``: by the Earth-fixed position of the
        satellite. ``turn``: by a right-handed rotation of the camera about its X, Y, Z axes, in
        metres per radian, for an error of the attitude or a misalignment. ``image``: by X, Y and Z
        of the image vector, per metre. The derivatives by principal point or distortion have the
        opposite sign of the first two columns, that by the focal length the opposite sign of the
        third.

    Examples
    --------
    At nadir, the derivative by a rotation about the Y axis of the camera is the altitude.

    >>> down = [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
    >>> _, derivatives = ground_jacobian([[0, 0, -0.5]], [7378137.0, 0, 0], down)
    >>> derivatives["turn"][0, :, 1].round(3) + 0.0
    array([      0.,       0., 1000000.])
    """
    position = imaged_position(vectors, satellite, earth_from_camera)
    # The projection along the line of sight, s = l u, onto the tangent plane.
    sight = position - satellite[..., None, :]
    normal = position / EARTH_AXES**2
    steep = np.vecdot(normal, sight)[..., None, None]
    slide = np.eye(3) - sight[..., None] * normal[..., None, :] / steep
    matrix = earth_from_camera[..., None, :, :]
    # A rotation t changes the line by t × s, so ds = (R t) × s for a rotation about camera axes,
    # and a row r of the projection gives r · ds = (s × r) · R t.
    by_turn = np.cross(sight[..., None, :], slide) @ matrix
    # Along the line the projection vanishes, so the image vector needs no projection.
    scale = np.linalg.norm(sight, axis=-1) / np.linalg.norm(vectors, axis=-1)
    by_image = slide @ matrix * -scale[..., None, None]
    return position, {"satellite": slide, "turn": by_turn, "image": by_image}


@checked
def ground_resolution(
    focal_length: Positive, pixel_pitch: Positive, altitude: Positive
) -> FloatArray:
    """Return the size of a pixel on the ground at nadir.

    Parameters
    ----------
    focal_length, pixel_pitch, altitude : array_like, shape (...)
        Lengths, in metres.

    Returns
    -------
    ndarray, shape (...)
        pitch × altitude / focal length, in metres.

    Examples
    --------
    >>> float(ground_resolution(focal_length=10.0, pixel_pitch=1e-5, altitude=500e3))
    0.5
    """
    return pixel_pitch * altitude / focal_length


@checked
def circular_error(covariance: _Plane, share: Size = 0.9) -> FloatArray:
    """Return the radius of the circle that contains a fraction of the errors: CE90 by default.

    Parameters
    ----------
    covariance : array_like, shape (..., 2, 2)
        Covariance of east and north about the true position, in m^2, positive semidefinite.
    share : float
        Fraction of the errors, above 0 and below 1.

    Returns
    -------
    ndarray, shape (...)
        Radius, in metres.

    Examples
    --------
    For equal errors of 1 m, it is 2.146 m by the Rayleigh distribution, and 1.645 m along a line.

    >>> circular_error([np.eye(2), np.diag([1.0, 0.0])]).round(3)
    array([2.146, 1.645])
    """
    valid("share", share, share < 1.0, "a fraction between 0 and 1")
    from scipy.optimize import elementwise  # the other functions do not need it

    low, high = np.moveaxis(np.linalg.eigvalsh(covariance), -1, 0)
    valid(
        "covariance",
        low,
        low >= -1e-9 * high.clip(0.0),
        "no negative variance in any direction",
    )
    ratio = (low / np.where(high > 0, high, 1.0)).clip(0.0)
    # The radius for equal semi-axes, the largest one, has a closed form.
    bracket = 0.0, 1.01 * np.sqrt(-2.0 * np.log1p(-share))
    angle = (np.arange(_SECTORS) + 0.5) / _SECTORS * np.pi

    def excess(radius: FloatArray, ratio: FloatArray) -> FloatArray:
        # In each direction of the plane with equal axes, half the squared distance is exponential.
        square = np.cos(angle) ** 2 + ratio[..., None] * np.sin(angle) ** 2
        inside = -np.expm1(-(radius[..., None] ** 2) / (2.0 * square)).mean(axis=-1)
        return inside - share

    radius = elementwise.find_root(excess, bracket, args=(ratio,)).x
    return radius * np.sqrt(high.clip(0.0))
