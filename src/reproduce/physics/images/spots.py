"""Gaussian spots integrated over pixels: rendered and fitted.

Positions are in px, x before y, the centre of the first pixel at (0, 0): a pixel reaches half a
pixel to both sides of its number. Images and windows are arrays [..., y, x], rows from the first
upwards. Leading axes are a batch (frames, spots, trials). The radius of a spot is the standard
deviation of its Gaussian, in px. Light is in photons.

Centres are fitted by maximum likelihood: to windows in electrons, without background; `corners`
holds x and y of the first pixel of each.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr

from reproduce.physics import validate
from reproduce.physics.validate import FloatArray, NonNegative, Point, Positive

IntArray = NDArray[np.int64]
Mask = NDArray[np.bool_]
# How far from its centre a spot is drawn in a frame, in standard deviations.
_REACH = 6.0


@validate.checked
def window_corners(positions: Point, size: int) -> IntArray:
    """Return the first pixel of a window around each spot, centred on the pixel that holds it.

    Parameters
    ----------
    positions : array_like, shape (..., 2), in px
    size : int
        Width and height of the window, in px; odd, so that it has a middle pixel.

    Returns
    -------
    ndarray of int, shape (..., 2)
        x and y of the pixel with the smallest numbers.

    Examples
    --------
    >>> window_corners([10.4, 7.6], 5)
    array([8, 6])
    """
    if validate.whole_number("size", size) % 2 == 0:
        raise ValueError(
            f"size: expected odd, so that a window has a middle, got {size}"
        )
    return _corners(positions, size)


def _corners(points: FloatArray, size: int) -> IntArray:
    # Half up everywhere, not half to even: neighbouring pixels must be treated alike.
    return (np.floor(points + 0.5) - size // 2).astype(np.int64)


@validate.checked
def spot_windows(
    positions: Point,
    photons: NonNegative,
    radius: Positive,
    corners: Point,
    size: int,
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
    size : int
        Width and height of the window, in px.

    Returns
    -------
    ndarray, shape (..., size, size)
        Photons per pixel, without noise; see `detector.expose`.

    Examples
    --------
    >>> spot_windows([0.0, 0.0], 1000.0, 0.5, [-1, -1], 3).round()
    array([[ 25., 107.,  25.],
           [107., 466., 107.],
           [ 25., 107.,  25.]])
    """
    count = validate.whole_number("size", size)
    across = _shares(positions[..., 0], radius, corners[..., 0], count)
    down = _shares(positions[..., 1], radius, corners[..., 1], count)
    # A Gaussian is the product of its rows and columns, integrals included.
    scaled = photons[..., np.newaxis] * down
    return scaled[..., :, np.newaxis] * across[..., np.newaxis, :]


_windows = validate.kernel(spot_windows)


