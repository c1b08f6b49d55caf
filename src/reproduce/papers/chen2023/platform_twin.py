"""A simulated bench (digital twin) of the ground platform, from images to the misalignment (IV, V).

Every frame is made as on the bench: four spots at their places, light integrated over pixels,
photon noise, centres of gravity, and (2) to (9). The assumptions, recorded with their results:

* light: each laser of each group has the light that gives the mean variance of its two cells of
  Table III by photon noise. Nothing else is fitted. The twin lacks effects other than photon noise,
  such as a laser whose x scatters less than its y;
* the spot's radius is the printed one; it is the same for all lasers;
* places: the printed centroids, minus the bias of their 5 by 5 window, are constant within a group,
  and are the same in both groups, because the paper does not print the difference;
* laser directions are the designed ones, as in the calibration, with the printed nominal focal
  length and diagonal. Within the rounding of the diagonal and a few per cent of the focal length
  they fit the printed spots, as a test shows. The residual is the same in all frames and belongs
  to the zero point.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.random import Generator, default_rng
from numpy.typing import ArrayLike

from reproduce.papers.charts import INK, named_below, pair, sized
from reproduce.papers.chen2023 import accuracy, effectiveness, platform, resolution
from reproduce.papers.chen2023.satellite import LASER, STAR
from reproduce.papers.declare import draws, seed_of
from reproduce.physics import attitude, images
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.store.measured import bright_stars
from reproduce.units import ARCSEC_PER_RADIAN

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

_WINDOW = f"{platform.TEXT}#window-x"
_BENCH = (*platform.INSTRUMENT, platform.SCATTER, resolution.SPOT_RADIUS, _WINDOW)
READS = (*_BENCH, accuracy.FRAMES)


@dataclass(frozen=True, eq=False)
class _Bench:
    """The ground platform as the twin sees it.

    Attributes
    ----------
    design : Platform
        Lasers and tracker as designed.
    spots : ndarray, shape (4, 2)
        True centres of the spots at rest, in px.
    light : ndarray, shape (2, 4)
        Electrons of each spot, for both groups of images.
    radius : float
        Radius of a spot, in px.
    window : int
        Width of the window around a spot, in px.
    """

    design: attitude.Platform
    spots: FloatArray
    light: FloatArray
    radius: float
    window: int

    def turned(self, angles: ArrayLike) -> FloatArray:
        """Return the spots after a turn of the camera by angles of shape (..., 3)."""
        zero = self.design.transform(self.spots)
        # (6): the light goes back to the camera of the zero point, then by the present transform.
        now = zero @ attitude.rotation_from_vector(angles)
        moved = self.design.seen(self.spots) @ zero @ now.mT
        return attitude.received_spots(moved, *self.design.tracker)


def bench(inputs: Inputs) -> _Bench:
    """Set the twin up from printed numbers."""
    design, window = platform.as_designed(inputs), round(inputs[_WINDOW])
    radius = inputs[resolution.SPOT_RADIUS] / inputs[platform.PIXEL]
    law, _ = resolution.spot_laws(design.spots, radius, window)
    target = np.stack(
        [(platform.scatter(inputs, g) ** 2).mean(axis=-1) for g in (1, 2)]
    )
    light = np.asarray(law.variance.mean(axis=-1) / target)
    return _Bench(design, design.spots - law.bias, light, radius, window)


def centroids(
    twin: _Bench, spots: ArrayLike, light: ArrayLike, frames: int, generator: Generator
) -> FloatArray:
    """Render frames and extract the spots, as the bench does.

    Shape (..., frames, 4, 2). Centres of gravity, in px.
    """
    places = np.asarray(spots, dtype=np.float64)[..., np.newaxis, :, :]
    corners = images.window_corners(places, twin.window)
    mean = images.spot_windows(places, light, twin.radius, corners, twin.window)
    shape = (*mean.shape[:-4], frames, *mean.shape[-3:])
    seen = images.expose(np.broadcast_to(mean, shape), images.Detector(), generator)
    return images.centre_of_gravity(seen, np.broadcast_to(corners, (*shape[:-2], 2)))


class _Series(NamedTuple):
    """What the bench measures over two groups of frames.

    Extracted centroids, (2, frames, 4, 2), in px; error of the laser transform of the first group,
    in the camera frame, and misalignment of the second against the zero point of the first,
    (frames, 3), in radians.
    """

    spots: FloatArray
    transform: FloatArray
    misalignment: FloatArray


def _two_groups(twin: _Bench, frames: int, generator: Generator) -> _Series:
    """Take two groups of frames and solve them, as the accuracy test does."""
    found = np.stack(
        [centroids(twin, twin.spots, light, frames, generator) for light in twin.light]
    )
    single = twin.design.transform(found[0])
    zero = attitude.mean_rotation(single)
    errors = attitude.misalignment_angles(single.mT @ zero)
    return _Series(found, errors, twin.design.misalignment(found[1], zero))


# Towards Orion, a well-known constellation: right ascension, declination and turn about the
# boresight.
_POINTING_DEG = (84.6, -0.4, 20.0)
_FAINTEST_MAGNITUDE = 6.0
_SERIES_READS = (*READS, accuracy.SMOOTHED, accuracy.DURATION)
_STAGE_READS = (
    *_SERIES_READS,
    f"{effectiveness.TABLE}#*.position-?",
    effectiveness.FRAMES,
)
_MARGIN_PX = 12
_in_series = partial(draws, inputs=_SERIES_READS, random=True)
_in_ride = partial(draws, inputs=_STAGE_READS, random=True)


@draws("chen2023/fig-1c", inputs=platform.INSTRUMENT, marks=[platform.SPOTS])
def _draw_frame(figure: Figure, printed: Mapping[str, float], inputs: Inputs) -> None:
    """A frame of the star and laser tracker: stars of the catalogue and the four laser spots."""
    (alpha, delta, turn), stars = _POINTING_DEG, bright_stars()
    # Intrinsic turns about Z, X and Z.
    turns = np.radians([[0, 0, alpha + 90], [90 - delta, 0, 0], [0, 0, turn]])
    about_z, about_x, roll = attitude.rotation_from_vector(turns)
    rays = stars.directions @ about_z @ about_x @ roll
    seen = (rays[:, 2] > 0.9) & (stars.magnitude <= _FAINTEST_MAGNITUDE)
    spots = attitude.received_spots(rays[seen], *platform.as_designed(inputs).tracker)
    sizes = 5 * 1.7 ** (_FAINTEST_MAGNITUDE - stars.magnitude[seen])
    inside = ((spots > 0) & (spots < inputs.array(platform.PIXELS) - 1)).all(axis=1)
    sized(figure, 6.0, 6.0, 4.2)
    axes = figure.add_subplot()
    x, y = spots[inside].T
    axes.scatter(
        x, y, s=sizes[inside], color=STAR.colour, marker=STAR.marker, label="stars"
    )
    axes.plot(*_pairs(printed).T, LASER.marker, markersize=5, color=LASER.colour)
    axes.lines[0].set_label("laser spots, printed")
    axes.set(xlim=(-0.5, 1023.5), ylim=(1023.5, -0.5), aspect="equal")
    axes.set(xlabel="x (px)", ylabel="y (px)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, 1.09), ncols=2)


def _pairs(printed: Mapping[str, float]) -> FloatArray:
    return np.array(list(printed.values())).reshape(-1, 2)


@cache
def _groups(inputs: Inputs) -> _Series:
    """Return the two groups of frames that Figures 8 and 9 show."""
    twin, frames = bench(inputs), inputs.count(accuracy.FRAMES)
    return _two_groups(
        twin, frames, default_rng(seed_of("chen2023/fig-8", inputs.root))
    )


@cache
def _ride(inputs: Inputs) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Run the test of Figure 10: the printed positions, one state after the other.

    Shape (frames,). Times, in seconds. Shape (frames, 2), twice. Angles about X and Y, in radians:
    reference, and as monitored by the mean of up to 100 frames before.
    """
    twin, frames = bench(inputs), inputs.count(effectiveness.FRAMES)
    places = inputs.array(f"{effectiveness.TABLE}#*.position-?").reshape(-1, 2)
    # A motion along one axis turns the camera about the other; the printed signs are kept.
    motions = (places - places[0])[:, ::-1]
    angles = attitude.stage_angle(motions, inputs[platform.TELESCOPE])
    spots = twin.turned(np.insert(angles, 2, 0.0, axis=1))
    generator = default_rng(seed_of("chen2023/fig-10b", inputs.root))
    found = centroids(twin, spots, twin.light[1], frames, generator)
    zero = attitude.mean_rotation(twin.design.transform(found[0]))
    single = twin.design.misalignment(found, zero).reshape(-1, 3)[:, :2]
    count = inputs.count(accuracy.SMOOTHED)
    start = np.cumsum(single[: count - 1], axis=0) / np.arange(1, count)[:, None]
    monitored = np.concatenate([start, attitude.moving_average(single.T, count).T])
    times = np.arange(len(single), dtype=np.float64) * accuracy.time_per_frame(inputs)
    return times, np.repeat(angles, frames, axis=0), monitored


