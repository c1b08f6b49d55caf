"""How well a spot is centred when it may lie anywhere within a pixel: many phases, many trials.

The spot moves along x across one pixel, its y at the middle of a row of pixels. A window of
`size` pixels stands around that pixel, and the centre of gravity of all of it is the centroid.
Positions are in px, light in electrons; the radius is the standard deviation of the Gaussian.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike

from reproduce.physics.images.centroids import CentroidError, _error, _least_variance
from reproduce.physics.images.spots import _shares
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    finite_array,
    non_negative,
    positive,
    whole_number,
)


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

    def __post_init__(self) -> None:
        positive("signal", self.signal)
        non_negative("read_noise", self.read_noise)


@dataclass(frozen=True, eq=False)
class Scatter:
    """Errors of centroids over phases, at one or many radii. In px; all of shape (...).

    Attributes
    ----------
    total : ndarray
        Standard deviation of the errors of all phases together: bias counts.
    within : ndarray
        Root mean square of the standard deviations within each phase: bias does not count.
    bias : ndarray
        Root mean square of the mean errors of the phases.
    """

    total: FloatArray
    within: FloatArray
    bias: FloatArray


def even_phases(count: int) -> FloatArray:
    """Return the middles of so many equal parts of one pixel, shape (count,), in px.

    Parameters
    ----------
    count : int

    Returns
    -------
    ndarray, shape (count,), from -1/2 to 1/2 px, symmetric

    Examples
    --------
    >>> even_phases(4)
    array([-0.375, -0.125,  0.125,  0.375])
    """
    return (np.arange(whole_number("count", count)) + 0.5) / count - 0.5


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
        Found less true position, in px.

    Raises
    ------
    DegenerateGeometryError
        If noise leaves a window without light.

    Examples
    --------
    >>> simulated_errors([0.0], Light(1e12), 0.5, 5, 2, np.random.default_rng(1)).round(4).shape
    (2, 1)
    """
    offsets = finite_array("phases", phases, shape=(None,))
    width, first = positive("radius", radius), np.array(-(whole_number("size", size) // 2))
    columns = light.signal * _shares(offsets, width, first, size)
    columns = columns * _shares(np.zeros(()), width, first, size).sum()
    shape = (whole_number("trials", trials), *columns.shape)
    seen = generator.poisson(columns, size=shape).astype(np.float64)
    if light.read_noise:
        noise = generator.standard_normal(shape)
        noise *= light.read_noise * np.sqrt(size)
        seen += noise
    pixel = np.stack([np.ones(size), np.arange(size) + float(first)], axis=-1)
    moments = seen.reshape(-1, size) @ pixel
    if (moments[:, 0] <= 0).any():
        raise DegenerateGeometryError(
            "light: expected light in every window, got one with none; ask for more signal"
        )
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
    >>> predicted_errors([0.0], Light(1e4), 0.5, 5).bias
    array([0.])
    """
    law = _error(*_laid_out(phases, light, radius, size))
    return CentroidError(law.bias[..., 0], law.variance[..., 0], law.slope[..., 0])


def bound(phases: ArrayLike, light: Light, radius: ArrayLike, size: int) -> FloatArray:
    """Return the least standard deviation of an unbiased centroid, over all phases.

    Arguments are those of `predicted_errors`.

    Returns
    -------
    ndarray, shape (...)
        Root mean square over the phases of the Cramér-Rao bound along x, in px.

    Examples
    --------
    Photon noise and pixels much finer than the spot: the radius over the root of the light.

    >>> float(bound([0.0], Light(1e4), 4.0, 41).round(3))
    0.04
    """
    least = _least_variance(*_laid_out(phases, light, radius, size))
    return np.asarray(np.sqrt(least[..., 0].mean(axis=-1)))


def predicted_scatter(law: CentroidError) -> Scatter:
    """Return the scatter (...) over all phases that an error from `predicted_errors` amounts to.

    Examples
    --------
    >>> law = CentroidError(np.array([-3.0, 3.0]), np.array([16.0, 16.0]), np.ones(2))
    >>> predicted_scatter(law).total
    array(5.)
    """
    within = law.variance.mean(axis=-1)
    about_mean = law.bias.var(axis=-1)
    return Scatter(
        np.asarray(np.sqrt(within + about_mean)),
        np.asarray(np.sqrt(within)),
        np.asarray(np.sqrt((law.bias**2).mean(axis=-1))),
    )


def observed_scatter(errors: ArrayLike) -> Scatter:
    """Return the scatter (...) of errors (..., trials, phases) from `simulated_errors`.

    Examples
    --------
    >>> observed_scatter([[-3.0, 3.0], [-3.0, 3.0]]).bias
    array(3.)
    """
    found = finite_array("errors", errors, shape=(None, None))
    return Scatter(
        np.asarray(found.std(axis=(-2, -1))),
        np.asarray(np.sqrt(found.var(axis=-2, ddof=1).mean(axis=-1))),
        np.asarray(np.sqrt((found.mean(axis=-2) ** 2).mean(axis=-1))),
    )


def _laid_out(
    phases: ArrayLike, light: Light, radius: ArrayLike, size: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, int, FloatArray]:
    """Return positions, light, radii, corner, size and read noise, with the phases last."""
    offsets = finite_array("phases", phases, shape=(None,))
    points = np.stack([offsets, np.zeros_like(offsets)], axis=-1)
    width = positive("radius", radius)[..., np.newaxis]
    corner = np.full(2, -float(whole_number("size", size) // 2))
    return points, np.asarray(light.signal), width, corner, size, np.asarray(light.read_noise)