def render_frame(
    positions: ArrayLike,
    photons: ArrayLike,
    radius: ArrayLike,
    size: tuple[int, int],
) -> FloatArray:
    """Return the mean light in a whole frame of spots; spots outside leave only their tails.

    Parameters
    ----------
    positions : array_like, shape (n, 2), in px
    photons, radius : array_like, shape () or (n,)
        Light of each spot, and its standard deviation in px.
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
    points = validate.finite_array("positions", positions, shape=(None, 2)).reshape(
        -1, 2
    )
    count = len(points)
    light = np.broadcast_to(validate.non_negative("photons", photons), (count,))
    widths = np.broadcast_to(validate.positive("radius", radius), (count,))
    half = int(np.ceil(_REACH * widths.max() + 0.5))
    columns, rows = (validate.whole_number("size", side) for side in size)
    near = (points > -half - 0.5) & (points < np.array([columns, rows]) + half - 0.5)
    kept = near.all(axis=-1)
    padded = np.zeros((rows + 4 * half + 2, columns + 4 * half + 2))
    margin = 2 * half + 1
    corners = _corners(points[kept], margin)
    windows = _windows(points[kept], light[kept], widths[kept], corners, margin)
    steps = np.arange(margin)
    y = (corners[:, 1, np.newaxis] + steps + margin)[:, :, np.newaxis]
    x = (corners[:, 0, np.newaxis] + steps + margin)[:, np.newaxis, :]
    np.add.at(padded, (y, x), windows)
    return padded[margin : margin + rows, margin : margin + columns]


def _gradient(
    state: FloatArray, radius: FloatArray, columns: int, rows: int
) -> tuple[FloatArray, FloatArray]:
    """Return spots in windows, (..., rows, columns), and their derivatives by x, y and light.

    The state, (..., 3), is x and y relative to the window's first pixel, in px, and the light.
    The derivatives have shape (..., 3, rows, columns).
    """
    across, down, flux = (
        state[..., 0],
        state[..., 1],
        state[..., 2, np.newaxis, np.newaxis],
    )
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
    size = radius[..., np.newaxis]
    offset = ((first - position)[..., np.newaxis] + (np.arange(count + 1) - 0.5)) / size
    return -np.diff(np.exp(-0.5 * offset**2) / (np.sqrt(2 * np.pi) * size), axis=-1)


# Most steps from the brightest pixel; between two spots it takes hundreds.
_STEPS = 500
# A movement of the centre, in px, below which a fit has come to rest.
_AT_REST = 1e-8
# How far beyond the edge of its last pixel a spot may be centred, in px.
_BEYOND = 1.0
# Light below which a pixel's variance is not taken smaller, in electrons squared: a pixel that
# should be dark must not count without limit.
_DARKEST = 1e-3
_TINY = float(np.finfo(float).tiny)


def fitted_centre(
    windows: ArrayLike,
    corners: ArrayLike,
    radius: ArrayLike,
    read_noise: float = 0.0,
) -> FloatArray:
    """Return the centre of the pixel-integrated Gaussian that fits each window best.

    It is the maximum-likelihood estimate under photon and read noise (the sum is taken as Poisson,
    shifted by the read noise's variance, which is exact without read noise). Where a window holds
    several spots, the one of the brightest pixel is fitted.

    Parameters
    ----------
    windows : array_like, shape (..., height, width)
        Light without background, in electrons.
    corners : array_like, shape (..., 2)
        First pixel of each window.
    radius : array_like, shape (...)
        Standard deviation of the spot, in px; known.
    read_noise : float
        Noise of a pixel without light, in electrons.

    Returns
    -------
    ndarray, shape (..., 2)
        In px; not a number where the fit did not come to rest at an optimum inside the window or
        less than a pixel beyond its edge. It does not in a window that is dark, flat, or holds a
        value that is not finite.

    Examples
    --------
    A spot spread evenly about the pixel (4, 7), and a dark window.

    >>> spot = np.array([[0, 1, 0], [1, 6, 1], [0, 1, 0.0]])
    >>> fitted_centre([spot, 0 * spot], (3, 6), 0.6).round(6)
    array([[ 4.,  7.],
           [nan, nan]])
    """
    return fitted_spots(windows, corners, radius, read_noise).centre


@dataclass(frozen=True, eq=False)
class Spots:
    """Spots fitted to windows; not a number where a fit did not come to rest.

    Attributes
    ----------
    centre : ndarray, shape (..., 2), in px
    light : ndarray, shape (...), in electrons
    covariance : ndarray, shape (..., 2, 2)
        Of the centre, in px squared: the inverse of the information, the light unknown too.
    residuals : ndarray, shape (..., height, width)
        Window less spot, in electrons; zero where nothing was seen.
    """

    centre: FloatArray
    light: FloatArray
    covariance: FloatArray
    residuals: FloatArray


def fitted_spots(
    windows: ArrayLike,
    corners: ArrayLike,
    radius: ArrayLike,
    read_noise: ArrayLike = 0.0,
    seen: ArrayLike | None = None,
) -> Spots:
    """Return centre, light and covariance of the spot that fits each window best.

    As `fitted_centre`, whose arguments these are, and further:

    Parameters
    ----------
    windows, corners, radius
        As there.
    read_noise : array_like, shape (...)
        Noise of a pixel without light, in electrons, of each window.
    seen : array_like of bool, shape (..., height, width), optional
        Pixels that count: not those that are saturated, or under a filter of another colour.

    Returns
    -------
    Spots

    Examples
    --------
    A spot whose right half is not seen is known less well along x.

    >>> half = np.arange(9) < 5
    >>> window = spot_windows([4.0, 4.0], 1000.0, 1.0, [0, 0], 9)
    >>> found = fitted_spots(window, (0, 0), 1.0, 3.0, half & np.ones((9, 9), bool))
    >>> found.centre.round(6), np.sqrt(np.diag(found.covariance)).round(3)
    (array([4., 4.]), array([0.072, 0.048]))
    """
    light = validate.number_array("windows", windows, shape=(None, None))
    first = validate.finite_array("corners", corners, shape=(2,))
    width = validate.positive("radius", radius)
    noise = validate.non_negative("read_noise", read_noise)
    mask = (
        np.ones(light.shape[-2:], bool)
        if seen is None
        else np.asarray(seen, dtype=bool)
    )
    shapes = {
        "windows": light.shape[:-2],
        "corners": first.shape[:-1],
        "radius": width.shape,
    }
    batch = validate.common_batch(
        **shapes, read_noise=noise.shape, seen=mask.shape[:-2]
    )
    shape = light.shape[-2:]
    flat, counts = (
        np.broadcast_to(one, (*batch, *shape)).reshape(-1, *shape)
        for one in (light, mask)
    )
    widths, noises = (np.broadcast_to(one, batch).reshape(-1) for one in (width, noise))
    usable = np.flatnonzero((np.isfinite(flat) | ~counts).all(axis=(-2, -1)))
    dark = np.where(counts, flat, 0.0)
    fit = _Fit(
        dark[usable], widths[usable], noises[usable] ** 2, counts[usable].astype(float)
    )
    state, covariance = (
        np.full((len(flat), 3), np.nan),
        np.full((len(flat), 2, 2), np.nan),
    )
    residuals = np.full(flat.shape, np.nan)
    state[usable], covariance[usable], residuals[usable] = fit.spots()
    return Spots(
        state.reshape(*batch, 3)[..., :2] + first,
        state.reshape(*batch, 3)[..., 2],
        covariance.reshape(*batch, 2, 2),
        residuals.reshape(*batch, *shape),
    )


@dataclass(frozen=True, eq=False)
class _Fit:
    """Windows (n, height, width), radii and variances of a dark pixel (n,), and what counts."""

    light: FloatArray
    radius: FloatArray
    variance: FloatArray
    counts: FloatArray

    def spots(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return x, y and light, (n, 3), the covariance of x and y, and the residuals."""
        state = self.optimum()
        rest = np.flatnonzero(np.isfinite(state).all(axis=-1))
        part = self.of(rest)
        _, _, matrix = part.look(state[rest])
        model, _ = _gradient(state[rest], part.radius, *self.light.shape[:0:-1])
        covariance = np.full((len(state), 2, 2), np.nan)
        covariance[rest] = np.linalg.inv(matrix)[:, :2, :2]
        residuals = np.full(self.light.shape, np.nan)
        residuals[rest] = (part.light - model) * part.counts
        return state, covariance, residuals

    def of(self, rows: IntArray) -> _Fit:
        """Return some of the windows."""
        return _Fit(
            self.light[rows], self.radius[rows], self.variance[rows], self.counts[rows]
        )

    def optimum(self) -> FloatArray:
        """Return x, y and light of each spot, (n, 3); not a number where there is no optimum."""
        found = np.full((len(self.light), 3), np.nan)
        index, state = np.arange(len(found)), self.start()
        cost, score, matrix = self.look(state)
        damping = np.full(len(found), 1e-3)
        for _ in range(_STEPS):
            # Close to the optimum a gain is lost in the last digits of the cost.
            blur = 1e-13 * np.abs(cost)
            rest = (_movement(matrix, score) < _AT_REST) & np.isfinite(cost)
            found[index[rest]] = state[rest]
            kept = ~rest & np.isfinite(cost) & (damping < 1e12)
            index, state, cost, blur = index[kept], state[kept], cost[kept], blur[kept]
            score, matrix, damping = score[kept], matrix[kept], damping[kept]
            if not len(index):
                break
            part = self.of(index)
            trial = state + _step(matrix, score, damping)
            then, pulled, turned = part.look(trial)
            nearer = _movement(turned, pulled) < _movement(matrix, score)
            better = (then < cost - blur) | ((then <= cost + blur) & nearer)
            state[better], cost[better] = trial[better], then[better]
            score[better], matrix[better] = pulled[better], turned[better]
            damping = np.maximum(damping * np.where(better, 0.1, 10.0), 1e-9)
        return found

    def start(self) -> FloatArray:
        """Return the brightest pixel, and the light that fits best there."""
        rows, columns = self.light.shape[-2:]
        y, x = np.divmod(
            self.light.reshape(len(self.light), -1).argmax(axis=-1), columns
        )
        state = np.stack([x, y, np.ones(len(x))], axis=-1)
        shape, _ = _gradient(state, self.radius, columns, rows)
        seen = (self.counts * shape**2).sum(axis=(-2, -1))
        state[:, 2] = (self.light * shape).sum(axis=(-2, -1)) / np.maximum(seen, _TINY)
        return state

    def look(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the cost (n,), its fall (n, 3), and the information (n, 3, 3).

        The cost is infinite without light and far off.
        """
        rows, columns = self.light.shape[-2:]
        last = np.array([columns, rows]) - 0.5 + _BEYOND
        inside = ((state[:, :2] > -0.5 - _BEYOND) & (state[:, :2] < last)).all(axis=-1)
        allowed = inside & (state[:, 2] > 0)
        safe = np.where(allowed[:, np.newaxis], state, 1.0)
        model, slopes = _gradient(safe, self.radius, columns, rows)
        dark = self.variance[:, np.newaxis, np.newaxis]
        level, seen = model + dark, self.light + dark
        bright = np.maximum(level, _DARKEST)
        # Below the least variance, the parabola that goes on with the same slope.
        low = np.minimum(level - _DARKEST, 0.0)
        each = bright - seen * np.log(bright)
        each += low * (_DARKEST - seen) / _DARKEST + low**2 / (2 * _DARKEST)
        each, trust = each * self.counts, self.counts / bright
        score = np.einsum("nkyx,nyx->nk", slopes, (self.light - model) * trust)
        flat = slopes.reshape(len(slopes), 3, rows * columns)
        matrix = (flat * trust.reshape(len(flat), 1, rows * columns)) @ flat.mT
        return np.where(allowed, each.sum(axis=(-2, -1)), np.inf), score, matrix


def _step(matrix: FloatArray, score: FloatArray, damping: FloatArray) -> FloatArray:
    """Return the step, damped in each parameter's own size."""
    size = np.sqrt(np.maximum(np.diagonal(matrix, axis1=-2, axis2=-1), 1e-300))
    scaled = matrix / (size[..., :, np.newaxis] * size[..., np.newaxis, :])
    scaled = scaled + (damping + 1e-12)[..., np.newaxis, np.newaxis] * np.eye(3)
    return np.linalg.solve(scaled, (score / size)[..., np.newaxis])[..., 0] / size


def _movement(matrix: FloatArray, score: FloatArray) -> FloatArray:
    """Return how far a step without damping moves the centre along x or y, in px."""
    step = _step(matrix, score, np.zeros(len(score)))
    return np.abs(step[:, :2]).max(axis=-1, initial=0.0)
