"""Light at mirrors: retro-reflectors, fold mirrors, and the path from the lasers to the tracker.

Directions are those of propagation and have shape (..., 3). A mirror is given by its normal. A
train of plane mirrors acts on directions as one matrix, the product of its reflections, for any
distances of the mirrors. The position of a ray matters only for a curved mirror, such as a cone.
Small rotations are right-handed rotation vectors. Lengths are in metres, angles in radians.

All positions are in one frame: the origin is the middle of the lens of the camera, Z is along its
boresight out of the camera. The lasers are behind the lens, at -Z. The retro-reflector is in front
of it, to one side. The light returns next to the camera, where the dichroic mirror reflects it into
the tracker. Both lenses are ideal: a point of the focal plane is a direction outside. The boresight
of the tracker is in the plane of Y and Z.
"""

from __future__ import annotations

from functools import reduce

import numpy as np

from reproduce.physics.attitude import (
    Platform,
    received_spots,
    rotation_from_vector,
    unit,
)
from reproduce.physics.validate import (
    DegenerateGeometryError,
    Direction,
    Directions,
    FloatArray,
    Number,
    Points,
    Size,
    checked,
    valid,
)

# Three mutually perpendicular mirrors, whose train is equal in every attitude, and two with their
# edge along Y.
CORNER = np.eye(3)
ROOF = np.array([[1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]])
_NO_TURN = (0.0, 0.0, 0.0)
# The tip of a conical retro-reflector: a metre in front of the camera and half a metre aside.
_CONE_TIP = np.array([0.5, 0.0, 1.0])
# The cone is the surface x^2 + y^2 - z^2 = 0.
_CONE_FORM = np.array([1.0, 1.0, -1.0])


@checked
def reflection(normal: Direction) -> FloatArray:
    """Return the matrix of a plane mirror.

    Parameters
    ----------
    normal : array_like, shape (..., 3)
        Normal of the mirror, of any length but zero, and any sign.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        I - 2 n n^T. It applies to directions, not to positions.

    Examples
    --------
    >>> reflection([0, 0, 2.0]) @ [1.0, 0.0, 1.0]
    array([ 1.,  0., -1.])
    """
    across = unit("normal", normal)
    return np.eye(3) - 2.0 * across[..., None] * across[..., None, :]


@checked
def mirror_train(normals: Directions) -> FloatArray:
    """Return the matrix of several plane mirrors, one after the other.

    Parameters
    ----------
    normals : array_like, shape (..., n, 3)
        Normals in the order of the reflections, as for `reflection`.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Product of the reflections.

    Examples
    --------
    Three mutually perpendicular mirrors reverse every direction.

    >>> mirror_train(np.eye(3)) @ [0.6, 0.0, 0.8]
    array([-0.6,  0. , -0.8])
    """
    mirrors = np.moveaxis(reflection(normals), -3, 0)
    return reduce(np.matmul, mirrors[::-1])


@checked
def fold_mirror_tilt(boresight_angle: Number) -> FloatArray:
    """Return the tilt of a mirror that reflects retro-reflected light into another instrument.

    Light leaves the first instrument along its boresight and returns along the same line. A plane
    mirror in front of the second instrument reflects it onto the second boresight. The normal of
    the mirror bisects the angle between the directions before and after the reflection.

    Parameters
    ----------
    boresight_angle : array_like, shape (...)
        Angle between the two boresights, both outwards, from 0 (excluded) to pi.

    Returns
    -------
    ndarray, shape (...)
        Angle between the mirror and the plane perpendicular to the second boresight:
        pi/2 - boresight_angle/2.

    Examples
    --------
    The tilt is zero for opposite instruments.

    >>> float(fold_mirror_tilt(np.pi))
    0.0
    """
    valid(
        "boresight_angle",
        boresight_angle,
        (boresight_angle > 0) & (boresight_angle <= np.pi),
        "angles above 0 and at most pi, in radians",
    )
    return np.pi / 2 - boresight_angle / 2


@checked
def fold_mirror(boresight_angle: Size) -> FloatArray:
    """Return the normal of the dichroic mirror in front of the tracker, shape (3,).

    Parameters are those of `fold_mirror_tilt`. The frame is that of the camera.

    Examples
    --------
    >>> fold_mirror(np.pi)
    array([0., 0., 1.])
    """
    tilt = fold_mirror_tilt(boresight_angle)
    return np.array([0.0, np.sin(tilt), np.cos(tilt)])


