"""Spots of a whole image: detected by photutils, and measured with a covariance.

Noise is that of the image minus its background. Centres are those of `spots.fitted_spots`, whose
units apply here too. Images are in digital numbers, and the gain is estimated.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.polynomial.polynomial import polyvander2d
from numpy.typing import ArrayLike, NDArray

from reproduce.physics.images.spots import IntArray, fitted_spots
from reproduce.physics.validate import Finding, FloatArray, positive

# Touching pixels above the detection threshold, at least.
_MIN_PIXELS = 3
# A hot pixel exceeds 10 standard deviations, and its neighbours have less than 10 % of its flux.
_HOT_SIGMAS, _HOT_FRACTION = 10.0, 0.1
# Side of the boxes of the background, in px. Images whose sides are longer than 768 px are sampled
# at each third pixel.
_BOX_PX, _STRIDE, _LARGE_PX = 64, 3, 768
# Spots at most, the brightest; and spots that determine the radius and the gain.
_MAX_SPOTS, _MAX_TYPICAL = 20_000, 100
# Half side of a window, reach of the tail of a neighbour, and weights of moments, in radii.
_HALF_RADII, _TAIL_RADII, _WEIGHT_RADII = 3.0, 2.0, (1.0, 2.0)
# Misfit of the shape of a spot, as a fraction of its squared flux: at most, in medians of the
# image, and an allowance; and its significance in standard deviations.
_MAX_MISFIT, _MISFIT_MEDIANS, _MISFIT_OFFSET, _MISFIT_SIGMAS = 0.1, 4.0, 2e-3, 5.0
# Fits from which the gain is found; range of plausible gains, in electrons per digital number.
_GAIN_FITS, _MIN_GAIN, _MAX_GAIN = 4, 0.01, 1000.0
# Gain that makes photon noise negligible, over the inverse variance of the noise.
_DARK_GAIN = 1e6
# Degrees in x and y, and radii of the Gaussians, of the common shape of the spots.
_DEGREES, _SCALES = (2, 2), (0.5, 1.0, 2.0)
# Difference in width that matters, as a fraction; probability of a false warning.
_MIN_DIFFERENCE, _FALSE_WARNING = 0.05, 0.01
# Stars at least of each image, and the fraction of them that is trimmed from each end.
_MIN_STARS_COMPARED, _TRIMMED = 4, 0.2
# Systematic error of the shift, in changes of the asymmetry.
_ERROR_PER_ASYMMETRY = 2.0
_ODD = "not the shape of a spot"


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
        Why a spot cannot be measured; empty if it can.
    shapes : ndarray, shape (n, 3, 2)
        Asymmetry in x and y, in px, and the matrix of second moments, in px^2; NaN except for the
        brighter half of the measured spots. The asymmetry is the centre of gravity with weights
        of twice the radius of a spot minus that with weights of one radius.
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


def find_spots(
    image: NDArray[Any],
    threshold: float | None = None,
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
        Standard deviations of the pixels, in digital numbers. Default: from the background.
    saturation : float
        Digital number of saturated pixels.

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
    >>> find_spots(sky + light).centre.round(1)
    array([[30.2, 20.7]])
    """
    from scipy.spatial import KDTree

    limit = positive("threshold", 5.0 if threshold is None else threshold)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # boxes without pixels
        light, noise = _without_background(image)
        light[image >= saturation] = np.inf
        noise = noise if sigma is None else np.array(sigma, dtype=np.float32)
        _remove_hot_pixels(light, noise)
        noise *= limit
        places, guess = _detected(light, noise)
    at = tuple(places.T[::-1])
    deviations = noise[at] / limit
    del noise
    typical = slice(0, (len(places) + 1) // 2, len(places) // (2 * _MAX_TYPICAL) + 1)
    radius = _Windows(light, deviations[typical], places[typical], guess).radius(guess)
    gain = _Windows(light, deviations[typical], places[typical], radius).gain(radius)
    windows = _Windows(light, deviations, places, radius)
    fit, side = _Fit(windows, radius, gain), windows.light.shape[-1]
    last = np.array(image.shape[::-1]) - 1 - radius
    reach: Any = side // 2 + _TAIL_RADII * radius
    close = KDTree(places).query_pairs(reach, np.inf, output_type="ndarray")
    checks = {
        "saturated": windows.saturated,
        "at the edge": ((places < radius) | (places > last)).any(axis=1),
        "another close by": np.isin(np.arange(len(places)), close),
        _ODD: fit.has_odd_shape(),
        "no centre found": ~(np.abs(fit.centre - places).max(axis=1) < side / 2),
    }
    reasons = np.select(list(checks.values()), list(checks), default="")
    flux = np.where(np.isin(reasons, ["", _ODD]), fit.flux, -np.inf)
    faint = np.argsort(-flux)[(np.isfinite(flux).sum() + 1) // 2 :]
    shapes = fit.shapes()
    shapes[faint] = np.nan
    facts = {
        "threshold": float(limit),
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
        fit.centre, fit.covariance, fit.flux, reasons, shapes, facts, findings
    )


def _without_background(image: NDArray[Any]) -> tuple[NDArray[Any], NDArray[Any]]:
    """Return the image minus its background, and the noise of each pixel.

    The noise is that of the image minus a first background: a slope within a box is no noise.
    """
    from photutils.background import Background2D, BiweightScaleBackgroundRMS
    from scipy.ndimage import median_filter, zoom

    stride = _STRIDE if min(image.shape) > _LARGE_PX else 1
    sample = image[::stride, ::stride].astype(np.float64)
    values = np.unique(sample[np.isfinite(sample)])
    light = (image - float(np.median(values))).astype(np.float32, copy=False)
    boxes = -(-np.array(sample.shape) // -(-np.array(image.shape) // _BOX_PX))

    def enlarged(mesh: FloatArray) -> NDArray[Any]:
        # The median of neighbours continues a slope beyond the boxes at the edge.
        wide = np.pad(mesh, 2, mode="reflect", reflect_type="odd").astype(np.float32)
        wide = median_filter(wide, 3)[1:-1, 1:-1]
        y, x = sides = stride * boxes
        full = zoom(wide, sides, order=1, mode="nearest", grid_mode=True)
        return full[y : y + len(image), x : x + len(image.T)]

    for _ in range(2):
        rest = light[::stride, ::stride]
        found = Background2D(
            rest,
            tuple(boxes),
            mask=np.isnan(rest),
            exclude_percentile=90.0,
            filter_size=1,
            bkg_rms_estimator=BiweightScaleBackgroundRMS(),
        )
        light -= enlarged(found.background_mesh)
    # Rounding to whole numbers is noise, too. The last term is for images without noise.
    rounding = float(np.diff(values).min()) / np.sqrt(12)
    noise = np.maximum(found.background_rms_mesh, rounding)
    least = 0.0 if noise.all() else 1e-3 * float(np.nanmax(rest))
    return light, enlarged(np.maximum(noise, least))


def _remove_hot_pixels(light: NDArray[Any], noise: NDArray[Any]) -> None:
    """Set bright pixels to NaN if their neighbours have almost no flux."""
    from scipy.ndimage import maximum_filter

    ring = np.arange(9).reshape(3, 3) != 4
    bright = np.nonzero(light > _HOT_SIGMAS * noise)
    beside = maximum_filter(light, footprint=ring)[bright]
    faint = np.maximum(_HOT_FRACTION * light[bright], 3 * noise[bright])
    light[bright] = np.where(beside < faint, np.nan, light[bright])


def _detected(light: NDArray[Any], limit: NDArray[Any]) -> tuple[IntArray, float]:
    """Return the brightest pixels of the spots, the most flux first, and a radius."""
    from photutils.segmentation import SourceCatalog, detect_sources

    segments = detect_sources(light, limit, _MIN_PIXELS)
    if segments is None:
        raise ValueError(
            "threshold: expected stars above the noise, got none. Lower the threshold, or check "
            "the image"
        )
    catalogue = SourceCatalog(light, segments)
    flux = catalogue.segment_flux
    order = np.argsort(-flux, kind="stable")[: min(_MAX_SPOTS, np.isfinite(flux).sum())]
    # A Gaussian has 2 pi radius^2 times the flux of its brightest pixel.
    ratio = np.median((flux / catalogue.max_value)[order])
    places = np.stack([catalogue.max_value_xindex, catalogue.max_value_yindex], axis=-1)
    return places[order].astype(np.int64), float(np.sqrt(ratio / (2 * np.pi)))


class _Windows:
    """Windows around spots and their noise, in digital numbers, without saturated pixels."""

    def __init__(
        self, light: NDArray[Any], noise: FloatArray, places: IntArray, radius: float
    ) -> None:
        """Cut the windows at `places` that contain a spot of a radius."""
        size = 2 * int(np.clip(np.ceil(_HALF_RADII * radius), 2, 60)) + 1
        size = min(size, *(side - 1 + side % 2 for side in light.shape))
        last = np.array(light.shape[::-1]) - size
        self.corners = np.clip(places - size // 2, 0, last)
        x, y = (self.corners[:, axis, None] + np.arange(size) for axis in (0, 1))
        pixels = light[y[:, :, None], x[:, None]].astype(np.float64)
        self.saturated = np.isinf(pixels).any(axis=(1, 2))
        self.light = np.where(np.isfinite(pixels), pixels, np.nan)
        self.noise = noise.astype(np.float64)
        self.dark_gain = _DARK_GAIN / float(self.noise.min()) ** 2

    def radius(self, guess: float) -> float:
        """Return the radius that fits half of the spots best."""
        from scipy.optimize import minimize_scalar

        flux = np.nansum(self.light**2, axis=(1, 2))

        def misfit(radius: float) -> float:
            left = _Fit(self, radius, self.dark_gain).left
            part = np.nansum(left**2, axis=(1, 2)) / flux
            return float(np.median(np.where(part > 0, part, 1.0)))

        bounds = (0.2, 3 * guess)
        return float(minimize_scalar(misfit, bounds=bounds, options={"xatol": 1e-3}).x)

    def gain(self, radius: float) -> float:
        """Return electrons per digital number that explain the residuals of half of the spots.

        The residuals are those of the common shape, which need not be a Gaussian. Pixels count if
        their flux exceeds the noise. Blended spots do not change the median.
        """
        gain, dark = self.dark_gain, self.noise[:, None, None] ** 2
        for _ in range(_GAIN_FITS):
            fit = _Fit(self, radius, gain)
            left, terms = fit.without_common_shape()
            bright = fit.model**2 > dark
            freedom = 1 - (terms + 3 * len(left)) / max(bright.sum(), 1)
            photons, flux = (
                np.sum(one, axis=(1, 2), where=bright)
                for one in (left**2 / max(freedom, 0.1) - dark, fit.model)
            )
            slopes = photons[flux > 0] / flux[flux > 0]
            slope = float(np.median(slopes)) if len(slopes) else 0.0
            gain = 1 / max(slope, 1 / self.dark_gain)
        return gain


class _Fit:
    """Spots of a radius that fit windows best, in digital numbers."""

    def __init__(self, windows: _Windows, radius: float, gain: float) -> None:
        spots = fitted_spots(
            gain * windows.light, windows.corners, radius, gain * windows.noise
        )
        self.centre, self.covariance = spots.centre, spots.covariance
        self.flux, self.left = spots.light / gain, spots.residuals / gain
        self.model = np.maximum(windows.light - self.left, 0.0)
        self.variance = windows.noise[:, None, None] ** 2 + self.model / gain
        self.radius = radius
        offsets = spots.centre - windows.corners
        steps = np.arange(self.left.shape[-1])
        # In radii, from the centre.
        self.x = (steps - offsets[:, None, None, 0]) / radius + 0 * self.left
        self.y = (steps[:, None] - offsets[:, None, None, 1]) / radius + 0 * self.left

    def weight(self, width: float) -> FloatArray:
        """Return a Gaussian around the centre, whose width is in radii."""
        return np.exp(-(self.x**2 + self.y**2) / (2 * width**2))

    def without_common_shape(self) -> tuple[FloatArray, int]:
        """Return residuals without the part that all spots share, and its number of terms."""
        kept, sigma = np.isfinite(self.left), np.sqrt(self.variance)
        flux = self.flux[:, None, None] / sigma
        powers = polyvander2d(self.x[kept], self.y[kept], _DEGREES)
        basis = np.hstack(
            [powers * (flux * self.weight(scale))[kept][:, None] for scale in _SCALES]
        )
        terms = np.linalg.lstsq(basis, (self.left / sigma)[kept])[0]
        left = self.left.copy()
        left[kept] -= basis @ terms * sigma[kept]
        return left, len(terms)

    def has_odd_shape(self) -> NDArray[np.bool_]:
        """Return which spots differ surely, and by more than others do, from a Gaussian."""
        excess, spread, flux = (
            np.nansum(one, axis=(1, 2))
            for one in (
                self.left**2 - self.variance,
                2 * self.variance**2,
                self.model**2,
            )
        )
        misfit = excess / np.maximum(flux, np.finfo(float).tiny)
        limit = _MISFIT_MEDIANS * max(float(np.median(misfit)), 0.0) + _MISFIT_OFFSET
        surely = excess > _MISFIT_SIGMAS * np.sqrt(spread)
        return np.asarray((misfit > min(limit, _MAX_MISFIT)) & surely)

    def shapes(self) -> FloatArray:
        """Return `Found.shapes` of all spots.

        Moments have Gaussian weights about the fitted centre. Those of the fitted Gaussian are
        subtracted, so that effects of pixels and of the edge of the window cancel.
        """
        axes, offsets = (self.x, self.y), []
        for width in _WEIGHT_RADII:
            weight, fraction = self.weight(width), width**2 / (width**2 + 1)
            total = np.nansum(weight * (self.model + self.left), axis=(1, 2))
            part = np.nan_to_num(weight * self.left / total[:, None, None])
            first = np.array([(part * one).sum(axis=(1, 2)) for one in axes])
            offsets.append(first.T / fraction)
        second = np.array(
            [[(part * a * b).sum(axis=(1, 2)) for a in axes] for b in axes]
        )
        expected = fraction * (1 - part.sum(axis=(1, 2)))
        second = second.T + expected[:, None, None] * np.eye(2)
        second = np.linalg.inv(np.linalg.inv(second) - np.eye(2) / width**2)
        asymmetry = (offsets[1] - offsets[0])[:, None]
        return np.hstack([asymmetry * self.radius, second * self.radius**2])


def shape_finding(
    source: FloatArray, target: FloatArray, matrix: ArrayLike = ((1, 0), (0, 1))
) -> tuple[Finding | None, FloatArray]:
    """Compare the shapes of the spots of two images.

    If the shapes differ, their centres are displaced by an unknown amount. Its standard deviation
    is twice the change of the asymmetry: for simulated stars with a tail, the displacement from
    the centre of gravity is 1.2 to 2.5 times that change.

    Parameters
    ----------
    source, target : ndarray, shape (n, 3, 2), (m, 3, 2)
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
    >>> same = np.random.default_rng(1).normal([[0, 0], [1, 0], [0, 1]], 0.01, (20, 3, 2))
    >>> shape_finding(same, same)[0] is None
    True
    >>> finding, covariance = shape_finding(same, same + [[0.5, 0], [1, 0], [0, 0]])
    >>> finding.kind, covariance.round(2)
    ('shape', array([[1., 0.],
           [0., 0.]]))
    """
    from scipy.stats import ttest_ind

    linear = np.asarray(matrix, dtype=np.float64)
    first, second = (one[np.isfinite(one).all(axis=(1, 2))] for one in (source, target))
    if min(len(first), len(second)) < _MIN_STARS_COMPARED:
        return None, np.zeros((2, 2))
    first = first @ linear.T
    first[:, 1:] = linear @ first[:, 1:]
    middles = [np.median(one, axis=0) for one in (first, second)]
    change = middles[1] - middles[0]
    axes = [np.sqrt(np.diagonal(one[1:])) for one in middles]
    # Any asymmetry counts, but moments only if the width changes.
    least = (
        2
        * _MIN_DIFFERENCE
        * float(np.mean(np.square(axes)))
        * np.array([[0], [1], [1]])
    )
    test = ttest_ind(first, second, equal_var=False, trim=_TRIMMED)
    differs = np.asarray(test.pvalue) < _FALSE_WARNING / change.size
    if not (differs & (np.abs(change) > least)).any():
        return None, np.zeros((2, 2))
    systematic = _ERROR_PER_ASYMMETRY * change[0]
    widths = " and ".join(f"{x:.3g} x {y:.3g} px" for x, y in axes)
    text = (
        f"the spots of the images differ in shape: radii along x and y {widths}; their asymmetry "
        f"displaces the shift by about {np.hypot(*systematic):.2g} px. Use images of the same "
        "focus and tracking"
    )
    return Finding("shape", text), np.outer(systematic, systematic)
