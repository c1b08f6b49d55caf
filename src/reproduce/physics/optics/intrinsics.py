"""Calibrating one channel alone: focal length, principal point and distortion from known starlight.

Directions have shape (..., n, 3), in the camera frame, z along the boresight; image points have
shape (..., n, 2), in px, x before y, with the centre of the first pixel at (0, 0). Parameters are
always in the order focal length F (m), principal point x, y (px), radial distortion m (m^-2); the
leading axes are a batch of calibrations.

The model is linear in F, m F^3 and the principal point. Its least-squares minimum is therefore
found at once, without starting values, and it is the minimum over F and m too, because the one
pair follows from the other.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reproduce.physics.optics.camera import Camera, _ideal, _turned
from reproduce.physics.validate import (
    DegenerateGeometryError,
    Directions,
    FloatArray,
    Number,
    Points,
    Size,
    checked,
)

_PARAMETERS = 4


@dataclass(frozen=True, eq=False)
class CameraFit:
    """A channel's fitted imaging parameters and what they leave over.

    Attributes
    ----------
    camera : Camera
        The estimate, batch shape (...).
    residuals : ndarray, shape (..., n, 2)
        Measured minus modelled image points, in px.
    cofactor : ndarray, shape (..., 4, 4)
        Inverse normal matrix of (F, x, y, m): the covariance for errors of one px.
    """

    camera: Camera
    residuals: FloatArray
    cofactor: FloatArray

    @property
    def parameters(self) -> FloatArray:
        """The vector (F, x, y, m), shape (..., 4), in m, px, px, m^-2."""
        point = self.camera.principal_point
        columns = (self.camera.focal_length, point[..., 0], point[..., 1])
        return np.stack([*columns, self.camera.radial_distortion], axis=-1)

    @property
    def covariance(self) -> FloatArray:
        """The cofactor matrix scaled by the residuals' own variance, shape (..., 4, 4)."""
        freedom = 2 * self.residuals.shape[-2] - _PARAMETERS
        if freedom <= 0:
            raise DegenerateGeometryError(
                "covariance: expected at least three points, got two; add points, or multiply "
                "`cofactor` by a known variance"
            )
        variance = np.square(self.residuals).sum(axis=(-2, -1)) / freedom
        return variance[..., None, None] * self.cofactor


@checked
def fit_camera(
    directions: Directions, points: Points, pixel_pitch: Size, rotation: Number = 0.0
) -> CameraFit:
    """The imaging parameters of one channel by least squares on its imaging model, (2) with (3).

    Parameters
    ----------
    directions : array_like, shape (..., n, 3)
        Known starlight, in the frame of the reference channel.
    points : array_like, shape (..., n, 2)
        Where the channel images it, in px.
    pixel_pitch : float, in metres
    rotation : array_like, shape (...)
        Angle of the detector against the reference, in radians; zero for the reference itself.

    Returns
    -------
    CameraFit

    Raises
    ------
    ValueError
        If the counts differ, a direction does not point in front of the camera, or the points
        leave the focal length zero or negative (a mirrored axis does).
    DegenerateGeometryError
        If the directions do not fix all four parameters: the same slope throughout.

    Examples
    --------
    >>> slopes = [[0, 0, 1], [0.1, 0, 1], [0, 0.2, 1]]
    >>> fit = fit_camera(slopes, [[50, 60], [250, 60], [50, 460]], 1e-5)
    >>> float(fit.camera.focal_length.round(9)), fit.camera.principal_point.round(9)
    (0.02, array([50., 60.]))
    """
    slopes = _turned(_ideal(directions, np.ones(())), rotation)
    squared = np.square(slopes).sum(axis=-1, keepdims=True)
    columns = np.stack([slopes, slopes * squared], axis=-1) / pixel_pitch
    # About the means, so that the principal point need not be solved for with the others.
    centred = columns - columns.mean(axis=-3, keepdims=True)
    observed = points - points.mean(axis=-2, keepdims=True)
    normal = np.einsum("...nij,...nik->...jk", centred, centred)
    pull = np.einsum("...nij,...ni->...j", centred, observed)
    linear = np.einsum("...jk,...k->...j", _inverse(normal), pull)
    modelled = np.einsum("...nij,...j->...ni", columns, linear)
    origin = (points - modelled).mean(axis=-2)
    if (linear[..., 0] <= 0).any():
        raise ValueError(
            "points: expected an image that grows with the slope of the starlight, got a focal "
            "length of zero or less; check the signs of the axes"
        )
    camera = Camera(linear[..., 0], origin, linear[..., 1] / linear[..., 0] ** 3, pixel_pitch)
    residuals = points - modelled - origin[..., None, :]
    return CameraFit(camera, residuals, _cofactor(camera, columns, normal))


def _inverse(normal: FloatArray) -> FloatArray:
    a, b, d = normal[..., 0, 0], normal[..., 0, 1], normal[..., 1, 1]
    determinant = a * d - b**2
    if not ((a > 0) & (determinant > 1e-12 * a * d)).all():
        raise DegenerateGeometryError(
            "directions: expected slopes that fix focal length and distortion, got the same slope "
            "throughout or two points alone; turn the table to angles near and far from zero"
        )
    rows = [np.stack([d, -b], axis=-1), np.stack([-b, a], axis=-1)]
    return np.stack(rows, axis=-2) / determinant[..., None, None]


def _cofactor(camera: Camera, columns: FloatArray, normal: FloatArray) -> FloatArray:
    """Return the inverse normal matrix by F, x, y, m, from that by the linear parameters."""
    focal, count = camera.focal_length, columns.shape[-3]
    inner = _inverse(normal)
    mean = columns.mean(axis=-3)
    batch = np.broadcast_shapes(inner.shape[:-2], focal.shape)
    linear = np.zeros((*batch, _PARAMETERS, _PARAMETERS))
    linear[..., :2, :2] = inner
    linear[..., 2:, :2] = -mean @ inner
    linear[..., :2, 2:] = linear[..., 2:, :2].mT
    linear[..., 2:, 2:] = np.eye(2) / count + mean @ inner @ mean.mT
    # Rows: F, x, y, m; columns: F, m F^3, x, y.
    change = np.zeros_like(linear)
    change[..., 0, 0] = change[..., 1, 2] = change[..., 2, 3] = 1
    change[..., 3, 0] = -3 * camera.radial_distortion / focal
    change[..., 3, 1] = 1 / focal**3
    return change @ linear @ change.mT
