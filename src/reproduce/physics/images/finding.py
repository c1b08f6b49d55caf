"""Finding the spots of a whole image, and measuring their centres with a covariance.

The background is subtracted before its noise is measured. Centres are those of `spots`, whose
shapes, units and radius apply here too. The flux is in digital numbers, and the gain is estimated.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import chdtri

from reproduce.physics.images.spots import IntArray, Mask, Spots, fitted_spots
from reproduce.physics.validate import Finding, FloatArray, positive

Float32 = NDArray[np.float32]
# A spot has at least 3 touching pixels above the threshold, in standard deviations of the noise.
_TOUCHING, THRESHOLD = 3, 5.0
# A hot pixel exceeds 10 standard deviations, and its neighbours have less than 10 % of its flux.
_GLARING, _ALONE = 10.0, 0.1
# Side of the boxes of the background, in px. Large images are sampled at each third pixel.
_BOX, _EVERY, _LARGE = 64, 3, 768
# Rows whose background is computed at once, to save memory.
_ROWS = 256
# Spots at most, the brightest; spots that determine the radius, and the gain.
_MOST, _MEASURED, _TYPICAL = 20_000, 9, 400
# Half side of a window, reach of the tail of a neighbour, radius of the weights of the moments, in
# radii of a spot.
_HALF, _TAIL, _WIDE = 3.0, 2.0, 2.0
# Largest misfit of the shape of a spot, as a fraction of its squared flux: absolute, in medians of
# the image, and an allowance; and its significance in standard deviations.
_MISFIT, _UNUSUAL, _SLIGHT, _SURELY = 0.1, 4.0, 2e-3, 5.0
_ODD = "not the shape of a spot"
# Number of fits from which the gain is found; range of plausible gains, in electrons per number.
_FITS, _PLAUSIBLE = 4, (0.01, 1000.0)
# Photon variance of the background that contradicts the gain, in squares of the noise.
_NOISIER = 3.0
# Range of gains around a first guess; parameters of the fit of a spot.
_GAINS, _FREE = 1e6, 3
# Median of chi-square with two degrees of freedom.
_MEDIAN = 2 * np.log(2)
# Powers of x and y of the moments; radii of the Gaussians that describe a common shape.
_POWERS, _SCALES = ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)), (0.5, 1.0, 2.0)
# Difference in shape that matters, as a fraction of the width; probability of a false warning.
_DIFFERENT, _FALSE = 0.05, 0.01
# Stars at least of each image, and the fraction of them that is trimmed from each end.
_COMPARED, _TRIMMED = 4, 0.2
# Systematic error of the shift, in changes of the asymmetry.
_BEYOND = 2.0


@dataclass(frozen=True, eq=False)
class Found:
    """Spots of an image, the brightest first.

    Attributes
    ----------
    spots : Spots
        Flux and residuals in electrons. The covariance contains the scatter of the centres that
        the noise does not explain.
    reasons : ndarray of str, shape (n,)
        Why a spot cannot be measured; empty if it can.
    facts : dict of str to float
        ``radius`` of all spots, in px; median ``background`` and ``noise``, in digital numbers;
        ``gain``, in electrons per digital number; ``elongation``, the ratio of the axes of the
        spots, and ``angle``, that of the long axis from x towards y, in radians.
    hot : int
        Number of hot pixels.
    shapes : ndarray, shape (n, 5)
        Asymmetry in x and y, in px, and second moments xx, xy and yy, in px^2; NaN except for the
        brighter half of the measured spots. The asymmetry is the centre of gravity with weights
        of twice the radius of a spot minus that with weights of one radius.
    remarks : tuple of Finding
        Warnings about the gain and the shape of the spots.
    """

    spots: Spots
    reasons: NDArray[np.str_]
    facts: dict[str, float]
    hot: int
    shapes: FloatArray
    remarks: tuple[Finding, ...] = ()


def find_spots(
    image: NDArray[np.floating],
    full: Mask,
    threshold: float = THRESHOLD,
    step: float = 0.0,
    sigma: NDArray[np.floating] | None = None,
) -> Found:
    """Find the spots of an image and measure them.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Digital numbers; NaN if a pixel is missing.
    full : ndarray of bool, shape (height, width)
        Saturated pixels.
    threshold : float
        Detection limit, in standard deviations of the noise.
    step : float
        Step between two digital numbers; nearly zero for real numbers.
    sigma : ndarray, shape (height, width), optional
        Standard deviations of the pixels, in digital numbers. Default: from the background.

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
    from scipy.spatial import KDTree

    positive("threshold", threshold)
    light, noise = _without_background(image, step)
    noise = noise if sigma is None else np.asarray(sigma)
    hot = _remove_hot(light, noise)
    places, guess = _segments(light, noise, threshold)
    # The very brightest half would contain artefacts: the sample covers all.
    some = places[: max(_MEASURED, len(places) // 2)]
    some = some[:: max(1, len(some) // _MEASURED)]
    radius = _View(light, full, noise, some, guess).radius(guess)
    typical = places[:: len(places) // _TYPICAL + 1]
    gain = _View(light, full, noise, typical, radius).gain(radius)
    view = _View(light, full, noise, places, radius)
    spots = view.spots(radius, gain)
    size, last = view.light.shape[-1], np.array(image.shape[::-1]) - 1 - radius
    reach = size // 2 + _TAIL * radius
    close: Any = KDTree(places).query_pairs(reach, np.inf, output_type="ndarray")
    reasons = {
        "saturated": view.full,
        "at the edge": ((places < radius) | (places > last)).any(axis=1),
        "another close by": np.isin(np.arange(len(places)), close),
        _ODD: view.odd(spots.residuals / gain, gain),
        "no centre found": ~(np.abs(spots.centre - places).max(axis=1) < size / 2),
    }
    first = np.select(list(reasons.values()), list(reasons), default="")
    # Spots of any shape, the brighter half.
    bright = np.flatnonzero(np.isin(first, ["", _ODD]) & (spots.light > 0))
    bright = bright[np.argsort(-spots.light[bright], kind="stable")][
        : (len(bright) + 1) // 2
    ]
    shapes = np.full((len(places), 5), np.nan)
    if len(bright):
        brighter = _View(light, full, noise, places[bright], radius)
        shapes[bright], scatter = brighter.shapes(radius, gain)
        spots = replace(spots, covariance=spots.covariance + scatter * np.eye(2))
    y, x = places.T[::-1]
    background = image[y, x] - light[y, x]
    facts = {
        "radius": radius,
        "background": float(np.median(background)),
        "noise": float(np.median(view.noise)),
        "gain": gain,
        **_axes(shapes),
    }
    remarks = _remarks(gain, background, view.noise)
    return Found(spots, first, facts, hot, shapes, remarks)


def _without_background(
    image: NDArray[np.floating], step: float
) -> tuple[Float32, Any]:
    """Return the image minus its background, and the noise of each pixel.

    The noise is that of the image minus a first background: a slope within a box is no noise.
    """
    from photutils.background import Background2D, BiweightScaleBackgroundRMS
    from scipy.interpolate import make_interp_spline
    from scipy.ndimage import median_filter

    every = _EVERY if min(image.shape) > _LARGE else 1
    rest = image[::every, ::every].astype(np.float64)
    missing = np.isnan(rest)
    sides = [-(-size // -(-size * every // _BOX)) for size in rest.shape]
    between = []
    for size, side, full in zip(rest.shape, sides, image.shape, strict=True):
        first = np.arange(0, size, side)
        middle = every * (first + np.minimum(first + side, size) - 1) / 2
        linear = make_interp_spline(
            middle, np.eye(len(first)), k=min(1, len(first) - 1)
        )
        between.append(linear(np.arange(full)))
    down, across = between
    level: Any = 0.0
    for _ in range(2):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # boxes without pixels
            found = Background2D(
                np.where(missing, 0.0, rest),
                sides,
                mask=missing,
                exclude_percentile=90.0,
                filter_size=1,
                bkg_rms_estimator=BiweightScaleBackgroundRMS(),
            )
        # The median of neighbours continues a slope beyond the boxes at the edge.
        meshes = [
            median_filter(np.pad(mesh, 1, mode="reflect", reflect_type="odd"), 3)[
                1:-1, 1:-1
            ]
            for mesh in (found.background_mesh, found.background_rms_mesh)
        ]
        level = level + meshes[0]
        rest -= down[::every] @ meshes[0] @ across[::every].T
    light, noise = (np.empty(image.shape, np.float32) for _ in range(2))
    least = 1e-3 * max(float(np.nanmax(rest)), 0.0)  # of an image without noise
    deviation = np.maximum(meshes[1], step / np.sqrt(12))
    deviation = np.where(deviation > 0, deviation, least)
    level, deviation = level @ across.T, deviation @ across.T
    for start in range(0, len(image), _ROWS):
        rows = slice(start, start + _ROWS)
        light[rows] = image[rows] - down[rows] @ level
        noise[rows] = down[rows] @ deviation
    return light, noise


def _remove_hot(light: Float32, noise: Any) -> int:
    """Set hot pixels, whose neighbours have almost no flux, to NaN, and return their number."""
    y, x = np.nonzero(light > _GLARING * noise)
    height, width = light.shape
    beside = np.zeros(len(y), light.dtype)
    for down, across in np.argwhere(np.arange(9).reshape(3, 3) != 4) - 1:
        near = light[
            np.clip(y + down, 0, height - 1), np.clip(x + across, 0, width - 1)
        ]
        beside = np.fmax(beside, near)
    alone = beside < np.maximum(_ALONE * light[y, x], 3 * noise[y, x])
    light[y[alone], x[alone]] = np.nan
    return int(alone.sum())


def _segments(light: Float32, noise: Any, threshold: float) -> tuple[IntArray, float]:
    """Return the brightest pixels of the spots, the most flux first, and a radius.

    `scipy.ndimage` takes a third of the time and memory of the segments of photutils.
    """
    from scipy.ndimage import binary_dilation, label

    bright, around = light > threshold * noise, np.ones((3, 3), bool)
    missing = np.isnan(light)
    if missing.any():  # a missing pixel does not split a spot
        bright |= missing & binary_dilation(bright, around)
    y, x = np.divmod(np.flatnonzero(bright), light.shape[1])
    names, count = label(bright, around)
    names, flux = names[y, x] - 1, np.nan_to_num(light[y, x])
    sums = np.bincount(names, flux, count)
    order = np.lexsort((-flux, names))
    peaks = order[np.unique(names[order], return_index=True)[1]]
    spots = np.flatnonzero(np.bincount(names, flux > 0, count) >= _TOUCHING)
    if not len(spots):
        raise ValueError(
            f"threshold: expected stars above {threshold:g} standard deviations of the noise, "
            "got none. Lower the threshold, or check the image"
        )
    spots = spots[np.argsort(-sums[spots], kind="stable")[:_MOST]]
    peaks = peaks[spots]
    # A Gaussian has 2 pi radius^2 times the flux of its brightest pixel.
    radius = np.sqrt(np.median(sums[spots] / flux[peaks]) / (2 * np.pi))
    return np.stack([x[peaks], y[peaks]], axis=-1), float(radius)


class _View:
    """Windows in digital numbers, the pixels that count, noise, and which have a full pixel."""

    def __init__(
        self, light: Float32, full: Mask, noise: Any, places: IntArray, radius: float
    ) -> None:
        """Cut the windows at `places` that contain a spot of a radius."""
        size = 2 * int(np.clip(np.ceil(_HALF * radius), 2, 60)) + 1
        size = min(size, *(side - 1 + side % 2 for side in light.shape))
        self.corners = np.clip(
            places - size // 2, 0, np.array(light.shape[::-1]) - size
        )
        columns, rows = (self.corners[:, i, None] + np.arange(size) for i in (0, 1))
        at = rows[:, :, None], columns[:, None]
        self.light = light[at].astype(np.float64)
        self.seen = np.isfinite(self.light) & ~full[at]
        self.light[~self.seen] = 0.0
        self.full = full[at].any(axis=(1, 2))
        self.noise = noise[*places.T[::-1]].astype(np.float64)
        # With this gain the photon noise is negligible.
        self.dark_gain = _GAINS / float(self.noise.min()) ** 2

    def spots(self, radius: float, gain: float) -> Spots:
        """Return the spots of a radius that fit best."""
        return fitted_spots(
            gain * self.light, self.corners, radius, gain * self.noise, self.seen
        )

    def radius(self, guess: float) -> float:
        """Return the radius that fits half of the spots best."""
        from scipy.optimize import minimize_scalar

        def misfit(radius: float) -> float:
            left = self.spots(radius, self.dark_gain).residuals / self.dark_gain
            part = (left**2).sum(axis=(1, 2)) / (self.light**2).sum(axis=(1, 2))
            return float(np.median(np.nan_to_num(part, nan=1.0)))

        bounds = (0.2, 3 * guess)
        return float(minimize_scalar(misfit, bounds=bounds, options={"xatol": 1e-3}).x)

    def model(self, left: FloatArray) -> FloatArray:
        """Return the flux of the fitted spots, from their residuals."""
        return np.maximum((self.light - left) * self.seen, 0.0)

    def gain(self, radius: float) -> float:
        """Return electrons per digital number with which half of the spots fit as they should.

        The residuals are those of the common shape, which need not be a Gaussian. Pixels count if
        their flux exceeds the noise. Blended spots do not change the median.
        """
        from scipy.optimize import brentq

        gain = self.dark_gain
        for _ in range(_FITS):
            spots = self.spots(radius, gain)
            left, dark = spots.residuals / gain, self.noise[:, None, None] ** 2
            model = self.model(left)
            left, terms = self.common(
                spots.centre, left, model, dark + model / gain, radius
            )
            bright = self.seen & (model**2 > dark)
            count = bright.sum(axis=(1, 2))
            kept = np.isfinite(spots.light)
            free = 1 - min(
                0.9, (terms + _FREE * kept.sum()) / max(count[kept].sum(), 1)
            )
            median = chdtri(np.maximum(count * free, 0.5), 0.5)
            known = bright * left**2, model, dark, median
            guess = float(np.log(np.nanmedian((model / dark).max(axis=(1, 2)))))
            low, high = guess - np.log(_GAINS), guess + np.log(_GAINS)
            within = _excess(low, *known) < 0 < _excess(high, *known)
            gain = float(
                np.exp(brentq(_excess, low, high, args=known) if within else high)
            )
        return gain

    def common(
        self,
        centre: FloatArray,
        left: FloatArray,
        model: FloatArray,
        variance: FloatArray,
        radius: float,
    ) -> tuple[FloatArray, int]:
        """Return residuals without the part that all spots share, and its number of parameters."""
        x, y = np.moveaxis(self.away(centre), -1, 0) / radius
        square = x[:, None] ** 2 + y[:, :, None] ** 2
        flux = model.sum(axis=(1, 2), keepdims=True) / np.sqrt(variance) * self.seen
        basis = np.stack(
            [
                flux
                * np.exp(-square / (2 * one**2))
                * x[:, None] ** i
                * y[:, :, None] ** j
                for one in _SCALES
                for i, j in _POWERS
            ],
            axis=-1,
        )
        kept = np.isfinite(left).all(axis=(1, 2))
        rows = (left / np.sqrt(variance))[kept].ravel()
        shares = np.linalg.lstsq(basis[kept].reshape(len(rows), -1), rows)[0]
        return left - basis @ shares * np.sqrt(variance), len(shares)

    def away(self, centre: FloatArray) -> FloatArray:
        """Return the distances of columns and rows from the centres, (n, size, 2)."""
        steps = np.arange(self.light.shape[-1])
        return steps[:, None] - (centre - self.corners)[:, None]

    def variance(self, model: FloatArray, gain: float) -> FloatArray:
        """Return the variance of the pixels that count."""
        return (self.noise[:, None, None] ** 2 + model / gain) * self.seen

    def odd(self, left: FloatArray, gain: float) -> Mask:
        """Return which spots differ surely, and by more than others do, from the common shape."""
        model = self.model(left)
        variance = self.variance(model, gain)
        excess = (left**2 - variance).sum(axis=(1, 2))
        spread = np.sqrt(2 * (variance**2).sum(axis=(1, 2)))
        misfit = excess / (model**2).sum(axis=(1, 2))
        limit = min(_MISFIT, _UNUSUAL * max(float(np.nanmedian(misfit)), 0.0) + _SLIGHT)
        return np.asarray((misfit > limit) & (excess > _SURELY * spread))

    def shapes(self, radius: float, gain: float) -> tuple[FloatArray, float]:
        """Return `Found.shapes`, and the variance of the centres that noise does not explain.

        Moments have Gaussian weights about the fitted centre. Those of the fitted Gaussian are
        subtracted, so that effects of pixels and of the edge of the window cancel.
        """
        spots = self.spots(radius, gain)
        left = spots.residuals / gain
        model = self.model(left)
        x, y = np.moveaxis(self.away(spots.centre), -1, 0)
        square, wide = x[:, None] ** 2 + y[:, :, None] ** 2, (_WIDE * radius) ** 2
        offsets = []
        for squared in (radius**2, wide):  # narrow weights, then wide ones
            weight = np.exp(-square / (2 * squared))
            total, *moments = (
                [
                    np.einsum("nyx,nx,ny->n", weight * one, x**i, y**j)
                    for one in (model + left, model)
                ]
                for i, j in _POWERS
            )
            change = np.stack(
                [one / total[0] - two / total[1] for one, two in moments], axis=1
            )
            share = squared / (squared + radius**2)
            offsets.append(change[:, :2] / share)
        narrow, offset = offsets
        second = share * radius**2 * np.eye(2) + change[:, [[2, 3], [3, 4]]]
        second = np.linalg.inv(np.linalg.inv(second) - np.eye(2) / wide)
        known = (weight**2 * self.variance(model, gain) * square).sum(axis=(1, 2))
        known = known / (total[0] * share) ** 2 - np.trace(
            spots.covariance, axis1=1, axis2=2
        )
        apart = np.square(offset - np.median(offset, axis=0)).sum(axis=1)
        scatter = max(0.0, float(np.median(apart / _MEDIAN - known / 2)))
        return np.hstack(
            [offset - narrow, second.reshape(-1, 4)[:, [0, 1, 3]]]
        ), scatter


def _excess(
    log_gain: float,
    squares: FloatArray,
    model: FloatArray,
    dark: FloatArray,
    median: FloatArray,
) -> float:
    """Return the median of chi-square over its expected median, minus one."""
    chi_squares = (squares / (dark + model / np.exp(log_gain))).sum(axis=(1, 2))
    return float(np.nanmedian(chi_squares / median)) - 1


def _axes(shapes: FloatArray) -> dict[str, float]:
    """Return the elongation and the angle of the median spot."""
    if np.isnan(shapes).all():
        return {"elongation": np.nan, "angle": np.nan}
    _, _, xx, xy, yy = np.nanmedian(shapes, axis=0)
    short, long = np.linalg.eigvalsh([[xx, xy], [xy, yy]])
    angle = float(np.arctan2(2 * xy, xx - yy) / 2)
    return {"elongation": float(np.sqrt(long / short)), "angle": angle}


def shape_finding(
    source: FloatArray, target: FloatArray, matrix: ArrayLike = ((1, 0), (0, 1))
) -> tuple[Finding | None, FloatArray]:
    """Compare the shapes of the spots of two images.

    If the shapes differ, their centres are displaced by an unknown amount. Its standard deviation
    is twice the change of the asymmetry: for simulated stars with a tail, the displacement from
    the centre of gravity is 1.2 to 2.5 times that change.

    Parameters
    ----------
    source, target : ndarray, shape (n, 5), (m, 5)
        `Found.shapes` of both images, for example of the paired stars.
    matrix : array_like, shape (2, 2)
        Linear part of the transform from source to target.

    Returns
    -------
    finding : Finding or None
        Warning with the kind "shape", if the means differ significantly and by more than 5 % of
        the width.
    covariance : ndarray, shape (2, 2)
        Systematic covariance of the shift, in px^2 of the target; zero without a warning.

    Examples
    --------
    >>> round_spots = np.random.default_rng(1).normal((0, 0, 1, 0, 1), 0.01, (20, 5))
    >>> shape_finding(round_spots, round_spots)[0] is None
    True
    >>> finding, covariance = shape_finding(round_spots, round_spots + (0.5, 0, 1, 0, 0))
    >>> finding.kind, covariance.round(2)
    ('shape', array([[1., 0.],
           [0., 0.]]))
    """
    from scipy.stats import ttest_ind

    linear = np.asarray(matrix, dtype=np.float64)
    first, second = (one[np.isfinite(one).all(axis=1)] for one in (source, target))
    none = np.zeros((2, 2))
    if min(len(first), len(second)) < _COMPARED:
        return None, none
    moments = linear @ first[:, [2, 3, 3, 4]].reshape(-1, 2, 2) @ linear.T
    first = np.column_stack(
        [first[:, :2] @ linear.T, moments.reshape(-1, 4)[:, [0, 1, 3]]]
    )
    middle = [np.median(one, axis=0) for one in (first, second)]
    change = middle[1] - middle[0]
    systematic = _BEYOND * change[:2]
    widths = [float(np.sqrt((one[2] + one[4]) / 2)) for one in middle]
    chance = np.asarray(ttest_ind(first, second, equal_var=False, trim=_TRIMMED).pvalue)
    # Any offset counts, but moments only if the width changes.
    least = np.array([0, 0, 1, 1, 1]) * 2 * _DIFFERENT * widths[0] * widths[1]
    if not ((chance < _FALSE / chance.size) & (np.abs(change) > least)).any():
        return None, none
    axes = [_axes(one)["elongation"] for one in (first, second)]
    text = (
        f"the spots of the images differ in shape: width {widths[0]:.3g} and {widths[1]:.3g} px, "
        f"elongation {axes[0]:.3g} and {axes[1]:.3g}; their asymmetry displaces the shift by "
        f"about {np.hypot(*systematic):.2g} px. Use images of the same focus and tracking"
    )
    return Finding("shape", text), np.outer(systematic, systematic)


def _remarks(
    gain: float, background: FloatArray, noise: FloatArray
) -> tuple[Finding, ...]:
    """Return a warning if the gain is implausible, or contradicts the noise of the background."""
    low, high = _PLAUSIBLE
    brightest = np.argmax(background)
    photons = (background[brightest] - background.min()) / gain
    if low <= gain <= high and photons < _NOISIER * noise[brightest] ** 2:
        return ()
    text = (
        f"gain: expected {low:g} to {high:g} electrons per digital number, and photon noise of the "
        f"background below its noise, got {gain:.2g}; the standard deviations of bright stars are "
        "uncertain. Check whether the image was scaled, averaged or smoothed"
    )
    return (Finding("gain", text),)
