"""Centres of gravity of spots in windows, their errors, and the Cramér-Rao bound.

Positions are in px, x before y, with the centre of the first pixel at (0, 0). Windows are arrays
[..., y, x]. `corners` contains x and y of their first pixels. Windows are in any linear unit of
flux, without background. The estimator that fits the shape of a spot is in `spots`.

In closed forms and simulations, flux is in electrons, and the radius of a spot is the standard
deviation of its Gaussian, in px. Leading axes are a batch.
"""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from reproduce.physics import validate
from reproduce.physics.images.spots import _edges, _fractions, _gradient
from reproduce.physics.validate import (
    Count,
    FloatArray,
    Image,
    NonNegative,
    Point,
    Positive,
)

# Variance of a pixel without flux and noise, which tells nothing of the spot.
_LEAST_VARIANCE = np.finfo(float).tiny


@validate.checked
def centre_of_gravity(windows: Image, corners: Point) -> FloatArray:
    """Return the centre of gravity of all pixels of each window.

    Parameters
    ----------
    windows : array_like, shape (..., height, width)
        Flux without background; pixels may be below zero.
    corners : array_like, shape (..., 2)
        First pixel of each window.

    Returns
    -------
    ndarray, shape (..., 2)
        Centroids, in px.

    Raises
    ------
    DegenerateGeometryError
        If the sum of a window is zero or less.

    Examples
    --------
    >>> centre_of_gravity([[0, 0, 0], [0, 1, 3], [0, 0, 0]], (10, 20))
    array([11.75, 21.  ])
    """
    rows, columns = windows.shape[-2:]
    y, x = np.mgrid[:rows, :columns].reshape(2, -1)
    # One matrix product for all windows: sums over short axes are slow.
    powers = np.stack([np.ones(len(x)), x, y], axis=-1)
    moments = windows.reshape(-1, len(x)) @ powers
    _check_flux(moments[:, 0])
    centres = moments[:, 1:] / moments[:, :1]
    return centres.reshape(*windows.shape[:-2], 2) + corners


def _check_flux(total: FloatArray) -> None:
    dark = np.flatnonzero(total <= 0)
    if len(dark):
        raise validate.DegenerateGeometryError(
            f"windows: expected flux in every window, got {len(dark)} of {total.size} without "
            f"any, the first at index {dark[0]}. Subtract less background, or drop these windows"
        )


@validate.checked
def centre_of_gravity_error(
    positions: Point,
    light: NonNegative,
    radius: Positive,
    corners: Point,
    size: Count,
    read_noise: NonNegative = 0.0,
) -> tuple[FloatArray, FloatArray]:
    """Return the bias and variance of the centre of gravity in a fixed window.

    The bias contains the S-curve, the truncation by the window, and the effect of read noise, which
    displaces the centre from the middle of the window. The variance is the sum of photon noise and
    read noise, to first order.

    Parameters
    ----------
    positions : array_like, shape (..., 2)
        True centres of the spots, in px.
    light : array_like, shape (...)
        Flux of a whole spot, in electrons.
    radius : array_like, shape (...)
        Standard deviation of the Gaussian, in px.
    corners : array_like, shape (..., 2)
        First pixel of each window.
    size : int
        Width and height of the window, in px.
    read_noise : array_like, shape (...)
        Noise of a pixel without flux, in electrons.

    Returns
    -------
    bias : ndarray, shape (..., 2)
        Expected minus true position, in px.
    variance : ndarray, shape (..., 2)
        Variance about the expected position, in px^2.

    Raises
    ------
    DegenerateGeometryError
        If a window contains no flux.

    Examples
    --------
    In a wide window, the variance is the sum of the squared radius and 1/12 px^2, the variance of
    the width of a pixel, over the number of electrons.

    >>> _, variance = centre_of_gravity_error([0.0, 0.0], 1e4, 1.0, [-8, -8], 17)
    >>> (variance * 1e4).round(4)
    array([1.0833, 1.0833])
    """
    sums = _sums(positions - corners, light, radius, size)
    total = sums.sum(axis=-1)
    _check_flux(total)
    pixels = np.arange(size)
    centre = sums @ pixels / total
    offsets = pixels - centre[..., None]
    read = read_noise[..., None] ** 2 * size
    variance = (offsets**2 * sums).sum(axis=-1) + read * (offsets**2).sum(axis=-1)
    # The denominator has noise too, correlated with that of the numerator: second order.
    push = -read * offsets.sum(axis=-1) / total**2
    bias = centre + push - (positions - corners)
    return bias, variance / total**2