@_in_series("chen2023/fig-7", marks=[platform.SPOTS])
def _draw_spots(figure: Figure, printed: Mapping[str, float], inputs: Inputs) -> None:
    """Image of the four laser spots in the tracker, rendered at the printed places."""
    twin = bench(inputs)
    corner = np.floor(twin.spots.min(axis=0)).astype(int) - _MARGIN_PX
    end = np.ceil(twin.spots.max(axis=0)).astype(int) + _MARGIN_PX
    size = tuple((end - corner).tolist())
    spots = twin.spots - corner
    mean = images.render_frame(spots, twin.light[0], twin.radius, size)
    generator = default_rng(seed_of("chen2023/fig-7", inputs.root))
    seen = images.expose(mean, images.Detector(), generator)
    (left, top), (right, bottom) = corner - 0.5, end - 0.5
    sized(figure, 6.4, 5.2, 3.2)
    figure.set_layout_engine("compressed")
    axes = figure.add_subplot()
    extent = (left, right, bottom, top)
    picture = axes.imshow(seen, extent=extent, cmap="gray", vmin=0.0)
    centres = _pairs(printed)
    axes.plot(
        *centres.T,
        "o",
        markersize=16,
        fillstyle="none",
        color="#D55E00",
        label="printed",
    )
    for number, (x, y) in enumerate(centres, start=1):
        axes.annotate(f"{number}", (x + 2.5, y - 1.5), color="#E69F00")
    axes.grid(visible=False)
    axes.set(xlabel="x (px)", ylabel="y (px)")
    axes.legend(loc="upper right", labelcolor="#E69F00")
    figure.colorbar(picture, ax=axes, label="electrons per frame")


