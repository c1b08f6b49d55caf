"""From a user's own pictures to stars, to pairs of them, to the transform between two pictures.

Background, noise and width of the spots are photutils', and so are the segments in which a star is
looked for. Its centre is the one of maximum likelihood (`physics.images.fitted_spots`), in which
pixels that are missing or lie under another filter do not count. Stars of two pictures are paired
by the triangles of neighbours, which no shift, turn or scale changes; as complex numbers those of a
mirror image are the conjugates, so that one is recognised.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reproduce.physics.images import fitted_spots, window_corners
from reproduce.physics.registration import (
    Registration,
    as_complex,
    as_points,
    fit_registration,
    registered_image,
)
from reproduce.store.pictures import (
    Mask,
    Picture,
    PictureError,
    is_picture,
    read_pictures,
)
from reproduce.store.points import STARS, is_table, read_table
from reproduce.views.blocks import Block, Fold, Grid
from reproduce.views.display import Display
from reproduce.views.measurements import Registered, Remade

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from reproduce.views.posterior import Posterior

FloatArray = NDArray[np.float64]
# A star has so many touching pixels above the threshold, in standard deviations of the noise.
_TOUCHING, THRESHOLD = 3, 5.0
# A hot pixel exceeds so many deviations, and its neighbours have less than a share of its light.
_GLARING, _ALONE = 10.0, 0.1
# Side of the boxes in which the background is found; of so many pixels along each axis one counts.
_BOX, _EVERY = 64, 4
# Segments at most, the brightest; stars whose widths are measured; half a window, in radii.
_MOST, _MEASURED, _REACH = 20_000, 9, 3.0
# Of another star, so many radii reach into the window.
_TAIL = 2.0
# Share of a spot's square that may differ from a Gaussian of the common width: at most, and as many
# times what is usual in the picture, and a little.
_MISFIT, _UNUSUAL, _SLIGHT = 0.1, 4.0, 2e-3
# The width of a Gaussian at half its height, in standard deviations.
_FWHM = float(np.sqrt(8 * np.log(2)))
# So often spots are fitted where the gain is to be found too.
_FITS, _ROUNDS = 4, 10
# So much must another shape than the Gaussian better chi-square.
_PLAIN = 9.0
# Fewer spots do not tell photon noise from another shape, fewer pixels nothing of their noise;
# what may multiply its variance.
_TELLING, _DARK, _FACTOR = 10, 200, (0.25, 4.0)
# In how many standard deviations of its noise that must show.
_SURELY = 5.0
# Stars among which triangles are looked for, first and where that fails; neighbours of each.
_BRIGHTEST, _NEIGHBOURS = (50, 200), 6
# How far triangles may differ in shape, and stars may land apart: px, and a share of the field.
_ALIKE, _NEAR, _SHARE = 0.02, 2.0, 1e-3
# Triangles that are tried at most, the likeliest first.
_TRIED = 4_000
# Fewer pairs are not sharpened; fewer do not make a robust fit; rounds of the scatter beyond.
_FEW, _FEWEST, _TIMES = 6, 4, 3
# The chance that as many stars land on others by chance.
_CHANCE = 1e-6


class Stars(Display):
    """The stars of one picture: centres with covariance, and what was dropped and why.

    Attributes
    ----------
    name : str
    shape : tuple of int
        Height and width of the picture, in px; (0, 0) where there is none.
    points : ndarray, shape (n, 2), in px, the brightest first
    covariance : ndarray, shape (n, 2, 2), in px^2; zero where nothing is known of it
    dropped : DataFrame
        What else was found, with the reason.
    log : list of str
        How the picture was read, the cuts, and how many were dropped why.
    facts : dict of str to float
        Radius of a spot in px, background, noise and gain.
    """

    def __init__(
        self,
        name: str,
        shape: tuple[int, ...],
        table: pd.DataFrame,
        covariance: FloatArray,
        log: Sequence[str] = (),
        facts: Mapping[str, float] | None = None,
    ) -> None:
        order = np.argsort(-table["flux"].to_numpy(), kind="stable")
        table, covariance = table.iloc[order].reset_index(drop=True), covariance[order]
        used = (table["dropped"] == "").to_numpy()
        self.name, self.shape, self.facts = name, shape, dict(facts or {})
        self.covariance = covariance[used]
        self._kept = table[used].drop(columns="dropped").reset_index(drop=True)
        self.dropped = table.loc[~used].reset_index(drop=True)
        self.points: FloatArray = self._kept[["x", "y"]].to_numpy(float)
        self.log = [*log, *_counted(self.dropped["dropped"])]

    def __len__(self) -> int:
        """How many stars there are."""
        return len(self.points)

    def frame(self) -> pd.DataFrame:
        """Return x, y, sigma_x and sigma_y in px, flux and what else is known of each star."""
        return self._kept.copy()

    def blocks(self) -> Iterator[Block]:
        """Yield the brightest stars and the log."""
        rows = [[str(i), *(f"{one:.6g}" for one in row[:5])]
                for i, *row in self._kept.head(10).itertuples()]  # fmt: skip
        head = ("star", *self._kept.columns[:5])
        title = f"{len(self)} stars of {self.name}, in px" + ", the brightest" * (len(self) > 10)
        yield Grid(title, head, rows)
        yield from self.log


def _counted(reasons: pd.Series[str]) -> list[str]:
    return [f"dropped {count}: {reason}" for reason, count in reasons.value_counts().items()]


def one_channel(source: Any, channel: str | None, cuts: Mapping[str, Any]) -> Stars:
    """Return the stars of a picture, of one of its channels, or of a table of centroids."""
    if not is_picture(source):
        return _listed(source)
    found = read_pictures(source, cuts["bayer"], cuts["saturation"])
    if channel is None and len(found) == 1:
        channel = next(iter(found))
    if channel not in found:
        known = ", ".join(filter(None, found)) or "none, of a grey picture"
        raise PictureError(f"channel: expected one of {known}, got {channel!r}")
    return _found(found[channel], cuts["threshold"], cuts["gain"])


def _listed(source: Any) -> Stars:
    """Return the stars of a table with the columns x and y, or of an array."""
    import pandas as pd

    if not is_table(source):
        source = pd.DataFrame(np.asarray(source, dtype=float), columns=["x", "y"])
    known = ("sigma", "sigma_x", "sigma_y", "flux")
    table = read_table(source, ("x", "y"), known)
    sigma = [table.optional.get(f"sigma_{axis}", table.optional.get("sigma")) for axis in "xy"]
    wide = np.column_stack([np.zeros(len(table.values)) if s is None else s for s in sigma])
    flux = table.optional.get("flux", np.arange(len(wide), 0, -1.0))
    columns = [*table.values.T, *wide.T, flux]
    frame = pd.DataFrame(dict(zip(("x", "y", "sigma_x", "sigma_y", "flux"), columns, strict=True)))
    covariance = wide[:, :, None] ** 2 * np.eye(2)
    return Stars(table.path, (0, 0), frame.assign(dropped=""), covariance, table.notes)


def _found(picture: Picture, threshold: float | None = None, gain: float | None = None) -> Stars:
    """Find the stars of a picture."""
    threshold = threshold or THRESHOLD
    try:
        field_ = _field(picture, threshold)
    except ImportError as error:
        raise PictureError(
            f'finding stars needs {error.name}: pip install "reproduce-pointing[images]"'
        ) from error
    if not len(field_.places):
        raise PictureError(
            f"{picture.name}: expected stars, got nothing above {threshold:g} standard deviations "
            f"of the noise in {_TOUCHING} touching pixels"
        )
    picture = _without(picture, field_.hot)
    return _measured(picture, field_, gain or picture.gain, threshold)


def _without(picture: Picture, hot: Mask) -> Picture:
    return picture if picture.cell else replace(picture, seen=picture.seen & ~hot)


def _hot(light: FloatArray, noise: FloatArray, step: int) -> Mask:
    """Say which pixels shine alone, as no spot does: their neighbours have next to no light."""
    rows, columns = np.nonzero(light > _GLARING * float(noise.min()))
    padded = np.pad(np.nan_to_num(light), 1)
    around = [padded[rows + y, columns + x] for y in range(3) for x in range(3) if (y, x) != (1, 1)]
    own, sigma = light[rows, columns], noise[rows // step, columns // step]
    alone = np.max(around, axis=0, initial=-np.inf) < np.maximum(_ALONE * own, 3 * sigma)
    hot = np.zeros(light.shape, bool)
    hot[rows, columns] = alone & (own > _GLARING * sigma)
    return hot


@dataclass(frozen=True, eq=False)
class _Field:
    """Where stars may be, (n, 2) in px, their light, background and noise, and their radius."""

    places: FloatArray
    light: FloatArray
    level: FloatArray
    noise: FloatArray
    hot: Mask
    radius: float = np.nan


def _field(picture: Picture, threshold: float) -> _Field:
    """Return what stands out of the background, and the width of its spots."""
    from photutils.background import Background2D, MADStdBackgroundRMS
    from photutils.segmentation import SourceCatalog, detect_sources

    image, missing, scale, first = _coarse(picture)
    step = max(1, min(_EVERY, min(image.shape) // 256))
    some = (slice(None, None, step),) * 2
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # boxes without pixels, nothing found: told below
        ground = Background2D(
            np.where(missing, 0.0, image)[some], max(8, _BOX // step), mask=missing[some],
            exclude_percentile=90.0,
            bkgrms_estimator=MADStdBackgroundRMS(),
        )  # fmt: skip
        level, noise = ground.background, np.hypot(
            ground.background_rms, picture.step / np.sqrt(12 * max(len(picture.cell), 1))
        )  # fmt: skip
        least = 1e-3 * max(float(np.nanmax(image) - np.median(level)), 0.0)
        noise = np.where(noise > 0, noise, least)
        under = _spread(level, step, image.shape)
        hot = np.zeros_like(missing) if picture.cell else _hot(image - under, noise, step)
        missing = missing | hot
        limit = under + threshold * _spread(noise, step, image.shape)
        segments = detect_sources(np.where(missing, limit, image), limit, _TOUCHING)
        if segments is None:
            return _Field(np.zeros((0, 2)), *(np.zeros(0),) * 3, hot)
        catalogue = SourceCatalog(np.where(missing, 0.0, image - under), segments, mask=missing)
        places = np.column_stack([catalogue.maxval_xindex, catalogue.maxval_yindex]).astype(float)
        light = np.asarray(catalogue.segment_flux)
        some_ = np.argsort(-light)[:_MOST]
        places, light = places[some_], light[some_]
        rows, columns = (places[:, i].astype(int) // step for i in (1, 0))
        found = _Field(
            scale * places + first, light, level[rows, columns],
            noise[rows, columns] * np.sqrt(max(len(picture.cell), 1)), hot,
        )  # fmt: skip
        long, across = (np.asarray(getattr(catalogue, f"semi{one}_axis"))[some_]
                        for one in ("major", "minor"))  # fmt: skip
        guess = float(np.nanmedian(long)) if np.isfinite(long).any() else 1.0
        usual = (long < 2 * across) & (long < 1.5 * guess) & (long > guess / 1.5)
        radius = _radius(_without(picture, hot), found, usual, scale * guess)
    return replace(found, radius=radius)


def _coarse(picture: Picture) -> tuple[FloatArray, Mask, int, FloatArray]:
    """Return what is searched: the picture, or the mean of a mosaic's cells; scale and first px."""
    if not picture.cell:
        return picture.light, np.isnan(picture.light), 1, np.zeros(2)
    height, width = (side // 2 for side in picture.light.shape)
    parts = [picture.light[y::2, x::2][:height, :width] for y, x in picture.cell]
    mean = np.mean(parts, axis=0)
    return mean, np.isnan(mean), 2, np.mean(picture.cell, axis=0)[::-1]


def _spread(coarse: FloatArray, step: int, shape: tuple[int, ...]) -> FloatArray:
    return coarse.repeat(step, axis=0).repeat(step, axis=1)[: shape[0], : shape[1]]


def _radius(picture: Picture, found: _Field, usual: Mask, guess: float) -> float:
    """Return the median radius of a few bright spots, fitted by photutils."""
    from photutils.psf import fit_2dgaussian

    size = _size(guess)
    whole = usual & ~_touched(picture.full, found.places, size)
    inside = _inside(found.places, picture.light.shape, size // 2)
    bright = np.flatnonzero(whole & inside)
    bright = bright[: max(_MEASURED, len(bright) // 2)]
    if not len(bright):
        return guess
    # Not the very brightest: what is no star is among them.
    chosen = bright[:: max(1, len(bright) // _MEASURED)][:_MEASURED]
    corners = window_corners(found.places[chosen], size)
    # Side by side, so that photutils is called once.
    parts = [(slice(y, y + size), slice(x, x + size)) for x, y in corners]
    seen = np.hstack([picture.seen[part] for part in parts])
    levels = zip(parts, found.level[chosen], strict=True)
    light = np.hstack([picture.light[part] - level for part, level in levels])
    middles = [(size * i + size // 2, size // 2) for i in range(len(parts))]
    fit = fit_2dgaussian(np.where(seen, light, 0.0), xypos=middles, fwhm=_FWHM * guess,
                         fix_fwhm=False, fit_shape=size, mask=~seen).results  # fmt: skip
    widths = np.asarray(fit["fwhm_fit"], dtype=float) / _FWHM
    good = (widths > 0.2) & (widths < 10 * guess)
    return float(np.median(widths[good])) if good.any() else guess


def _size(radius: float) -> int:
    """Return the side of a window about a spot, in px; odd."""
    return 2 * int(np.clip(np.ceil(_REACH * radius), 2, 60)) + 1


def _inside(places: FloatArray, shape: tuple[int, ...], margin: float) -> Mask:
    last = np.array(shape[::-1]) - 1 - margin
    return np.asarray(((places >= margin) & (places <= last)).all(axis=1))


def _touched(mask: Mask, places: FloatArray, size: int) -> Mask:
    """Say which windows about places have a pixel of a mask in them."""
    from scipy.ndimage import maximum_filter

    if not mask.any():
        return np.zeros(len(places), bool)
    x, y = places.astype(int).T
    return np.asarray(maximum_filter(mask, size=size)[y, x])


def _measured(picture: Picture, found: _Field, gain: float | None, threshold: float) -> Stars:
    """Fit the centre of each spot, and say which ones are no stars."""
    import pandas as pd

    shape, size = picture.light.shape, min(_size(found.radius), *picture.light.shape)
    corners = np.clip(window_corners(found.places, size | 1), 0, np.array(shape[::-1]) - size)
    y, x = (corners[:, i, None] + np.arange(size) for i in (1, 0))
    at = (y[:, :, None], x[:, None, :])
    seen = picture.seen[at]
    light = np.where(seen, picture.light[at] - found.level[:, None, None], 0.0)
    fits, estimated = (_FITS, True) if gain is None else (2, False)
    # Without photon noise first: what scatters more under more light tells how much there is.
    gain = gain or 1e6 / float(found.noise.min()) ** 2
    noise = found.noise
    for _ in range(fits):
        spots = fitted_spots(gain * light, corners, found.radius, gain * noise, seen)
        left = spots.residuals / gain
        model = np.maximum((light - left) * seen, 0)
        noise = found.noise * np.sqrt(_dark(left, model, np.square(found.noise), seen))
        if estimated:
            gain = _gain(left, model, np.square(noise), seen, gain)
    dark = np.square(noise)
    flux = spots.light / gain
    odd = _odd(left, model, dark[:, None, None] + model / gain, seen)
    reach = size // 2 + _TAIL * found.radius
    moved = np.abs(spots.centre - found.places).max(axis=1)
    reasons = {
        "saturated": _touched(picture.full, found.places, size),
        "at the edge": ~_inside(found.places, shape, found.radius),
        f"another within {reach:.3g} px": _crowded(found, reach),
        "not the shape of a spot": odd,
        "no centre found": ~(moved < size / 2) | ~(flux > 0),
    }
    dropped = np.full(len(flux), "", object)
    for reason, rows in reasons.items():
        dropped[rows & (dropped == "")] = reason
    sigma = np.sqrt(np.diagonal(spots.covariance, axis1=1, axis2=2))
    columns = (*spots.centre.T, *sigma.T, flux, found.level, noise, dropped)
    names = ("x", "y", "sigma_x", "sigma_y", "flux", "background", "noise", "dropped")
    table = pd.DataFrame(dict(zip(names, columns, strict=True)))
    facts = {"radius": found.radius, "background": float(np.median(found.level)),
             "noise": float(np.median(noise)), "gain": float(gain)}  # fmt: skip
    log = [*picture.notes, *_told(picture, found.hot, facts, threshold, size, len(flux))]
    result = Stars(picture.name, shape, table, spots.covariance, log, facts)
    if not len(result):
        raise PictureError(
            f"{picture.name}: expected stars, got {len(flux)} other things: {_causes(result)}"
        )
    return result


def _causes(found: Stars) -> str:
    counts = found.dropped["dropped"].value_counts()
    return ", ".join(f"{count} {reason}" for reason, count in counts.items())


def _told(
    picture: Picture, hot: Mask, facts: Mapping[str, float], threshold: float, size: int, count: int
) -> list[str]:
    counts = {"missing": int(np.isnan(picture.light).sum()), "saturated": int(picture.full.sum()),
              "hot": int(hot.sum())}  # fmt: skip
    masked = [f"{number} pixels are {kind}" for kind, number in counts.items() if number]
    return [
        *[", ".join(masked)] * bool(masked),
        "background {background:.5g}, noise {noise:.3g}, gain {gain:.3g} electrons per number, "
        "spots of radius {radius:.3g} px".format(**facts),
        f"{count} things above {threshold:g} standard deviations in {_TOUCHING} touching pixels, "
        f"each fitted in {size} by {size} px",
    ]


def _dark(left: FloatArray, model: FloatArray, dark: FloatArray, seen: Mask) -> float:
    """Return what multiplies the variance of dark pixels, from those of the windows."""
    some = seen & (np.square(model) < dark[:, None, None] / 4) & np.isfinite(left)
    if some.sum() < _DARK:
        return 1.0
    squares = np.square(left) / dark[:, None, None]
    # The median of the square of a normal number.
    return float(np.clip(np.median(squares[some]) / 0.4549, *_FACTOR))


def _gain(left: FloatArray, model: FloatArray, dark: FloatArray, seen: Mask, last: float) -> float:
    """Return electrons per digital number, from how residuals grow with the light.

    What grows with its square is no photon noise: spots that are not quite Gaussian. Residuals are
    those of a fit with the `last` gain.
    """
    from scipy.optimize import nnls

    variance = dark[:, None, None] + model / last
    free = np.maximum(seen.sum(axis=(1, 2)) - 3.0, 1.0)  # a fit has three numbers
    share = (free / seen.sum(axis=(1, 2)))[:, None, None] * seen / variance
    over = (np.square(left) / variance - share * dark[:, None, None]).sum(axis=(1, 2))
    columns = np.stack([(share * model**power).sum(axis=(1, 2)) for power in (1, 2)], axis=-1)
    good = np.isfinite(over) & (columns[:, 0] > 0)
    over, columns, free = over[good], columns[good], free[good]
    columns = columns[:, : 1 if len(over) < _TELLING else 2]
    scale = columns.max(axis=0, initial=1e-300)
    found = np.zeros(len(scale))
    for _ in range(_ROUNDS):
        spread = np.sqrt(2 * free) + (columns / scale)[:, 1:] @ found[1:]
        # One that is not alone in its window would spoil what the others say.
        off = np.abs(over - columns / scale @ found) / spread
        trust = 1 / (spread * np.sqrt(np.maximum(1, off / 3)))
        found, _ = nnls(columns / scale * trust[:, None], over * trust)
    alone, worse = nnls(columns[:, :1] / scale[:1] * trust[:, None], over * trust)
    rest = np.linalg.norm((over - columns / scale @ found) * trust)
    if worse**2 - rest**2 < _PLAIN:
        found = alone
    return float(1 / max(found[0] / scale[0], 1e-6 * float(dark.min())))


def _odd(left: FloatArray, model: FloatArray, variance: FloatArray, seen: Mask) -> Mask:
    """Say which spots differ surely, and by more than others do, from the common shape."""
    expected = (variance * seen).sum(axis=(1, 2))
    excess = np.square(left).sum(axis=(1, 2)) - expected
    spread = np.sqrt(2 * (np.square(variance) * seen).sum(axis=(1, 2)))
    misfit = excess / np.square(model).sum(axis=(1, 2))
    usual = max(float(np.nanmedian(misfit)), 0.0)
    limit = min(_MISFIT, _UNUSUAL * usual + _SLIGHT)
    return np.asarray((misfit > limit) & (excess > _SURELY * spread))


def _crowded(found: _Field, reach: float) -> Mask:
    """Say which places have another one close by."""
    from scipy.spatial import KDTree

    near: Any = KDTree(found.places).query_pairs(reach, output_type="ndarray", p=np.inf)
    close = np.zeros(len(found.places), bool)
    close[near.ravel()] = True
    return close


class Match(Display):
    """The stars of two pictures that are the same, row by row.

    Attributes
    ----------
    rows : ndarray of int, shape (n, 2)
        Of each pair the star of the source and that of the target, as `Stars.frame` numbers them.
    start : Registration
        The transform under which they are neighbours.
    mirrored : bool
        Whether the target is a mirror image of the source.
    log : list of str
        How the pairs were found, and how many stars have none.
    """

    def __init__(
        self,
        source: Stars,
        target: Stars,
        start: Registration | None = None,
        radius: float | None = None,
    ) -> None:
        self.source, self.target = source, target
        near = radius or _reach(source, target)
        how = "neighbours of a start"
        if start is None:
            try:
                start = _asterism(source.points, target.points, near)
            except ValueError as error:
                raise ValueError(f"{source.name} and {target.name}: {error}") from error
            how = "triangles of neighbours"
        pairs = _neighbours(start, source.points, target.points, near)
        for _ in range(2 if len(pairs) > _FEW else 0):
            # What was found from a few bright stars is sharpened by all.
            fit = _affine(source.points[pairs[:, 0]], target.points[pairs[:, 1]])
            start, pairs = fit, _neighbours(fit, source.points, target.points, near)
        self.start, self.rows = start, pairs
        self.mirrored = bool(np.linalg.det(start.matrix) < 0)
        counts = f"{len(source)} and {len(target)} stars"
        self.log = [f"{len(pairs)} pairs of {counts}, by {how}, less than {near:.3g} px apart"]
        if self.mirrored:
            self.log.append("the pictures mirror each other")

    def frame(self) -> pd.DataFrame:
        """Return the pairs: places in px, and the rows of both stars."""
        import pandas as pd

        a, b = self.rows.T
        places = (*self.source.points[a].T, *self.target.points[b].T)
        columns = dict(zip(STARS, places, strict=True))
        return pd.DataFrame({**columns, "row": a, "row_reference": b})

    def blocks(self) -> Iterator[Block]:
        """Yield the first pairs and the log."""
        frame = self.frame().head(10)
        rows = [[str(i), *(f"{one:.6g}" for one in row)] for i, *row in frame.itertuples()]
        names = f"{self.source.name} and {self.target.name}"
        yield Grid(f"{len(self.rows)} pairs of {names}, in px", ("pair", *frame.columns), rows)
        yield from self.log


def _reach(source: Stars, target: Stars) -> float:
    """Return how far from each other two stars of a pair may land, in px."""
    field_ = max(float(np.ptp(one.points, axis=0).max()) for one in (source, target))
    widths = [one.facts.get("radius", 0.0) for one in (source, target)]
    return max(_NEAR, *widths) + _SHARE * field_


def _affine(source: FloatArray, target: FloatArray) -> Registration:
    """Return the affine transform of most pairs; mirrored ones are no exception."""
    return fit_registration(
        source, target, source.mean(axis=0), model="affine", robust=True
    ).transform


def _neighbours(
    start: Registration, source: FloatArray, target: FloatArray, radius: float
) -> NDArray[np.int64]:
    """Return rows of stars that are each other's nearest under a transform, shape (n, 2)."""
    from scipy.spatial import KDTree

    landed = start.apply(source)
    apart, there = map(np.asarray, KDTree(target).query(landed))
    back = np.asarray(KDTree(landed).query(target)[1])
    rows = np.arange(len(source))
    kept = (apart < radius) & (back[there] == rows)
    return np.stack([rows[kept], there[kept]], axis=-1)


def _asterism(source: FloatArray, target: FloatArray, radius: float) -> Registration:
    """Return the similarity, perhaps of a mirror image, under which most stars are neighbours."""
    tried = ""
    for count in _BRIGHTEST:
        some = source[:count], target[:count]
        if min(map(len, some)) < 3:
            raise ValueError(
                "expected three stars or more in both pictures, got "
                f"{len(source)} and {len(target)}; lower the threshold, or give a start"
            )
        best, landed = _consensus(*some, radius)
        area = float(np.prod(np.ptp(some[1], axis=0))) or 1.0
        mean = len(some[0]) * min(1.0, len(some[1]) * np.pi * radius**2 / area)
        if landed >= 3 and _by_chance(landed, mean) < _CHANCE:
            return best
        tried = f"{landed} of {len(some[0])}"
        if max(len(source), len(target)) <= count:
            break
    raise ValueError(
        "expected the same stars in both pictures, got none that can be told: the likeliest "
        f"transform lays {tried} stars on others, no more than chance does; give a start"
    )


def _by_chance(landed: int, mean: float) -> float:
    """Return how often so many of the tried transforms' stars land on others by chance."""
    from scipy.special import pdtrc

    # Two stars were laid there by the transform itself.
    return _TRIED * float(pdtrc(landed - 3, mean))


def _consensus(source: FloatArray, target: FloatArray, radius: float) -> tuple[Registration, int]:
    """Return the similarity of the triangles that lay most stars on others, and how many."""
    from scipy.spatial import KDTree

    corners, shapes = _triangles(source)
    others, there = _triangles(target)
    near, best, most = KDTree(target), Registration.similarity(1, 0, (0, 0), (0, 0)), 0
    for flip in (False, True):
        wanted = shapes.conj() if flip else shapes
        lists: Any = KDTree(as_points(there)).query_ball_point(as_points(wanted), _ALIKE)
        pairs = np.array([(i, j) for i, found in enumerate(lists) for j in found], int).reshape(
            -1, 2
        )
        unlike = np.abs(wanted[pairs[:, 0]] - there[pairs[:, 1]])
        pairs = pairs[np.argsort(unlike, kind="stable")[:_TRIED]]
        stars = as_complex(source * (1, -1) if flip else source)
        a, b = stars[corners[pairs[:, 0]]], as_complex(target)[others[pairs[:, 1]]]
        factor = (b[:, 1] - b[:, 0]) / (a[:, 1] - a[:, 0])
        landed = factor[:, None] * (stars - a[:, :1]) + b[:, :1]
        apart, hit = near.query(as_points(landed))
        # Several stars in one place are one.
        hit = np.sort(np.where(apart < radius, hit, -1), axis=1)
        counts = (np.diff(hit, axis=1, prepend=-1) > 0).sum(axis=1)
        if counts.size and counts.max() > most:
            i = int(counts.argmax())
            most, turn = int(counts[i]), factor[i]
            shift = as_points(-(b[i, 0] - turn * a[i, 0]))
            columns = np.array([[turn.real, -turn.imag], [turn.imag, turn.real]])
            columns = columns * (1, -1) if flip else columns
            best = Registration("affine", np.append(columns.ravel(), shift), np.zeros(2))
    return best, most


def _triangles(points: FloatArray) -> tuple[NDArray[np.int64], NDArray[np.complex128]]:
    """Return triangles of neighbours: their corners, and their shapes as complex numbers.

    The longest side leads from the first corner to the second; the shape says where, in units of
    it, the third one lies, nearer to the first.
    """
    from scipy.spatial import KDTree

    count = min(len(points), _NEIGHBOURS + 1)
    near = np.asarray(KDTree(points).query(points, count)[1])
    chosen = {tuple(sorted((row[0], *two))) for row in near.tolist()
              for two in combinations(row[1:], 2)}  # fmt: skip
    corners = np.array(sorted(chosen), int).reshape(-1, 3)
    stars = as_complex(points)
    sides = np.abs(stars[corners] - stars[np.roll(corners, -1, axis=1)])
    longest = sides.argmax(axis=1)[:, None]
    # Turned so that the longest side joins the first two.
    corners = np.take_along_axis(corners, (longest + np.arange(3)) % 3, axis=1)
    a, b, c = stars[corners].T
    swap = np.abs(c - a) > np.abs(c - b)
    corners[swap] = corners[swap][:, [1, 0, 2]]
    a, b, c = stars[corners].T
    return corners, (c - a) / (b - a)


class RegisteredPictures(Registered):
    """The transform that lays one picture on another, from their stars.

    As `Registered`, and further the ``source`` and the ``target`` as `Stars`, their ``match``, the
    pairs used as ``pairs``, and a ``log`` of how they were found and of what was dropped and why.
    """

    def __init__(
        self,
        source: Stars,
        target: Stars,
        pivot: Any = None,
        *,
        model: str = "similarity",
        robust: bool = True,
        start: Registration | None = None,
        radius: float | None = None,
        picture: Picture | None = None,
    ) -> None:
        given: dict[str, Any] = {"source": source, "target": target, "pivot": pivot}
        given |= {
            "model": model,
            "robust": robust,
            "start": start,
            "radius": radius,
            "picture": picture,
        }
        self.match = Match(source, target, getattr(start, "transform", start), radius)
        if self.match.mirrored and model != "affine":
            raise ValueError(
                f"{source.name} and {target.name} mirror each other: flip one, image[:, ::-1], "
                'or take model="affine"'
            )
        if pivot is None:
            height, width = source.shape
            pivot = ((width - 1) / 2, (height - 1) / 2) if width else source.points.mean(axis=0)
        self.source_stars, self.target_stars = source, target
        rows, landing = self.match.rows, self.match.start.matrix
        points = source.points[rows[:, 0]], target.points[rows[:, 1]]
        spread = landing @ source.covariance[rows[:, 0]] @ landing.T
        variance = np.trace(spread + target.covariance[rows[:, 1]], axis1=1, axis2=2) / 2
        robust = robust and len(rows) >= _FEWEST
        settings: dict[str, Any] = {"model": model, "robust": robust}
        self.beyond = _beyond(*points, np.asarray(pivot), variance, settings)
        weights = variance + self.beyond**2
        weights = np.median(weights) / weights if (weights > 0).all() else np.ones(len(rows))
        super().__init__(*points, pivot, weights=weights, **settings)
        self._given, self._picture = given, picture
        self.pairs = self.match.frame().assign(
            residual_x=self.residuals[:, 0], residual_y=self.residuals[:, 1],
            used=self.fit.weights > 0,
        )  # fmt: skip
        out = int((self.fit.weights == 0).sum())
        self.log = [
            *(f"{one.name}: {line}" for one in (source, target) for line in one.log),
            *self.match.log,
            f"beyond the errors of the centres the pairs scatter by {self.beyond:.2g} px",
            *[f"dropped {out} pairs that do not fit the others"] * bool(out),
        ]
        facts = {"source": source.name, "target": target.name, "log": self.log}
        self._facts = {**facts, **self._facts, "beyond_px": self.beyond}

    def blocks(self) -> Iterator[Block]:
        """Yield the parameters, the remarks, and how the pairs were found."""
        yield from super().blocks()
        yield Fold("How the stars were found, and what was dropped", tuple(self.log))

    def landed(self) -> pd.DataFrame:
        """Return where all stars of the source land, with deviations and covariance, in px."""
        import pandas as pd

        points = self.source_stars.points
        places = self.transform.apply(points)
        spread = self.fit.landed_covariance(points, self.source_stars.covariance)
        sigma = np.sqrt(np.diagonal(spread, axis1=1, axis2=2))
        columns = (*places.T, *sigma.T, spread[:, 0, 1])
        names = ("x", "y", "sigma_x", "sigma_y", "covariance_xy")
        return pd.DataFrame(dict(zip(names, columns, strict=True)))

    def posterior(self, **plan: Any) -> Posterior:
        """Return the posterior of the same transform over the pairs that are used, by emcee.

        It is that of a similarity; `plan` holds steps, walkers, seed and priors.
        """
        from reproduce.views.posterior import Posterior

        if self.model != "similarity":
            raise ValueError(f"posterior: expected the model similarity, got {self.model}")
        used = self.pairs[self.pairs["used"]].reset_index(drop=True)
        pivot = tuple(self.transform.pivot.tolist())
        return Posterior("registration", data=used, pivot=pivot, **plan)

    @cached_property
    def drawn(self) -> Figure:
        """The residual vectors before and after, as a matplotlib figure."""
        from reproduce.views.figure import painted

        return painted(self._paint)

    def save(self, path: str | Path) -> Path:
        """Write the picture of the residual vectors: .svg, .pdf or .png."""
        from reproduce.views.figure import save

        save(self.drawn, Path(path))
        return Path(path)

    def _paint(self, figure: Figure) -> None:
        """Draw the pairs before and after, each with a scale of its own."""
        used, source = self.fit.weights > 0, self.pairs[["x", "y"]].to_numpy()
        before = self.pairs[["x_reference", "y_reference"]].to_numpy() - source
        figure.set_size_inches(6.4, 3.4)
        both = figure.subplots(1, 2, sharex=True, sharey=True)
        span = float(np.ptp(source, axis=0).max())
        kinds = ((used, "#0072B2", "used"), (~used, "#D55E00", "dropped"))
        panels = zip(both, ("before", "after"), (before, self.residuals), strict=True)
        for axes, title, arrows in panels:
            length = float(np.median(np.hypot(*arrows[used].T))) or 1.0
            looks = {"angles": "xy", "scale": 20 * length / span, "scale_units": "xy"}
            for kind, colour, label in kinds:
                axes.quiver(*source[kind].T, *arrows[kind].T, color=colour, label=label, **looks)
            axes.set(title=f"{title}: median {length:.2g} px", aspect="equal", xlabel="x (px)")
        both[0].set_ylabel("y (px)")
        both[0].invert_yaxis()

    def write(self, path: str | Path) -> Path:
        """Write the registered picture as FITS, background taken away, the transform in its header.

        Pixels that come from none of the source are NaN. A file that is there is not overwritten.
        """
        from astropy.io import fits

        if self._picture is None or self._picture.cell:
            raise ValueError("write: expected a picture without a mosaic as the source, got none")
        light = self._picture.light - self.source_stars.facts["background"]
        missing = np.isnan(light)
        image = registered_image(np.where(missing, 0.0, light), self.transform)
        inside = registered_image(1.0 - missing, self.transform, order=1)
        image[inside < inside.max() * (1 - 1e-9)] = np.nan
        unit = fits.PrimaryHDU(image.astype(np.float32))
        used = int(np.count_nonzero(self.fit.weights))
        names = {"source": self.source_stars.name, "target": self.target_stars.name}
        entries: list[tuple[str, Any, str]] = [(key, name, "") for key, name in names.items()]
        entries += [("model", self.model, ""), ("stars", used, "")]
        pivot = self.transform.pivot.tolist()
        entries += [(f"pivot-{axis}", value, "px") for axis, value in zip("xy", pivot, strict=True)]
        for name, unit_of, value, deviation, *_ in self.frame().itertuples():
            entries += [(name, value, unit_of), (f"{name}-sd", deviation, unit_of)]
        for key, value, note in entries:
            known = isinstance(value, str) or np.isfinite(value)
            unit.header[f"HIERARCH register {key}"] = (value if known else "unknown", note)
        try:
            unit.writeto(path)
        except OSError as error:
            raise ValueError(f"{path}: {error}") from error
        return Path(path)


def _beyond(
    source: FloatArray, target: FloatArray, pivot: FloatArray, variance: FloatArray,
    settings: Mapping[str, Any],
) -> float:  # fmt: skip
    """Return the scatter of pairs beyond the variance of their centres, in px.

    With it chi-square is its degrees of freedom; zero where the centres explain all.
    """
    extra = 0.0
    for _ in range(_TIMES):
        total = np.maximum(variance + extra, 1e-30)
        fit = fit_registration(source, target, pivot, np.median(total) / total, **settings)
        used = fit.weights > 0
        square, own = np.square(fit.residuals[used]).sum(axis=1), variance[used]
        low, high = 0.0, float(square.sum() / max(float(fit.degrees_of_freedom), 1.0))
        for _ in range(50):
            extra = (low + high) / 2
            over = (square / np.maximum(own + extra, 1e-30)).sum() > fit.degrees_of_freedom
            low, high = (extra, high) if over else (low, extra)
    return float(np.sqrt(extra)) if extra > 1e-12 else 0.0


class Channels(Remade):
    """Several pictures of one field, each laid on the reference: a `Registered` by name."""

    def __init__(self, fits: Mapping[str, RegisteredPictures], reference: str) -> None:
        self.fits, self.reference = dict(fits), reference
        self._given = {"fits": fits, "reference": reference}

    def __getitem__(self, name: str) -> RegisteredPictures:
        """Return the registration of one picture."""
        return self.fits[name]

    def frame(self) -> pd.DataFrame:
        """Return the parameters of all, by picture."""
        import pandas as pd

        return pd.concat({name: fit.frame() for name, fit in self.fits.items()}, names=["picture"])

    def record(self) -> dict[str, Any]:
        """Return everything for other programs."""
        pictures = {name: fit.record() for name, fit in self.fits.items()}
        return {"reference": self.reference, "pictures": pictures}

    def blocks(self) -> Iterator[Block]:
        """Yield what each registration shows."""
        for fit in self.fits.values():
            yield from fit.blocks()


def registered(
    sources: Sequence[Any],
    pivot: Any = None,
    *,
    reference: str | int | None = None,
    progress: Callable[[int, int], None] | None = None,
    fit: Mapping[str, Any],
    bayer: str | None = None,
    threshold: float | None = None,
    saturation: float | None = None,
    gain: float | None = None,
) -> RegisteredPictures | Channels:
    """Register pictures, or the channels of one, on one of them: the second of three, last of two.

    Parameters
    ----------
    sources : sequence of paths, arrays or `Stars`
    pivot : array_like, shape (2,), optional
        The middle of the source by default.
    reference : str or int, optional
        Name or place of the picture on which the others are laid.
    progress : callable, optional
        Is told how many of all are read.
    fit : mapping
        Settings of `RegisteredPictures`.
    bayer, threshold, saturation, gain
        As for `reproduce.stars`.
    """
    pictures: dict[str, Picture | None] = {}
    found: dict[str, Stars] = {}
    for number, source in enumerate(sources, start=1):
        channels: Mapping[str, Any] = {"": source}
        if is_picture(source):
            channels = read_pictures(source, bayer, saturation)
        if len(channels) > 1 and len(sources) > 1:
            raise PictureError(
                f"{_name(source, number, pictures)}: expected one channel beside other pictures, "
                f"got {', '.join(channels)}; register it alone, or rp.stars of one channel of each"
            )
        for colour, one in channels.items():
            name = colour or _name(source, number, pictures)
            unnamed = not (colour or isinstance(source, str | Path))
            picture = one if isinstance(one, Picture) else None
            picture = replace(picture, name=name) if picture and unnamed else picture
            pictures[name], known = picture, one if isinstance(one, Stars) else None
            found[name] = _found(picture, threshold, gain) if picture else known or _listed(one)
        if progress:
            progress(number, len(sources))
    names = list(found)
    if len(names) < 2:
        raise ValueError("target: expected a second picture, or one of several channels")
    chosen = names[1] if reference is None else _chosen(reference, names)
    shapes = {name: picture.light.shape for name, picture in pictures.items() if picture}
    for name, shape in shapes.items():
        if shape != shapes.get(chosen, shape):
            (h, w), (high, wide) = shape, shapes[chosen]
            raise PictureError(
                f"{name}: expected {wide} by {high} px as {chosen}, got {w} by {h}; stars of "
                "pictures that differ are registered by rp.register(rp.stars(a), rp.stars(b))"
            )
    fits = {
        name: RegisteredPictures(found[name], found[chosen], pivot, picture=pictures[name], **fit)
        for name in names if name != chosen
    }  # fmt: skip
    return next(iter(fits.values())) if len(fits) == 1 else Channels(fits, chosen)


def _name(source: Any, number: int, others: Mapping[str, Any]) -> str:
    name = Path(source).name if isinstance(source, str | Path) else getattr(source, "name", "")
    return name if name and name not in others else f"picture {number}"


def _chosen(reference: str | int, names: Sequence[str]) -> str:
    if isinstance(reference, int) and 1 <= reference <= len(names):
        return names[reference - 1]
    if str(reference) in names:
        return str(reference)
    given = Path(str(reference)).name
    if given in names:
        return given
    raise ValueError(f"reference: expected one of {', '.join(names)}, got {reference!r}")
