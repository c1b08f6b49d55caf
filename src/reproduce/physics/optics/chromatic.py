"""How one channel's image differs from the reference channel's, and the paper's approximations.

Positions and displacements have shape (..., n, 2), x before y; image points are in px with the
centre of the first pixel at (0, 0). The reference channel is the green one, the other is named by
its role here. Each approximation is a function of its own, so that its error is the difference of
two calls: `distortion_ratio` (7) against `distortion_ratio_equal_coefficients` (8) against
`distortion_ratio_linear` (9).
"""

from __future__ import annotations

import numpy as np

from reproduce.physics.validate import FloatArray, Number, Point, Points, Positive, checked


@checked
def scale_factor(reference_focal_length: Positive, focal_length: Positive) -> FloatArray:
    """The scale factor k that lays a channel over the reference: the definition before (6).

    Parameters
    ----------
    reference_focal_length, focal_length : array_like
        Of the reference channel and of the other, in the same unit.

    Returns
    -------
    ndarray
        k = reference / other, without unit.

    Examples
    --------
    >>> float(scale_factor(30e-3, 20e-3))
    1.5
    """
    return np.asarray(reference_focal_length / focal_length)


@checked
def reference_ideal_positions(ideal: Points, scale: Positive) -> FloatArray:
    """Ideal positions in the reference channel, from those of the other.

    Implements: niu2024 (6).

    Parameters
    ----------
    ideal : array_like, shape (..., n, 2), from the principal point, in any unit of length
    scale : array_like, shape (...)
        Scale factor k, above zero.

    Returns
    -------
    ndarray, shape (..., n, 2), in the same unit

    Examples
    --------
    >>> reference_ideal_positions([[2, 4]], 1.5)
    array([[3., 6.]])
    """
    return scale[..., None, None] * ideal


@checked
def distortion_ratio(
    scale: Positive, reference_distortion: Number, distortion: Number
) -> FloatArray:
    """Displacement by distortion in the reference channel over that in the other.

    Implements: niu2024 (7).

    Parameters
    ----------
    scale : array_like
        Scale factor k, above zero.
    reference_distortion, distortion : array_like
        First radial coefficients of the reference channel and of the other, in the same unit; the
        other one not zero.

    Returns
    -------
    ndarray
        k^3 * reference_distortion / distortion, the same in x and y.

    Examples
    --------
    >>> float(distortion_ratio(2.0, 3.0, 4.0))
    6.0
    """
    if (distortion == 0).any():
        raise ValueError(
            "distortion: expected a coefficient other than zero, got zero; "
            "a channel without distortion has no ratio"
        )
    return np.asarray(scale**3 * (reference_distortion / distortion))


@checked
def distortion_ratio_equal_coefficients(scale: Positive) -> FloatArray:
    """The ratio (7) if all channels share one distortion coefficient: k^3.

    Implements: niu2024 (8).

    Parameters
    ----------
    scale : array_like
        Scale factor k, above zero.

    Returns
    -------
    ndarray

    Examples
    --------
    >>> float(distortion_ratio_equal_coefficients(2.0))
    8.0
    """
    return np.asarray(scale**3)


@checked
def distortion_ratio_linear(scale: Positive) -> FloatArray:
    """The ratio (7) under equal coefficients and the further approximation k^3 = k.

    Implements: niu2024 (9).

    Near k = 1 its relative error is 2 (1 - k). Arguments are those of
    `distortion_ratio_equal_coefficients`.

    Returns
    -------
    ndarray

    Examples
    --------
    >>> float(distortion_ratio_linear(2.0))
    2.0
    """
    return np.asarray(scale)


@checked
def reference_points_from_ideal(
    ideal: Points, displacements: Points, scale: Positive, principal_point: Point
) -> FloatArray:
    """Image points of the reference channel, from ideal positions and distortion of the other.

    Implements: niu2024 (10).

    Scale and principal point are those of `reference_points_scaled`; the displacements are scaled
    by k too, which is approximation (9).

    Parameters
    ----------
    ideal, displacements : array_like, shape (..., n, 2)
        Ideal positions and displacements by distortion of the other channel, both in px.

    Returns
    -------
    ndarray, shape (..., n, 2), in px

    Examples
    --------
    >>> reference_points_from_ideal([[10, 0]], [[1, 0]], 2.0, (5, 5))
    array([[27.,  5.]])
    """
    return scale[..., None, None] * (ideal + displacements) + principal_point[..., None, :]


@checked
def offsets_from_principal_point(points: Points, principal_point: Point) -> FloatArray:
    """Ideal position and distortion together: what an image point holds beyond its origin.

    Implements: niu2024 (11).

    Parameters
    ----------
    points : array_like, shape (..., n, 2), in px
    principal_point : array_like, shape (..., 2), in px

    Returns
    -------
    ndarray, shape (..., n, 2), in px

    Examples
    --------
    >>> offsets_from_principal_point([[7, 9]], (5, 5))
    array([[2., 4.]])
    """
    return points - principal_point[..., None, :]


@checked
def reference_points_scaled(points: Points, scale: Positive, principal_point: Point) -> FloatArray:
    """Image points of the reference channel where only focal length and distortion differ.

    Implements: niu2024 (12).

    Parameters
    ----------
    points : array_like, shape (..., n, 2)
        Image points of the other channel, in px.
    scale : array_like, shape (...)
        Scale factor k, above zero.
    principal_point : array_like, shape (..., 2)
        Shared by both channels here, in px.

    Returns
    -------
    ndarray, shape (..., n, 2)
        In px: k * points - k * principal_point + principal_point.

    Examples
    --------
    >>> reference_points_scaled([[7, 9]], 2.0, (5, 5))
    array([[ 9., 13.]])
    """
    principal_point = principal_point[..., None, :]
    return scale[..., None, None] * (points - principal_point) + principal_point
