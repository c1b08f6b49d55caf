"""What the error of a centroid should be: closed forms for the centre of gravity, and the bound.

Positions are in px, x before y, the centre of the first pixel at (0, 0); light is in electrons;
the radius of a spot is the standard deviation of its Gaussian, in px. Leading axes are a batch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reproduce.physics.images.centroids import _centre_of_gravity
from reproduce.physics.images.spots import _gradient, _windows
from reproduce.physics.validate import (
    FloatArray,
    NonNegative,
    Number,
    Point,
    Positive,
    checked,
    kernel,
    whole_number,
)


@checked
def s_curve_bias(phase: Number, radius: Positive, terms: int = 20) -> FloatArray:
    """Return the error of the centre of gravity that comes from pixels alone.

    The centre of gravity of an endless row of pixels is the mean of the light's positions, each
    rounded to its pixel. What rounding takes away is a saw-tooth; a Gaussian damps its harmonics.

    Parameters
    ----------
    phase, radius : array_like, in px
        Position relative to the centre of a pixel, and standard deviation of the spot.
    terms : int
        Harmonics of the series.

    Returns
    -------
    ndarray
        Found less true position, in px.

    Examples
    --------
    A spot that is wide against a pixel has none; a narrow one is drawn to the pixel's centre.

    >>> s_curve_bias(0.25, [2.0, 0.2]).round(3)
    array([-0.   , -0.144])
    """
    order = np.arange(1, whole_number("terms", terms) + 1)
    damping = np.exp(-2.0 * (np.pi * order * radius[..., np.newaxis]) ** 2)
    waves = np.sin(2.0 * np.pi * order * phase[..., np.newaxis])
    return np.asarray(((-1.0) ** order / (np.pi * order) * damping * waves).sum(axis=-1))


@dataclass(frozen=True, eq=False)
class CentroidError:
    """The error of a centroid along x and y.

    Attributes
    ----------
    bias : ndarray, shape (..., 2)
        Expected less true position, in px.
    variance : ndarray, shape (..., 2)
        Of the scatter about the expected position, in px squared.
    slope : ndarray, shape (..., 2)
        How far the expected position moves for one px of the true one; 1 without bias.
    """

    bias: FloatArray
    variance: FloatArray
    slope: FloatArray

    @property
    def mean_square(self) -> FloatArray:
        """Bias squared plus variance, in px squared."""
        return self.bias**2 + self.variance


@checked
def centre_of_gravity_error(
    positions: Point,
    light: NonNegative,
    radius: Positive,
    corners: Point,
    size: int,
    read_noise: NonNegative = 0.0,
) -> CentroidError:
    """Return what the centre of gravity in a fixed window errs by: bias and variance.

    The bias holds the S-curve, what the window cuts off, and the push of read noise away
    from the window's middle. The variance is photon noise plus read noise, to first order.

    Parameters
    ----------
    positions : array_like, shape (..., 2)
        True centres of the spots, in px.
    light : array_like, shape (...), of a whole spot, in electrons
    radius : array_like, shape (...), in px
    corners : array_like, shape (..., 2)
        First pixel of each window.
    size : int
        Width and height of the window, in px.
    read_noise : array_like, shape (...)
        Noise of a pixel without light, in electrons.

    Returns
    -------
    CentroidError

    Raises
    ------
    DegenerateGeometryError
        If a window holds no light.

    Examples
    --------
    All light in a wide window, no pixel too coarse: photon noise is the radius over the root of
    the number of electrons, and a twelfth of a pixel squared is added for the pixel's width.

    >>> error = centre_of_gravity_error([0.0, 0.0], 1e4, 1.0, [-8, -8], 17)
    >>> (error.variance * 1e4).round(4)
    array([1.0833, 1.0833])
    """
    windows = _windows(positions, light, radius, corners, size)
    centre = _centre_of_gravity(windows) + corners
    total = windows.sum(axis=(-2, -1))[..., np.newaxis]
    # Offsets of columns and rows from the centre of gravity, x before y.
    offsets = np.arange(size) - (centre - corners)[..., np.newaxis]
    sums = np.stack([windows.sum(axis=-2), windows.sum(axis=-1)], axis=-2)
    read = read_noise[..., np.newaxis] ** 2
    variance = ((offsets**2 * sums).sum(-1) + read * size * (offsets**2).sum(-1)) / total**2
    # The denominator's own noise, which is correlated with the numerator's: second order.
    push = -read * size * offsets.sum(axis=-1) / total**2
    _, slopes = _gradient(*_state(positions, light, radius, corners), size, size)
    # How the sums of columns and rows change with x and y.
    moved = np.stack([slopes[..., 0, :, :].sum(-2), slopes[..., 1, :, :].sum(-1)], axis=-2)
    slope = (offsets * moved).sum(axis=-1) / total
    return CentroidError(centre + push - positions, variance, slope)


_error = kernel(centre_of_gravity_error)


@checked
def cramer_rao_variance(
    positions: Point,
    light: Positive,
    radius: Positive,
    corners: Point,
    size: int,
    read_noise: NonNegative = 0.0,
) -> FloatArray:
    """Return the least variance that an unbiased centroid can have in a window.

    Under photon noise and Gaussian read noise, with the light of the spot unknown too. The
    information of a pixel is taken as that of a normal variable with the pixel's variance, which
    is exact for photon noise alone.

    Arguments are those of `centre_of_gravity_error`, the light above zero.

    Returns
    -------
    ndarray, shape (..., 2)
        Along x and y, in px squared. A biased estimator is bounded by this times the square of
        its slope (`CentroidError.slope`).

    Examples
    --------
    Many pixels across the spot and no read noise: the radius over the root of the light.

    >>> (cramer_rao_variance([0, 0], 1e4, 3.0, [-20, -20], 41) * 1e4).round(2)
    array([9.08, 9.08])
    """
    size = whole_number("size", size)
    model, slopes = _gradient(*_state(positions, light, radius, corners, read_noise), size, size)
    variance = model + read_noise[..., np.newaxis, np.newaxis] ** 2
    trust = 1.0 / np.maximum(variance, np.finfo(float).tiny)
    weighted = slopes * trust[..., np.newaxis, :, :]
    information = np.einsum("...kyx,...lyx->...kl", weighted, slopes)
    return np.linalg.inv(information).diagonal(axis1=-2, axis2=-1)[..., :2]


_least_variance = kernel(cramer_rao_variance)


def _state(
    points: FloatArray, flux: FloatArray, width: FloatArray, first: FloatArray, *others: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return x, y in the window and light as rows, (..., 3), and the radius of each."""
    shapes = (array.shape for array in (flux, width, *others))
    batch = np.broadcast_shapes(points.shape[:-1], first.shape[:-1], *shapes)
    state = np.empty((*batch, 3))
    state[..., :2] = points - first
    state[..., 2] = flux
    return state, np.broadcast_to(width, batch)
