"""Finding spots in a frame, and their centres of gravity in windows, for a whole batch at once.

Positions are in px, x before y, the centre of the first pixel at (0, 0). Windows are arrays
[..., y, x], rows from the first upwards; `corners` holds x and y of the first pixel of each.
Windows are in any linear unit of light, after the background has been taken away. The estimator
that fits the shape of the spot is in `spots`.

Below them stands what the error should be: closed forms for the centre of gravity, and the bound.
There light is in electrons, and the radius of a spot is the standard deviation of its Gaussian, in
px. Leading axes are a batch. Last stands a spot that may lie anywhere within a pixel: it moves
along x, its y at the middle of a row of pixels, in a window of `size` pixels around that pixel.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.images.spots import _edges, _gradient, _shares, spot_windows
from reproduce.physics.validate import FloatArray, Image, NonNegative, Point, Positive


@validate.checked
def centre_of_gravity(windows: Image, corners: Point) -> FloatArray:
    """Return the centre of gravity of all pixels of each window.

    Parameters
    ----------
    windows : array_like, shape (..., height, width)
        Light without background; single pixels may be below zero.
    corners : array_like, shape (..., 2)
        First pixel of each window.

    Returns
    -------
    ndarray, shape (..., 2)
        Centroids, in px.

    Raises
    ------
    DegenerateGeometryError
        If a window holds no light in sum.

    Examples
    --------
    >>> centre_of_gravity([[0, 0, 0], [0, 1, 3], [0, 0, 0]], (10, 20))
    array([11.75, 21.  ])
    """
    return _centre_of_gravity(windows) + corners


def _centre_of_gravity(light: FloatArray) -> FloatArray:
    """Return centres of gravity relative to the first pixels."""
    rows, columns = light.shape[-2:]
    y, x = np.mgrid[:rows, :columns]
    # One matrix product for all windows: sums over short axes are slow.
    moments = light.reshape(-1, rows * columns) @ np.stack(
        [np.ones(rows * columns), x.ravel(), y.ravel()], axis=-1
    )
    _refuse_dark(moments[:, 0])
    return (moments[:, 1:] / moments[:, :1]).reshape(*light.shape[:-2], 2)


def _refuse_dark(total: FloatArray) -> None:
    dark = np.flatnonzero(total <= 0)
    if len(dark):
        raise validate.DegenerateGeometryError(
            f"windows: expected flux in every window, got {len(dark)} of {total.size} without "
            f"any, the first at index {dark[0]}. Subtract less background, or drop these windows"
        )


@dataclass(frozen=True, eq=False)
class CentroidError:
    """The error of a centroid along x and y.

    Attributes
    ----------
    bias : ndarray, shape (..., 2)
        Expected minus true position, in px.
    variance : ndarray, shape (..., 2)
        Variance about the expected position, in px^2.
    slope : ndarray, shape (..., 2)
        How far the expected position moves for one px of the true one; 1 without bias.
    """

    bias: FloatArray
    variance: FloatArray
    slope: FloatArray

    @property
    def within(self) -> FloatArray:
        """Root mean square of the scatter at each place of the last axis: bias does not count."""
        return np.asarray(np.sqrt(self.variance.mean(axis=-1)))

    @property
    def total(self) -> FloatArray:
        """Standard deviation of the errors at all places of the last axis together: bias counts."""
        return np.asarray(np.sqrt(self.variance.mean(axis=-1) + self.bias.var(axis=-1)))


@validate.checked
def centre_of_gravity_error(
    positions: Point,
    light: NonNegative,
    radius: Positive,
    corners: Point,
    size: int,
    read_noise: NonNegative = 0.0,
) -> CentroidError:
    """Return the bias and variance of the centre of gravity in a fixed window.

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
    windows = spot_windows(positions, light, radius, corners, size)
    centre = _centre_of_gravity(windows) + corners
    total = windows.sum(axis=(-2, -1))[..., np.newaxis]
    # Offsets of columns and rows from the centre of gravity, x before y.
    offsets = np.arange(size) - (centre - corners)[..., np.newaxis]
    sums = np.stack([windows.sum(axis=-2), windows.sum(axis=-1)], axis=-2)
    read = read_noise[..., np.newaxis] ** 2
    variance = (
        (offsets**2 * sums).sum(-1) + read * size * (offsets**2).sum(-1)
    ) / total**2
    # The denominator's own noise, which is correlated with the numerator's: second order.
    push = -read * size * offsets.sum(axis=-1) / total**2
    _, slopes = _gradient(*_state(positions, light, radius, corners), size, size)
    # How the sums of columns and rows change with x and y.
    moved = np.stack(
        [slopes[..., 0, :, :].sum(-2), slopes[..., 1, :, :].sum(-1)], axis=-2
    )
    slope = (offsets * moved).sum(axis=-1) / total
    return CentroidError(centre + push - positions, variance, slope)


