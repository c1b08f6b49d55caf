"""The light of the lasers, traced from the camera's focal plane to the tracker's detector.

One frame for all: the origin in the middle of the camera's lens, Z along its boresight out of the
camera. Lasers sit behind the lens, at -Z; the retro-reflector hangs in front of it, to one side, so
that the light comes back beside the camera, where the dichroic mirror folds it into the tracker.
Both lenses are ideal: a point of the focal plane is a direction outside. The tracker's boresight
lies in the plane of Y and Z. Lengths are in metres, angles in radians.

Rays have places of shape (..., 3) and directions, unit vectors, of the same shape.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.attitude import emitted_directions, rotation_from_vector, unit
from reproduce.physics.attitude.lasers import _spots
from reproduce.physics.light.raytrace import CORNER, ROOF, cone_path, fold_mirror_tilt
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    finite_array,
)

STILL = (0.0, 0.0, 0.0)
# Planes nearer than this are those just left.
_NOWHERE = 1e-12


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
    turn: ArrayLike = STILL

    def send(self, places: FloatArray, ways: FloatArray) -> tuple[FloatArray, FloatArray]:
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
            if not np.isfinite(length).all():
                raise DegenerateGeometryError(
                    "rays: expected each to meet every mirror, got one that misses; move the "
                    "mirrors into the beam"
                )
            np.put_along_axis(left, first[..., np.newaxis], False, axis=-1)
            places, normal = places + length * ways, normals[first]
            across = np.einsum("...i,...i->...", ways, normal)[..., np.newaxis]
            ways = ways - 2.0 * across * normal
        return places, ways


@dataclass(frozen=True, eq=False)
class Cone:
    """A hollow right-angled conical mirror that looks towards -Z.

    Attributes
    ----------
    point : ndarray, shape (3,)
        Its tip, in metres.
    turn : array_like, shape (3,)
        Rotation vector by which it has turned about its tip.
    """

    point: FloatArray
    turn: ArrayLike = STILL

    def send(self, places: FloatArray, ways: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return places and directions of rays as they leave the cone; as `Mirrors.send`."""
        # The cone of `cone_path` opens towards +Z: half a turn about X turns it over.
        over = np.array([1.0, -1.0, -1.0])
        turn = np.asarray(self.turn, dtype=np.float64) * over
        found, gone = cone_path((places - self.point) * over, ways * over, turn)
        return found * over + self.point, gone * over


RETROREFLECTORS = {"corner cube": CORNER, "two mirrors at a right angle": ROOF}


@dataclass(frozen=True, eq=False)
class LightPath:
    """Camera, retro-reflector, dichroic mirror and tracker.

    Attributes
    ----------
    camera_focal_length, tracker_focal_length : float, in metres
    boresight_angle : float
        Between the two boresights, both outwards, in radians.
    retroreflector : Mirrors or Cone
        In front of the camera.
    fold_point : ndarray, shape (3,)
        Where the axis of the returned light meets the dichroic mirror.
    fold_turn : array_like, shape (3,)
        Rotation vector by which the dichroic mirror has turned about that point.
    camera_turn : array_like, shape (3,)
        Rotation vector by which the camera, lasers and lens, has turned about its lens.
    """

    camera_focal_length: float
    tracker_focal_length: float
    boresight_angle: float
    retroreflector: Mirrors | Cone
    fold_point: FloatArray
    fold_turn: ArrayLike = STILL
    camera_turn: ArrayLike = STILL
    tracker_axes: FloatArray = field(init=False)

    def __post_init__(self) -> None:
        axes = rotation_from_vector([self.boresight_angle, 0.0, 0.0]).T
        object.__setattr__(self, "tracker_axes", axes)

    @property
    def fold(self) -> Mirrors:
        """The dichroic mirror, at the tilt that folds the returned light onto the boresight."""
        tilt = float(fold_mirror_tilt(self.boresight_angle))
        # Its normal stands between where the light comes from and where it goes to.
        normal = rotation_from_vector([self.boresight_angle - np.pi + tilt, 0.0, 0.0])[:, 2]
        return Mirrors(self.fold_point, normal[np.newaxis], self.fold_turn)

    def arriving(self, lasers: ArrayLike, aperture: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return the light on the dichroic mirror, on its way to the tracker.

        Parameters
        ----------
        lasers : array_like, shape (n, 2)
            Points on the camera's focal plane, in metres.
        aperture : array_like, shape (rays, 2)
            Points of the camera's lens that each laser lights, in metres.

        Returns
        -------
        places, ways : ndarray, shape (n, rays, 3), in the frame of the camera at rest

        Raises
        ------
        DegenerateGeometryError
            If a ray misses a mirror.
        """
        camera = rotation_from_vector(self.camera_turn)
        light = emitted_directions(lasers, self.camera_focal_length) @ camera.T
        holes = finite_array("aperture", aperture, shape=(None, 2))
        lens = np.column_stack([holes, np.zeros(len(holes))]) @ camera.T
        shape = (len(light), len(lens), 3)
        places = np.broadcast_to(lens, shape)
        ways = np.broadcast_to(light[:, np.newaxis], shape)
        return self.fold.send(*self.retroreflector.send(places, ways))

    def spots(self, lasers: ArrayLike, aperture: ArrayLike) -> FloatArray:
        """Return where the rays of each laser meet the tracker's detector.

        Arguments and errors are those of `arriving`.

        Returns
        -------
        ndarray, shape (n, rays, 2), in metres from the principal point
        """
        _, ways = self.arriving(lasers, aperture)
        # The tracker counts directions to where the light comes from.
        sources = -ways @ self.tracker_axes.T
        return _spots(sources, np.zeros(2), np.asarray(self.tracker_focal_length))


def light_path(
    kind: str,
    camera_focal_length: float,
    tracker_focal_length: float,
    boresight_angle: float,
    distance: float = 1.0,
    aside: float = 0.5,
) -> LightPath:
    """Return a light path at rest, with a retro-reflector of one kind.

    Parameters
    ----------
    kind : str
        A key of `RETROREFLECTORS`, or ``conical mirror``.
    camera_focal_length, tracker_focal_length, boresight_angle : float
        As of `LightPath`, in metres and radians.
    distance : float
        Of the retro-reflector in front of the camera's lens, in metres.
    aside : float
        Half the distance along X between the light that goes and the light that comes back, in
        metres; wider than the beam.

    Returns
    -------
    LightPath

    Examples
    --------
    A laser at the centre makes a spot at the centre, whatever part of the lens it lights.

    >>> path = light_path("corner cube", 2.0, 0.06, np.radians(120))
    >>> bool(np.abs(path.spots([[0.0, 0.0]], [[0.0, 0.02], [0.1, 0.05]])).max() < 1e-15)
    True
    """
    point = np.array([aside, 0.0, distance])
    retro: Mirrors | Cone
    if kind == "conical mirror":
        retro = Cone(point)
    elif kind in RETROREFLECTORS:
        # Rows look towards +Z; turned over they look at the camera.
        retro = Mirrors(point, RETROREFLECTORS[kind] * np.array([1.0, 1.0, -1.0]))
    else:
        kinds = (*RETROREFLECTORS, "conical mirror")
        raise ValueError(f"kind: expected one of {kinds}, got {kind!r}; choose one")
    fold_point = np.array([2.0 * aside, 0.0, 0.0])
    return LightPath(camera_focal_length, tracker_focal_length, boresight_angle, retro, fold_point)