@_in_series("chen2023/fig-8", marks=[f"{accuracy.TEXT}#transform-single-?"])
def _draw_transform(
    figure: Figure, printed: Mapping[str, float], inputs: Inputs
) -> None:
    """Error of the laser transform over the first group, single frames and smoothed."""
    _series(figure, inputs, _groups(inputs).transform, printed, "error (arcsec)")


@_in_series("chen2023/fig-9", marks=[f"{accuracy.TEXT}#misalignment-single-?"])
def _draw_misalignment(
    figure: Figure, printed: Mapping[str, float], inputs: Inputs
) -> None:
    """Monitored misalignment over the second group, single frames and smoothed.

    The bench stood differently in the second group, and the paper prints no number for it. A
    constant misalignment moves the whole series and leaves its scatter as it is; the twin has
    none, and the axis says that it counts from there.
    """
    _series(
        figure,
        inputs,
        _groups(inputs).misalignment,
        printed,
        "angle, less offset (arcsec)",
    )


def _series(
    figure: Figure,
    inputs: Inputs,
    angles: FloatArray,
    printed: Mapping[str, float],
    quantity: str,
) -> None:
    count, frames = inputs.count(accuracy.SMOOTHED), np.arange(1, len(angles) + 1)
    panels = pair(figure, 3.4, 5.4, quantity)
    columns = zip(
        panels, "XY", angles.T[:2] * ARCSEC_PER_RADIAN, printed.values(), strict=True
    )
    for panel, axis, series, limit in columns:
        panel.plot(frames, series, ".", markersize=2.5, label="single frame")
        smoothed, name = attitude.moving_average(series, count), f"mean of {count}"
        panel.plot(frames[count - 1 :], smoothed, color=INK, linewidth=2.5, label=name)
        for side, limits in ((-1, "_"), (1, "printed, 3σ")):
            edge = series.mean() + side * limit * ARCSEC_PER_RADIAN
            panel.axhline(edge, color=INK, linestyle="--", linewidth=1, label=limits)
        panel.set(xlabel="frame", title=f"about {axis}")
    named_below(figure, 3)


