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
    common_batch,
    finite_array,
    non_negative,
    positive,
    whole_number,
)

IntArray = NDArray[np.int64]


def pixel_shares(
    position: ArrayLike, radius: ArrayLike, first: ArrayLike, count: int
) -> FloatArray:
    """Return the share of a spot's light in each pixel of a row: the Gaussian, integrated.

    Parameters
    ----------
    position : array_like, shape (...)
        Centre of the spot along the row, in px.
    radius : array_like, shape (...)
        Standard deviation of the Gaussian, in px.
    first : array_like, shape (...)
        Number of the row's first pixel.
    count : int
        How many pixels.

    Returns
    -------
    ndarray, shape (..., count)
        Shares; their sum falls short of one by what lies outside the row.

    Raises
    ------
    TypeError, ValueError
        If a value is not finite, the radius not above zero, or the count not a whole number.

    Examples
    --------
    >>> pixel_shares(0.0, 0.5, -1, 3).round(4)
    array([0.1573, 0.6827, 0.1573])
    """
    centre, size = finite_array("position", position), positive("radius", radius)
    start = finite_array("first", first)
    common_batch(position=centre.shape, radius=size.shape, first=start.shape)
    edges = np.arange(whole_number("count", count) + 1) - 0.5
    offset = (start - centre)[..., np.newaxis] + edges
    scaled = offset / size[..., np.newaxis]
    # What lies beyond each edge, away from the spot: both tails keep their digits this way.
    beyond = ndtr(-np.abs(scaled))
    near, far = beyond[..., :-1], beyond[..., 1:]
    astride = (scaled[..., :-1] < 0) & (scaled[..., 1:] > 0)
    return np.asarray(np.where(astride, 1.0 - near - far, np.abs(near - far)))


def pixel_share_slopes(
    position: ArrayLike, radius: ArrayLike, first: ArrayLike, count: int
) -> FloatArray:
    """Return how the share of light in each pixel of a row changes with the spot's position.

    Parameters
    ----------
    position, radius, first, count
        As for `pixel_shares`.

    Returns
    -------
    ndarray, shape (..., count)
        Derivatives by the position, in 1/px.

    Raises
    ------
    TypeError, ValueError
        As for `pixel_shares`.

    Examples
    --------
    A spot that moves right takes light from the left pixel and gives it to the right one.

    >>> pixel_share_slopes(0.0, 0.5, -1, 3).round(4)
    array([-0.4751, -0.    ,  0.4751])
    """
    _, density = _edge_densities(position, radius, first, count)
    return np.asarray(-np.diff(density, axis=-1))


def pixel_share_curvatures(
    position: ArrayLike, radius: ArrayLike, first: ArrayLike, count: int
) -> FloatArray:
    """Return the second derivatives of the light in each pixel of a row by the spot's position.

    Parameters
    ----------
    position, radius, first, count
        As for `pixel_shares`.

    Returns
    -------
    ndarray, shape (..., count)
        In 1/px^2.

    Raises
    ------
    TypeError, ValueError
        As for `pixel_shares`.

    Examples
    --------
    A spot in the middle of a pixel gives away light wherever it moves.

    >>> pixel_share_curvatures(0.0, 0.5, -1, 3).round(4)
    array([ 0.9147, -1.9358,  0.9147])
    """
    offset, density = _edge_densities(position, radius, first, count)
    size = positive("radius", radius)[..., np.newaxis]
    return np.asarray(-np.diff(density * offset / size, axis=-1))


