"""Light over mirrors: retro-reflectors, fold mirrors, and the path from the lasers to the tracker.

Directions point where the light goes and have shape (..., 3); mirrors are given by their normals.
A train of plane mirrors acts on directions as one matrix, the product of its reflections, however
far apart the mirrors stand; only a curved mirror, such as a cone, asks where a ray hits. Small
turns are right-handed rotation vectors; lengths are in metres, angles in radians.

One frame for all: the origin in the middle of the camera's lens, Z along its boresight out of the
camera. Lasers sit behind the lens, at -Z; the retro-reflector hangs in front of it, to one side, so
that the light comes back beside the camera, where the dichroic mirror folds it into the tracker.
Both lenses are ideal: a point of the focal plane is a direction outside. The tracker's boresight
lies in the plane of Y and Z.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.attitude import (
    emitted_directions,
    received_spots,
    rotation_from_vector,
    unit,
)
from reproduce.physics.attitude.rotations import _cross_matrix, _unit
from reproduce.physics.validate import Direction, Directions, FloatArray, Number

_Train = Annotated[Any, (3, 3)]
# Three mutually perpendicular mirrors evenly around Z, and two with their edge along Y.
CORNER = np.array(
    [[2.0, 0.0, 2**0.5], [-1.0, 3**0.5, 2**0.5], [-1.0, -(3**0.5), 2**0.5]]
)
ROOF = np.array([[1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]])
_STILL = (0.0, 0.0, 0.0)
# Planes nearer than this are those just left.
_NOWHERE = 1e-12
# Where the retro-reflector stands, and where the axis of the returned light meets the dichroic
# mirror: a metre in front of the camera and half a metre aside, more than the width of the beam.
_POINT, _FOLD = np.array([0.5, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
# The cone is the surface x^2 + y^2 - z^2 = 0.
_FORM = np.array([1.0, 1.0, -1.0])


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
    across = _unit("normal", normal)
    return np.eye(3) - 2.0 * across[..., :, np.newaxis] * across[..., np.newaxis, :]


@validate.checked
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
        result = validate.kernel(reflection)(normals[..., index, :]) @ result
    return result


@validate.checked
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


@validate.checked
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


@dataclass(frozen=True, eq=False)
class Mirrors:
    """Plane mirrors that meet in one point, each met once: one mirror, two at an edge, a corner.

    Attributes
    ----------
    point : ndarray, shape (3,)
        Where they meet, in metres.
    normals : ndarray, shape (n, 3), of the mirrors, of any length
    turn : array_like, shape (3,)
        Rotation vector by which all have turned about that point.
    """

    point: FloatArray
    normals: FloatArray
    turn: ArrayLike = _STILL

    def send(
        self, places: FloatArray, ways: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return places and directions, (..., 3), of rays as they leave the last mirror.

        Places and ways are those of the rays that come in; one that misses a mirror raises a
        DegenerateGeometryError.
        """
        normals = unit("normals", self.normals) @ rotation_from_vector(self.turn).T
        left = np.ones((*ways.shape[:-1], len(normals)), dtype=bool)
        for _ in normals:
            with np.errstate(divide="ignore", invalid="ignore"):
                ahead = ((self.point - places) @ normals.T) / (ways @ normals.T)
            # Each mirror is met once; of those that are left the nearest comes first.
            ahead = np.where(left & (ahead > _NOWHERE), ahead, np.inf)
            first = ahead.argmin(axis=-1)
            length = np.take_along_axis(ahead, first[..., np.newaxis], axis=-1)
            _refuse_misses(length)
            np.put_along_axis(left, first[..., np.newaxis], False, axis=-1)
            places, normal = places + length * ways, normals[first]
            across = np.einsum("...i,...i->...", ways, normal)[..., np.newaxis]
            ways = ways - 2.0 * across * normal
        return places, ways


