"""Chandra's fiducial lights: chen2023's monitoring in orbit, and the drift of seven years.

Three lights beside the X-ray detector are seen by the star tracker, in windows that stay where they
are. Places are in px of the tracker, column before row, as `Platform` takes them; the camera's
frame is that of the tracker, so that the angles say how the pattern turns as the tracker sees it.
Light is in DN of the telemetry where nothing else is said.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property
from typing import TYPE_CHECKING

import numpy as np
from scipy.stats import theilslopes

from reproduce.papers.chen2023 import accuracy
from reproduce.papers.declare import Fact, draws, studied
from reproduce.papers.sketch import INK, sized
from reproduce.physics.attitude import (
    Platform,
    Stability,
    allan_deviation,
    moving_average,
    scatter_of_averages,
    stability,
)
from reproduce.physics.ground import DAY, trend_and_fourier
from reproduce.physics.images import fitted_centre
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.store.measured import Windows, aimpoints, star_images, tracker, windows
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from collections.abc import Iterator

    import pandas as pd
    from matplotlib.figure import Figure

LIGHTS = (0, 1, 2)
# Standard deviation of the Gaussian that is fitted to a light, in px.
RADIUS = 0.7
# Electrons per DN as the flight software has it; its README names the place.
GAIN = 5.0
# The dimmest pixels of a window tell its background.
_DIM = 16
# Half a pixel, and the light of a star as bright as the lights, in electrons.
_HALF, _STAR_LIGHT = 0.5, 2e5
# By how much a pixel is changed to see how a centre answers, in electrons.
_NUDGE = 20.0
_HOUR = DAY / 24
_AXES = "XYZ"
# Frames that are shown as one.
_TOGETHER = 16
_SHARE = 0.95
_BLUE, _ORANGE, _GREEN = "#0072B2", "#D55E00", "#009E73"


def _background(images: FloatArray) -> float:
    """Return the light of the dimmest pixels of windows (n, height, width), in their mean."""
    return float(np.sort(images.mean(axis=0), axis=None)[:_DIM].mean())


def _rms(values: FloatArray, axis: int | None = None) -> FloatArray:
    """Return the root of the mean square."""
    return np.asarray(np.sqrt(np.square(values).mean(axis=axis)))


def _scatter(series: FloatArray) -> FloatArray:
    """Return the standard deviation of a frame, along the first axis, from successive frames."""
    return np.asarray(np.diff(series, axis=0).std(axis=0) / np.sqrt(2))


@dataclass(frozen=True)
class Transfer:
    """Noise of a pixel: electrons per DN with its interval, and noise without light, in DN."""

    gain: float
    ends: tuple[float, float]
    noise: float


def _windows() -> list[Windows]:
    """Return the windows of the three lights, which show the same frames."""
    return [windows(slot) for slot in LIGHTS]


@cache
def transfer() -> Transfer:
    """Return how the variance of a pixel follows its light: a line that few pixels cannot bend."""
    images = [one.images for one in _windows()]
    light = np.concatenate([one.mean(axis=0).ravel() for one in images])
    variance = np.concatenate([_scatter(one).ravel() ** 2 for one in images])
    found = theilslopes(variance, light, _SHARE)
    ends = (float(1 / found.high_slope), float(1 / found.low_slope))
    return Transfer(float(1 / found.slope), ends, float(np.sqrt(max(found.intercept, 0.0))))


def _fitted(seen: Windows, images: FloatArray, radius: float) -> FloatArray:
    """Return the centres that fit images (n, height, width) of a window best, (n, 2)."""
    known = transfer()
    light = (images - _background(seen.images)) * known.gain
    return fitted_centre(light, seen.corners[0], radius, known.noise * known.gain)


@dataclass(frozen=True, eq=False)
class Lights:
    """The three lights in every frame, and what they say."""

    radius: float

    @cached_property
    def hours(self) -> FloatArray:
        """Time of each frame since the first."""
        times = _windows()[0].times
        return np.asarray((times - times[0]) / _HOUR)

    @property
    def step(self) -> float:
        """Time from a frame to the next, as a rule, in s."""
        return float(np.median(np.diff(self.hours))) * _HOUR

    @cached_property
    def spots(self) -> FloatArray:
        """Fitted centres, (frames, 3, 2)."""
        fitted = [_fitted(one, one.images, self.radius) for one in _windows()]
        return np.stack(fitted, axis=1)

    @cached_property
    def platform(self) -> Platform:
        """The tracker, with the lights where they are on average."""
        return Platform.of_spots(**{**tracker(), "spots": self.spots.mean(axis=0)})

    @cached_property
    def angles(self) -> FloatArray:
        """Turn of the lights since their mean, (frames, 3), in arcsec."""
        turned = self.platform.misalignment(self.spots, self.platform.reference)
        return np.asarray(turned * ARCSEC_PER_RADIAN)

    def covariance(self, variance: FloatArray) -> FloatArray:
        """Return that of the angles of a frame, (3, 3), in arcsec squared, for spots' (3, 2)."""
        moves = self.platform.response(self.platform.spots) * ARCSEC_PER_RADIAN
        return np.asarray(np.einsum("anx,nx,bnx->ab", moves, variance, moves))

    @cached_property
    def steady(self) -> Stability:
        """Drift of the angles in an hour, and what averages of the rest reach."""
        return stability(self.hours, self.angles)

    @cached_property
    def raw(self) -> FloatArray:
        """Allan deviations of averages as of `steady`, with the drift in them."""
        return allan_deviation(self.angles, self.steady.counts.tolist(), axis=0)

    @cached_property
    def bent(self) -> Stability:
        """The same of what no turn explains: places of the lights less turned ones, (…, 6)."""
        turns = self.angles[None] / ARCSEC_PER_RADIAN
        left = self.spots - self.platform.predicted(np.zeros((1, 3)), turns)[0]
        return stability(self.hours, left.reshape(len(left), -1))

    @cached_property
    def answer(self) -> FloatArray:
        """How each centre answers to each pixel, (3, 2, height, width), in px per DN."""
        found = []
        for one in _windows():
            mean = one.images.mean(axis=0)
            nudges = np.eye(mean.size).reshape(-1, *mean.shape) * _NUDGE / transfer().gain
            up, down = (_fitted(one, mean + sign * nudges, self.radius) for sign in (1, -1))
            slopes = (up - down) / (2 * _NUDGE / transfer().gain)
            found.append(slopes.T.reshape(2, *mean.shape))
        return np.stack(found)

    @cached_property
    def foretold(self) -> FloatArray:
        """The variance of each place, (3, 2), by the noise of the pixels."""
        light = np.stack([one.images.mean(axis=0) for one in _windows()])
        pixels = light / transfer().gain + transfer().noise ** 2
        return np.asarray(np.einsum("nxij,nij->nx", np.square(self.answer), pixels))


