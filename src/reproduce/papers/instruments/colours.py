"""Colour against colour on real instruments: three detectors behind dichroics, and many lenses.

The mosaics of 2MASS show one field in J, H and K on one grid, so the registration between any two
is known beforehand: scale one, no rotation, no shift. Places are in px of the mosaics, which are
`PIXEL` arcsec wide, x before y, the centre of the first pixel at (0, 0). A scale or a rotation is
also given as what it moves a star `EDGE` px from the pivot.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.special import chdtrc, fdtrc

from reproduce.papers.declare import Fact, draws, studied
from reproduce.papers.sketch import INK, sized
from reproduce.physics.images import fitted_centre, window_corners
from reproduce.physics.registration import (
    MODELS,
    RegistrationFit,
    fit_registration,
    neighbours,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.store.measured import lenses, mosaic

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    import pandas as pd
    from matplotlib.figure import Figure

BoolArray = NDArray[np.bool_]

PAIRS = {"jh": "J to H", "hk": "H to K", "jk": "J to K"}
PIXEL = 5.0
PIVOT = np.array([360.0, 359.5])
EDGE = 360.0
_FIELD = 721.0
# Width of a strip of the survey, each scanned along y, in arcmin.
_STRIP = 8.5
# What a similarity should find; scale and rotation, then the shift, as what they move.
_TRUTH, _LEVER = np.array([1.0, 0.0, 0.0, 0.0]), np.array([EDGE, EDGE, 1.0, 1.0])
_NAMES = ("Scale, at the edge", "Rotation, at the edge", "Shift along x", "Shift along y")
# Of a star: least brightness over the noise of the sky, and the radius of its spot, in px.
LEAST, RADIUS = 10.0, 0.35
# Above this, in the units of the files, stars are near saturation.
_BRIGHT = 2300.0
# Widths of a window and of what is searched for one peak, and of the margin, in px.
_WINDOW, _PEAK, _MARGIN, _TILE = 3, 5, 4, 32
# How far apart two detections may be one star, in px.
REACH = 1.0
_BLOCKS = 6
# Periods that are tried for a pattern over the mosaic, in px.
_PERIODS = _FIELD / np.arange(4.0, 24.0, 0.05)
# Models between the truth and the wave, and for each of all the place of its simpler one.
_TRIED = ("shift", "similarity", "similarity+radial", "affine")
_SIMPLER = (0, 0, 1, 2, 2, 2)
_LOOKS = (("x", "#0072B2", "o", "-"), ("y", "#D55E00", "s", "--"))


@cache
def stars(band: str, least: float = LEAST, radius: float = RADIUS) -> FloatArray:
    """Return the stars of a mosaic, (n, 2): the library's peaks and background, our centres."""
    image = mosaic(band)  # which says what to install
    from photutils.background import Background2D
    from photutils.detection import find_peaks

    sky = Background2D(image, _TILE, filter_size=3)
    light, noise = image - sky.background, float(np.median(sky.background_rms))
    peaks = find_peaks(light, least * noise, box_size=_PEAK, border_width=_MARGIN)
    x, y = (np.asarray(peaks[f"{axis}_peak"]) for axis in "xy")
    kept = image[y, x] < _BRIGHT
    corners = window_corners(np.stack([x, y], axis=-1)[kept], _WINDOW)
    across, down = (corners[:, axis, None] + np.arange(_WINDOW) for axis in (0, 1))
    windows = light[down[:, :, None], across[:, None, :]]
    places = fitted_centre(windows, corners, radius, noise)
    return places[np.isfinite(places).all(axis=-1)]


@dataclass(frozen=True, eq=False)
class Pairs:
    """The same stars in two mosaics, and the robust similarity between them."""

    source: FloatArray  # (n, 2), in px
    target: FloatArray
    fit: RegistrationFit

    @property
    def kept(self) -> BoolArray:
        """Which stars the robust fit counts."""
        return np.asarray(self.fit.weights > 0)

    def again(self, model: str = "similarity") -> RegistrationFit:
        """Fit a model to the stars that the robust similarity counts."""
        return fit_registration(self.source, self.target, PIVOT, self.fit.weights, model)