def reflected_by_cone(points: FloatArray, directions: FloatArray) -> FloatArray:
    """Return the directions of light after two reflections by a hollow right-angled cone.

    The tip is at the origin, and the cone opens towards -Z. In a plane through the axis it acts as
    two mirrors at a right angle. Light off that plane returns only to first order.

    Parameters
    ----------
    points, directions : ndarray, shape (..., 3)
        Point of each ray in front of the cone, and its direction.

    Returns
    -------
    ndarray, shape (..., 3)
        Directions.

    Raises
    ------
    DegenerateGeometryError
        If a ray does not have two reflections.

    Examples
    --------
    >>> reflected_by_cone(np.array([0.1, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])).round(12) + 0.0
    array([ 0.,  0., -1.])
    """
    for _ in range(2):
        square = directions**2 @ _CONE_FORM
        mixed = (points * directions) @ _CONE_FORM
        constant = points**2 @ _CONE_FORM
        root = np.sqrt((mixed**2 - square * constant).clip(0.0))
        lengths = np.stack([-mixed - root, -mixed + root]) / square
        # A ray has just left a point at length zero.
        ahead = lengths > 1e-9 * (1.0 + np.abs(points).max())
        hits = ahead & (points[..., 2] + lengths * directions[..., 2] < 0)
        length = np.where(hits, lengths, np.inf).min(axis=0)
        if np.isinf(length).any():
            raise DegenerateGeometryError(
                "points: expected rays with two reflections, got a ray that misses the cone. "
                "Move the tip of the cone away from the axis of the beam"
            )
        points = points + length[..., None] * directions
        mirrors = reflection(points * _CONE_FORM)
        directions = (mirrors @ directions[..., None])[..., 0]
    return directions


# Trains of retro-reflectors in front of the camera; `None` for a cone.
RETROREFLECTORS: dict[str, FloatArray | None] = {
    "corner cube": mirror_train(CORNER),
    "two mirrors at a right angle": mirror_train(ROOF),
    "conical mirror": None,
}


@checked
def traced_spots(
    platform: Platform,
    boresight_angle: Size,
    retroreflector: FloatArray | None,
    aperture: Points,
    turn: Direction = _NO_TURN,
    camera_turn: Direction = _NO_TURN,
) -> FloatArray:
    """Return the positions of the rays of each laser on the detector of the tracker.

    Parameters
    ----------
    platform : Platform
        Lasers, camera and tracker.
    boresight_angle : float
        Angle between the two boresights, both outwards, in radians.
    retroreflector : ndarray, shape (3, 3), or None
        Train of the mirrors in front of the camera, from `RETROREFLECTORS`. `None` for a cone.
    aperture : array_like, shape (n, 2)
        Illuminated points of the lens of the camera, in metres.
    turn, camera_turn : array_like, shape (3,)
        Rotation vectors of the retro-reflector, for a cone about its tip, and of the camera with
        lasers and lens, about its lens.

    Returns
    -------
    ndarray, shape (lasers, n, 2)
        Positions, in px.

    Examples
    --------
    The spot of a laser at the centre is at the centre, for any part of the lens.

    >>> platform = Platform([[0, 0], [0.01, 0]], 2.0, 0.06, 13e-6, (0, 0))
    >>> lens = [[0.0, 0.02], [0.1, 0.05]]
    >>> spots = traced_spots(platform, np.radians(120), mirror_train(CORNER), lens)
    >>> bool(np.abs(spots[0]).max() < 1e-9)
    True
    """
    camera = rotation_from_vector(camera_turn)
    light = platform.directions @ camera.T
    lens = np.insert(aperture, 2, 0.0, axis=-1) @ camera.T
    # In the frame of the retro-reflector: rows times R are the columns R' x.
    turned = rotation_from_vector(turn)
    rays = np.repeat(light[:, None], len(lens), axis=1) @ turned
    if retroreflector is None:
        rays = reflected_by_cone((lens - _CONE_TIP) @ turned, rays)
    else:
        rays = rays @ retroreflector.T
    rays = rays @ turned.T @ reflection(fold_mirror(boresight_angle))
    # Directions in the tracker point to the source of the light.
    sources = -rays @ rotation_from_vector([boresight_angle, 0.0, 0.0])
    return received_spots(sources, *platform.tracker)