def _sums(
    positions: FloatArray, light: FloatArray, radius: FloatArray, size: int
) -> FloatArray:
    """Return the sums of the columns and of the rows of windows, (..., 2, size).

    Positions, (..., 2), are relative to the first pixel.
    """
    inside = _fractions(_edges(positions, radius[..., None], size))
    across = inside.sum(axis=-1, keepdims=True)[..., ::-1, :]
    return light[..., None, None] * inside * across


@validate.checked
def cramer_rao_variance(
    positions: Point,
    light: Positive,
    radius: Positive,
    corners: Point,
    size: Count,
    read_noise: NonNegative = 0.0,
) -> FloatArray:
    """Return the least variance of an unbiased centroid in a window: the Cramér-Rao bound.

    The noise is photon noise and Gaussian read noise, and the flux of the spot is unknown too. The
    information of a pixel is that of a normal variable with the variance of the pixel, which is
    exact without read noise.

    Parameters are those of `centre_of_gravity_error`, with a flux above zero.

    Returns
    -------
    ndarray, shape (..., 2)
        Variance along x and y, in px^2. The bound of a biased estimator is this variance times the
        square of the derivative of its expected position by the true position.

    Examples
    --------
    For many pixels across the spot, it is the squared radius over the number of electrons.

    >>> (cramer_rao_variance([0, 0], 1e4, 3.0, [-20, -20], 41) * 1e4).round(2)
    array([9.08, 9.08])
    """
    x, y = np.moveaxis(positions - corners, -1, 0)
    state = np.stack(np.broadcast_arrays(x, y, light), axis=-1)
    slopes = _gradient(state, radius, size, size)
    noise = slopes[..., 2, :, :] + read_noise[..., None, None] ** 2
    weights = 1 / np.maximum(noise, _LEAST_VARIANCE)
    information = np.einsum("...kyx,...yx,...lyx->...kl", slopes, weights, slopes)
    return np.linalg.inv(information).diagonal(axis1=-2, axis2=-1)[..., :2]


@validate.checked
def simulated_errors(
    positions: Point,
    light: NonNegative,
    radius: Positive,
    corners: Point,
    size: Count,
    trials: Count,
    generator: Generator,
) -> FloatArray:
    """Return the errors of simulated centroids along x in one window, due to photon noise.

    Each column of the window is drawn as one number, because the centre of gravity along x depends
    only on the sums of columns, and a sum of Poisson numbers is a Poisson number.

    Parameters
    ----------
    positions, light, radius, corners, size
        As in `centre_of_gravity_error`, for positions of shape (n, 2) and one window.
    trials : int
        Number of simulations of each position.
    generator : numpy.random.Generator
        Source of the noise.

    Returns
    -------
    ndarray, shape (trials, n)
        Measured minus true position, in px.

    Raises
    ------
    DegenerateGeometryError
        If the sum of a window is zero or less.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> simulated_errors([[0, 0]], 1e12, [0.5], (-2, -2), 5, 2, rng).shape
    (2, 1)
    """
    columns = _sums(positions - corners, light, radius, size)[:, 0]
    shape = (trials, *columns.shape)
    seen = generator.poisson(columns, size=shape)
    centres = centre_of_gravity(seen[..., None, :], corners)
    return centres[..., 0] - positions[:, 0]
