"""Faults in the spots of fiducial lights, each with its remedy.

Spots have shape (frames, n, 2), in px, and are NaN if lost. Group 0 is the zero point, group 1 the
present. Lights and images are counted from one. Spots without a fault and with white noise cause
a finding in about 1/1000 of all data sets.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import chain, combinations

import numpy as np
from scipy.special import fdtrc, fdtri, ndtri

from reproduce.physics.attitude.monitoring import _correlation
from reproduce.physics.attitude.platform import (
    Platform,
    _check_distinct,
    emitted_directions,
    received_spots,
)
from reproduce.physics.attitude.rotations import attitude
from reproduce.physics.validate import (
    DegenerateGeometryError,
    Finding,
    FloatArray,
    Images,
    IntArray,
)

# Probability that a test finds a fault where there is none. Five tests share 1e-3: of two patterns,
# of the correlation of spots and of angles, and of the noise of both groups.
_FALSE_ALARM = 1e-3 / 5
# Probability, of each test of correlation and noise, that equal white noise changes the errors. It
# exceeds the probability of a finding, because few images show a fault in part.
_WIDE_ALARM = 0.05
# Fewest degrees of freedom of correlated images.
_MIN_FREEDOM = 2.0
# Smallest noise that matters, and the assumed noise of single images, in px.
_MIN_NOISE_PX, _UNKNOWN_NOISE_PX = 1e-3, 1.0
# Degrees of freedom of a known noise.
_KNOWN_FREEDOM = 1e9
# A cause is named if it reduces the misfit by this factor, although some misfit remains. Correlated
# images need a misfit of this size, because the variance of their mean is uncertain.
_MISFIT_FACTOR = 20.0
# Residual of spots of another platform, as a fraction of the size of the pattern.
_FOREIGN_FRACTION = 0.1
# Distance of a spot from its place in other images, over this quantile of all distances, that noise
# cannot explain. Of three lights or three images, a third may be at the median, with no distance.
_FAR_RATIO, _USUAL_QUANTILE = 20.0, 2 / 3
# Smallest ratio of distances that are equal.
_TIE_RATIO = 0.99
# Largest step of rounded coordinates, in px, and the decimals that distinguish them.
_LARGEST_STEP_PX, _DECIMALS = 1.0, 3
# Iterations of a fit of rotation and size.
_SIZE_ROUNDS = 5
# Causes that leave no usable angle.
_REFUSED_KINDS = ("mirrored", "swapped")
_TEXTS = {
    "pattern": "lights are up to {off:.2g} px off, and no single light or scale explains it. "
    "Measure the lights of the platform",
    "scale": "the pattern is {scale:.4g} of its expected size. Correct a focal length, the pixel "
    "pitch, the unit of the spots or the platform (of two lights, one may be displaced)",
    "displaced": "light {named} is displaced by {off:.2g} px. Leave it out (NaN or masked)",
    "mirrored": "the spots are mirrored. Change the sign of x, or swap x and y",
    "swapped": "lights {named} look swapped. Correct their order, or give the platform the rough "
    "spots of a tracker that is rolled by 180 deg",
}
_PROBLEMS = (
    "at the zero point, the pattern does not fit the design",
    "at the present, the pattern does not fit the zero point",
)
_FOREIGN_TEXT = (
    "the best fit leaves residuals of {:.0%} of the size of the pattern. The spots belong to "
    "another platform, or several lights are in another order: give their own platform"
)
_CORRELATED_TEXT = (
    "neighbouring images have common errors, or the spots drift (correlation {:.2g}): the standard "
    "deviation of a mean of independent images is too small by a factor of {:.2g}. "
    "Take images further apart"
)
_DRIFT_TEXT = ", or use misalignment-drift for a linear drift"
_UNEVEN_TEXT = (
    "the spots scatter by {:.2g} px at the zero point and {:.2g} px at the present. The error of "
    "the mean includes it, but errors of single images and posteriors assume equal noise. Take "
    "images of equal noise"
)
_SMALL_TEXT = "expected spots that determine a rotation, got others. Give pixels"
_SPARE_TEXT = "no group has two images of a light, so the noise is unknown. Add images"
_LOST_TEXT = "{} of {} spots are lost: an image with fewer spots has less weight"


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Lights in both groups, findings on their spots, and the agreement of the groups.

    Attributes
    ----------
    platform : Platform
        With the lights in both groups.
    images : tuple of two ndarray, shape (frames, n, 2)
        Spots of these lights.
    findings : list of Finding
        The worst first.
    agreement : dict of str to float
        ``chi_square``: squared residuals of the mean spots at the present, after the best rotation
        from the zero point, over their variance from the scatter between images, per degree of
        freedom. It is about 1, and less if all spots of an image move together. ``low`` and
        ``high``: its central 95 % without a fault. ``residual_rms``: of the residuals, in px.
    widening : float
        Factor on the standard error of mean angles for equal noise: of correlated images and of
        groups of unequal noise, also if they are too uncertain for a finding, and the root of a
        `chi_square` above 1.
    freedom : float
        Upper limit of the degrees of freedom of the standard error.
    design_variance : float
        Variance of a coordinate of a light about its designed place at the zero point, in a pattern
        of free size and without the noise, in px^2. It makes the axes of the camera uncertain.
    """

    platform: Platform
    images: Images
    findings: list[Finding]
    agreement: dict[str, float]
    widening: float
    freedom: float
    design_variance: float


