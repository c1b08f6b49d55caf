"""Finding spots in a frame, and their centres in windows, for a whole batch at once.

Positions are in px, x before y, the centre of the first pixel at (0, 0). Windows are arrays
[..., y, x], rows from the first upwards; `corners` holds x and y of the first pixel of each.
Windows are in any linear unit of light, after the background has been taken away. Estimators that
fit the shape of the spot are in `spots`.

Below them stands what the error should be: closed forms for the centre of gravity, and the bound.
There light is in electrons, and the radius of a spot is the standard deviation of its Gaussian, in
px. Leading axes are a batch.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import label, maximum_filter

from reproduce.physics.images.spots import IntArray, _gradient, _windows
from reproduce.physics.validate import (
    DegenerateGeometryError,
    FloatArray,
    Image,
    NonNegative,
    Number,
    Point,
    Positive,
    checked,
    finite_array,
    kernel,
    whole_number,
)

# Steps after which every spot of sensible brightness has come to rest.
_STEPS = 30


def detect_spots(frame: ArrayLike, threshold: float, separation: int = 5) -> IntArray:
    """Return the brightest pixel of every spot in a frame.

    A spot is a pixel that no other one within `separation` outshines. Touching pixels that are
    equally bright, as in a saturated star, are one spot together, however large: the pixel nearest
    to their middle stands for it.

    Parameters
    ----------
    frame : array_like, shape (height, width)
        Light or digital numbers.
    threshold : float
        What a pixel must exceed.
    separation : int
        Least distance between two spots along x or y, in px; with 1 every pixel is a spot.

    Returns
    -------
    ndarray of int, shape (n, 2)
        x and y, the brightest first; no rows where nothing is bright enough.

    Examples
    --------
    >>> frame = np.zeros((9, 9))
    >>> frame[2, 7] = 5.0
    >>> detect_spots(frame, 1.0)
    array([[7, 2]])
    """
    image = finite_array("frame", frame, shape=(None, None))
    if image.ndim != 2:
        raise ValueError(f"frame: expected one image, got shape {image.shape}; pass them singly")
    least, reach = finite_array("threshold", threshold), whole_number("separation", separation)
    if least.ndim:
        raise ValueError(f"threshold: expected one number, got shape {least.shape}; give one")
    highest = maximum_filter(image, size=2 * reach - 1, mode="nearest")
    peaks = (image == highest) & (image > least)
    # From two pixels on, peaks that touch are equally bright.
    rows, columns = np.nonzero(peaks) if reach == 1 else _plateaus(peaks)
    order = np.argsort(-image[rows, columns], kind="stable")
    # Only equally bright spots can still be too close to each other: the first one stands for both.
    kept: dict[tuple[int, int], tuple[int, int]] = {}
    for x, y in zip(columns[order].tolist(), rows[order].tolist(), strict=True):
        column, row = x // reach, y // reach
        near = (kept.get((column + i, row + j)) for i in (-1, 0, 1) for j in (-1, 0, 1))
        if all(max(abs(x - at[0]), abs(y - at[1])) >= reach for at in near if at):
            kept[column, row] = (x, y)
    return np.array(list(kept.values()), dtype=np.int64).reshape(-1, 2)


def _plateaus(peaks: NDArray[np.bool_]) -> tuple[IntArray, IntArray]:
    """Return row and column of the pixel in the middle of each group of touching peaks."""
    labels, count = label(peaks, structure=np.ones((3, 3)))
    rows, columns = np.nonzero(peaks)
    group = labels[rows, columns] - 1
    size = np.bincount(group, minlength=count)
    middle = [np.bincount(group, weights=axis, minlength=count) / size for axis in (rows, columns)]
    off = (rows - middle[0][group]) ** 2 + (columns - middle[1][group]) ** 2
    # Sorted by group, then by distance: the first of each group is the one in its middle.
    order = np.lexsort((off, group))
    first = order[np.searchsorted(group[order], np.arange(count))]
    first.sort()
    return rows[first], columns[first]


def cut_windows(frames: ArrayLike, corners: ArrayLike, size: int | tuple[int, int]) -> FloatArray:
    """Return the windows of a frame, or of many frames, that begin at the given pixels.

    Parameters
    ----------
    frames : array_like, shape (..., height, width)
        Images.
    corners : array_like of int, shape (n, 2)
        x and y of the first pixel of each window; the same for all frames.
    size : int or (int, int)
        Width of a window, or width and height, in px.

    Returns
    -------
    ndarray, shape (..., n, height, width)
        The windows.

    Raises
    ------
    ValueError
        If a window reaches over the edge of the frame.

    Examples
    --------
    >>> cut_windows(np.arange(12.0).reshape(3, 4), [[1, 0]], 2)
    array([[[1., 2.],
            [5., 6.]]])
    """
    images = finite_array("frames", frames, shape=(None, None))
    first = finite_array("corners", corners, shape=(2,)).astype(np.int64).reshape(-1, 2)
    columns, rows = size if isinstance(size, tuple) else (size, size)
    height, width = images.shape[-2:]
    last = first + np.array([columns, rows])
    if (first < 0).any() or (last > np.array([width, height])).any():
        raise ValueError(
            f"corners: expected windows inside the frame of {width} x {height} px, got one that "
            "reaches over its edge; drop the spots next to the edge"
        )
    y = (first[:, 1, np.newaxis] + np.arange(rows))[:, :, np.newaxis]
    x = (first[:, 0, np.newaxis] + np.arange(columns))[:, np.newaxis, :]
    return images[..., y, x]


@checked
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


@checked
def windowed_centre(
    windows: Image, corners: Point, radius: Positive, steps: int = _STEPS
) -> FloatArray:
    """Return the centre of gravity under a Gaussian weight that follows the spot.

    The weight has the spot's own radius, so each step doubles the weighted offset: the product of
    two equal Gaussians lies halfway between them. Far pixels, which hold noise and no light, lose
    their weight. Other arguments and errors are those of `centre_of_gravity`.

    Parameters
    ----------
    radius : array_like, shape (...)
        Standard deviation of the weight, in px.
    steps : int
        How many steps from the plain centre of gravity.

    Returns
    -------
    ndarray, shape (..., 2), in px

    Examples
    --------
    >>> even = np.ones((3, 3)) + np.eye(3)[1] * np.eye(3)[1][:, None]
    >>> windowed_centre(even, (0, 0), 0.6)
    array([1., 1.])
    """
    # Those that run out of their window are put back on its edge.
    edge = np.array([windows.shape[-1], windows.shape[-2]]) - 0.5
    centre = _centre_of_gravity(windows)
    y, x = np.arange(windows.shape[-2]), np.arange(windows.shape[-1])
    scale = radius[..., np.newaxis]
    for _ in range(whole_number("steps", steps)):
        across, down = x - centre[..., :1], y - centre[..., 1:]
        right = np.exp(-0.5 * (across / scale) ** 2)
        up = np.exp(-0.5 * (down / scale) ** 2)
        weighted = windows * right[..., np.newaxis, :] * up[..., :, np.newaxis]
        total = weighted.sum(axis=(-2, -1))
        _refuse_dark(total)
        offset_x = (weighted.sum(axis=-2) * across).sum(axis=-1) / total
        offset_y = (weighted.sum(axis=-1) * down).sum(axis=-1) / total
        centre = np.clip(centre + 2.0 * np.stack([offset_x, offset_y], axis=-1), -0.5, edge)
    return centre + corners


def _refuse_dark(total: FloatArray) -> None:
    dark = total <= 0
    if dark.any():
        places = [str(tuple(one) if len(one) > 1 else one[0]) for one in np.argwhere(dark).tolist()]
        named = f" ({', '.join(places[:5])}{', ...' * (len(places) > 5)})" if dark.ndim else ""
        raise DegenerateGeometryError(
            f"windows: expected light in every window, got {len(places)} of {dark.size} with none "
            f"in sum{named}; take less background away, or drop these windows"
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