@cache
def lights(radius: float = RADIUS) -> Lights:
    """Return the lights, with spots of such a radius fitted."""
    return Lights(radius)


@cache
def answers(radius: float = RADIUS) -> tuple[float, float]:
    """Return by how much a fitted centre answers to a motion of a star within a pixel.

    The least and the most, from one tenth of a pixel to the next; one is a faithful answer.
    """
    images, places = star_images()
    known, inner = transfer(), np.abs(places) < _HALF
    light = images[inner][:, inner] * _STAR_LIGHT
    found = fitted_centre(light, (0.0, 0.0), radius, known.noise * known.gain)
    steps = np.diff(places[inner])
    down = np.diff(found[..., 1], axis=0).mean(axis=1) / steps
    along = np.diff(found[..., 0], axis=1).mean(axis=0) / steps
    both = np.concatenate([down, along])
    return float(both.min()), float(both.max())


def _light_facts() -> Iterator[tuple[str, Fact]]:
    seen, known = lights(), transfer()
    yield "frames", Fact(len(seen.spots), ",d")
    yield "minutes", Fact(60 * float(seen.hours[-1]), ".0f", "min")
    yield "frame-time", Fact(seen.step, ".1f", "s")
    yield "gain", Fact(known.gain, ".1f")
    yield "gain-low", Fact(known.ends[0], ".1f")
    yield "gain-high", Fact(known.ends[1], ".1f")
    yield "gain-said", Fact(GAIN, "g")
    yield "share", Fact(100 * _SHARE, ".0f", "%")
    yield "noise", Fact(known.noise, ".1f")
    ratio = _scatter(seen.spots) / np.sqrt(seen.foretold)
    yield "measured", Fact(float(_rms(ratio)), ".2f")