def diagnose_spots(
    platform: Platform, images: Images, drifts: bool = False
) -> Diagnosis:
    """Return the faults of the spots of both groups, without the lights that a group lacks.

    Parameters
    ----------
    platform : Platform
        Platform with n lights.
    images : tuple of two ndarray, shape (frames, n, 2)
        Spots at the zero point and at the present, in px. NaN if lost.
    drifts : bool
        Whether a model includes a drift in group 1.

    Returns
    -------
    Diagnosis
        Spots and platform that are used, and the findings.

    Raises
    ------
    ValueError
        If both groups have fewer than two lights, two lights have the same spots, spots are
        mirrored or belong to another platform, or lights are swapped.

    Examples
    --------
    >>> lasers = np.array([[1e-3, 0], [0, 1e-3], [-1e-3, 0], [0, -1e-3]])
    >>> spots = np.array([[20.0, 0], [0, 20], [-20, 0], [0, -20]])
    >>> platform = Platform(lasers, 1.0, 0.05, 5e-6, np.zeros(2))
    >>> findings = diagnose_spots(platform, (spots[None], spots[None] + 1)).findings
    >>> [finding.kind for finding in findings]
    ['scale', 'spare']
    """
    counts = np.array([np.isfinite(group[..., 0]).sum(axis=0) for group in images])
    total = sum(group.size for group in images) // 2
    lost = total - counts.sum()
    seen = counts.min(axis=0) > 0
    lights = np.flatnonzero(seen) + 1
    if len(lights) < 2:
        raise ValueError(
            f"spots: expected two lights or more in both groups, got {len(lights)}. Add lights"
        )
    platform = replace(
        platform, lasers=platform.lasers[seen], spots=platform.spots[seen]
    )
    counts, images = counts[:, seen], (images[0][:, seen], images[1][:, seen])
    means = [np.nanmean(group, axis=0) for group in images]
    for mean in means:
        _check_distinct("spots", mean, lights)
    series = [
        np.nan_to_num(group - mean).reshape(len(group), -1)
        for group, mean in zip(images, means, strict=True)
    ]
    noise = _noise(series, counts, drifts)
    score, lag, widening = _correlated(
        series[: 1 if drifts else 2], platform.response(means[0]).reshape(3, -1)
    )
    correlated = score > -ndtri(_FALSE_ALARM)
    variance = np.cumsum((noise.pixels[:, None] * widening) ** 2 / counts, axis=0)
    zero = Platform.of_spots(means[0], *platform.tracker[::-1])
    findings = [*_single_images(images, lights)]
    if not (findings or correlated) and noise.chance < _FALSE_ALARM:
        findings.append(Finding("uneven", _UNEVEN_TEXT.format(*noise.pixels)))
    tolerated, off_design = _MISFIT_FACTOR * correlated, []
    for model, spots, errors, problem in zip(
        (platform, zero), means, variance, _PROBLEMS, strict=True
    ):
        fits = _fits(model, spots, errors, noise.freedom, tolerated, lights)
        fit, scaled = next(fits), next(fits)
        off_design.append(max(scaled.misfit - 1.0, 0.0))
        findings += _misfit(
            fit, chain([scaled], fits), spots.std(axis=0).max(), problem
        )
    if counts.max() < 2:
        findings.append(Finding("spare", _SPARE_TEXT))
    factor, limit = noise.factor, noise.limit
    if score > -ndtri(_WIDE_ALARM):
        independent = counts.max(axis=1).sum() * (1 - lag**2) / (1 + lag**2)
        factor, limit = factor * widening, min(limit, max(independent, _MIN_FREEDOM))
    if correlated:
        text = _CORRELATED_TEXT.format(lag, widening) + _DRIFT_TEXT * (not drifts)
        findings.append(Finding("correlated", text))
    if lost:
        findings.append(Finding("lost", _LOST_TEXT.format(lost, total)))
    low, high = fdtri(fit.freedom, noise.freedom, [0.025, 0.975]).tolist()
    if fit.misfit > high:
        limit = min(limit, fit.freedom)
    return Diagnosis(
        platform=platform,
        images=images,
        findings=findings,
        agreement={
            "chi_square": fit.misfit,
            "low": low,
            "high": high,
            "residual_rms": fit.rms,
        },
        widening=factor * max(fit.misfit, 1.0) ** 0.5,
        freedom=limit,
        design_variance=variance[0].mean() * off_design[0],
    )


