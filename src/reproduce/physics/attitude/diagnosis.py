"""What is wrong with spots of lights, as far as they can tell: findings in words, with the cure.

Spots have shape (frames, n, 2), in px, NaN where lost; group 0 is the zero point, group 1 the
present. Lights and images are counted from one. Every threshold knows how many spots there are:
on clean spots of even noise one set in a thousand or so is found fault with.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from reproduce.physics.attitude.platform import Platform
from reproduce.physics.validate import DegenerateGeometryError, Finding, FloatArray

# Clean spots are found fault with one time in so many, over all that is asked.
_ALARM = 1e-3
# Asked: far spots, motion in two groups, the pattern against its design and against the zero point.
_QUESTIONS = 5
# Nobody needs to hear of less, in px; and the noise where single images do not tell it.
LEAST, UNKNOWN = 1e-3, 1.0
# A cause is named if it leaves so many times less than the design does, though not all.
_EXPLAINED = 20.0
# Fewer images do not tell motion from noise.
_FEW = 5
# Steps of derivatives, in radians and as a share of the pattern; and how often the fit is repeated.
STEP, ROUNDS = 1e-5, 3
# So many spots are named.
_NAMED = 5
# In a metre.
_MILLIMETRES = 1e3
# Kinds of findings that leave no number of any use.
_REFUSED = ("mirrored", "swapped")


@dataclass(frozen=True, eq=False)
class _Cause:
    """A reason why a pattern does not fit: its kind, its words, the platform that it would make."""

    kind: str
    text: str
    lasers: FloatArray
    lights: NDArray[np.bool_]
    scaled: bool


def diagnose(
    platform: Platform,
    images: tuple[FloatArray, FloatArray],
    drifts: bool = False,
    numbers: Sequence[int] = (),
) -> list[Finding]:
    """Return what is wrong with the spots of both groups, the worst first.

    Parameters
    ----------
    platform : Platform
        With n lights.
    images : tuple of two ndarray, shape (frames, n, 2)
        Spots at the zero point and at the present; every light is seen in each group.
    drifts : bool
        Whether a model follows the motion of group 1, which is then none of its faults.
    numbers : sequence of int, optional
        Of the lights, where some are left out; else they count from one.

    Returns
    -------
    list of Finding
        None of clean spots.

    Examples
    --------
    >>> lasers = np.array([[1e-3, 0], [0, 1e-3], [-1e-3, 0], [0, -1e-3]])
    >>> spots = np.array([[20.0, 0], [0, 20], [-20, 0], [0, -20]])
    >>> platform = Platform(lasers, 1.0, 0.05, 5e-6, np.zeros(2))
    >>> [one.kind for one in diagnose(platform, (spots[None], spots[None]))]
    ['scale', 'spare']
    """
    lights = tuple(numbers) or tuple(range(1, len(platform.lasers) + 1))
    far, kept = _far(images, lights)
    means = [np.nanmean(one, axis=0) for one in kept]
    counts = [np.isfinite(one).all(axis=-1).sum(axis=0) for one in kept]
    noise, freedom = _noise(kept)
    length, pitch = platform.tracker_focal_length, platform.pixel_pitch
    zero = Platform.of_spots(means[0], length, pitch, platform.principal_point)
    designed = _Pattern(platform, means[0], noise**2 / counts[0], freedom, lights)
    since = _Pattern(zero, means[1], noise**2 / counts[0] + noise**2 / counts[1], freedom, lights)
    found = [
        *designed.findings("at the zero point", "as designed"),
        *since.findings("since the zero point", "as at the zero point"),
    ]
    found += [*far, *_repeated(images), *_moving(kept[: 1 if drifts else 2])]
    if not np.isfinite(freedom):
        text = "no light is seen twice in a group, so the size of the errors is unknown"
        found.append(Finding("spare", text))
    return found


def refuse(findings: Iterable[Finding], source: str) -> None:
    """Raise what leaves no angle of any use: mirrored spots, or lights that are swapped.

    Parameters
    ----------
    findings : iterable of Finding
        From `diagnose`.
    source : str
        Where the spots come from.

    Returns
    -------
    None
        If nothing is to be refused.

    Raises
    ------
    ValueError
        With the words of the finding, after those of where the spots come from.

    Examples
    --------
    >>> refuse([Finding("spot", "1 spot lies far off")], "spots.csv")
    """
    for one in findings:
        if one.kind in _REFUSED:
            raise ValueError(f"{source}: {one.text}")


def seen(
    platform: Platform, images: tuple[FloatArray, FloatArray]
) -> tuple[Platform, tuple[FloatArray, FloatArray], tuple[int, ...]]:
    """Return a platform and images without lights that a group lacks, and the numbers of the rest.

    Parameters
    ----------
    platform, images
        As for `diagnose`, of which lights may be lost throughout.

    Returns
    -------
    platform, images, numbers
        Of the lights that are seen in both groups; numbers count from one.

    Raises
    ------
    ValueError
        If fewer than two are left.

    Examples
    --------
    >>> platform = Platform([[1e-3, 0], [0, 1e-3], [-1e-3, 0]], 1.0, 0.05, 5e-6, (0, 0))
    >>> lost = np.array([[[10.0, 0], [np.nan, np.nan], [-10, 0]]])
    >>> seen(platform, (lost, lost))[2]
    (1, 3)
    """
    told = np.all([np.isfinite(one).all(axis=-1).any(axis=0) for one in images], axis=0)
    if told.sum() < 2:
        raise ValueError(f"expected two lights or more in both groups, got {told.sum()}")
    chosen = replace(platform, lasers=platform.lasers[told], spots=platform.spots[told])
    numbers = tuple((np.flatnonzero(told) + 1).tolist())
    return chosen, (images[0][:, told], images[1][:, told]), numbers


def _noise(images: Sequence[FloatArray]) -> tuple[float, float]:
    """Noise of a coordinate about the mean of its light, in px, and its degrees of freedom."""
    squares = sum(float(np.nansum(np.square(one - np.nanmean(one, axis=0)))) for one in images)
    spots = sum(int(np.isfinite(one).all(axis=-1).sum()) for one in images)
    freedom = 2 * (spots - sum(one.shape[1] for one in images))
    return (max(np.sqrt(squares / freedom), LEAST), freedom) if freedom else (UNKNOWN, np.inf)


def _far(
    images: tuple[FloatArray, FloatArray], numbers: tuple[int, ...]
) -> tuple[list[Finding], list[FloatArray]]:
    """Name spots far from all others of their light, and return the images without them."""
    kept = [one.copy() for one in images]
    alarm = _ALARM / _QUESTIONS / sum(int(np.isfinite(one).all(axis=-1).sum()) for one in images)
    far: list[tuple[int, int, int]] = []
    for light in range(images[0].shape[1]):
        while found := _farthest([one[:, light] for one in kept], alarm):
            group, image = found
            kept[group][image, light] = np.nan
            far.append((group, image, light))
    if not far:
        return [], kept
    off = max(np.hypot(*(images[group][image, light] - np.nanmean(kept[group][:, light], axis=0)))
              for group, image, light in far)  # fmt: skip
    places = [f"light {numbers[light]} in image {image + 1} of group {group}"
              for group, image, light in sorted(far)]  # fmt: skip
    text = (
        f"{len(far)} spot{'s lie' if len(far) > 1 else ' lies'} up to {off:.2g} px from where the "
        f"other images have the light, which scatter by {_noise(kept)[0]:.2g} px "
        f"({', '.join(places[:_NAMED])}{', ...' * (len(places) > _NAMED)}): mask or remove what is "
        "false"
    )
    return [Finding("spot", text, tuple(sorted({image for _, image, _ in far})))], kept


def _farthest(groups: list[FloatArray], alarm: float) -> tuple[int, int] | None:
    """Group and image of the spot of one light that is farthest off, if it is too far."""
    counts = [int(np.isfinite(one).all(axis=-1).sum()) for one in groups]
    freedom = 2 * (sum(counts) - len(groups) - 1)  # of all others
    if freedom < 2:
        return None
    left = [np.square(one - np.nanmean(one, axis=0)).sum(axis=-1) for one in groups]
    # A spot pulls the mean towards itself.
    own = [np.nan_to_num(one) * count / max(count - 1, 1)
           for one, count in zip(left, counts, strict=True)]  # fmt: skip
    group = int(np.argmax([one.max() for one in own]))
    image = int(own[group].argmax())
    farthest = float(own[group][image])
    others = sum(float(np.nansum(one)) for one in left) - farthest
    variance = max(others / freedom, LEAST**2)
    return None if fdtrc(2, freedom, farthest / 2 / variance) >= alarm else (group, image)


def _repeated(images: tuple[FloatArray, FloatArray]) -> Iterator[Finding]:
    """Name images that repeat an earlier one of their group, as no two measurements do."""
    for group, spots in enumerate(images):
        first: dict[bytes, int] = {}
        known = (first.setdefault(one.tobytes(), row) != row for row, one in enumerate(spots))
        rows = [row for row, old in enumerate(known) if old and np.isfinite(spots[row]).any()]
        if rows:
            shown = ", ".join(str(row + 1) for row in rows[:_NAMED]) + ", ..." * (
                len(rows) > _NAMED
            )
            text = (
                f"{len(rows)} of {len(spots)} images of group {group} repeat an earlier one "
                f"({shown}): each counts as an image of its own"
            )
            yield Finding("repeated", text, tuple(rows))


def _moving(groups: Sequence[FloatArray]) -> Iterator[Finding]:
    """Name groups within which the spots move evenly in time."""
    for group, images in enumerate(groups):
        told = np.isfinite(images).all(axis=(-2, -1))
        if told.sum() < _FEW:
            continue
        times, left = np.linspace(-1, 1, len(images))[told], images[told]
        times, left = times - times.mean(), left - left.mean(axis=0)
        lever = float(times @ times)
        slopes = np.tensordot(times, left, axes=1) / lever
        freedom = (len(left) - 2) * slopes.size
        variance = np.square(left - times[:, None, None] * slopes).sum() / freedom
        ratio = lever * np.square(slopes).mean() / variance if variance else 0.0
        if fdtrc(slopes.size, freedom, ratio) < _ALARM / _QUESTIONS:
            way = 2 * np.hypot(*slopes.T).max()  # the slope is that over half of the group
            follow = "; misalignment-drift follows it" if group else ""
            yield Finding(
                "moving", f"the spots move within group {group}, by {way:.2g} px from its first "
                "image to its last: its mean is that of its middle, and no error counts the "
                f"motion{follow}",
            )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Pattern:
    """Mean spots against where a platform, turned as may be, puts them.

    - `platform`: where they should lie.
    - `spots`, (n, 2), and `variance`, (n,): of a coordinate of each, in px^2.
    - `freedom`: degrees of freedom of the noise.
    - `numbers`: what the lights are called.
    """

    platform: Platform
    spots: FloatArray
    variance: FloatArray
    freedom: float
    numbers: tuple[int, ...]

    def findings(self, when: str, how: str) -> list[Finding]:
        """Say why the pattern does not fit, if it does not."""
        everyone = np.ones(len(self.spots), bool)
        design = _Cause("pattern", "", self.platform.lasers, everyone, False)
        chance, plain, left, _ = self.fit(design)
        if chance > _ALARM / _QUESTIONS:
            return []
        tried = []
        for cause in self.causes():
            with suppress(DegenerateGeometryError):  # a mirrored square leaves a turn free
                tried.append((cause, *self.fit(cause)))
        good = [one for one in tried if one[1] > _ALARM / _QUESTIONS]
        if not good and tried:
            best = min(tried, key=lambda one: one[2])
            good = [best] if best[2] * _EXPLAINED < plain else []
        if not good:
            off = np.hypot(*left.T)
            most = self.numbers[int(off.argmax())]
            return [Finding("pattern", f"{when}, the lights do not lie {how}: they are up to "
                            f"{off.max():.2g} px off, light {most} the most, and no single light "
                            "or size explains it")]  # fmt: skip
        reasons = "; or ".join(self.words(cause, left, scale) for cause, _, _, left, scale in good)
        return [Finding(good[0][0].kind, f"{when}, the lights do not lie {how}: {reasons}")]

    def causes(self) -> Iterator[_Cause]:
        """What may be wrong, the likelier first; with too few lights it cannot be told."""
        lasers, count = self.platform.lasers, len(self.spots)
        everyone = np.ones(count, bool)
        yield _Cause("scale", "", lasers, everyone, True)
        if count < 3:
            return
        for light, number in enumerate(self.numbers):
            others = np.arange(count) != light
            yield _Cause("displaced", f"light {number}", lasers, others, False)
        yield _Cause("mirrored", "", lasers * np.array([-1, 1]), everyone, True)
        for one, other in combinations(range(count), 2):
            order = np.arange(count)
            order[[one, other]] = other, one
            names = f"lights {self.numbers[one]} and {self.numbers[other]}"
            yield _Cause("swapped", names, lasers[order], everyone, True)

    def words(self, cause: _Cause, left: FloatArray, scale: float) -> str:
        """Say a cause, with its cure."""
        if cause.kind == "scale":
            metric = 0.8 < scale / (self.platform.pixel_pitch * _MILLIMETRES) < 1.25
            unit = "a focal length, the pixel pitch or the unit of the spots is wrong"
            unit = "the spots look like millimetres, expected px" if metric else unit
            return f"the pattern is {scale:.4g} of its expected size: {unit}"
        if cause.kind == "displaced":
            off = float(np.hypot(*left[~cause.lights][0]))
            return f"{cause.text} is displaced by {off:.2g} px: leave it out (NaN, or masked)"
        if cause.kind == "mirrored":
            return "the spots are mirrored: change the sign of x, or swap x and y"
        return f"{cause.text} look swapped"

    def fit(self, cause: _Cause) -> tuple[float, float, FloatArray, float]:
        """Return the chance of such a misfit, the misfit per degree of freedom, what is left, size.

        What is left, (n, 2), is that of all spots, also of those that the fit leaves out.
        """
        size = _size(self.spots[cause.lights]) / _size(
            cause.lasers[cause.lights] / self.platform.camera_focal_length * self.platform.pixels
        )
        start = size if cause.scaled else 1.0
        aligned = replace(
            self.platform, lasers=start * cause.lasers[cause.lights], spots=self.spots[cause.lights]
        )
        vector, roots = np.zeros(3 + cause.scaled), np.sqrt(self.variance[cause.lights])[:, None]
        for _ in range(ROUNDS):
            steps = STEP * np.eye(len(vector))
            found = _landed(aligned, start * cause.lasers, np.stack(
                [vector, *(vector + steps), *(vector - steps)]))  # fmt: skip
            left = self.spots - found[0]
            response = (found[1 : len(steps) + 1] - found[len(steps) + 1 :]) / (2 * STEP)
            weighed = (response[:, cause.lights] / roots).reshape(len(vector), -1).T
            target = (left[cause.lights] / roots).ravel()
            vector = vector + np.linalg.lstsq(weighed, target, rcond=None)[0]
        squares = float(target @ target)
        freedom = target.size - len(vector)
        scale = start * float(np.exp(vector[3])) if cause.scaled else 1.0
        if freedom < 1:
            return 1.0, 0.0, left, scale
        misfit = squares / freedom
        noise = self.freedom if np.isfinite(self.freedom) else 1e9
        return float(fdtrc(freedom, noise, misfit)), misfit, left, scale


def _landed(platform: Platform, lasers: FloatArray, vectors: FloatArray) -> FloatArray:
    """Spots of lasers after turns (m, 3) and, where there is a fourth, of a size, (m, n, 2)."""
    sizes = np.exp(vectors[:, 3:]).prod(axis=1)[:, None, None]
    still = np.zeros((len(vectors), 1, 3))
    return platform.predicted(vectors[:, :3], still, sizes * lasers)[:, 0]


def _size(points: FloatArray) -> float:
    return float(np.sqrt(np.square(points - points.mean(axis=0)).sum()))
