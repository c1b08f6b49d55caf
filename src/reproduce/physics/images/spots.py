"""Gaussian spots integrated over pixels, rendered for a whole batch at once.

Positions are in px, x before y, the centre of the first pixel at (0, 0): a pixel reaches half a
pixel to both sides of its number. Images and windows are arrays [..., y, x], rows from the first
upwards. Leading axes are a batch (frames, spots, trials). The radius of a spot is the standard
deviation of its Gaussian, in px. Light is in photons.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

from reproduce.physics.validate import (
    FloatArray,
    NonNegative,
    Point,
    Positive,
    checked,
    finite_array,
    kernel,
    non_negative,
    positive,
    whole_number,
)

IntArray = NDArray[np.int64]


@checked
def window_corners(positions: Point, size: int | tuple[int, int]) -> IntArray:
    """Return the first pixel of a window around each spot, centred on the pixel that holds it.

    Parameters
    ----------
    positions : array_like, shape (..., 2), in px
    size : int or (int, int)
        Width of the window, or width and height, in px; odd, so that it has a middle pixel.

    Returns
    -------
    ndarray of int, shape (..., 2)
        x and y of the pixel with the smallest numbers.

    Examples
    --------
    >>> window_corners([10.4, 7.6], 5)
    array([8, 6])
    """
    sides = np.array(_sides(size))
    if (sides % 2 == 0).any():
        raise ValueError(f"size: expected odd, so that a window has a middle, got {size}")
    return _corners(positions, sides)


def _corners(points: FloatArray, sides: IntArray | int) -> IntArray:
    # Half up everywhere, not half to even: neighbouring pixels must be treated alike.
    return (np.floor(points + 0.5) - sides // 2).astype(np.int64)


@checked
def spot_windows(
    positions: Point,
    photons: NonNegative,
    radius: Positive,
    corners: Point,
    size: int | tuple[int, int],
) -> FloatArray:
    """Return the mean light in a window around each spot.

    Parameters
    ----------
    positions : array_like, shape (..., 2)
        Centres of the spots, in px.
    photons : array_like, shape (...)
        Light of the whole spot.
    radius : array_like, shape (...)
        Standard deviation of the Gaussian, in px.
    corners : array_like, shape (..., 2)
        First pixel of each window, from `window_corners`.
    size : int or (int, int)
        Width of the window, or width and height, in px.

    Returns
    -------
    ndarray, shape (..., height, width)
        Photons per pixel, without noise; see `detector.expose`.

    Examples
    --------
    >>> spot_windows([0.0, 0.0], 1000.0, 0.5, [-1, -1], 3).round()
    array([[ 25., 107.,  25.],
           [107., 466., 107.],
           [ 25., 107.,  25.]])
    """
    columns, rows = _sides(size)
    across = _shares(positions[..., 0], radius, corners[..., 0], columns)
    down = _shares(positions[..., 1], radius, corners[..., 1], rows)
    # A Gaussian is the product of its rows and columns, integrals included.
    scaled = photons[..., np.newaxis] * down
    return scaled[..., :, np.newaxis] * across[..., np.newaxis, :]


_windows = kernel(spot_windows)


def render_frame(
    positions: ArrayLike,
    photons: ArrayLike,
    radius: ArrayLike,
    size: int | tuple[int, int],
    reach: float = 6.0,
) -> FloatArray:
    """Return the mean light in a whole frame of spots; spots outside leave only their tails.

    Parameters
    ----------
    positions : array_like, shape (n, 2), in px
    photons, radius : array_like, shape () or (n,)
        Light of each spot, and its standard deviation in px.
    size : int or (int, int)
        Width of the frame, or width and height, in px.
    reach : float
        How far from its centre a spot is drawn, in standard deviations; above zero.

    Returns
    -------
    ndarray, shape (height, width)
        Photons per pixel, without noise.

    Examples
    --------
    >>> float(render_frame([[4.0, 3.0]], 100.0, 0.5, (9, 7)).sum().round(6))
    100.0
    """
    points = finite_array("positions", positions, shape=(None, 2)).reshape(-1, 2)
    count = len(points)
    light = np.broadcast_to(non_negative("photons", photons), (count,))
    widths = np.broadcast_to(positive("radius", radius), (count,))
    half = int(np.ceil(float(positive("reach", reach)) * widths.max() + 0.5))
    columns, rows = _sides(size)
    near = (points > -half - 0.5) & (points < np.array([columns, rows]) + half - 0.5)
    kept = near.all(axis=-1)
    padded = np.zeros((rows + 4 * half + 2, columns + 4 * half + 2))
    margin = 2 * half + 1
    corners = _corners(points[kept], margin)
    windows = _windows(points[kept], light[kept], widths[kept], corners, (margin, margin))
    steps = np.arange(margin)
    y = (corners[:, 1, np.newaxis] + steps + margin)[:, :, np.newaxis]
    x = (corners[:, 0, np.newaxis] + steps + margin)[:, np.newaxis, :]
    np.add.at(padded, (y, x), windows)
    return padded[margin : margin + rows, margin : margin + columns]


def _sides(size: int | tuple[int, int]) -> tuple[int, int]:
    columns, rows = size if isinstance(size, tuple) else (size, size)
    return whole_number("size", columns), whole_number("size", rows)


def _gradient(
    state: FloatArray, radius: FloatArray, columns: int, rows: int
) -> tuple[FloatArray, FloatArray]:
    """Return spots in windows, (..., rows, columns), and their derivatives by x, y and light.

    The state, (..., 3), is x and y relative to the window's first pixel, in px, and the light.
    The derivatives have shape (..., 3, rows, columns).
    """
    across, down, flux = state[..., 0], state[..., 1], state[..., 2, np.newaxis, np.newaxis]
    start = np.zeros_like(across)
    in_x = _shares(across, radius, start, columns)[..., np.newaxis, :]
    in_y = _shares(down, radius, start, rows)[..., :, np.newaxis]
    moved_x = _share_slopes(across, radius, start, columns)[..., np.newaxis, :]
    moved_y = _share_slopes(down, radius, start, rows)[..., :, np.newaxis]
    shape = in_x * in_y
    slopes = np.stack([flux * moved_x * in_y, flux * in_x * moved_y, shape], axis=-3)
    return flux * shape, slopes


def _shares(
    position: FloatArray, radius: FloatArray, first: FloatArray | IntArray, count: int
) -> FloatArray:
    """Return the share of a spot's light in each pixel of a row: the Gaussian, integrated.

    The row begins at pixel `first`; the shares, (..., count), fall short of one by what lies
    outside it.
    """
    offset = (first - position)[..., np.newaxis] + (np.arange(count + 1) - 0.5)
    scaled = offset / radius[..., np.newaxis]
    # What lies beyond each edge, away from the spot: both tails keep their digits this way.
    beyond = ndtr(-np.abs(scaled))
    near, far = beyond[..., :-1], beyond[..., 1:]
    astride = (scaled[..., :-1] < 0) & (scaled[..., 1:] > 0)
    return np.where(astride, 1.0 - near - far, np.abs(near - far))


def _share_slopes(
    position: FloatArray, radius: FloatArray, first: FloatArray, count: int
) -> FloatArray:
    """Return the derivatives of `_shares` by the position, in 1/px."""
    _, density = _edge_densities(position, radius, first, count)
    return -np.diff(density, axis=-1)


def _share_curvatures(
    position: FloatArray, radius: FloatArray, first: FloatArray, count: int
) -> FloatArray:
    """Return the second derivatives of `_shares` by the position, in 1/px^2."""
    offset, density = _edge_densities(position, radius, first, count)
    return -np.diff(density * offset / radius[..., np.newaxis], axis=-1)


def _edge_densities(
    position: FloatArray, radius: FloatArray, first: FloatArray, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return where pixel edges lie, in standard deviations, and the Gaussian there, in 1/px."""
    size = radius[..., np.newaxis]
    offset = ((first - position)[..., np.newaxis] + (np.arange(count + 1) - 0.5)) / size
    return offset, np.exp(-0.5 * offset**2) / (np.sqrt(2 * np.pi) * size)