def _correlated(
    series: list[FloatArray], response: FloatArray
) -> tuple[float, float, float]:
    """Return the larger `_correlation`: of spots (frames, 2 n), or of the rotations they cause."""
    unit_response = response.T / np.linalg.norm(response, axis=1)
    angles = [group @ unit_response for group in series]
    return max(map(_correlation, (series, angles)))


@dataclass(frozen=True, eq=False)
class _Noise:
    """Noise of a coordinate of a spot in both groups, and its effect on mean angles.

    Fields: noise in px, shape (2,), and its degrees of freedom; probability of such a ratio if both
    are equal; factor on the standard error for equal noise, and limit of its degrees of freedom.
    """

    pixels: FloatArray
    freedom: float
    chance: float = 1.0
    factor: float = 1.0
    limit: float = np.inf


def _noise(series: list[FloatArray], counts: IntArray, drifts: bool) -> _Noise:
    """Return the noise of spots (frames, 2 n) about their means, from counts (2, n) of spots.

    It is equal in both groups if group 1 drifts, a group has no scatter, or no difference is seen.
    """
    # Without the images that lack all spots.
    spares, sizes = 2 * (counts - 1).sum(axis=1), counts.max(axis=1)
    if not (spare := spares.sum()):
        return _Noise(np.full(2, _UNKNOWN_NOISE_PX), _KNOWN_FREEDOM)
    squares = np.array([np.square(group).sum() for group in series])
    noise = max((squares.sum() / spare) ** 0.5, _MIN_NOISE_PX)
    equal = _Noise(np.full(2, noise), spare)
    if drifts or not squares.all():
        return equal
    each = np.maximum((squares / spares) ** 0.5, _MIN_NOISE_PX)
    low, high = np.argsort(each)
    # The spots of an image may move together, in both directions or in one.
    spots = np.concatenate(series)
    scatter = spots.T @ spots
    free = (sizes - 1) * min((scatter.trace() / np.linalg.norm(scatter)) ** 2, 2.0)
    chance = 2 * fdtrc(free[high], free[low], (each[high] / each[low]) ** 2)
    if chance > _WIDE_ALARM:
        return equal
    parts = each**2 / sizes
    return _Noise(
        pixels=each,
        freedom=spares.min(),
        chance=chance,
        factor=(parts.sum() / (1 / sizes).sum()) ** 0.5 / noise,
        # Welch and Satterthwaite.
        limit=parts.sum() ** 2 / (parts**2 / (sizes - 1)).sum(),
    )


def _single_images(images: Images, lights: IntArray) -> Iterator[Finding]:
    """Yield the faults of single images: repeated ones, and a spot far from its place."""
    every = np.concatenate(images)
    whole = every[np.isfinite(every[..., 0]).any(axis=1)]
    if repeats := len(whole) - len({image.tobytes() for image in whole}):
        yield Finding(
            "repeated",
            f"{repeats} of {len(whole)} images repeat another image: copies, or too few digits?",
        )
    for when, spots in zip(("zero point", "present"), images, strict=True):
        # The place of a spot is relative to the other spots of its image.
        rows = np.flatnonzero(np.isfinite(spots[..., 0]).sum(axis=1) > 1)
        if not len(rows):
            continue
        off = (spots - np.nanmedian(spots, axis=0))[rows]
        # The spots of an image move together.
        distance = np.linalg.norm(off - np.nanmedian(off, axis=1)[:, None], axis=2)
        largest = np.nanmax(distance, axis=1)
        row = largest.argmax()
        # Spots that are rounded to the same number have no scatter, except that of the rounding.
        steps = np.diff(np.unique(off.round(_DECIMALS)))
        rounding = np.nanmin(steps, initial=_LARGEST_STEP_PX) / np.sqrt(12)
        usual = np.nanquantile(distance, _USUAL_QUANTILE)
        if largest[row] > _FAR_RATIO * max(usual, _MIN_NOISE_PX, rounding):
            # Two lights have the same distance from their centre.
            named = lights[distance[row] > _TIE_RATIO * largest[row]]
            yield Finding(
                "stray",
                f"at the {when}, light {' or '.join(map(str, named))} in image {rows[row] + 1} is "
                f"{largest[row]:.2g} px from its place: a wrong spot? Mark it as lost (NaN or "
                "masked)",
            )


