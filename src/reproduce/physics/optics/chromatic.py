"""How one channel's image differs from the reference channel's, and the paper's approximations.

Positions and displacements have shape (..., n, 2), x before y; image points are in px with the
centre of the first pixel at (0, 0). The reference channel is the green one, the other is named by
its role here. Each approximation is a function of its own, so that its error is the difference of
two calls: `distortion_ratio` (7) against `distortion_ratio_equal_coefficients` (8) against
`distortion_ratio_linear` (9).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.optics.camera import per_point
from reproduce.physics.validate import FloatArray, common_batch, finite_array, positive


def scale_factor(reference_focal_length: ArrayLike, focal_length: ArrayLike) -> FloatArray:
    """The scale factor k that lays a channel over the reference: the ratio of focal lengths.

    Parameters
    ----------
    reference_focal_length, focal_length : array_like
        Of the reference channel and of the other, in the same unit.

    Returns
    -------
    ndarray
        k = reference / other, without unit; the definition that precedes (6).

    Raises
    ------
    ValueError
        If a focal length is not finite and above zero.

    Examples
    --------
    >>> float(scale_factor(30e-3, 20e-3))
    1.5
    """
    reference_focal_length = positive("reference_focal_length", reference_focal_length)
    focal_length = positive("focal_length", focal_length)
    common_batch(
        reference_focal_length=reference_focal_length.shape, focal_length=focal_length.shape
    )
    return np.asarray(reference_focal_length / focal_length)


def reference_ideal_positions(ideal: ArrayLike, scale: ArrayLike) -> FloatArray:
    """Ideal positions in the reference channel, from those of the other.

    Implements: niu2024 (6).

    Parameters
    ----------
    ideal : array_like, shape (..., n, 2)
        From the principal point, in any unit of length.
    scale : array_like, shape (...)
        Scale factor k.

    Returns
    -------
    ndarray, shape (..., n, 2)
        In the same unit.

    Raises
    ------
    ValueError
        If an argument is not finite, has the wrong shape, or `scale` is not above zero.

    Examples
    --------
    >>> reference_ideal_positions([[2, 4]], 1.5)
    array([[3., 6.]])
    """
    ideal = finite_array("ideal", ideal, shape=(None, 2))
    scale = positive("scale", scale)
    common_batch(ideal=ideal.shape[:-2], scale=scale.shape)
    return per_point(scale) * ideal


def distortion_ratio(
    scale: ArrayLike, reference_distortion: ArrayLike, distortion: ArrayLike
) -> FloatArray:
    """Displacement by distortion in the reference channel over that in the other.

    Implements: niu2024 (7).

    Parameters
    ----------
    scale : array_like
        Scale factor k.
    reference_distortion, distortion : array_like
        First radial coefficients of the reference channel and of the other, in the same unit.

    Returns
    -------
    ndarray
        k^3 * reference_distortion / distortion, the same in x and y.

    Raises
    ------
    ValueError
        If an argument is not finite, `scale` is not above zero, or `distortion` is zero.

    Examples
    --------
    >>> float(distortion_ratio(2.0, 3.0, 4.0))
    6.0
    """
    cube = distortion_ratio_equal_coefficients(scale)
    reference_distortion = finite_array("reference_distortion", reference_distortion)
    distortion = finite_array("distortion", distortion)
    if (distortion == 0).any():
        raise ValueError(
            "distortion: expected a coefficient other than zero, got zero; "
            "a channel without distortion has no ratio"
        )
    common_batch(
        scale=cube.shape,
        reference_distortion=reference_distortion.shape,
        distortion=distortion.shape,
    )
    return np.asarray(cube * (reference_distortion / distortion))


def distortion_ratio_equal_coefficients(scale: ArrayLike) -> FloatArray:
    """The ratio (7) under the approximation that all channels share one distortion coefficient.

    Implements: niu2024 (8).

    Parameters
    ----------
    scale : array_like
        Scale factor k.

    Returns
    -------
    ndarray
        k^3.

    Raises
    ------
    ValueError
        If `scale` is not finite and above zero.

    Examples
    --------
    >>> float(distortion_ratio_equal_coefficients(2.0))
    8.0
    """
    return np.asarray(positive("scale", scale) ** 3)


def distortion_ratio_linear(scale: ArrayLike) -> FloatArray:
    """The ratio (7) under equal coefficients and the further approximation k^3 = k.

    Implements: niu2024 (9).

    Parameters
    ----------
    scale : array_like
        Scale factor k.

    Returns
    -------
    ndarray
        k. Near k = 1 its relative error is 2 (1 - k).

    Raises
    ------
    ValueError
        If `scale` is not finite and above zero.

    Examples
    --------
    >>> float(distortion_ratio_linear(2.0))
    2.0
    """
    return positive("scale", scale)


def reference_points_from_ideal(
    ideal: ArrayLike, displacements: ArrayLike, scale: ArrayLike, principal_point: ArrayLike
) -> FloatArray:
    """Image points of the reference channel, from ideal positions and distortion of the other.

    Implements: niu2024 (10).

    Parameters
    ----------
    ideal, displacements : array_like, shape (..., n, 2)
        Ideal positions and displacements by distortion of the other channel, both in px.
    scale : array_like, shape (...)
        Scale factor k; the displacements are scaled by k too, which is approximation (9).
    principal_point : array_like, shape (..., 2)
        Shared by both channels here, in px.

    Returns
    -------
    ndarray, shape (..., n, 2)
        In px.

    Raises
    ------
    ValueError
        If an argument is not finite, has the wrong shape, or `scale` is not above zero.

    Examples
    --------
    >>> reference_points_from_ideal([[10, 0]], [[1, 0]], 2.0, (5, 5))
    array([[27.,  5.]])
    """
    displacements = finite_array("displacements", displacements, shape=(None, 2))
    ideal = finite_array("ideal", ideal, shape=(None, 2))
    common_batch(ideal=ideal.shape[:-1], displacements=displacements.shape[:-1])
    scaled = reference_ideal_positions(ideal + displacements, scale)
    return scaled + _pivot(principal_point, scaled)


def offsets_from_principal_point(points: ArrayLike, principal_point: ArrayLike) -> FloatArray:
    """Ideal position and distortion together: what an image point holds beyond its origin.

    Implements: niu2024 (11).

    Parameters
    ----------
    points : array_like, shape (..., n, 2)
        Image points, in px.
    principal_point : array_like, shape (..., 2)
        In px.

    Returns
    -------
    ndarray, shape (..., n, 2)
        In px.

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape.

    Examples
    --------
    >>> offsets_from_principal_point([[7, 9]], (5, 5))
    array([[2., 4.]])
    """
    points = finite_array("points", points, shape=(None, 2))
    return points - _pivot(principal_point, points)


def reference_points_scaled(
    points: ArrayLike, scale: ArrayLike, principal_point: ArrayLike
) -> FloatArray:
    """Image points of the reference channel where only focal length and distortion differ.

    Implements: niu2024 (12).

    Parameters
    ----------
    points : array_like, shape (..., n, 2)
        Image points of the other channel, in px.
    scale : array_like, shape (...)
        Scale factor k.
    principal_point : array_like, shape (..., 2)
        Shared by both channels here, in px.

    Returns
    -------
    ndarray, shape (..., n, 2)
        In px: k * points - k * principal_point + principal_point.

    Raises
    ------
    ValueError
        If an argument is not finite, has the wrong shape, or `scale` is not above zero.

    Examples
    --------
    >>> reference_points_scaled([[7, 9]], 2.0, (5, 5))
    array([[ 9., 13.]])
    """
    offsets = offsets_from_principal_point(points, principal_point)
    return reference_ideal_positions(offsets, scale) + _pivot(principal_point, offsets)


def _pivot(principal_point: ArrayLike, points: FloatArray) -> FloatArray:
    principal_point = finite_array("principal_point", principal_point, shape=(2,))
    common_batch(points=points.shape[:-2], principal_point=principal_point.shape[:-1])
    return principal_point[..., None, :]
