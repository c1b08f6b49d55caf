"""Gaussian spots integrated over pixels: simulated and fitted.

Positions are in px, x before y, with the centre of the first pixel at (0, 0). Images and windows
are arrays [..., y, x]. Leading axes are a batch, for example of frames, spots and trials. The
radius of a spot is the standard deviation of its Gaussian, in px.

Windows for a fit are in electrons, without background. `corners` contains x and y of their first
pixels.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from scipy.special import ndtr

from reproduce.physics.validate import (
    Count,
    FloatArray,
    IntArray,
    NonNegative,
    Point,
    Positive,
    checked,
    number_array,
    valid,
    whole_number,
)

# Pixels may be missing.
_Windows = Annotated[Any, (None, None), number_array]


@checked
def window_corners(positions: Point, size: Count) -> IntArray:
    """Return the first pixels of windows that are centred on spots.

    Parameters
    ----------
    positions : array_like, shape (..., 2)
        Centres of the spots, in px.
    size : int
        Width and height of a window, in px. The size is odd.

    Returns
    -------
    ndarray of int, shape (..., 2)
        Smallest x and y of each window, in px.

    Raises
    ------
    ValueError
        If the size is even.

    Examples
    --------
    >>> window_corners([10.4, 7.6], 5)
    array([8, 6])
    """
    valid("size", size, size % 2 == 1, "an odd number")
    # Halves are rounded up.
    return (np.floor(positions + 0.5) - size // 2).astype(np.int64)


@checked
def spot_windows(
    positions: Point,
    photons: NonNegative,
    radius: Positive,
    corners: Point,
    size: Count,
) -> FloatArray:
    """Return the mean flux in a window around each spot.

    Parameters
    ----------
    positions : array_like, shape (..., 2)
        Centres of the spots, in px.
    photons : array_like, shape (...)
        Flux of a whole spot, in photons.
    radius : array_like, shape (...)
        Standard deviation of the Gaussian, in px.
    corners : array_like, shape (..., 2)
        First pixels of the windows, from `window_corners`.
    size : int
        Width and height of the windows, in px.

    Returns
    -------
    ndarray, shape (..., size, size)
        Photons per pixel, without noise. `detector.expose` adds noise.

    Examples
    --------
    >>> spot_windows([0.0, 0.0], 1000.0, 0.5, [-1, -1], 3).round()
    array([[ 25., 107.,  25.],
           [107., 466., 107.],
           [ 25., 107.,  25.]])
    """
    across, down = (
        _fractions(_edges(offsets, radius, size))
        for offsets in np.moveaxis(positions - corners, -1, 0)
    )
    scaled = photons[..., None] * down
    return scaled[..., :, None] * across[..., None, :]


@checked
def render_frame(
    positions: Point,
    photons: NonNegative,
    radius: Positive,
    size: tuple[int, int],
) -> FloatArray:
    """Return the mean flux in a frame of spots.

    Parameters
    ----------
    positions : array_like, shape (n, 2)
        Centres of the spots, in px, inside or outside of the frame.
    photons, radius : array_like, shape () or (n,)
        Flux of each spot, in photons, and its standard deviation, in px.
    size : (int, int)
        Width and height of the frame, in px.

    Returns
    -------
    ndarray, shape (height, width)
        Photons per pixel, without noise.

    Examples
    --------
    >>> float(render_frame([[4.0, 3.0]], 100.0, 0.5, (9, 7)).sum().round(6))
    100.0
    """
    across, down = (
        _fractions(_edges(centres, radius, whole_number("size", side)))
        for centres, side in zip(positions.reshape(-1, 2).T, size, strict=True)
    )
    return (down.T * photons) @ across


def _edges(position: FloatArray, radius: FloatArray, count: int) -> FloatArray:
    """Return the edges of pixels 0 to count - 1, from the spot and in radii, (..., count + 1)."""
    edges = np.arange(count + 1) - 0.5 - position[..., None]
    return edges / radius[..., None]


def _fractions(edges: FloatArray) -> FloatArray:
    """Return the fraction of the flux in each pixel of a row, (..., count)."""
    # Differences in the lower tail keep their digits.
    below, above = np.diff(ndtr(edges)), -np.diff(ndtr(-edges))
    return np.where(edges[..., 1:] < 0, below, above)


def _gradient(
    state: FloatArray, radius: FloatArray, columns: int, rows: int
) -> FloatArray:
    """Return the derivatives of spots in windows, (..., 3, rows, columns).

    They are by x, y and the logarithm of the flux: the last one is the spot. The state, (..., 3),
    is x and y relative to the first pixel, in px, and the flux.
    """
    edges = [
        _edges(state[..., 0], radius, columns),
        _edges(state[..., 1], radius, rows),
    ]
    root = -np.sqrt(2 * np.pi) * radius[..., None]
    in_x, in_y = (_fractions(axis) for axis in edges)
    slope_x, slope_y = (np.diff(np.exp(-0.5 * axis**2)) / root for axis in edges)
    down = state[..., 2, None, None] * np.stack([in_y, slope_y, in_y], axis=-2)
    across = np.stack([slope_x, in_x, in_x], axis=-2)
    return down[..., :, None] * across[..., None, :]


# Steps of a fit, at most: between two spots it takes hundreds. Later steps become shorter, because
# full steps may alternate between two places.
_MAX_STEPS, _FULL_STEPS = 1000, 50
# Longest step, and step at which a fit has converged, in px and as fractions of the flux.
_LONGEST_STEP, _CONVERGED = 0.5, 1e-8
# Largest distance of a centre from the outer edge of the window, in px.
_OUTSIDE_PX = 1.0
# Least variance of a pixel, in electrons squared: the weight of a dark pixel is finite.
_MIN_VARIANCE = 1e-3
# Relative increase of the information of each parameter, so that a step is always defined.
_RIDGE = 1e-12


@dataclass(frozen=True, eq=False)
class Spots:
    """Spots fitted to windows, NaN if a fit did not converge.

    Attributes
    ----------
    centre : ndarray, shape (..., 2)
        Centres, in px.
    light : ndarray, shape (...)
        Flux, in electrons.
    covariance : ndarray, shape (..., 2, 2)
        Covariance of the centre, in px^2: the inverse of the information, with unknown flux.
    residuals : ndarray, shape (..., height, width)
        Window minus spot, in electrons.
    """

    centre: FloatArray
    light: FloatArray
    covariance: FloatArray
    residuals: FloatArray


@checked
def fitted_spots(
    windows: _Windows,
    corners: Point,
    radius: Positive,
    read_noise: NonNegative = 0.0,
) -> Spots:
    """Return centre, flux and covariance of the spot that fits each window best.

    The fit is the maximum of the likelihood under photon and read noise. The sum of both is taken
    as Poisson noise, shifted by the variance of the read noise, which is exact without read noise.
    If a window contains several spots, the spot of the brightest pixel is fitted.

    Parameters
    ----------
    windows : array_like, shape (..., height, width)
        Flux without background, in electrons. Pixels that are not finite do not count.
    corners : array_like, shape (..., 2)
        First pixels of the windows.
    radius : array_like, shape (...)
        Known standard deviation of the spot, in px.
    read_noise : array_like, shape (...)
        Noise of a pixel without flux, in electrons.

    Returns
    -------
    Spots
        Centres in px, fluxes in electrons, and their covariances. NaN if a fit did not converge to
        an optimum inside of the window or less than a pixel outside of it, for example in a dark or
        flat window.

    Examples
    --------
    A spot around the pixel (4, 7), and a dark window.

    >>> window = np.array([[0, 1, 0], [1, 6, 1], [0, 1, 0.0]])
    >>> fitted_spots([window, 0 * window], (3, 6), 0.6).centre.round(6)
    array([[ 4.,  7.],
           [nan, nan]])

    A spot whose right half is missing is known less well along x.

    >>> window = spot_windows([4.0, 4.0], 1000.0, 1.0, [0, 0], 9)
    >>> window[:, 5:] = np.nan
    >>> spot = fitted_spots(window, (0, 0), 1.0, 3.0)
    >>> spot.centre.round(6), np.sqrt(np.diag(spot.covariance)).round(3)
    (array([4., 4.]), array([0.072, 0.048]))
    """
    shape = windows.shape[-2:]
    batch = np.broadcast_shapes(
        windows.shape[:-2], corners.shape[:-1], radius.shape, read_noise.shape
    )
    flat = np.broadcast_to(windows, (*batch, *shape)).reshape(-1, *shape)
    widths, noises = (
        np.broadcast_to(width, batch).reshape(-1) for width in (radius, read_noise)
    )
    state, information = _optimum(flat, widths, np.maximum(noises**2, _MIN_VARIANCE))
    covariance = np.asarray(np.linalg.inv(information)[:, :2, :2])
    residuals = flat - _gradient(state, widths, *shape[::-1])[:, 2]
    return Spots(
        state[:, :2].reshape(*batch, 2) + corners,
        state[:, 2].reshape(batch),
        covariance.reshape(*batch, 2, 2),
        residuals.reshape(*batch, *shape),
    )


def _optimum(
    light: FloatArray, radius: FloatArray, variance: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return x, y and flux, (n, 3), and the information matrix of each spot.

    The steps of Fisher scoring begin at the brightest pixel, with about the flux of a spot there.
    The flux remains above zero, because a step changes it by half at most.
    """
    count, height, width = light.shape
    seen = np.isfinite(light)
    light = np.where(seen, light, 0.0)
    bright = light.reshape(count, -1).argmax(axis=1)
    flux = light.max(axis=(1, 2)) * (1 + 2 * np.pi * radius**2)
    state = np.stack([bright % width, bright // width, flux], axis=-1)
    information = np.full((count, 3, 3), np.nan)
    half, unit = np.array([width, height]) / 2, np.eye(3)
    rows = np.flatnonzero(flux > 0)
    for number in range(_MAX_STEPS):
        if not len(rows):
            break
        slopes = _gradient(state[rows], radius[rows], width, height)
        spot = slopes[:, 2]
        weights = seen[rows] / (spot + variance[rows, None, None])
        score = np.einsum("nkyx,nyx->nk", slopes, (light[rows] - spot) * weights)
        matrix = np.einsum("nkyx,nyx,nlyx->nkl", slopes, weights, slopes)
        firm = matrix * (1 + _RIDGE * unit) + np.finfo(float).tiny * unit
        step = np.linalg.solve(firm, score[..., None])[..., 0]
        found = (np.abs(step) < _CONVERGED).all(axis=1)
        information[rows[found]] = firm[found]
        step = np.clip(step, -_LONGEST_STEP, _LONGEST_STEP)
        step[:, 2] *= state[rows, 2]
        state[rows] += step * min(1.0, _FULL_STEPS / (number + 1)) ** 0.5
        away = np.abs(state[rows, :2] - (half - 0.5))
        rows = rows[~found & (away < half + _OUTSIDE_PX).all(axis=1)]
    state[np.isnan(information[:, 0, 0])] = np.nan
    return state, information