@dataclass(frozen=True)
class _Fit:
    """Best rotation of a pattern under a cause.

    Fields: kind and text of the cause, squared residuals per degree of freedom, the same over the
    largest value that is expected, degrees of freedom, rms of the residuals in px, and whether the
    rotation exceeds 120 deg.
    """

    kind: str
    text: str
    misfit: float
    excess: float
    freedom: int
    rms: float
    is_rolled: bool


def _fits(
    platform: Platform,
    spots: FloatArray,
    variance: FloatArray,
    known: float,
    tolerated: float,
    numbers: IntArray,
) -> Iterator[_Fit]:
    """Yield the fit of a platform to mean spots (n, 2), of a free size, then under other causes.

    The variance of a coordinate of each spot, (n,) in px^2, has `known` degrees of freedom. Misfits
    up to `tolerated` are expected. The lights have these numbers.
    """
    lasers, weights = platform.lasers, 1 / variance
    causes = [("pattern", "", lasers, weights), ("scale", "", lasers, weights)]
    for i, j in combinations(range(len(lasers)), 2):
        swapped = lasers.copy()
        swapped[[i, j]] = lasers[[j, i]]
        named = f"{numbers[i]} and {numbers[j]}"
        causes.append(("swapped", named, swapped, weights))
    if len(lasers) > 2:
        causes.append(("mirrored", "", lasers * [-1, 1], weights))
        for number in numbers:
            others = weights * (numbers != number)
            causes.append(("displaced", str(number), lasers, others))
    for kind, named, lights, weights in causes:
        scale, is_free = 1.0, kind not in ("pattern", "displaced")
        try:
            for _ in range(_SIZE_ROUNDS if is_free else 1):
                rays = emitted_directions(scale * lights, platform.camera_focal_length)
                rotation = attitude(platform.seen(spots), rays, weights)
                expected = received_spots(rays @ rotation.T, *platform.tracker)
                if is_free:
                    scale *= _size(spots, weights) / _size(expected, weights)
        except DegenerateGeometryError as error:
            if kind in ("pattern", "scale"):
                raise DegenerateGeometryError(
                    f"spots: {_SMALL_TEXT} ({error})"
                ) from error
            continue  # a mirrored square has no unique rotation
        off = np.hypot(*(spots - expected).T)
        # Two lights have no misfit if the size is free.
        freedom = max(2 * int(np.count_nonzero(weights)) - 3 - is_free, 1)
        misfit = float(weights @ off**2 / freedom)
        largest = float(fdtri(freedom, known, 1 - _FALSE_ALARM))
        yield _Fit(
            kind=kind,
            text=_TEXTS[kind].format(named=named, off=off.max(), scale=scale),
            misfit=misfit,
            excess=misfit / max(largest, tolerated),
            freedom=freedom,
            rms=float(off @ off / off.size / 2) ** 0.5,
            is_rolled=np.trace(platform.reference.T @ rotation) < 0,
        )


def _misfit(
    design: _Fit, fits: Iterator[_Fit], size: float, problem: str
) -> Iterator[Finding]:
    """Yield the cause of a misfit of a pattern of this size, or of a rotation by more than 120 deg.

    The fits under other causes are computed only if the design does not fit.
    """
    is_right = design.excess < 1
    if is_right and not design.is_rolled:
        return
    causes = sorted(fits, key=lambda cause: (cause.kind == "swapped", cause.excess))
    good = [cause for cause in causes if cause.excess < 1]
    good = [cause for cause in good if not cause.is_rolled] or good * (not is_right)
    refused = [cause for cause in good if cause.kind in _REFUSED_KINDS]
    # Three lights fit without one light too.
    if refused and all(cause.kind != "scale" for cause in good):
        good = refused
    if not good:
        if is_right:
            return
        fraction = min(c.rms for c in causes if c.kind != "displaced") / size
        if fraction > _FOREIGN_FRACTION:
            raise ValueError(f"spots: {problem}: {_FOREIGN_TEXT.format(fraction)}")
        best = min(causes, key=lambda cause: cause.misfit)
        good = [best if best.misfit * _MISFIT_FACTOR < design.misfit else design]
    text = f"{problem}: {'; or '.join(cause.text for cause in good)}"
    if good[0].kind in _REFUSED_KINDS:
        raise ValueError(f"spots: {text}")
    yield Finding(good[0].kind, text)


def _size(points: FloatArray, weights: FloatArray) -> float:
    return float(np.sqrt(np.cov(points.T, aweights=weights).trace()))
