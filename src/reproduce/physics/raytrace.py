"""Light over mirrors: retro-reflectors, fold mirrors, and the path from the lasers to the tracker.

Directions point where the light goes and have shape (..., 3); mirrors are given by their normals.
A train of plane mirrors acts on directions as one matrix, the product of its reflections, however
far apart the mirrors stand. Only for a curved mirror, such as a cone, the place of a ray counts.
Small turns are right-handed rotation vectors; lengths are in metres, angles in radians.

One frame for all: the origin in the middle of the camera's lens, Z along its boresight out of the
camera. Lasers sit behind the lens, at -Z. The retro-reflector hangs in front of it, to one side.
The light returns next to the camera, where the dichroic mirror folds it into the tracker.
Both lenses are ideal: a point of the focal plane is a direction outside. The tracker's boresight
lies in the plane of Y and Z.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.attitude import (
    cross_matrix,
    emitted_directions,
    received_spots,
    rotation_from_vector,
    unit,
)
from reproduce.physics.validate import Direction, Directions, FloatArray, Number

_Train = Annotated[Any, (3, 3)]
# Three mutually perpendicular mirrors evenly around Z, and two with their edge along Y.
CORNER = np.array(
    [[2.0, 0.0, 2**0.5], [-1.0, 3**0.5, 2**0.5], [-1.0, -(3**0.5), 2**0.5]]
)
ROOF = np.array([[1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]])
_NO_TURN = (0.0, 0.0, 0.0)
# The tip of a conical retro-reflector: a metre in front of the camera and half a metre aside.
_CONE_TIP = np.array([0.5, 0.0, 1.0])
# The cone is the surface x^2 + y^2 - z^2 = 0.
_CONE_FORM = np.array([1.0, 1.0, -1.0])


@validate.checked
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
    across = unit("normal", normal)
    return np.eye(3) - 2.0 * across[..., None] * across[..., None, :]


@validate.checked
def mirror_train(normals: Directions) -> FloatArray:
    """Return the matrix of several plane mirrors, one after the other.

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
    mirrors = np.moveaxis(reflection(normals), -3, 0)
    return reduce(np.matmul, mirrors[::-1])


@validate.checked
def turn_response(train: _Train, direction: Direction) -> FloatArray:
    """Return the derivative of outgoing light by turns of a train of mirrors about three axes.

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
    coming = unit("direction", direction)
    going = (train @ coming[..., None])[..., 0]
    # d/da of R M R' d at no turn: a × (M d) - M (a × d).
    return train @ cross_matrix(coming) - cross_matrix(going)


@validate.checked
def fold_mirror_tilt(boresight_angle: Number) -> FloatArray:
    """Return the tilt of a mirror that sends retro-reflected light into another instrument.

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


def reflected_by_cone(places: FloatArray, ways: FloatArray) -> FloatArray:
    """Return the directions of light after a hollow right-angled conical mirror.

    Its tip is at the origin and it opens towards -Z. A ray meets it twice. In a plane through the
    axis it acts as two mirrors at a right angle; light off that plane returns to first order only.

    Parameters
    ----------
    places, ways : ndarray, shape (..., 3)
        A point of each ray in front of the cone, and its direction.

    Returns
    -------
    ndarray, shape (..., 3)

    Raises
    ------
    DegenerateGeometryError
        If a ray does not meet the cone twice.

    Examples
    --------
    >>> reflected_by_cone(np.array([0.1, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])).round(12) + 0.0
    array([ 0.,  0., -1.])
    """
    for _ in range(2):
        square, mixed, rest = (
            np.vecdot(one * _CONE_FORM, other)
            for one, other in ((ways, ways), (places, ways), (places, places))
        )
        root = np.sqrt((mixed**2 - square * rest).clip(0.0))
        ends = np.stack([-mixed - root, -mixed + root]) / square
        # A ray has just left a point at length zero.
        ahead = ends > 1e-9 * (1.0 + np.abs(places).max())
        met = ahead & (places[..., 2] + ends * ways[..., 2] < 0)
        length = np.where(met, ends, np.inf).min(axis=0)
        if np.isinf(length).any():
            raise validate.DegenerateGeometryError(
                "rays: expected each to meet the cone twice, got a ray that misses. Move the tip "
                "of the cone beside the beam"
            )
        places = places + length[..., None] * ways
        normals = unit("normals", places * _CONE_FORM)
        ways = ways - 2.0 * np.vecdot(ways, normals)[..., None] * normals
    return ways


# Trains of retro-reflectors in front of the camera; `None` for a cone.
RETROREFLECTORS: dict[str, FloatArray | None] = {
    "corner cube": mirror_train(CORNER),
    "two mirrors at a right angle": mirror_train(ROOF),
    "conical mirror": None,
}


@dataclass(frozen=True, eq=False)
class LightPath:
    """Camera, retro-reflector, dichroic mirror and tracker.

    Attributes
    ----------
    camera_focal_length, tracker_focal_length : float, in metres
    boresight_angle : float
        Between the two boresights, both outwards, in radians.
    retroreflector : ndarray, shape (3, 3), or None
        Train of the mirrors in front of the camera, from `RETROREFLECTORS`. `None` for a cone.
    turn, camera_turn : array_like, shape (3,)
        Rotation vectors by which the retro-reflector has turned, a cone about its tip, and the
        camera, lasers and lens, about its lens.

    Examples
    --------
    A laser at the centre makes a spot at the centre, for any lit part of the lens.

    >>> path = LightPath(2.0, 0.06, np.radians(120), RETROREFLECTORS["corner cube"])
    >>> bool(np.abs(path.spots([[0.0, 0.0]], [[0.0, 0.02], [0.1, 0.05]])).max() < 1e-15)
    True
    """

    camera_focal_length: float
    tracker_focal_length: float
    boresight_angle: float
    retroreflector: FloatArray | None
    turn: ArrayLike = _NO_TURN
    camera_turn: ArrayLike = _NO_TURN

    @property
    def fold(self) -> FloatArray:
        """Normal of the dichroic mirror that folds the returned light onto the boresight, (3,)."""
        tilt = float(fold_mirror_tilt(self.boresight_angle))
        return rotation_from_vector([-tilt, 0.0, 0.0])[:, 2]

    def spots(self, lasers: ArrayLike, aperture: ArrayLike) -> FloatArray:
        """Return where the rays of each laser meet the tracker's detector.

        Parameters
        ----------
        lasers : array_like, shape (n, 2)
            Points on the camera's focal plane, in metres.
        aperture : array_like, shape (rays, 2)
            Points of the camera's lens that each laser lights, in metres.

        Returns
        -------
        ndarray, shape (n, rays, 2), in metres from the principal point
        """
        camera = rotation_from_vector(self.camera_turn)
        light = emitted_directions(lasers, self.camera_focal_length) @ camera.T
        holes = validate.finite_array("aperture", aperture, shape=(None, 2))
        lens = np.insert(holes, 2, 0.0, axis=-1) @ camera.T
        # In the frame of the retro-reflector: rows times R are the columns R' x.
        turn = rotation_from_vector(self.turn)
        ways = np.repeat(light[:, None], len(lens), axis=1) @ turn
        if self.retroreflector is None:
            ways = reflected_by_cone((lens - _CONE_TIP) @ turn, ways)
        else:
            ways = ways @ self.retroreflector.T
        ways = ways @ turn.T @ reflection(self.fold)
        # The tracker's directions point to the source of the light, in its own frame.
        sources = -ways @ rotation_from_vector([self.boresight_angle, 0.0, 0.0])
        return received_spots(sources, (0.0, 0.0), 1.0, self.tracker_focal_length)
