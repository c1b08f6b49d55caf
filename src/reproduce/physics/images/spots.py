"""Gaussian spots integrated over pixels: rendered, fitted and found.

Positions are in px, x before y, the centre of the first pixel at (0, 0): a pixel reaches half a
pixel to both sides of its number. Images and windows are arrays [..., y, x], rows from the first
upwards. Leading axes are a batch (frames, spots, trials). The radius of a spot is the standard
deviation of its Gaussian, in px. Light is in photons.

Centres are fitted by maximum likelihood: to windows in electrons, without background; `corners`
holds x and y of the first pixel of each. In a whole image photutils finds the background, its
noise, and the segments in which a spot is looked for.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri, ndtr

from reproduce.physics.validate import (
    FloatArray,
    NonNegative,
    Point,
    Positive,
    checked,
    common_batch,
    finite_array,
    kernel,
    non_negative,
    number_array,
    positive,
    whole_number,
)

IntArray = NDArray[np.int64]
Mask = NDArray[np.bool_]
# How far from its centre a spot is drawn in a frame, in standard deviations.
_REACH = 6.0


@checked
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
    if whole_number("size", size) % 2 == 0:
        raise ValueError(f"size: expected odd, so that a window has a middle, got {size}")
    return _corners(positions, size)


def _corners(points: FloatArray, size: int) -> IntArray:
    # Half up everywhere, not half to even: neighbouring pixels must be treated alike.
    return (np.floor(points + 0.5) - size // 2).astype(np.int64)


@checked
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
    count = whole_number("size", size)
    across = _shares(positions[..., 0], radius, corners[..., 0], count)
    down = _shares(positions[..., 1], radius, corners[..., 1], count)
    # A Gaussian is the product of its rows and columns, integrals included.
    scaled = photons[..., np.newaxis] * down
    return scaled[..., :, np.newaxis] * across[..., np.newaxis, :]


_windows = kernel(spot_windows)


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
    points = finite_array("positions", positions, shape=(None, 2)).reshape(-1, 2)
    count = len(points)
    light = np.broadcast_to(non_negative("photons", photons), (count,))
    widths = np.broadcast_to(positive("radius", radius), (count,))
    half = int(np.ceil(_REACH * widths.max() + 0.5))
    columns, rows = (whole_number("size", side) for side in size)
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
    light = number_array("windows", windows, shape=(None, None))
    first = finite_array("corners", corners, shape=(2,))
    width, noise = positive("radius", radius), non_negative("read_noise", read_noise)
    mask = np.ones(light.shape[-2:], bool) if seen is None else np.asarray(seen, dtype=bool)
    shapes = {"windows": light.shape[:-2], "corners": first.shape[:-1], "radius": width.shape}
    batch = common_batch(**shapes, read_noise=noise.shape, seen=mask.shape[:-2])
    shape = light.shape[-2:]
    flat, counts = (np.broadcast_to(one, (*batch, *shape)).reshape(-1, *shape)
                    for one in (light, mask))  # fmt: skip
    widths, noises = (np.broadcast_to(one, batch).reshape(-1) for one in (width, noise))
    usable = np.flatnonzero((np.isfinite(flat) | ~counts).all(axis=(-2, -1)))
    dark = np.where(counts, flat, 0.0)
    fit = _Fit(dark[usable], widths[usable], noises[usable] ** 2, counts[usable].astype(float))
    state, covariance = np.full((len(flat), 3), np.nan), np.full((len(flat), 2, 2), np.nan)
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
        return _Fit(self.light[rows], self.radius[rows], self.variance[rows], self.counts[rows])

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
        y, x = np.divmod(self.light.reshape(len(self.light), -1).argmax(axis=-1), columns)
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


# A spot has so many touching pixels above the threshold, in standard deviations of the noise.
_TOUCHING, THRESHOLD = 3, 5.0
# A hot pixel exceeds so many deviations, and its neighbours have less than a share of its light.
_GLARING, _ALONE = 10.0, 0.1
# Side of the boxes in which the background is found; of a large image one pixel in so many, an odd
# number, so that of a mosaic those under each filter are met.
_BOX, _EVERY, _LARGE = 64, 3, 768
# Spots at most, the brightest; spots whose widths are measured; half a window, in radii.
_MOST, _MEASURED, _HALF = 20_000, 9, 3.0
# Of another spot, so many radii reach into the window.
_TAIL = 2.0
# Share of a spot's square that may differ from a Gaussian of the common width: at most, and as many
# times what is usual in the image, and a little; in how many deviations that must show.
_MISFIT, _UNUSUAL, _SLIGHT, _SURELY = 0.1, 4.0, 2e-3, 5.0
# So often spots are fitted to find the gain; by how much it may exceed a first guess.
_FITS, _GAINS = 4, 1e6


@dataclass(frozen=True, eq=False)
class Found:
    """What stands out of an image, the brightest first, in digital numbers.

    Attributes
    ----------
    spots : Spots
    light, level, noise : ndarray, shape (n,)
        Of the spot, and of the background under it.
    reasons : ndarray of str, shape (n,)
        Why one is no star that can be measured; empty where it is.
    facts : dict of str to float
        Radius of all spots, in px, median background and noise, and gain, in electrons per digital
        number: with it half of the spots fit better than the median of chi-square.
    size, hot : int
        Side of the windows, in px, and how many pixels shine alone.
    """

    spots: Spots
    light: FloatArray
    level: FloatArray
    noise: FloatArray
    reasons: NDArray[np.str_]
    facts: dict[str, float]
    size: int
    hot: int


def find_spots(
    image: FloatArray, full: Mask, threshold: float = THRESHOLD, step: float = 0.0, pitch: int = 1
) -> Found:
    """Find the spots of an image and measure them.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Digital numbers; not a number where one is missing, or under another filter.
    full : ndarray of bool, shape (height, width)
        Pixels that are saturated.
    threshold : float
        What a spot must exceed, in standard deviations of the noise.
    step : float
        Between two digital numbers; next to nothing where they are not.
    pitch : int
        From a pixel to the next under the same filter.

    Returns
    -------
    Found

    Raises
    ------
    ValueError
        If nothing exceeds the threshold.

    Examples
    --------
    >>> y, x = np.indices((64, 64))
    >>> light = 500 * np.exp(-((x - 30.2) ** 2 + (y - 20.7) ** 2) / 4)
    >>> sky = np.random.default_rng(1).normal(100, 1, light.shape)
    >>> find_spots(sky + light, np.zeros(light.shape, dtype=bool)).spots.centre.round(1)
    array([[30.2, 20.7]])
    """
    positive("threshold", threshold)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # boxes without pixels, and segments without light
        level, noise = _background(image, step)
        light = image - level
        hot = _hot(light, noise, pitch)
        light[hot] = np.nan
        places, guess = _segments(light, threshold * noise)
        if not len(places):
            raise ValueError(
                f"expected stars, got nothing above {threshold:g} standard deviations of the noise "
                f"in {_TOUCHING} touching pixels"
            )
    view = _View.of(light, full, noise, places, guess)
    # Not the very brightest: what is no star is among them.
    some = np.arange(max(_MEASURED, len(places) // 2))[: len(places)]
    radius = view.part(some[:: max(1, len(some) // _MEASURED)]).radius(guess)
    view = _View.of(light, full, noise, places, radius)
    spots, gain = view.fitted(radius)
    size, under = view.light.shape[-1], _pixels(places)
    reasons = {
        "saturated": view.full,
        "at the edge": ~_inside(places, image.shape, radius),
        "another close by": _crowded(places, size // 2 + _TAIL * radius),
        "not the shape of a spot": view.odd(spots.residuals / gain, gain),
        "no centre found": ~(np.abs(spots.centre - places).max(axis=1) < size / 2),
    }
    first = np.select(list(reasons.values()), list(reasons), default="")
    facts = {"radius": radius, "background": float(np.median(level[under])),
             "noise": float(np.median(noise[under])), "gain": gain}  # fmt: skip
    light = spots.light / gain
    return Found(spots, light, level[under], noise[under], first, facts, size, int(hot.sum()))


def _background(image: FloatArray, step: float) -> tuple[FloatArray, FloatArray]:
    """Return the background of each pixel, and its noise."""
    from photutils.background import Background2D, MADStdBackgroundRMS

    every = _EVERY if min(image.shape) > _LARGE else 1
    some = image[::every, ::every]
    missing, box = np.isnan(some), max(8, _BOX // every)
    options = {"exclude_percentile": 90.0, "bkg_rms_estimator": MADStdBackgroundRMS()}
    found = Background2D(np.where(missing, 0.0, some), box, mask=missing, **options)
    level, noise = (
        one.repeat(every, axis=0).repeat(every, axis=1)[: image.shape[0], : image.shape[1]]
        for one in (found.background, np.hypot(found.background_rms, step / np.sqrt(12)))
    )
    # Of an image without noise, a share of its brightest pixel.
    least = 1e-3 * max(float(np.nanmax(image) - np.median(level)), 0.0)
    return level, np.where(noise > 0, noise, least)


def _hot(light: FloatArray, noise: FloatArray, pitch: int) -> Mask:
    """Say which pixels shine alone, as no spot does: their neighbours have next to no light."""
    from scipy.ndimage import maximum_filter

    around = np.ones((2 * pitch + 1, 2 * pitch + 1), bool)
    around[pitch, pitch] = False
    beside = maximum_filter(np.nan_to_num(light), footprint=around)
    alone = beside < np.maximum(_ALONE * light, 3 * noise)
    return np.asarray(alone & (light > _GLARING * noise))


def _segments(light: FloatArray, limit: FloatArray) -> tuple[FloatArray, float]:
    """Return the brightest pixels of what exceeds a limit, the most light first, and a radius."""
    from astropy.convolution import interpolate_replace_nans
    from photutils.segmentation import SourceCatalog, detect_sources

    if np.isnan(light).any():
        near = np.outer([1.0, 2.0, 1.0], [1.0, 2.0, 1.0])
        light = np.nan_to_num(interpolate_replace_nans(light, near))
    segments = detect_sources(light, limit, _TOUCHING)
    if segments is None:
        return np.zeros((0, 2)), 1.0
    found = SourceCatalog(light, segments)
    order = np.argsort(-np.asarray(found.segment_flux), kind="stable")[:_MOST]
    places = np.stack([found.maxval_xindex, found.maxval_yindex], axis=-1)[order]
    radius = float(np.nanmedian(np.asarray(found.semimajor_axis)))
    return places.astype(float), radius if radius > 0 else 1.0


def _pixels(places: FloatArray) -> tuple[IntArray, IntArray]:
    """Return the rows and columns of places."""
    return places[:, 1].astype(int), places[:, 0].astype(int)


def _inside(places: FloatArray, shape: tuple[int, ...], margin: float) -> Mask:
    last = np.array(shape[::-1]) - 1 - margin
    return np.asarray(((places >= margin) & (places <= last)).all(axis=1))


def _crowded(places: FloatArray, reach: float) -> Mask:
    """Say which places have another one close by."""
    from scipy.spatial import KDTree

    near: Any = KDTree(places).query_pairs(reach, output_type="ndarray", p=np.inf)
    return np.isin(np.arange(len(places)), near)


@dataclass(frozen=True, eq=False)
class _View:
    """Windows in digital numbers, the pixels that count, noise, and which have a full pixel."""

    light: FloatArray
    seen: Mask
    noise: FloatArray
    full: Mask
    corners: IntArray

    @classmethod
    def of(
        cls, light: FloatArray, full: Mask, noise: FloatArray, places: FloatArray, radius: float
    ) -> _View:
        """Return the windows about places that hold a spot of a radius."""
        size = 2 * int(np.clip(np.ceil(_HALF * radius), 2, 60)) + 1
        size = min(size, *(side - 1 + side % 2 for side in light.shape))
        corners = np.clip(_corners(places, size), 0, np.array(light.shape[::-1]) - size)
        columns, rows = (corners[:, i, None] + np.arange(size) for i in (0, 1))
        at = rows[:, :, None], columns[:, None]
        seen, cut = np.isfinite(light[at]) & ~full[at], np.asarray(full[at].any(axis=(1, 2)))
        return cls(np.where(seen, light[at], 0.0), seen, noise[_pixels(places)], cut, corners)

    def part(self, rows: IntArray) -> _View:
        """Return some of the windows."""
        return _View(self.light[rows], self.seen[rows], self.noise[rows], self.full[rows],
                     self.corners[rows])  # fmt: skip

    def spots(self, radius: float, gain: float) -> Spots:
        """Return the spots of a radius that fit best."""
        return fitted_spots(gain * self.light, self.corners, radius, gain * self.noise, self.seen)

    @property
    def dark_gain(self) -> float:
        """A gain with which photons make next to no noise."""
        return _GAINS / float(self.noise.min()) ** 2

    def radius(self, guess: float) -> float:
        """Return the radius that fits half of the spots best."""
        from scipy.optimize import minimize_scalar

        def misfit(radius: float) -> float:
            left = self.spots(radius, self.dark_gain).residuals / self.dark_gain
            share = (left**2).sum(axis=(1, 2)) / (self.light**2).sum(axis=(1, 2))
            return float(np.median(np.nan_to_num(share, nan=1.0)))

        bounds = (0.2, 3 * guess)
        return float(minimize_scalar(misfit, bounds=bounds, options={"xatol": 1e-3}).x)

    def fitted(self, radius: float) -> tuple[Spots, float]:
        """Return the spots and the gain with which they fit."""
        # Without photon noise first: what scatters more under more light tells how much there is.
        gain = self.dark_gain
        for _ in range(_FITS):
            spots = self.spots(radius, gain)
            used, gain = gain, self.gain(spots.residuals / gain)
        return spots, used

    def model(self, left: FloatArray) -> FloatArray:
        """Return the light of the spots, from what they leave."""
        return np.maximum((self.light - left) * self.seen, 0.0)

    def gain(self, left: FloatArray) -> float:
        """Return electrons per digital number with which half of the spots fit as they should.

        Counted are pixels whose light exceeds the noise. A spot that is not alone, or not quite a
        Gaussian, does not spoil the median.
        """
        from scipy.optimize import brentq

        model, dark = self.model(left), self.noise[:, None, None] ** 2
        bright = self.seen & (model**2 > dark)
        median = chdtri(np.maximum(bright.sum(axis=(1, 2)) - 3.0, 0.5), 0.5)  # a fit has three

        def excess(log_gain: float) -> float:
            squares = bright * left**2 / (dark + model / np.exp(log_gain))
            return float(np.nanmedian(squares.sum(axis=(1, 2)) / median)) - 1

        guess = float(np.log(np.nanmedian((model / dark).max(axis=(1, 2)))))
        low, high = guess - np.log(_GAINS), guess + np.log(_GAINS)
        within = excess(low) < 0 < excess(high)
        return float(np.exp(brentq(excess, low, high) if within else high))

    def odd(self, left: FloatArray, gain: float) -> Mask:
        """Say which spots differ surely, and by more than others do, from the common shape."""
        model = self.model(left)
        variance = (self.noise[:, None, None] ** 2 + model / gain) * self.seen
        excess = (left**2 - variance).sum(axis=(1, 2))
        spread = np.sqrt(2 * (variance**2).sum(axis=(1, 2)))
        misfit = excess / (model**2).sum(axis=(1, 2))
        limit = min(_MISFIT, _UNUSUAL * max(float(np.nanmedian(misfit)), 0.0) + _SLIGHT)
        return np.asarray((misfit > limit) & (excess > _SURELY * spread))
