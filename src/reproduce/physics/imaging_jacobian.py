"""How a position on the ground answers to errors of the imaging model (1): the exact derivative.

A position P = S + l u stays on the ellipsoid whatever is varied, so its motion is that of the line
of sight, dS + l du, slid along the line until it lies in the tangent plane: with the surface's
normal n,

    dP = (I - u n^T / n·u) (dS + l du).

Lengths are in metres, angles in radians; positions are Earth-fixed. Leading axes are a batch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.imaging import WGS84, Ellipsoid, imaged_position
from reproduce.physics.rotations import cross_matrix, rotations, unit
from reproduce.physics.validate import FloatArray, finite_array


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

    Examples
    --------
    >>> still = np.zeros((1, 3, 3))
    >>> GroundJacobian(np.zeros((1, 3)), still, still, still).by_turn.shape
    (1, 3, 3)
    """

    position: FloatArray
    by_satellite: FloatArray
    by_turn: FloatArray
    by_image: FloatArray

    @property
    def by_principal_point(self) -> FloatArray:
        """By (X_0, Y_0), shape (..., n, 3, 2), without unit."""
        return np.asarray(-self.by_image[..., :2])

    @property
    def by_focal_length(self) -> FloatArray:
        """By f_cam, shape (..., n, 3, 1), without unit."""
        return np.asarray(-self.by_image[..., 2:])


def ground_jacobian(
    vectors: ArrayLike,
    satellite: ArrayLike,
    earth_from_camera: ArrayLike,
    ellipsoid: Ellipsoid = WGS84,
) -> GroundJacobian:
    """Return ground positions with their derivatives by all terms of the imaging model.

    Parameters
    ----------
    vectors, satellite, earth_from_camera, ellipsoid
        As for `imaging.imaged_position`.

    Returns
    -------
    GroundJacobian
        Exact to rounding.

    Raises
    ------
    EarthMissedError, ValueError
        As for `imaging.imaged_position`.

    Examples
    --------
    Straight down from 1000 km, a turn about the camera's Y axis moves the ground by the altitude.

    >>> down = [[0, 0, -1], [0, 1, 0], [1, 0, 0]]
    >>> found = ground_jacobian([[0, 0, -0.5]], [7378137.0, 0, 0], down)
    >>> found.by_turn[0, :, 1].round(3) + 0.0
    array([      0.,       0., 1000000.])
    """
    rows = finite_array("vectors", vectors, shape=(None, 3))
    origin = finite_array("satellite", satellite, shape=(3,))
    chain = rotations("earth_from_camera", earth_from_camera)
    imaged = imaged_position(rows, origin, chain, ellipsoid)
    position = imaged.position
    sight = unit("vectors", -(rows @ np.swapaxes(chain, -1, -2)))
    lengths = np.linalg.norm(rows, axis=-1)
    reach = np.abs(imaged.scale) * lengths
    slide = _slide(position, sight, ellipsoid)
    far = slide * reach[..., np.newaxis, np.newaxis]
    matrix = chain[..., np.newaxis, :, :]
    # A turn by t moves the line by t × u, so du = -[u ×] R t for a turn about camera axes.
    by_turn = -far @ cross_matrix(sight) @ matrix
    across = np.eye(3) - sight[..., :, np.newaxis] * sight[..., np.newaxis, :]
    by_image = -far @ across @ matrix / lengths[..., np.newaxis, np.newaxis]
    return GroundJacobian(position, slide, by_turn, by_image)


def _slide(position: FloatArray, sight: FloatArray, ellipsoid: Ellipsoid) -> FloatArray:
    """Return the projection along the line of sight onto the tangent plane."""
    axes = np.array([ellipsoid.equatorial_radius] * 2 + [ellipsoid.polar_radius])
    normal = position / axes**2
    steep = np.einsum("...i,...i->...", normal, sight)[..., np.newaxis, np.newaxis]
    outer = sight[..., :, np.newaxis] * normal[..., np.newaxis, :]
    return np.asarray(np.eye(3) - outer / steep)