@studied("instruments/lights", named=lambda: dict(_light_facts()))
def _of_lights(radius: float = RADIUS) -> pd.DataFrame:
    """The noise of one frame: scatter of each light against what its pixels foretell."""
    seen = lights(radius)
    columns = _scatter(seen.spots), np.sqrt(seen.foretold)
    rows = []
    for light, images in enumerate(one.images for one in _windows()):
        total = float((images - _background(images)).sum(axis=(1, 2)).mean() * transfer().gain)
        for axis, name in enumerate(("column", "row")):
            values = [1e3 * float(one[light, axis]) for one in columns]
            rows.append((light + 1, name, total / 1e3, *values))
    return _of_lights.frame(rows, radius=radius)


def _turn_facts() -> Iterator[tuple[str, Fact]]:
    seen = lights()
    steady, bent, hours = seen.steady, seen.bent, float(seen.hours[-1])
    yield "rate-x", Fact(steady.rate[0], ".3f", "arcsec")
    yield "rate-x-error", Fact(steady.rate_error[0], ".3f", "arcsec")
    yield "drift-y", Fact(abs(steady.rate[1]) * hours, ".2f", "arcsec")
    for at, axis in enumerate("xyz"):
        yield f"scatter-{axis}", Fact(_scatter(seen.angles)[at], "#.2g", "arcsec")
    for at, axis in enumerate("xy"):
        yield f"floor-{axis}", Fact(steady.floor[at], "#.2g", "arcsec")
    pixel, worst = ARCSEC_PER_RADIAN / seen.platform.pixels, int(np.abs(bent.rate).argmax())
    yield "pixel", Fact(pixel, ".3f", "arcsec")
    yield "bent", Fact(abs(bent.rate[worst]) * hours, ".4f", "px")
    yield "bent-error", Fact(bent.rate_error[worst] * hours, ".4f", "px")
    yield "bent-angle", Fact(abs(bent.rate[worst]) * hours * pixel, ".3f", "arcsec")
    low, high = answers()
    moved = np.abs(stability(seen.hours, seen.spots.reshape(-1, 6)).rate).max() * hours
    yield "answer-error", Fact(100 * max(1 - low, high - 1), ".0f", "%")
    yield "bent-made", Fact(float((high - low) * moved), ".3f", "px")


@studied("instruments/laser-metrology", named=lambda: dict(_turn_facts()))
def _turns() -> pd.DataFrame:
    """What three lights say of the misalignment in one observation."""
    seen = lights()
    steady, floor = seen.steady, seen.steady.floor_interval(_SHARE)
    known = np.sqrt(np.diag(seen.covariance(seen.foretold)))
    rows = [
        (axis, _scatter(seen.angles)[at], known[at], steady.rate[at], steady.rate_error[at],
         steady.floor[at], *floor[:, at], int(steady.reached[at]))
        for at, axis in enumerate(_AXES)
    ]  # fmt: skip
    return _turns.frame(rows, share=100 * _SHARE)


_COUNTS = f"{accuracy.TABLE}#*.frames"
_PRINTED = tuple(f"{accuracy.TABLE}#*.misalignment-{axis}" for axis in "xy")
_READS = (_COUNTS, *_PRINTED, accuracy.FRAMES)


def white_scatter(frames: int, count: int) -> float:
    """Return the scatter of moving averages over so many frames of white noise of unit size.

    It is that about their own mean, whose square is expected.
    """
    runs, apart = frames - count + 1, np.arange(-count + 1, count)
    shared = (np.maximum(runs - np.abs(apart), 0) * (count - np.abs(apart))).sum() / count**2
    return float(np.sqrt((1 / count - shared / runs**2) * runs / (runs - 1)))


