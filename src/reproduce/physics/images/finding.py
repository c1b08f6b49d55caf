"""Spots of a whole image: detected by photutils, and measured with a covariance.

Noise is that of the image minus its background. Centres are those of `spots.fitted_spots`, whose
units apply here too. Images are in digital numbers, and the gain is estimated.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.polynomial.polynomial import polyvander2d
from numpy.typing import ArrayLike, NDArray

from reproduce.physics.images.spots import fitted_spots
from reproduce.physics.validate import (
    BoolArray,
    Finding,
    FloatArray,
    IntArray,
    Size,
    checked,
)

Pixels = NDArray[Any]

# Touching pixels above the detection threshold, at least.
_MIN_PIXELS = 3
# A hot pixel exceeds 10 standard deviations, and its neighbours have less than 10 % of its flux.
_HOT_SIGMAS, _HOT_FRACTION = 10.0, 0.1
# Side of the boxes of the background, in px. Images whose sides are longer than 768 px are sampled
# at each third pixel.
_BOX_PX, _STRIDE, _LARGE_PX = 64, 3, 768
# Percentile of normal numbers that is a standard deviation above their median.
_SIGMA_PERCENT = 84.13
# Spots at most, the brightest; and spots that determine the radius and the gain.
_MAX_SPOTS, _MAX_TYPICAL = 20_000, 100
# Half side of a window, reach of the tail of a neighbour, and weights of moments, in radii.
_HALF_RADII, _TAIL_RADII, _WEIGHT_RADII = 3.0, 2.0, 2.0
# Half side of a window, in px, at least and at most.
_MIN_HALF_PX, _MAX_HALF_PX = 2, 60
# Percentile of the noise in a window that contains no photon noise of its spot.
_DARK_PERCENT = 10.0
# Misfit of the shape of a spot, as a fraction of its squared flux: at most, in medians of the
# image, and an allowance; and its significance in standard deviations.
_MAX_MISFIT, _MISFIT_MEDIANS, _MISFIT_OFFSET, _MISFIT_SIGMAS = 0.1, 4.0, 2e-3, 5.0
# Fits from which the gain is found; range of plausible gains, in electrons per digital number.
_GAIN_FITS, _MIN_GAIN, _MAX_GAIN = 4, 0.01, 1000.0
# Least degrees of freedom of a spot: for fewer, the median of chi-square is not approximated well.
_MIN_FREEDOM = 0.7
# Least part of the noise of bright pixels that a common shape of the spots leaves over.
_MIN_SHARE = 0.25
# Smallest photon noise of the brightest pixel, as a variance over that of the noise.
_MIN_PHOTON_NOISE = 1e-2
# Degrees in x and y, and radii of the Gaussians, of the common shape of the spots.
_DEGREES, _SCALES = (2, 2), (0.5, 1.0, 2.0)
# Differences of size and axes that matter, as fractions of the squared width: 5 % and 1 % of the
# width; probability of a false warning.
_MIN_DIFFERENCES, _FALSE_WARNING = np.array([0.1, 0.02, 0.02]), 0.01
# Half the sum and difference of the moments along x and y, and the mixed moment, of a flat matrix.
_AXES = np.array([[1, 0, 0, 1], [1, 0, 0, -1], [0, 1, 1, 0]]) / 2
# Stars at least of each image, and the fraction of them that is trimmed from each end.
_MIN_STARS_COMPARED, _TRIMMED = 4, 0.2


@dataclass(frozen=True, eq=False)
class Detections:
    """Spots of an image, the brightest first.

    Attributes
    ----------
    centre : ndarray, shape (n, 2)
        Centres, in px.
    covariance : ndarray, shape (n, 2, 2)
        Covariance of the centres, in px^2.
    flux : ndarray, shape (n,)
        Flux, in digital numbers.
    reasons : ndarray of str, shape (n,)
        Reason why a spot cannot be measured; empty if it can.
    shapes : ndarray, shape (n, 2, 2)
        Matrix of second moments, in px^2; NaN without a centre.
    facts : dict of str to float
        ``radius`` of all spots, in px; median ``background`` and ``noise``, in digital numbers;
        ``gain``, in electrons per digital number; numbers of ``missing`` and ``saturated`` pixels;
        ``threshold``, in standard deviations of the noise.
    findings : tuple of Finding
        Warning with the kind "gain" if the gain is implausible.
    """

    centre: FloatArray
    covariance: FloatArray
    flux: FloatArray
    reasons: NDArray[np.str_]
    shapes: FloatArray
    facts: dict[str, float]
    findings: tuple[Finding, ...]


@checked
def find_spots(
    image: Pixels,
    threshold: Size = None,
    sigma: ArrayLike | None = None,
    saturation: float = np.inf,
) -> Detections:
    """Find the spots of an image and measure them.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Digital numbers; NaN if a pixel is missing.
    threshold : float, optional
        Detection limit, in standard deviations of the noise. Default: 5.
    sigma : array_like, shape (height, width), optional
        Standard deviations of the pixels with their photon noise, in digital numbers. Default: from
        the background.
    saturation : float
        Digital number of saturated pixels.

    Returns
    -------
    Detections
        Centres, fluxes and shapes.

    Raises
    ------
    ValueError
        If nothing exceeds the threshold.

    Examples
    --------
    >>> y, x = np.indices((64, 64))
    >>> light = 500 * np.exp(-((x - 30.2) ** 2 + (y - 20.7) ** 2) / 4)
    >>> sky = np.random.default_rng(1).normal(100, 1, light.shape)
    >>> find_spots(sky + light).centre.round(1)
    array([[30.2, 20.7]])
    """
    from scipy.spatial import KDTree

    limit = threshold or 5.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # boxes without pixels
        light, noise = _without_background(image)
        light[image >= saturation] = np.inf
        noise = noise if sigma is None else np.array(sigma, dtype=np.float32)
        _remove_hot_pixels(light, noise)
        noise *= limit
        peaks, guess = _detected(light, noise)
    # The photon noise of a spot follows from the gain.
    around, _ = _windows(noise, peaks, guess)
    deviations = np.percentile(around, _DARK_PERCENT, axis=(1, 2)) / limit
    del noise, around
    at = tuple(peaks.T[::-1])
    typical = slice(0, (len(peaks) + 1) // 2, len(peaks) // (2 * _MAX_TYPICAL) + 1)
    fitted = partial(_SpotFit, light, deviations[typical], peaks[typical])
    radius = _best_radius(fitted, guess)
    gain = _best_gain(fitted, radius)
    fit = _SpotFit(light, deviations, peaks, radius, radius, gain)
    side = fit.left.shape[-1]
    last = np.array(image.shape[::-1]) - 1 - radius
    distances = np.asarray(KDTree(peaks).query(peaks, 2, p=np.inf)[0])
    checks = {
        "saturated": fit.is_saturated,
        "at the edge": ((peaks < radius) | (peaks > last)).any(axis=1),
        "another close by": distances[:, 1] < side // 2 + _TAIL_RADII * radius,
        "not the shape of a spot": fit.has_odd_shape(),
        "no centre found": ~(np.abs(fit.centre - peaks).max(axis=1) < side / 2),
    }
    reasons = np.select(list(checks.values()), list(checks), default="")
    facts = {
        "threshold": limit,
        "radius": radius,
        "background": float(np.nanmedian(image[at] - light[at])),
        "noise": float(np.median(deviations)),
        "gain": gain,
        "missing": float(np.isnan(image).sum()),
        "saturated": float((image >= saturation).sum()),
    }
    text = (
        f"gain: expected {_MIN_GAIN:g} to {_MAX_GAIN:g} electrons per digital number, got "
        f"{gain:.2g}; the standard deviations of bright stars are uncertain. Check whether the "
        "image was scaled, averaged or smoothed"
    )
    findings = () if _MIN_GAIN <= gain <= _MAX_GAIN else (Finding("gain", text),)
    return Detections(
        fit.centre, fit.covariance, fit.flux, reasons, fit.moments(), facts, findings
    )


def _without_background(image: Pixels) -> tuple[Pixels, Pixels]:
    """Return the image minus its background, and the noise of each pixel.

    The noise is that of the image minus a first background: a slope within a box is no noise.
    """
    from photutils.background import Background2D
    from scipy.ndimage import median_filter, zoom

    stride = _STRIDE if min(image.shape) > _LARGE_PX else 1
    subset = image[::stride, ::stride].astype(np.float64)
    values = np.unique(subset[np.isfinite(subset)])
    light = (image - float(np.median(values))).astype(np.float32, copy=False)
    boxes = -(-np.array(subset.shape) // -(-np.array(image.shape) // _BOX_PX))

    def enlarged(mesh: FloatArray) -> Pixels:
        # The median of neighbours continues a slope beyond the boxes at the edge.
        wide = np.pad(mesh, 2, mode="reflect", reflect_type="odd").astype(np.float32)
        wide = median_filter(wide, 3)[1:-1, 1:-1]
        y, x = sides = stride * boxes
        full = zoom(wide, sides, order=1, mode="nearest", grid_mode=True)
        return full[y : y + len(image), x : x + len(image.T)]

    for _ in range(2):
        thinned_light = light[::stride, ::stride]
        background = Background2D(
            thinned_light,
            tuple(boxes),
            mask=np.isnan(thinned_light),
            exclude_percentile=90.0,
            filter_size=1,
        )
        light -= enlarged(background.background_mesh)
    # Rounding to whole numbers is noise, too.
    rounding = float(np.diff(values).min()) / np.sqrt(12)
    noise = np.maximum(background.background_rms_mesh, rounding)
    if np.mean(subset == values[0]) > 0.5:  # numbers below the sky are clipped
        noise = np.maximum(noise, np.nanpercentile(thinned_light, _SIGMA_PERCENT))
    peak = float(np.nanmax(thinned_light))
    if noise.min() <= np.finfo(float).eps * peak:  # an image without noise
        noise = np.maximum(noise, 1e-3 * peak)
    # A slope that continues beyond the edge may end below zero.
    return light, np.maximum(enlarged(noise), noise.min(), dtype=np.float32)


def _remove_hot_pixels(light: Pixels, noise: Pixels) -> None:
    """Set dead pixels, and bright pixels whose neighbours have almost no flux, to NaN."""
    from scipy.ndimage import maximum_filter

    ring = np.arange(9).reshape(3, 3) != 4
    bright = np.nonzero(light > _HOT_SIGMAS * noise)
    beside = maximum_filter(light, footprint=ring)[bright]
    faint = np.maximum(_HOT_FRACTION * light[bright], 3 * noise[bright])
    light[bright] = np.where(beside < faint, np.nan, light[bright])
    light[light < -_HOT_SIGMAS * noise] = np.nan


def _detected(light: Pixels, limit: Pixels) -> tuple[IntArray, float]:
    """Return the brightest pixels of the spots, the most flux first, and a radius."""
    from photutils.segmentation import SourceCatalog, detect_sources

    segments = detect_sources(light, limit, _MIN_PIXELS)
    catalogue = segments and SourceCatalog(light, segments)
    if not catalogue or not np.isfinite(flux := catalogue.segment_flux).any():
        raise ValueError(
            "threshold: expected stars above the noise that are not saturated, got none. Lower "
            "the threshold, or check the image"
        )
    order = np.argsort(-flux, kind="stable")[: min(_MAX_SPOTS, np.isfinite(flux).sum())]
    # A Gaussian has 2 pi radius^2 times the flux of its brightest pixel.
    ratio = np.median((flux / catalogue.max_value)[order])
    peaks = np.stack([catalogue.max_value_xindex, catalogue.max_value_yindex], axis=-1)
    return peaks[order].astype(np.int64), float(np.sqrt(ratio / (2 * np.pi)))


def _windows(image: Pixels, peaks: IntArray, reach: float) -> tuple[Pixels, IntArray]:
    """Return windows of spots of the radius `reach`, and their first pixels."""
    half = np.clip(np.ceil(_HALF_RADII * reach), _MIN_HALF_PX, _MAX_HALF_PX)
    size = min(2 * int(half) + 1, *(s - 1 + s % 2 for s in image.shape))
    corners = np.clip(peaks - size // 2, 0, np.array(image.shape[::-1]) - size)
    x, y = corners.T
    return sliding_window_view(image, (size, size))[y, x], corners


class _SpotFit:
    """Spots of a radius that fit windows around detections best, in digital numbers."""

    def __init__(
        self,
        light: Pixels,
        noise: FloatArray,
        peaks: IntArray,
        reach: float,
        radius: float,
        gain: float = 0.0,
    ) -> None:
        """Fit windows that contain spots of the radius `reach`, without photon noise by default."""
        windows, corners = _windows(light, peaks, reach)
        pixels = windows.astype(np.float64)
        self.is_saturated = np.isinf(pixels).any(axis=(1, 2))
        pixels[~np.isfinite(pixels)] = np.nan
        # Photon noise is negligible for this gain, in any unit of the image.
        dark = _MIN_PHOTON_NOISE * float(noise.min()) ** 2
        self.largest_gain = float(np.nanmax(pixels)) / dark
        gain = gain or self.largest_gain
        spots = fitted_spots(gain * pixels, corners, radius, gain * noise)
        self.centre, self.covariance = spots.centre, spots.covariance
        self.flux, self.left = spots.light / gain, spots.residuals / gain
        self.pixels, self.model = pixels, np.maximum(pixels - self.left, 0)
        self.dark = np.square(noise, dtype=np.float64)[:, None, None]
        self.variance = self.dark + self.model / gain
        self.radius = radius
        # In radii, from the centre.
        first = (corners - self.centre).T[::-1, :, None, None]
        self.y, self.x = (first + np.indices(pixels.shape[1:])[:, None]) / radius

    def weight(self, width: float) -> FloatArray:
        """Return a Gaussian around the centre, whose width is in radii."""
        return np.exp(-(self.x**2 + self.y**2) / (2 * width**2))

    def without_common_shape(self) -> tuple[FloatArray, int]:
        """Return residuals without the part that all spots share, and its number of terms."""
        seen, sigma = np.isfinite(self.left), np.sqrt(self.variance)
        flux = self.flux[:, None, None] / sigma
        powers = polyvander2d(self.x[seen], self.y[seen], _DEGREES)
        basis = np.hstack(
            [powers * (flux * self.weight(scale))[seen][:, None] for scale in _SCALES]
        )
        # The normal equations are small: spots have thousands of pixels.
        pull = basis.T @ (self.left / sigma)[seen]
        terms = np.linalg.lstsq(basis.T @ basis, pull)[0]
        left = self.left.copy()
        left[seen] -= basis @ terms * sigma[seen]
        return left, len(terms)

    def has_odd_shape(self) -> BoolArray:
        """Return whether a spot differs significantly, and more than others, from a Gaussian."""
        parts = self.left**2 - self.variance, 2 * self.variance**2, self.model**2
        excess, spread, flux = (np.nansum(part, axis=(1, 2)) for part in parts)
        misfit = excess / np.maximum(flux, np.finfo(float).tiny)
        limit = _MISFIT_MEDIANS * max(np.median(misfit), 0.0) + _MISFIT_OFFSET
        significant = excess > _MISFIT_SIGMAS * np.sqrt(spread)
        return (misfit > min(limit, _MAX_MISFIT)) & significant

    def leverage(self) -> FloatArray:
        """Return the part of the noise of each pixel that the fit of centre and flux absorbs."""
        shape = self.model / np.sqrt(self.variance)
        columns = np.nan_to_num(np.stack([shape, shape * self.x, shape * self.y]))
        inverse = np.linalg.pinv(np.einsum("anyx,bnyx->nab", columns, columns))
        return np.einsum("anyx,nab,bnyx->nyx", columns, inverse, columns)

    def moments(self) -> FloatArray:
        """Return `Detections.shapes` of all spots.

        Moments have Gaussian weights about the fitted centre. Those of the fitted Gaussian are
        subtracted, so that effects of pixels and of the edge of the window cancel.
        """
        weight, square = self.weight(_WEIGHT_RADII), _WEIGHT_RADII**2
        total = np.nansum(weight * self.pixels, axis=(1, 2), keepdims=True)
        part = np.nan_to_num(weight * self.left / total)
        offsets = np.stack([self.x, self.y])
        second = np.einsum("nyx,anyx,bnyx->nab", part, offsets, offsets)
        remainder = square / (square + 1) * (1 - part.sum(axis=(1, 2)))
        second += remainder[:, None, None] * np.eye(2)
        moments = np.linalg.inv(np.linalg.inv(second) - np.eye(2) / square)
        return np.asarray(moments * self.radius**2)


def _best_radius(fitted: partial[_SpotFit], guess: float) -> float:
    """Return the radius that fits half of the spots best."""
    from scipy.optimize import minimize_scalar

    def misfit(radius: float) -> float:
        fit = fitted(guess, radius)
        flux = np.nansum(fit.pixels**2, axis=(1, 2))
        part = np.nansum(fit.left**2, axis=(1, 2)) / flux
        return float(np.median(np.where(part > 0, part, 1.0)))

    bounds = (0.2, 3 * guess)
    return float(minimize_scalar(misfit, bounds=bounds, options={"xatol": 1e-3}).x)


def _best_gain(fitted: partial[_SpotFit], radius: float) -> float:
    """Return electrons per digital number that explain the residuals of half of the spots.

    The residuals are those of the common shape, which need not be a Gaussian. Pixels count if
    their flux exceeds the noise, and spots if they are not blended.
    """
    gain = 0.0
    for _ in range(_GAIN_FITS):
        fit = fitted(radius, radius, gain)
        odd = fit.has_odd_shape()
        # If most spots are odd, for example trailed, they show the common shape.
        fit.left[odd & (odd.mean() < 0.5)] = np.nan
        left, terms = fit.without_common_shape()
        bright = (fit.model**2 > fit.dark) & np.isfinite(left)
        share = 1 - terms / max(bright.sum(), 1)
        if share < _MIN_SHARE:  # few pixels do not determine the common shape
            left, share = fit.left, 1.0
        free = share * (1 - fit.leverage())
        photons, flux, squares = (
            np.sum(values, axis=(1, 2), where=bright)
            for values in (
                left**2 - fit.dark * free,
                fit.model * free,
                fit.model**2 * free,
            )
        )
        seen = flux > 0
        # The median of a sum of squares is below its mean (Wilson and Hilferty).
        freedom = np.maximum(flux[seen] ** 2 / squares[seen], _MIN_FREEDOM)
        slopes = photons[seen] / flux[seen] / (1 - 2 / (9 * freedom)) ** 3
        slope = float(np.median(slopes)) if len(slopes) else 0.0
        gain = 1 / max(slope, 1 / fit.largest_gain)
    return gain


def shape_finding(
    source: FloatArray, target: FloatArray, matrix: FloatArray
) -> tuple[list[Finding], FloatArray]:
    """Compare the shapes of the spots of two images.

    If the shapes differ in a direction, for example in a trailed image, the flux along the trail
    may be uneven, and the centres are displaced by an unknown amount. Its standard deviation is the
    root of the added second moment, which is the displacement by an exponential tail.

    Parameters
    ----------
    source, target : ndarray, shape (n, 2, 2), (m, 2, 2)
        `Detections.shapes` of both images, for example of the paired stars.
    matrix : ndarray, shape (2, 2)
        Linear part of the transform from source to target.

    Returns
    -------
    findings : list of Finding
        Warning with the kind "shape", if the sizes differ significantly and by more than 5 % of the
        width, or the axes by more than 1 %.
    covariance : ndarray, shape (2, 2)
        Systematic covariance of the shift, in px^2 of the target; zero without a warning.

    Examples
    --------
    >>> same = np.eye(2) + np.random.default_rng(1).normal(0, 0.01, (20, 2, 2))
    >>> shape_finding(same, same, np.eye(2))[0]
    []
    >>> (finding,), error = shape_finding(same, same + [[3, 0], [0, 0]], np.eye(2))
    >>> finding.kind, error.round(2) + 0.0
    ('shape', array([[3., 0.],
           [0., 0.]]))
    """
    from scipy.stats import ttest_ind

    error = np.zeros((2, 2))
    first, second = (m[np.isfinite(m).all(axis=(1, 2))] for m in (source, target))
    if min(len(first), len(second)) < _MIN_STARS_COMPARED:
        return [], error
    parts = [_AXES @ m.reshape(-1, 4).T for m in (matrix @ first @ matrix.T, second)]
    before, after = (np.median(part, axis=1) for part in parts)
    change, size = after - before, (before + after)[0] / 2
    test = ttest_ind(*parts, axis=1, equal_var=False, trim=_TRIMMED)
    differs = test.pvalue < _FALSE_WARNING / change.size
    differs &= np.abs(change) > _MIN_DIFFERENCES * size
    if not differs.any():
        return [], error
    radii = " and ".join(f"{np.sqrt(mean[0]):.3g}" for mean in (before, after))
    text = f"the spots of the images differ in shape, with radii of {radii} px"
    # Defocus is equal in all directions and displaces no centre.
    if differs[1:].any():
        # The direction of a complex number turns twice as fast as the trail of the wider image.
        trail = np.sqrt(2 * np.sign(change[0]) * complex(*change[1:]))
        axis = [trail.real, trail.imag]
        error = np.outer(axis, axis)
        text += f"; a trail would displace the shift by about {abs(trail):.2g} px"
    finding = Finding("shape", f"{text}. Use images of the same focus and tracking")
    return [finding], error