@validate.checked
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
    is exact for photon noise only.

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
    size = validate.whole_number("size", size)
    model, slopes = _gradient(
        *_state(positions, light, radius, corners, read_noise), size, size
    )
    variance = model + read_noise[..., np.newaxis, np.newaxis] ** 2
    trust = 1.0 / np.maximum(variance, np.finfo(float).tiny)
    weighted = slopes * trust[..., np.newaxis, :, :]
    information = np.einsum("...kyx,...lyx->...kl", weighted, slopes)
    return np.linalg.inv(information).diagonal(axis1=-2, axis2=-1)[..., :2]


def _state(
    points: FloatArray,
    flux: FloatArray,
    width: FloatArray,
    first: FloatArray,
    *others: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return x, y in the window and light as rows, (..., 3), and the radius of each."""
    places = np.moveaxis(points - first, -1, 0)
    columns = np.broadcast_arrays(*places, flux, width, *others)
    return np.stack(columns[:3], axis=-1), columns[3]


@dataclass(frozen=True)
class Light:
    """What the noise of a spot depends on.

    Attributes
    ----------
    signal : float
        Light of the whole spot, in electrons.
    read_noise : float
        Noise of a pixel without light, in electrons.
    """

    signal: float
    read_noise: float = 0.0


def simulated_errors(
    phases: ArrayLike,
    light: Light,
    radius: float,
    size: int,
    trials: int,
    generator: Generator,
) -> FloatArray:
    """Return the errors of simulated centroids along x.

    The centre of gravity along x needs only the sums of the window's columns. A sum of independent
    Poisson numbers is a Poisson number, and a sum of normal ones is normal: so each column is
    drawn as one number. That is the same law as drawing every pixel, with fewer draws.

    Parameters
    ----------
    phases : array_like, shape (n,)
        Positions of the spot relative to the middle of the window, in px.
    light : Light
    radius : float, in px
    size : int
        Width and height of the window, in px; odd.
    trials : int
        How often each phase is seen.
    generator : numpy.random.Generator
        Draws the noise.

    Returns
    -------
    ndarray, shape (trials, n)
        Measured minus true position, in px.

    Raises
    ------
    DegenerateGeometryError
        If noise leaves a window without light.

    Examples
    --------
    >>> simulated_errors([0.0], Light(1e12), 0.5, 5, 2, np.random.default_rng(1)).round(4).shape
    (2, 1)
    """
    offsets = validate.finite_array("phases", phases, shape=(None,))
    width = validate.positive("radius", radius)
    first = np.array(-(validate.whole_number("size", size) // 2))
    columns = light.signal * _shares(_edges(offsets - first, width, size))
    columns = columns * _shares(_edges(-first, width, size)).sum()
    shape = (validate.whole_number("trials", trials), *columns.shape)
    seen = generator.poisson(columns, size=shape).astype(np.float64)
    if light.read_noise:
        noise = generator.standard_normal(shape)
        noise *= light.read_noise * np.sqrt(size)
        seen += noise
    pixel = np.stack([np.ones(size), np.arange(size) + float(first)], axis=-1)
    moments = seen.reshape(-1, size) @ pixel
    _refuse_dark(moments[:, 0])
    return (moments[:, 1] / moments[:, 0]).reshape(shape[:-1]) - offsets


def predicted_errors(
    phases: ArrayLike, light: Light, radius: ArrayLike, size: int
) -> CentroidError:
    """Return the closed-form error of the same centroids.

    Arguments are those of `simulated_errors`, with radii of shape (...).

    Returns
    -------
    CentroidError
        bias, variance and slope along x only, of shape (..., n).

    Examples
    --------
    >>> predicted_errors([0.0], Light(1e4), 0.5, 5).bias.round(12) + 0.0
    array([0.])
    """
    law = centre_of_gravity_error(*_laid_out(phases, light, radius, size))
    return CentroidError(law.bias[..., 0], law.variance[..., 0], law.slope[..., 0])


def least_variance(
    phases: ArrayLike, light: Light, radius: ArrayLike, size: int
) -> FloatArray:
    """Return the Cramér-Rao bound of the same centroids, along x, at each phase.

    Arguments are those of `predicted_errors`.

    Returns
    -------
    ndarray, shape (..., n), in px squared

    Examples
    --------
    Photon noise and pixels much finer than the spot: the radius over the root of the light.

    >>> (least_variance([0.0], Light(1e4), 4.0, 41) ** 0.5).round(3)
    array([0.04])
    """
    return cramer_rao_variance(*_laid_out(phases, light, radius, size))[..., 0]


def _laid_out(
    phases: ArrayLike, light: Light, radius: ArrayLike, size: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, int, FloatArray]:
    """Return positions, light, radii, corner, size and read noise, with the phases last."""
    offsets = validate.finite_array("phases", phases, shape=(None,))
    points = np.stack([offsets, np.zeros_like(offsets)], axis=-1)
    width = validate.positive("radius", radius)[..., np.newaxis]
    corner = np.full(2, -float(validate.whole_number("size", size) // 2))
    return (
        points,
        np.asarray(light.signal),
        width,
        corner,
        size,
        np.asarray(light.read_noise),
    )