def _gains(door: Given) -> tuple[FloatArray, dict[str, FloatArray]]:
    """Return the counts of Table IV, (m,), and by how much averages beat one frame, (m, …) each.

    As shares of what the root of their number promises: one is white noise, more is worse. Of the
    lights both axes count together.
    """
    counts = door.array(_COUNTS).astype(int)
    frames, roots = door.count(accuracy.FRAMES), np.sqrt(counts)
    seen = lights()
    starts = np.linspace(0, len(seen.angles) - frames, 3).astype(int)

    def shares(scatters: FloatArray) -> FloatArray:
        return np.asarray(np.sqrt(np.square(scatters / scatters[:1]).mean(axis=1)) * roots)

    def flown(angles: FloatArray) -> FloatArray:
        parts = np.concatenate([angles[one : one + frames, :2] for one in starts], axis=-1)
        return shares(scatter_of_averages(parts, counts.tolist(), axis=0))

    printed = np.stack([door.array(one) for one in _PRINTED], axis=-1)
    white = np.array([white_scatter(frames, int(count)) for count in counts])
    return counts, {
        "printed": printed / printed[0] * roots[:, None],
        "flown": flown(seen.angles),
        "steady": flown(seen.steady.left),
        "next": shares(allan_deviation(seen.steady.left[:, :2], counts.tolist(), axis=0)),
        "white": white / white[0] * roots,
    }


def _gain_facts(door: Given) -> Iterator[tuple[str, Fact]]:
    counts, found = _gains(door)
    for axis, value in zip("xy", found.pop("printed")[-1].tolist(), strict=True):
        yield f"printed-{axis}", Fact(value, ".2f")
    for name, one in found.items():
        yield name, Fact(float(one[-1]), ".2f")
    yield "next-16", Fact(float(found["next"][list(counts).index(16)]), ".2f")
    yield "most", Fact(int(counts[-1]), "d")
    seen = lights()
    best = seen.steady.counts[seen.raw.argmin(axis=0)]
    for at, axis in enumerate("xy"):
        yield f"best-{axis}", Fact(int(best[at]), "d")
        yield f"least-{axis}", Fact(float(seen.raw[:, at].min()), "#.2g", "arcsec")
    yield "best-x-time", Fact(float(best[0]) * seen.step / 60, ".1f", "min")


@studied("instruments/averaging", given=_READS, named=lambda door: dict(_gain_facts(door)))
def _averaging(door: Given) -> pd.DataFrame:
    """How averaging falls: Table IV of chen2023 and the lights in orbit."""
    counts, found = _gains(door)
    table = np.column_stack(list(found.values()))
    rows = [(int(n), *row) for n, row in zip(counts, table.tolist(), strict=True)]
    return _averaging.frame(rows, frames=door.count(accuracy.FRAMES))


# The years that are foretold, each from all before it.
_TESTED = (2022, 2023, 2024, 2025)
_FIRST = 2019
# Strategies, by their names in sentences.
_STRATEGIES = {
    "once": "one calibration, in the first year",
    "trend": "a straight trend",
    "periodic": "trend and a yearly Fourier series of degree 2",
    "temperature": "trend and temperature",
    "flown": "the flight model as it was then",
}


@cache
def strategies() -> dict[str, FloatArray]:
    """Return what each strategy foretells for the observations of the tested years, (n, 2).

    In arcsec. Each year is foretold from all years before it; also what was ``measured``.
    """
    seen = aimpoints()
    years, measured, year_of = seen.years, seen.measured, np.floor(seen.years)
    since = years - _FIRST
    columns = np.stack([np.ones_like(since), since, seen.temperatures], axis=-1)
    found = {name: np.empty_like(measured) for name in _STRATEGIES}
    found["once"][:] = measured[year_of == _FIRST].mean(axis=0)
    for year in _TESTED:
        rows, known = year_of == year, int((year_of < year).sum())
        line = trend_and_fourier(since, years, measured, known, degree=0)
        series = trend_and_fourier(since, years, measured, known)
        fitted = np.linalg.lstsq(columns[:known], measured[:known], rcond=None)[0]
        found["trend"][rows], found["periodic"][rows] = line[rows], series[rows]
        found["temperature"][rows] = columns[rows] @ fitted
    found |= {"flown": seen.foretold, "measured": measured}
    tested = years >= _TESTED[0]
    return {name: one[tested] for name, one in found.items()}