@cache
def pairs(name: str, least: float = LEAST, radius: float = RADIUS) -> Pairs:
    """Match the stars of two mosaics, each the other's nearest, and register them."""
    one, other = (stars(band, least, radius) for band in name)
    here, there = neighbours(one, other, REACH).T
    source, target = one[here], other[there]
    return Pairs(source, target, fit_registration(source, target, PIVOT, robust=True))


def _blocks(found: Pairs) -> FloatArray:
    """Return standard errors of the similarity by a jackknife over blocks of the field, (4,)."""
    cells = (found.source * _BLOCKS / _FIELD).astype(int) @ [1, _BLOCKS]
    weights = found.fit.weights
    left = np.array([
        fit_registration(found.source, found.target, PIVOT, weights * (cells != cell)).parameters
        for cell in np.unique(cells)
    ])  # fmt: skip
    return np.asarray(np.sqrt((len(left) - 1) * left.var(axis=0)))


@dataclass(frozen=True, eq=False)
class Pattern:
    """The wave along one axis of the field that the residuals follow best."""

    period: float  # in px
    waves: FloatArray  # (2, 2): cosine and sine of the residual along x, then of that along y
    power: float  # of both; of noise alone it exceeds p with the chance (1 + p) exp(-p)

    @property
    def amplitude(self) -> FloatArray:
        """Of the residuals along x and y, in px."""
        return np.asarray(np.hypot(*self.waves.T))

    @property
    def chance(self) -> float:
        """How often noise alone has such waves, at any of the periods tried: at most so."""
        return float(min(1.0, len(_PERIODS) * (1 + self.power) * np.exp(-self.power)))


def wave(places: FloatArray, residuals: FloatArray) -> Pattern:
    """Look for a wave in residuals, (n, 2), of stars at places (n,)."""
    turns = np.exp(2j * np.pi * places / _PERIODS[:, None]) @ residuals / len(places)
    powers = len(places) * (np.abs(turns) ** 2 / residuals.var(axis=0)).sum(axis=1)
    best = int(powers.argmax())
    waves = 2 * np.stack([turns[best].real, turns[best].imag], axis=-1)
    return Pattern(float(_PERIODS[best]), waves, float(powers[best]))


@cache
def _pattern(name: str, axis: int = 0) -> Pattern:
    """Return the wave of a pair along an axis of the field."""
    found = pairs(name)
    return wave(found.source[found.kept, axis], found.again().residuals[found.kept])