@draws("chen2023/fig-10a", marks=["chen2023/table-5#*.position-?"])
def _draw_pattern(figure: Figure, printed: Mapping[str, float]) -> None:
    """Motion pattern of the stage, its five states marked."""
    places = _pairs(printed) * 1e6
    axes = figure.add_subplot()
    axes.plot(*places.T, "--", linewidth=1)
    axes.plot(*places.T, "^", markersize=8, color="#D55E00")
    for state, (x, y) in enumerate(places, start=1):
        axes.annotate(f"state {state}", (x + 3.5, y - 4.0), fontsize=9)
    axes.set(
        xlabel="stage along X (µm)",
        ylabel="stage along Y (µm)",
        xlim=(0, 112),
        ylim=(0, 95),
    )


@_in_ride("chen2023/fig-10b", marks=[f"{effectiveness.TABLE}#[2-5].monitoring-y"])
def _draw_about_y(figure: Figure, printed: Mapping[str, float], inputs: Inputs) -> None:
    """Monitored and reference angle about Y while the stage moves along X."""
    _ridden(figure, inputs, "Y", printed)


@_in_ride("chen2023/fig-10c", marks=[f"{effectiveness.TABLE}#[2-5].monitoring-x"])
def _draw_about_x(figure: Figure, printed: Mapping[str, float], inputs: Inputs) -> None:
    """Monitored and reference angle about X while the stage moves along Y."""
    _ridden(figure, inputs, "X", printed)


@_in_ride("chen2023/fig-1d")
def _draw_example(figure: Figure, printed: Mapping[str, float], inputs: Inputs) -> None:
    """One move of the stage, close up: the average follows the reference after its own length."""
    sized(figure, 6.4, 3.2, 2.8)
    _ridden(figure, inputs, "Y", {})


def _ridden(
    figure: Figure, inputs: Inputs, axis: str, marked: Mapping[str, float]
) -> None:
    """Draw the whole test with the printed angles, or one move without any."""
    times, *angles = _ride(inputs)
    each, axes = len(times) // len(effectiveness.STATES), figure.add_subplot()
    shown = slice(None) if marked else slice(each // 2, 2 * each)
    reference, monitored = (
        a[shown, "XY".index(axis)] * ARCSEC_PER_RADIAN for a in angles
    )
    axes.plot(
        times[shown], monitored, label="monitored" + " by the twin" * bool(marked)
    )
    axes.plot(
        times[shown], reference, "--", label="reference" + ", (10)" * bool(marked)
    )
    if marked:
        values = np.array(list(marked.values())) * ARCSEC_PER_RADIAN
        middles = times[each + each // 2 :: each]
        axes.plot(middles, values, "s", color=INK, label="monitored, printed")
    axes.set(xlabel="time (s)", ylabel=f"angle about {axis} (arcsec)")
    axes.legend()
