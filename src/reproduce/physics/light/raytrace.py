"""Light over mirrors: retro-reflectors, fold mirrors, and what a turn of them does to the light.

Directions point where the light goes and have shape (..., 3); mirrors are given by their normals.
A train of plane mirrors acts on directions as one matrix, the product of its reflections, however
far apart the mirrors stand; only a curved mirror, such as a cone, asks where a ray hits. Small
turns are right-handed rotation vectors in the frame of the directions; angles are in radians.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np

from reproduce.physics.attitude.rotations import _cross_matrix, _rotation_from_vector, _unit
from reproduce.physics.validate import (
    DegenerateGeometryError,
    Direction,
    Directions,
    FloatArray,
    Number,
    checked,
    kernel,
)

_Train = Annotated[Any, (3, 3)]
# Three mutually perpendicular mirrors evenly around Z, and two with their edge along Y.
CORNER = np.array([[2.0, 0.0, 2**0.5], [-1.0, 3**0.5, 2**0.5], [-1.0, -(3**0.5), 2**0.5]])
ROOF = np.array([[1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]])


@checked
def reflection(normal: Direction) -> FloatArray:
    """Return the matrix of a plane mirror.

    Parameters
    ----------
    normal : array_like, shape (..., 3), of any length but zero, and either sign

    Returns
    -------
    ndarray, shape (..., 3, 3)
        I - 2 n n^T; it turns directions, not places.

    Examples
    --------
    >>> reflection([0, 0, 2.0]) @ [1.0, 0.0, 1.0]
    array([ 1.,  0., -1.])
    """
    across = _unit("normal", normal)
    return np.eye(3) - 2.0 * across[..., :, np.newaxis] * across[..., np.newaxis, :]


@checked
def mirror_train(normals: Directions) -> FloatArray:
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
    result = np.broadcast_to(np.eye(3), (*normals.shape[:-2], 3, 3))
    for index in range(normals.shape[-2]):
        result = kernel(reflection)(normals[..., index, :]) @ result
    return result


@checked
def turned_train(train: _Train, turn: Direction) -> FloatArray:
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
    rotation = _rotation_from_vector(turn)
    return rotation @ train @ rotation.mT


@checked
def turn_response(train: _Train, direction: Direction) -> FloatArray:
    """Return how outgoing light answers to small turns of a train of mirrors about three axes.

    Parameters
    ----------
    train : array_like, shape (..., 3, 3), from `mirror_train`
    direction : array_like, shape (..., 3), of the incoming light

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
    coming = _unit("direction", direction)
    going = np.einsum("...ij,...j->...i", train, coming)
    # d/da of R M R' d at no turn: a × (M d) - M (a × d).
    return -_cross_matrix(going) + train @ _cross_matrix(coming)


@checked
def cone_path(
    origins: Direction, directions: Direction, turn: Direction = (0.0, 0.0, 0.0)
) -> tuple[FloatArray, FloatArray]:
    """Return where light leaves a right-angled conical mirror, and its direction.

    The cone is hollow, its tip at the origin, its axis along Z, open towards positive Z: the
    surface x^2 + y^2 = z^2. A ray meets it twice. In a plane through the axis it acts as two
    mirrors at a right angle; light off that plane it turns back to first order only.

    Parameters
    ----------
    origins : array_like, shape (..., 3)
        Points on the rays, inside the cone or above it, in any length unit.
    directions : array_like, shape (..., 3), of the rays, downwards
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
    directions = _unit("directions", directions)
    rotation = _rotation_from_vector(turn)
    # Work in the cone's own frame; rows times R are the columns R' x.
    place, way = origins @ rotation, directions @ rotation
    for _ in range(2):
        place = place + _to_cone(place, way)[..., np.newaxis] * way
        normal = _unit("normal", place * np.array([-1.0, -1.0, 1.0]))
        way = way - 2.0 * np.einsum("...i,...i->...", way, normal)[..., np.newaxis] * normal
    return place @ rotation.T, way @ rotation.T


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


@checked
def fold_mirror_tilt(boresight_angle: Number) -> FloatArray:
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

    Examples
    --------
    Opposite instruments look straight at each other through an untilted mirror.

    >>> float(fold_mirror_tilt(np.pi))
    0.0
    """
    if ((boresight_angle <= 0) | (boresight_angle > np.pi)).any():
        raise ValueError(
            f"boresight_angle: expected above 0 and at most pi, got {boresight_angle.min():g} to "
            f"{boresight_angle.max():g} rad; angles are in radians, not degrees"
        )
    return np.asarray(np.pi / 2 - boresight_angle / 2)