def _compared(found: Pairs) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return what a similarity finds less what it should, and its errors, also by blocks, (4,)."""
    return found.fit.parameters - _TRUTH, found.fit.standard_errors, _blocks(found)


def _detector_facts() -> Iterator[tuple[str, Fact]]:
    yield "pairs", Fact(len(pairs("hk").source), ",d")
    yield "kept", Fact(int(pairs("hk").kept.sum()), ",d")
    yield "lost", Fact(float(100 * (1 - pairs("hk").kept.mean())), ".1f", "%")
    for name in PAIRS:
        off, _, _ = _compared(pairs(name))
        chance = chdtrc(4, off @ np.linalg.solve(pairs(name).fit.covariance, off))
        yield f"{name}-chance", Fact(float(chance), "chance" if chance < 1e-3 else ".2f")
    off, errors, blocks = _compared(pairs("hk"))
    for end, values in (("", off), ("-error", errors)):
        yield f"scale{end}", Fact(1e6 * values[0], ".1f")
        yield f"x{end}", Fact(PIXEL * values[2], ".3f", "arcsec")
    yield "x-sigma", Fact(abs(off[2]) / max(errors[2], blocks[2]), ".1f")


@studied("instruments/three-detectors", named=lambda: dict(_detector_facts()))
def _detectors(least: float = LEAST, radius: float = RADIUS) -> pd.DataFrame:
    """The null test: what a similarity finds between two detectors that are registered."""
    rows = []
    for name, label in PAIRS.items():
        off, errors, blocks = _compared(pairs(name, least, radius))
        columns = off * _LEVER, errors * _LEVER, blocks * _LEVER, off / errors
        rows += [(label, *row) for row in zip(_NAMES, *map(list, columns), strict=True)]
    return _detectors.frame(rows, blocks=_BLOCKS**2, least=least)


def _models() -> Iterator[tuple[str, str, int, float, float, float]]:
    """Yield each model of each pair: its parameters, what it leaves, what each of them gains."""
    for name, label in PAIRS.items():
        found, ripple = pairs(name), _pattern(name)
        source, target = found.source[found.kept], found.target[found.kept]
        angle = 2 * np.pi * source[:, 0] / ripple.period
        waves = np.stack([np.cos(angle), np.sin(angle)], axis=-1) @ ripple.waves.T
        left = {"none: they are registered": target - source}
        left |= {model: found.again(model).residuals[found.kept] for model in _TRIED}
        left["similarity and a wave along x"] = left["similarity"] - waves
        counts = (0, *(len(MODELS[model]) for model in _TRIED), 9)
        squares = [float(np.square(one).sum()) for one in left.values()]
        for at, (model, count, simpler) in enumerate(zip(left, counts, _SIMPLER, strict=True)):
            freedom = 2 * len(source) - count
            gain = chance = float("nan")
            if at:
                more = count - counts[simpler]
                gain = (squares[simpler] - squares[at]) / more / (squares[at] / freedom)
                chance = ripple.chance if "wave" in model else float(fdtrc(more, freedom, gain))
            yield label, model, count, float(np.sqrt(squares[at] / 2 / len(source))), gain, chance


def _model_facts() -> Iterator[tuple[str, Fact]]:
    found, ripple = pairs("hk"), _pattern("hk")
    spread = found.again().residuals[found.kept].std(axis=0)
    for axis, size in zip("xy", ripple.amplitude, strict=True):
        yield f"amplitude-{axis}", Fact(size, ".4f", "px")
    error = float(spread.mean()) * np.sqrt(2 / found.kept.sum())
    yield "amplitude-error", Fact(error, ".4f", "px")
    yield "period", Fact(ripple.period, ".0f", "px")
    yield "period-angle", Fact(ripple.period * PIXEL / 60, ".1f", "arcmin")
    yield "strip", Fact(_STRIP, ".1f", "arcmin")
    yield "chance", Fact(ripple.chance, "chance")
    yield "control-chance", Fact(_pattern("hk", 1).chance, ".2f")


@studied("instruments/models", named=lambda: dict(_model_facts()))
def _of_models() -> pd.DataFrame:
    """Where the similarity stops: richer models on the same stars."""
    return _of_models.frame(_models())


# Printed scales, by colour and table.
_PRINTED = {(c, n): f"niu2024/table-{n}#scale.{c}" for n in (2, 4) for c in ("red", "blue")}
_PIXELS = ("niu2024/text-optics#pixels-x", "niu2024/text-optics#pixels-y")


@cache
def _scales(width: float, height: float) -> pd.DataFrame:
    """Return what lays each lens's red or blue over green on such a detector, in px.

    By least squares over all of it, for every setting of every lens: ``red`` and ``blue``, scale
    less one.
    """
    table, half = lenses(), height / 2
    x, y = np.meshgrid(*(np.linspace(-side, side, 25) / half for side in (width / 2, half)))
    green = np.hypot(x, y).ravel()
    found = table[["maker", "lens"]].set_index(["maker", "lens"])
    for colour in ("red", "blue"):
        one, two, three = (table[[term + colour[0]]].to_numpy() for term in "vcb")
        seen = green * (one + two * green + three * green**2)
        found[colour] = (seen @ green) / np.square(seen).sum(axis=1) - 1
    return found


_READS = (*_PRINTED.values(), *_PIXELS)


def _on(door: Given) -> pd.DataFrame:
    """Return the scales on the detector of niu2024, of each lens the median over its settings."""
    return _scales(*(door[address] for address in _PIXELS)).groupby(level=[0, 1]).median()


def _farther(door: Given) -> dict[tuple[str, int], int]:
    """Count the lenses whose scale is farther from one than each printed one."""
    return {one: int((_on(door)[one[0]].abs() > abs(door[address] - 1)).sum())
            for one, address in _PRINTED.items()}  # fmt: skip


def _lens_facts(door: Given) -> Iterator[tuple[str, Fact]]:
    found = _on(door)
    yield "lenses", Fact(len(found), "d")
    for (colour, number), count in _farther(door).items():
        yield f"{colour}-{number}-lenses", Fact(count, "d")
    for colour in ("red", "blue"):
        yield f"{colour}-typical", Fact(float(found[colour].abs().median()), ".1e")


@studied("instruments/lenses", given=_READS, named=lambda door: dict(_lens_facts(door)))
def _lenses(door: Given) -> pd.DataFrame:
    """The scale between colours: two tables of niu2024 among measured lenses."""
    found, farther = _on(door), _farther(door)
    rows = []
    for (colour, number), address in _PRINTED.items():
        ends = (1e3 * found[colour].quantile((0.025, 0.5, 0.975))).tolist()
        less = 1e3 * (door[address] - 1)
        rows.append((colour, f"Table {number}", less, *ends, farther[colour, number]))
    return _lenses.frame(rows, count=len(found))


@draws("instruments/drawing-lenses", given=_READS)
def _draw_lenses(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """The scale between colours of measured lenses, with those of niu2024."""
    narrow = sized(figure, 6.4, 3.0, 5.0)
    axes = figure.subplots(*((2, 1) if narrow else (1, 2)), sharex=True, squeeze=False).flat
    for one, colour, ink in zip(axes, ("red", "blue"), ("#D55E00", "#0072B2"), strict=True):
        values = 1e3 * _on(door)[colour]
        # Scales are told in round numbers: none may lie at an edge, where rounding decides.
        counts, edges = np.histogram(values, np.linspace(-3, 3, 61) + 1 / 30)
        one.plot(edges[1:], counts, color=ink, drawstyle="steps-pre")
        for number, line in ((2, "--"), (4, "-.")):
            scale = 1e3 * (door[_PRINTED[colour, number]] - 1)
            one.axvline(scale, color=INK, linestyle=line, label=f"niu2024, Table {number}")
        one.set(xlabel=f"scale of {colour} less one (10⁻³)", ylabel="lenses (count)")
    figure.legend(*one.get_legend_handles_labels(), loc="outside lower center", ncols=2)


@draws("instruments/drawing-strips")
def _draw_strips(figure: Figure) -> None:
    """What a similarity leaves between H and K, folded at the period that fits best."""
    import pandas as pd

    narrow = sized(figure, 6.4, 3.0, 5.0)
    axes = figure.subplots(*((2, 1) if narrow else (1, 2)), sharey=True)
    found, ripple = pairs("hk"), _pattern("hk")
    residuals = 1e3 * found.again().residuals[found.kept]
    turns = np.linspace(0, 1, 100)
    basis = np.stack([np.cos(2 * np.pi * turns), np.sin(2 * np.pi * turns)], axis=-1)
    for one, axis in zip(axes, (0, 1), strict=True):
        phase = (found.source[found.kept, axis] / ripple.period) % 1
        groups = pd.DataFrame(residuals).groupby((12 * phase).astype(int))
        means, errors = groups.mean(), groups.sem()
        for at, (name, ink, marker, line) in enumerate(_LOOKS):
            one.errorbar((means.index + 0.5) / 12, means[at], errors[at], fmt=marker, color=ink,
                         markersize=4, label=f"along {name}")  # fmt: skip
            if not axis:
                one.plot(turns, 1e3 * basis @ ripple.waves[at], line, color=ink)
        one.set(xlabel=f"phase along {'xy'[axis]} (period)", ylabel="mean residual (0.001 px)")
    figure.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=2)
