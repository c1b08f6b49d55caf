"""Light over mirrors: retro-reflectors, fold mirrors, and what a turn of them does to the light.

Directions point where the light goes and have shape (..., 3); mirrors are given by their normals.
A train of plane mirrors acts on directions as one matrix, the product of its reflections, however
far apart the mirrors stand; only a curved mirror, such as a cone, asks where a ray hits. Small
turns are right-handed rotation vectors in the frame of the directions; angles are in radians.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.attitude.rotations import _cross_matrix, _rotation_from_vector, _unit
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    finite_array,
    together,
)

__all__ = [
    "CORNER",
    "ROOF",
    "cone_path",
    "fold_mirror_tilt",
    "mirror_train",
    "reflection",
    "turn_response",
    "turned_train",
]

# Three mutually perpendicular mirrors evenly around Z, and two with their edge along Y.
CORNER = np.array([[2.0, 0.0, 2**0.5], [-1.0, 3**0.5, 2**0.5], [-1.0, -(3**0.5), 2**0.5]])
ROOF = np.array([[1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]])


def reflection(normal: ArrayLike) -> FloatArray:
    """Return the matrix of a plane mirror.

    Parameters
    ----------
    normal : array_like, shape (..., 3)
        Of any length and either sign.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        I - 2 n n^T; it turns directions, not places.

    Raises
    ------
    ValueError
        If a normal has length zero.

    Examples
    --------
    >>> reflection([0, 0, 2.0]) @ [1.0, 0.0, 1.0]
    array([ 1.,  0., -1.])
    """
    return _reflection(finite_array("normal", normal, shape=(3,)))


def mirror_train(normals: ArrayLike) -> FloatArray:
    """Return what several plane mirrors do to a direction, one after the other.

    Parameters
    ----------
    normals : array_like, shape (..., n, 3)
        In the order in which the light meets them, as for `reflection`.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Product of the reflections.

    Examples
    --------
    Three mutually perpendicular mirrors turn every direction round.

    >>> mirror_train(np.eye(3)) @ [0.6, 0.0, 0.8]
    array([-0.6,  0. , -0.8])
    """
    rows = finite_array("normals", normals, shape=(None, 3))
    result = np.broadcast_to(np.eye(3), (*rows.shape[:-2], 3, 3))
    for index in range(rows.shape[-2]):
        result = _reflection(rows[..., index, :]) @ result
    return result


def turned_train(train: ArrayLike, turn: ArrayLike) -> FloatArray:
    """Return a train of mirrors that has turned as a whole: R M R^T.

    Parameters
    ----------
    train : array_like, shape (..., 3, 3)
        M, from `mirror_train`.
    turn : array_like, shape (..., 3)
        Rotation vector, in radians.

    Returns
    -------
    ndarray, shape (..., 3, 3)

    Examples
    --------
    >>> np.allclose(turned_train(mirror_train(np.eye(3)), [0.1, 0.2, 0.3]), -np.eye(3))
    True
    """
    matrix, vector = together(train=(train, (3, 3)), turn=(turn, (3,)))
    rotation = _rotation_from_vector(vector)
    return rotation @ matrix @ rotation.mT


def turn_response(train: ArrayLike, direction: ArrayLike) -> FloatArray:
    """Return how outgoing light answers to small turns of a train of mirrors about three axes.

    Parameters
    ----------
    train : array_like, shape (..., 3, 3)
        From `mirror_train`.
    direction : array_like, shape (..., 3)
        Of the incoming light.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        Derivative of the outgoing direction by the turn about X, Y and Z (columns): for a plane
        mirror met head-on, two radians for one.

    Examples
    --------
    >>> turn_response(reflection([0, 0, 1.0]), [0, 0, -1.0])[:, 1]
    array([2., 0., 0.])
    """
    matrix, coming = together(train=(train, (3, 3)), direction=(direction, (3,)))
    coming = _unit("direction", coming)
    going = np.einsum("...ij,...j->...i", matrix, coming)
    # d/da of R M R' d at no turn: a × (M d) - M (a × d).
    return -_cross_matrix(going) + matrix @ _cross_matrix(coming)


def cone_path(
    origins: ArrayLike, directions: ArrayLike, turn: ArrayLike = (0.0, 0.0, 0.0)
) -> tuple[FloatArray, FloatArray]:
    """Return where light leaves a right-angled conical mirror, and its direction.

    The cone is hollow, its tip at the origin, its axis along Z, open towards positive Z: the
    surface x^2 + y^2 = z^2. A ray meets it twice. In a plane through the axis it acts as two
    mirrors at a right angle; light off that plane it turns back to first order only.

    Parameters
    ----------
    origins : array_like, shape (..., 3)
        Points on the rays, inside the cone or above it, in any length unit.
    directions : array_like, shape (..., 3)
        Of the rays, downwards.
    turn : array_like, shape (3,)
        Rotation vector by which the cone has turned about its tip, in radians.

    Returns
    -------
    places : ndarray, shape (..., 3)
        Where the second reflection happens, in the unit of the origins.
    directions : ndarray, shape (..., 3)
        Unit vectors after it.

    Raises
    ------
    DegenerateGeometryError
        If a ray meets the tip or leaves the cone without a second reflection.

    Examples
    --------
    >>> places, _ = cone_path([0.5, 0, 9.0], [0, 0, -1.0])
    >>> places.round(12) + 0.0
    array([-0.5,  0. ,  0.5])
    """
    start, sight = together(origins=(origins, (3,)), directions=(directions, (3,)))
    sight = _unit("directions", sight)
    rotation = _rotation_from_vector(finite_array("turn", turn, shape=(3,)))
    # Work in the cone's own frame; rows times R are the columns R' x.
    place, way = start @ rotation, sight @ rotation
    for _ in range(2):
        place = place + _to_cone(place, way)[..., np.newaxis] * way
        normal = _unit("normal", place * np.array([-1.0, -1.0, 1.0]))
        way = way - 2.0 * np.einsum("...i,...i->...", way, normal)[..., np.newaxis] * normal
    return place @ rotation.T, way @ rotation.T


def _reflection(normal: FloatArray) -> FloatArray:
    across = _unit("normal", normal)
    return np.eye(3) - 2.0 * across[..., :, np.newaxis] * across[..., np.newaxis, :]


def _to_cone(place: FloatArray, way: FloatArray) -> FloatArray:
    """Return the distance to where rays next meet the cone, the starting point left out."""
    sign = np.array([1.0, 1.0, -1.0])
    square = np.einsum("...i,i,...i->...", way, sign, way)
    mixed = np.einsum("...i,i,...i->...", place, sign, way)
    rest = np.einsum("...i,i,...i->...", place, sign, place)
    root = np.sqrt(np.maximum(mixed**2 - square * rest, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        # Light along the surface has one meeting only: the quadratic degenerates.
        line = -rest / (2.0 * mixed)
        ends = np.stack([(-mixed - root) / square, (-mixed + root) / square, line])
    ends[:2, np.abs(square) < 1e-12] = np.nan
    ends[2, np.abs(square) >= 1e-12] = np.nan
    height = place[..., 2] + ends * way[..., 2]
    ahead = (ends > 1e-9 * (1.0 + np.abs(place).max())) & (height > 0)
    found = np.where(ahead, ends, np.inf).min(axis=0)
    if not np.isfinite(found).all():
        raise DegenerateGeometryError(
            "origins: expected rays that meet the cone twice, got one that does not; let it come "
            "in next to the axis, not through the tip, and nearly along the axis"
        )
    return found


def fold_mirror_tilt(boresight_angle: ArrayLike) -> FloatArray:
    """The tilt of a mirror that sends the retro-reflected light of one instrument into another.

    Light leaves the first instrument along its boresight, comes back along the same line, and a
    plane mirror in front of the second instrument turns it onto that one's boresight. The mirror's
    normal halves the angle between the returning and the turned direction.

    Parameters
    ----------
    boresight_angle : array_like
        Angle between the two boresights, both pointing outwards, from 0 (excluded) to pi.

    Returns
    -------
    ndarray
        Dihedral angle between the mirror and the plane across the second boresight:
        pi/2 - boresight_angle/2.

    Raises
    ------
    ValueError
        If the angle is not above 0 and at most pi.

    Examples
    --------
    Opposite instruments look straight at each other through an untilted mirror.

    >>> float(fold_mirror_tilt(np.pi))
    0.0
    """
    angle = finite_array("boresight_angle", boresight_angle)
    if ((angle <= 0) | (angle > np.pi)).any():
        raise ValueError(
            f"boresight_angle: expected above 0 and at most pi, got {angle.min():g} to "
            f"{angle.max():g} rad; angles are in radians, not degrees"
        )
    return np.asarray(np.pi / 2 - angle / 2)
