"""Finding the spots of a whole image, and measuring them with an honest covariance.

photutils finds the background, its noise, and the segments in which a spot is looked for; centres
are those of `spots`. Shapes, units and the radius of a spot are those of `spots`, but light is in
digital numbers, and the gain is found.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtri

from reproduce.physics.images.spots import IntArray, Mask, Spots, fitted_spots
from reproduce.physics.validate import FloatArray, positive

# A spot has so many touching pixels above the threshold, in standard deviations of the noise.
_TOUCHING, THRESHOLD = 3, 5.0
# A hot pixel exceeds so many deviations, and its neighbours have less than a share of its light.
_GLARING, _ALONE = 10.0, 0.1
# Side of the boxes in which the background is found; of a large image one pixel in so many.
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
    """What stands out of an image, the brightest first.

    Attributes
    ----------
    spots : Spots
        Light and residuals in electrons.
    reasons : ndarray of str, shape (n,)
        Why one is no star that can be measured; empty where it is.
    facts : dict of str to float
        Radius of all spots, in px, median background and noise, in digital numbers, and gain, in
        electrons per digital number: with it half of the spots fit better than the median of
        chi-square.
    hot : int
        How many pixels shine alone.
    """

    spots: Spots
    reasons: NDArray[np.str_]
    facts: dict[str, float]
    hot: int


def find_spots(
    image: FloatArray,
    full: Mask,
    threshold: float = THRESHOLD,
    step: float = 0.0,
    sigma: FloatArray | None = None,
) -> Found:
    """Find the spots of an image and measure them.

    Parameters
    ----------
    image : ndarray, shape (height, width)
        Digital numbers; NaN if a pixel is missing.
    full : ndarray of bool, shape (height, width)
        Pixels that are saturated.
    threshold : float
        What a spot must exceed, in standard deviations of the noise.
    step : float
        Between two digital numbers; next to nothing where they are not.
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
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # boxes without pixels, and segments without light
        level, noise = _background(image, step)
        noise = noise if sigma is None else sigma
        light = image - level
        hot = _hot(light, noise)
        light[hot] = np.nan
        places, guess = _segments(light, noise, threshold)
    # Not the very brightest: what is no star is among them.
    some = places[: max(_MEASURED, len(places) // 2)]
    some = some[:: max(1, len(some) // _MEASURED)]
    radius = _View(light, full, noise, some, guess).radius(guess)
    view = _View(light, full, noise, places, radius)
    # Without photon noise first: what scatters more under more light tells how much there is.
    better = view.dark_gain
    for _ in range(_FITS):
        gain, spots = better, view.spots(radius, better)
        better = view.gain(spots.residuals / gain)
    size, last = view.light.shape[-1], np.array(image.shape[::-1]) - 1 - radius
    reach = size // 2 + _TAIL * radius
    close: Any = KDTree(places).query_pairs(reach, np.inf, output_type="ndarray")
    reasons = {
        "saturated": view.full,
        "at the edge": ((places < radius) | (places > last)).any(axis=1),
        "another close by": np.isin(np.arange(len(places)), close),
        "not the shape of a spot": view.odd(spots.residuals / gain, gain),
        "no centre found": ~(np.abs(spots.centre - places).max(axis=1) < size / 2),
    }
    first = np.select(list(reasons.values()), list(reasons), default="")
    sky, noise = np.median(level[*places.T[::-1]]), np.median(view.noise)
    facts = {"radius": radius, "background": float(sky), "noise": float(noise), "gain": gain}
    return Found(spots, first, facts, int(hot.sum()))


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


def _hot(light: FloatArray, noise: FloatArray) -> Mask:
    """Say which pixels shine alone, as no spot does: their neighbours have next to no light."""
    from scipy.ndimage import maximum_filter

    around = np.ones((3, 3), bool)
    around[1, 1] = False
    beside = maximum_filter(np.nan_to_num(light), footprint=around)
    alone = beside < np.maximum(_ALONE * light, 3 * noise)
    return np.asarray(alone & (light > _GLARING * noise))


def _segments(light: FloatArray, noise: FloatArray, threshold: float) -> tuple[IntArray, float]:
    """Return the brightest pixels of what exceeds the noise, the most light first, and a radius."""
    from astropy.convolution import interpolate_replace_nans
    from photutils.segmentation import SourceCatalog, detect_sources

    if np.isnan(light).any():
        near = np.outer([1.0, 2.0, 1.0], [1.0, 2.0, 1.0])
        light = np.nan_to_num(interpolate_replace_nans(light, near))
    segments = detect_sources(light, threshold * noise, _TOUCHING)
    if segments is None:
        raise ValueError(f"expected stars, got nothing above {threshold:g} standard deviations")
    found = SourceCatalog(light, segments)
    order = np.argsort(-np.asarray(found.segment_flux), kind="stable")[:_MOST]
    places = np.stack([found.maxval_xindex, found.maxval_yindex], axis=-1)[order]
    radius = float(np.nanmedian(np.asarray(found.semimajor_axis)))
    return places, radius if radius > 0 else 1.0


class _View:
    """Windows in digital numbers, the pixels that count, noise, and which have a full pixel."""

    def __init__(
        self, light: FloatArray, full: Mask, noise: FloatArray, places: IntArray, radius: float
    ) -> None:
        """Look about places at what holds a spot of a radius."""
        size = 2 * int(np.clip(np.ceil(_HALF * radius), 2, 60)) + 1
        size = min(size, *(side - 1 + side % 2 for side in light.shape))
        self.corners = np.clip(places - size // 2, 0, np.array(light.shape[::-1]) - size)
        columns, rows = (self.corners[:, i, None] + np.arange(size) for i in (0, 1))
        at = rows[:, :, None], columns[:, None]
        self.seen = np.isfinite(light[at]) & ~full[at]
        self.light, self.full = np.where(self.seen, light[at], 0.0), full[at].any(axis=(1, 2))
        self.noise = noise[*places.T[::-1]]
        # With it photons make next to no noise.
        self.dark_gain = _GAINS / float(self.noise.min()) ** 2

    def spots(self, radius: float, gain: float) -> Spots:
        """Return the spots of a radius that fit best."""
        return fitted_spots(gain * self.light, self.corners, radius, gain * self.noise, self.seen)

    def radius(self, guess: float) -> float:
        """Return the radius that fits half of the spots best."""
        from scipy.optimize import minimize_scalar

        def misfit(radius: float) -> float:
            left = self.spots(radius, self.dark_gain).residuals / self.dark_gain
            share = (left**2).sum(axis=(1, 2)) / (self.light**2).sum(axis=(1, 2))
            return float(np.median(np.nan_to_num(share, nan=1.0)))

        bounds = (0.2, 3 * guess)
        return float(minimize_scalar(misfit, bounds=bounds, options={"xatol": 1e-3}).x)

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