def window_corners(positions: ArrayLike, size: int | tuple[int, int]) -> IntArray:
    """Return the first pixel of a window around each spot, centred on the pixel that holds it.

    Parameters
    ----------
    positions : array_like, shape (..., 2)
        In px.
    size : int or (int, int)
        Width of the window, or width and height, in px; odd, so that it has a middle pixel.

    Returns
    -------
    ndarray of int, shape (..., 2)
        x and y of the pixel with the smallest numbers.

    Raises
    ------
    TypeError, ValueError
        If positions are not finite pairs, or the size is not odd.

    Examples
    --------
    >>> window_corners([10.4, 7.6], 5)
    array([8, 6])
    """
    points = finite_array("positions", positions, shape=(2,))
    sides = np.array(_sides(size))
    if (sides % 2 == 0).any():
        raise ValueError(f"size: expected odd, so that a window has a middle, got {size}")
    # Half up everywhere, not half to even: neighbouring pixels must be treated alike.
    return np.asarray(np.floor(points + 0.5) - sides // 2, dtype=np.int64)


def spot_windows(
    positions: ArrayLike,
    photons: ArrayLike,
    radius: ArrayLike,
    corners: ArrayLike,
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

    Raises
    ------
    TypeError, ValueError
        If a shape does not fit, a value is not finite, or a size or radius not above zero.

    Examples
    --------
    >>> spot_windows([0.0, 0.0], 1000.0, 0.5, [-1, -1], 3).round()
    array([[ 25., 107.,  25.],
           [107., 466., 107.],
           [ 25., 107.,  25.]])
    """
    points = finite_array("positions", positions, shape=(2,))
    start = finite_array("corners", corners, shape=(2,))
    light, width = non_negative("photons", photons), positive("radius", radius)
    common_batch(
        positions=points.shape[:-1],
        corners=start.shape[:-1],
        photons=light.shape,
        radius=width.shape,
    )
    columns, rows = _sides(size)
    across = pixel_shares(points[..., 0], width, start[..., 0], columns)
    down = pixel_shares(points[..., 1], width, start[..., 1], rows)
    # A Gaussian is the product of its rows and columns, integrals included.
    scaled = light[..., np.newaxis] * down
    return np.asarray(scaled[..., :, np.newaxis] * across[..., np.newaxis, :])


def spot_gradient(
    state: FloatArray, radius: FloatArray, columns: int, rows: int
) -> tuple[FloatArray, FloatArray]:
    """Return a spot in a window and its derivatives by x, y and light.

    Parameters
    ----------
    state : ndarray, shape (..., 3)
        x and y relative to the window's first pixel, in px, and the light.
    radius : ndarray, shape (...)
        Standard deviation of the spot, in px.
    columns, rows : int
        Size of the window.

    Returns
    -------
    model : ndarray, shape (..., rows, columns)
        Light per pixel.
    slopes : ndarray, shape (..., 3, rows, columns)
        Its derivatives.

    Examples
    --------
    >>> model, slopes = spot_gradient(np.array([1.0, 1.0, 9.0]), np.array(0.5), 3, 3)
    >>> model.shape, slopes.shape
    ((3, 3), (3, 3, 3))
    """
    across, down, flux = state[..., 0], state[..., 1], state[..., 2, np.newaxis, np.newaxis]
    start = np.zeros_like(across)
    in_x = pixel_shares(across, radius, start, columns)[..., np.newaxis, :]
    in_y = pixel_shares(down, radius, start, rows)[..., :, np.newaxis]
    moved_x = pixel_share_slopes(across, radius, start, columns)[..., np.newaxis, :]
    moved_y = pixel_share_slopes(down, radius, start, rows)[..., :, np.newaxis]
    shape = in_x * in_y
    slopes = np.stack([flux * moved_x * in_y, flux * in_x * moved_y, shape], axis=-3)
    return np.asarray(flux * shape), slopes


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
    positions : array_like, shape (n, 2)
        In px.
    photons, radius : array_like, shape () or (n,)
        Light of each spot, and its standard deviation in px.
    size : int or (int, int)
        Width of the frame, or width and height, in px.
    reach : float
        How far from its centre a spot is drawn, in standard deviations.

    Returns
    -------
    ndarray, shape (height, width)
        Photons per pixel, without noise.

    Raises
    ------
    TypeError, ValueError
        As for `spot_windows`; also if the reach is not above zero.

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
    corners = window_corners(points[kept], 2 * half + 1)
    windows = spot_windows(points[kept], light[kept], widths[kept], corners, 2 * half + 1)
    steps = np.arange(2 * half + 1)
    margin = 2 * half + 1
    y = (corners[:, 1, np.newaxis] + steps + margin)[:, :, np.newaxis]
    x = (corners[:, 0, np.newaxis] + steps + margin)[:, np.newaxis, :]
    np.add.at(padded, (y, x), windows)
    return padded[margin : margin + rows, margin : margin + columns]


def _sides(size: int | tuple[int, int]) -> tuple[int, int]:
    columns, rows = size if isinstance(size, tuple) else (size, size)
    return whole_number("size", columns), whole_number("size", rows)


def _edge_densities(
    position: ArrayLike, radius: ArrayLike, first: ArrayLike, count: int
) -> tuple[FloatArray, FloatArray]:
    """Return where pixel edges lie, in standard deviations, and the Gaussian there, in 1/px."""
    centre, size = finite_array("position", position), positive("radius", radius)
    start = finite_array("first", first)
    common_batch(position=centre.shape, radius=size.shape, first=start.shape)
    edges = np.arange(whole_number("count", count) + 1) - 0.5
    offset = ((start - centre)[..., np.newaxis] + edges) / size[..., np.newaxis]
    return offset, np.exp(-0.5 * offset**2) / (np.sqrt(2 * np.pi) * size[..., np.newaxis])