def _misses() -> dict[str, FloatArray]:
    """Return how far what was measured lies from what each strategy foretells, (n,)."""
    found = strategies()
    return {name: np.linalg.norm(found["measured"] - found[name], axis=1) for name in _STRATEGIES}


def _strategy_facts() -> Iterator[tuple[str, Fact]]:
    seen = aimpoints()
    yield "observations", Fact(len(seen.years), "d")
    yield "tested", Fact(len(strategies()["measured"]), "d")
    yield "last-day", Fact(float((seen.years % 1).max() * 365), ".0f")
    yield "worst", Fact(float(np.linalg.norm(seen.left, axis=1).max()), ".1f", "arcsec")
    for name, lengths in _misses().items():
        yield name, Fact(float(_rms(lengths)), ".1f", "arcsec")
        yield f"{name}-median", Fact(float(np.median(lengths)), ".1f", "arcsec")


@studied("instruments/strategies", named=lambda: dict(_strategy_facts()))
def _strategies() -> pd.DataFrame:
    """Seven years of drift: what each strategy foretells of years that it has not seen."""
    rows = [
        (_STRATEGIES[name], *_rms(lengths.reshape(len(_TESTED), -1), axis=1),
         float(_rms(lengths)), float(np.median(lengths)))
        for name, lengths in _misses().items()
    ]  # fmt: skip
    observations = len(strategies()["measured"])
    return _strategies.frame(rows, tested=observations, years=len(_TESTED))


@draws("instruments/drawing-lights")
def _draw_lights(figure: Figure) -> None:
    """The misalignment in one observation, and what averages of its frames err by."""
    narrow = sized(figure, 6.4, 3.2, 5.6)
    series, falls = figure.subplots(*((2, 1) if narrow else (1, 2)))
    seen = lights()
    counts = seen.steady.counts
    for at, ink, mark, line in ((0, _BLUE, "o", "--"), (1, _ORANGE, "s", "-.")):
        means, hours = (
            moving_average(one, _TOGETHER)[::_TOGETHER] for one in (seen.angles[:, at], seen.hours)
        )
        series.plot(60 * hours, means, mark, color=ink, markersize=2, label=f"about {_AXES[at]}")
        falls.plot(counts, seen.raw[:, at], mark, color=ink, markersize=4, fillstyle="none",
                   linestyle="-", linewidth=0.6)  # fmt: skip
        falls.plot(counts, seen.steady.deviations[:, at], mark, color=ink, markersize=4)
        falls.plot(counts, seen.steady.white[:, at], line, color=ink, linewidth=0.8)
    series.set(xlabel="time (min)", ylabel="misalignment (arcsec)")
    falls.set(xscale="log", yscale="log", xlabel="frames averaged (count)",
              ylabel="Allan deviation (arcsec)")  # fmt: skip
    falls.set_xticks((1, 10, 100), ("1", "10", "100"))
    falls.set_yticks((0.001, 0.003, 0.01), ("0.001", "0.003", "0.01"))
    falls.minorticks_off()
    figure.legend(*series.get_legend_handles_labels(), loc="outside lower center", ncols=2)


_MARKS = (("once", _GREEN, "+"), ("trend", _ORANGE, "x"), ("flown", _BLUE, "s"))


@draws("instruments/drawing-strategies")
def _draw_strategies(figure: Figure) -> None:
    """Seven years of drift as measured, and what strategies foretell."""
    narrow = sized(figure, 6.4, 3.2, 5.6)
    panels = figure.subplots(*((2, 1) if narrow else (1, 2)), sharex=True)
    seen, found = aimpoints(), strategies()
    tested = seen.years[seen.years >= _TESTED[0]]
    for at, (axes, name) in enumerate(zip(panels, "yz", strict=True)):
        axes.plot(seen.years, seen.measured[:, at], "o", color=INK, markersize=4, label="measured")
        for strategy, ink, mark in _MARKS:
            axes.plot(tested, found[strategy][:, at], mark, color=ink, markersize=5,
                      fillstyle="none", label=_STRATEGIES[strategy])  # fmt: skip
        axes.set(xlabel="time (year)", ylabel=f"drift along {name} (arcsec)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center",
                  ncols=1 if narrow else 2)  # fmt: skip