@dataclass(frozen=True, eq=False)
class Cone:
    """A hollow right-angled conical mirror that looks towards -Z.

    A ray meets it twice. In a plane through the axis it acts as two mirrors at a right angle; light
    off that plane it turns back to first order only.

    Attributes
    ----------
    point : ndarray, shape (3,)
        Its tip, in metres.
    turn : array_like, shape (3,)
        Rotation vector by which it has turned about its tip.
    """

    point: FloatArray
    turn: ArrayLike = _STILL

    def send(
        self, places: FloatArray, ways: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return places and directions of rays as they leave the cone; as `Mirrors.send`."""
        rotation = rotation_from_vector(self.turn)
        # Work in the cone's own frame; rows times R are the columns R' x.
        places, ways = (places - self.point) @ rotation, ways @ rotation
        for _ in range(2):
            places = places + _to_cone(places, ways)[..., np.newaxis] * ways
            normal = _unit("normal", places * _FORM)
            ways = (
                ways
                - 2.0
                * np.einsum("...i,...i->...", ways, normal)[..., np.newaxis]
                * normal
            )
        return self.point + places @ rotation.T, ways @ rotation.T


def _to_cone(places: FloatArray, ways: FloatArray) -> FloatArray:
    """Return the distance to where rays next meet the cone, the starting point left out."""
    square, mixed, rest = (
        np.einsum("...i,i,...i->...", one, _FORM, other)
        for one, other in ((ways, ways), (places, ways), (places, places))
    )
    root = np.sqrt(np.maximum(mixed**2 - square * rest, 0.0))
    ends = np.stack([-mixed - root, -mixed + root]) / square
    ahead = ends > 1e-9 * (1.0 + np.abs(places).max())
    met = ahead & (places[..., 2] + ends * ways[..., 2] < 0)
    found = np.where(met, ends, np.inf).min(axis=0)
    _refuse_misses(found)
    return found


def _refuse_misses(lengths: FloatArray) -> None:
    if not np.isfinite(lengths).all():
        raise validate.DegenerateGeometryError(
            "rays: expected each to meet every mirror, a cone twice, got one that misses; move the "
            "mirrors into the beam, the tip of a cone beside it"
        )


# What may stand in front of the camera; rows of the plane ones, turned over, look at it.
RETROREFLECTORS: dict[str, Mirrors | Cone] = {
    "corner cube": Mirrors(_POINT, CORNER * _FORM),
    "two mirrors at a right angle": Mirrors(_POINT, ROOF * _FORM),
    "conical mirror": Cone(_POINT),
}


@dataclass(frozen=True, eq=False)
class LightPath:
    """Camera, retro-reflector, dichroic mirror and tracker.

    Attributes
    ----------
    camera_focal_length, tracker_focal_length : float, in metres
    boresight_angle : float
        Between the two boresights, both outwards, in radians.
    retroreflector : Mirrors or Cone
        In front of the camera, from `RETROREFLECTORS`.
    camera_turn : array_like, shape (3,)
        Rotation vector by which the camera, lasers and lens, has turned about its lens.

    Examples
    --------
    A laser at the centre makes a spot at the centre, whatever part of the lens it lights.

    >>> path = LightPath(2.0, 0.06, np.radians(120), RETROREFLECTORS["corner cube"])
    >>> bool(np.abs(path.spots([[0.0, 0.0]], [[0.0, 0.02], [0.1, 0.05]])).max() < 1e-15)
    True
    """

    camera_focal_length: float
    tracker_focal_length: float
    boresight_angle: float
    retroreflector: Mirrors | Cone
    camera_turn: ArrayLike = _STILL

    @property
    def fold(self) -> Mirrors:
        """The dichroic mirror, at the tilt that folds the returned light onto the boresight."""
        tilt = float(fold_mirror_tilt(self.boresight_angle))
        # Its normal stands between where the light comes from and where it goes to.
        normal = rotation_from_vector([self.boresight_angle - np.pi + tilt, 0.0, 0.0])[
            :, 2
        ]
        return Mirrors(_FOLD, normal[np.newaxis])

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

        Raises
        ------
        DegenerateGeometryError
            If a ray misses a mirror.
        """
        camera = rotation_from_vector(self.camera_turn)
        light = emitted_directions(lasers, self.camera_focal_length) @ camera.T
        holes = validate.finite_array("aperture", aperture, shape=(None, 2))
        lens = np.column_stack([holes, np.zeros(len(holes))]) @ camera.T
        shape = (len(light), len(lens), 3)
        places = np.broadcast_to(lens, shape)
        ways = np.broadcast_to(light[:, np.newaxis], shape)
        _, ways = self.fold.send(*self.retroreflector.send(places, ways))
        # The tracker counts directions to where the light comes from, in its own frame.
        sources = -ways @ rotation_from_vector([self.boresight_angle, 0.0, 0.0])
        return received_spots(sources, (0.0, 0.0), 1.0, self.tracker_focal_length)
