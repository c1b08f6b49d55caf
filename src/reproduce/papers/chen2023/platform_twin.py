"""A simulated bench (digital twin) of the ground platform, from images to the misalignment (IV, V).

Every frame is computed in the steps of the bench: four spots at their positions, flux integrated
over pixels, photon noise, centres of gravity, and (2) to (9). The assumptions, recorded with their
results, are:

* flux: each laser of each group has the flux that gives the mean variance of its two cells of
  Table III by photon noise. Nothing else is fitted. Effects other than photon noise are neglected,
  such as a laser with a smaller scatter in x than in y;
* the radius of a spot is the printed one, and equal for all lasers;
* positions: the printed centroids, minus the bias of their 5 by 5 window, are constant within a
  group, and equal in both groups, because the paper does not print the difference;
* laser directions are the designed ones, as in the calibration, with the printed nominal focal
  length and diagonal. They fit the printed spots within the rounding of the diagonal and a few per
  cent of the focal length, as a test shows. The residual is constant in all frames and belongs to
  the zero point.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from numpy.random import Generator, default_rng
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from reproduce.papers.charts import Figure, legend_below, set_size, two_panels
from reproduce.papers.chen2023.accuracy import (
    DURATION,
    FRAMES,
    SMOOTHED,
    time_per_frame,
)
from reproduce.papers.chen2023.effectiveness import (
    BOUND,
    FRAMES_PER_STATE,
    LAST,
    stage_motions,
    telescope_length,
)
from reproduce.papers.chen2023.platform import (
    INSTRUMENT,
    PIXEL,
    SPOTS,
    as_designed,
    scatter,
)
from reproduce.papers.chen2023.resolution import SPOT_RADIUS
from reproduce.papers.declare import draws, seed_of
from reproduce.physics.attitude import (
    mean_rotation,
    misalignment_angles,
    moving_average,
    received_spots,
    rotation_from_vector,
    stage_angle,
)
from reproduce.physics.images import (
    centre_of_gravity,
    centre_of_gravity_error,
    spot_windows,
    window_corners,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.store.measured import bright_stars
from reproduce.units import ARCSEC_PER_RADIAN

_WINDOW = "chen2023/text-platform#window-x"
_POSITIONS = "chen2023/table-5#*.position-?"
INPUTS = (
    *INSTRUMENT,
    "chen2023/table-3",
    SPOT_RADIUS,
    _WINDOW,
    FRAMES,
    SMOOTHED,
)


class SimulatedBench:
    """The simulated ground platform of the printed numbers.

    Attributes
    ----------
    design : Platform
        Lasers and tracker as designed.
    spots : ndarray, shape (4, 2)
        True centres of the spots at rest, in px.
    flux : ndarray, shape (2, 4)
        Electrons of each spot, for both groups of images.
    radius : float
        Radius of a spot, in px.
    window : int
        Width of the window around a spot, in px.
    """

    def __init__(self, inputs: Inputs) -> None:
        self.design, self.window = as_designed(inputs), inputs.count(_WINDOW)
        self.radius = inputs[SPOT_RADIUS] / inputs[PIXEL]
        printed = self.design.spots
        corners = window_corners(printed, self.window)
        # Photon variance is proportional to the inverse of the flux.
        bias, variance = centre_of_gravity_error(
            printed, 1.0, self.radius, corners, self.window
        )
        target = [(scatter(inputs, g) ** 2).mean(axis=-1) for g in (1, 2)]
        self.spots, self.flux = printed - bias, variance.mean(axis=-1) / target

    def rotated(self, angles: ArrayLike) -> FloatArray:
        """Return the spots after a rotation of the camera by angles of shape (..., 3)."""
        zero = self.design.transform(self.spots)
        # (6): back to the camera of the zero point, then by the present transform.
        now = zero @ rotation_from_vector(angles)
        moved = self.design.seen(self.spots) @ zero @ now.mT
        return received_spots(moved, *self.design.tracker)

    def centroids(
        self, spots: FloatArray, flux: ArrayLike, frames: int, generator: Generator
    ) -> FloatArray:
        """Return the centres of gravity in simulated frames, (..., frames, 4, 2), in px."""
        centres = spots[..., None, :, :]
        corners = window_corners(centres, self.window)
        mean = spot_windows(centres, flux, self.radius, corners, self.window)
        seen = generator.poisson(np.repeat(mean, frames, axis=-4))
        return centre_of_gravity(seen, corners)

    def two_groups(
        self, frames: int, generator: Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Return two groups of frames and their solution, as in the accuracy test.

        Centroids, (2, frames, 4, 2), in px. Angles, (2, frames, 3), in radians: the error of the
        laser transform of the first group, in the frame of the camera, and the misalignment of
        the second group against the zero point of the first.
        """
        spots = self.centroids(self.spots, self.flux[:, None], frames, generator)
        single = self.design.transform(spots[0])
        zero = mean_rotation(single)
        errors = misalignment_angles(single.mT @ zero)
        return spots, np.stack([errors, self.design.misalignment(spots[1], zero)])


# Attitude towards Orion, a well-known constellation: right ascension 84.6, declination -0.4, and a
# rotation about the boresight, in degrees.
_POINTING = Rotation.from_euler("ZXZ", (84.6 + 90, 90 + 0.4, 20.0), degrees=True)
_FAINTEST_MAGNITUDE = 6.0
# Width of the shown part of an image around a spot.
_SHOWN_PX = 9
_draws_series = partial(draws, inputs=INPUTS, random=True)
_draws_test = partial(
    draws,
    inputs=(*INPUTS, DURATION, _POSITIONS, FRAMES_PER_STATE, LAST),
    random=True,
)


@draws("chen2023/fig-1c", inputs=INSTRUMENT, marks=[SPOTS])
def _draw_frame(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw a frame of the tracker: stars of the catalogue and the four laser spots."""
    _, directions, magnitude = bright_stars()
    rays = _POINTING.apply(directions, inverse=True)
    seen = (rays[:, 2] > 0.9) & (magnitude <= _FAINTEST_MAGNITUDE)
    spots = received_spots(rays[seen], *as_designed(inputs).tracker)
    sizes = 5 * 1.7 ** (_FAINTEST_MAGNITUDE - magnitude[seen])
    set_size(figure, 6.0, 4.2, width=6.0)
    axes = figure.add_subplot()
    x, y = spots.T
    axes.scatter(x, y, sizes, "C2", label="stars")
    axes.plot(*printed.pairs(SPOTS).T, "C1s", label="laser spots, printed")
    axes.set(
        xlim=(-0.5, 1023.5),
        ylim=(1023.5, -0.5),
        aspect="equal",
        xlabel="x (px)",
        ylabel="y (px)",
    )
    legend_below(figure, 2)


@cache
def _groups(inputs: Inputs) -> FloatArray:
    """Return the angles of the two groups of frames in Figures 8 and 9, in arcsec."""
    generator = default_rng(seed_of("chen2023/fig-8", inputs.root))
    _, angles = SimulatedBench(inputs).two_groups(inputs.count(FRAMES), generator)
    return angles * ARCSEC_PER_RADIAN


@cache
def _stage_test(
    inputs: Inputs, telescope: str = "nominal"
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the test of Figure 10: the printed positions, one state after the other.

    The focal length of the telescope is the nominal one, or the common one of Table V.
    Times of the frames, (frames,), in seconds. Reference angles about X and Y and the angles
    monitored by the mean of up to 100 frames before, each (frames, 2), in radians.
    """
    import pandas as pd

    twin, frames = SimulatedBench(inputs), inputs.count(FRAMES_PER_STATE)
    # A motion along one axis rotates the camera about the other; the printed signs are kept.
    length = telescope_length(inputs, "motions", telescope)
    angles = stage_angle(stage_motions(inputs)[:, ::-1], length)
    spots = twin.rotated(np.insert(angles, 2, 0.0, axis=1))
    generator = default_rng(seed_of("chen2023/fig-10b", inputs.root))
    centroids = twin.centroids(spots, twin.flux[1], frames, generator)
    zero = mean_rotation(twin.design.transform(centroids[0]))
    single = twin.design.misalignment(centroids, zero).reshape(-1, 3)[:, :2]
    windows = pd.DataFrame(single).rolling(inputs.count(SMOOTHED), 1)
    times = np.arange(len(single), dtype=np.float64) * time_per_frame(inputs)
    return times, np.repeat(angles, frames, axis=0), windows.mean().to_numpy()


@_draws_series("chen2023/fig-7", marks=[SPOTS])
def _draw_spots(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the images of the four laser spots in the tracker, at the printed positions."""
    from matplotlib.patches import Rectangle

    twin = SimulatedBench(inputs)
    generator = default_rng(seed_of("chen2023/fig-7", inputs.root))
    corners, inner = (
        window_corners(twin.spots, size) for size in (_SHOWN_PX, twin.window)
    )
    mean = spot_windows(twin.spots, twin.flux[0], twin.radius, corners, _SHOWN_PX)
    seen = generator.poisson(mean)
    set_size(figure, 4.8, 3.6, width=5.6)
    figure.set_layout_engine("compressed")
    panels = figure.subplots(2, 2)
    centres = printed.pairs(SPOTS)
    shown = zip(panels.flat, centres, corners - 0.5, inner - 0.5, seen, strict=True)
    for number, (axes, centre, (left, top), start, flux) in enumerate(shown, start=1):
        extent = (left, left + _SHOWN_PX, top + _SHOWN_PX, top)
        image = axes.imshow(flux, "gray", extent=extent, vmin=0.0, vmax=seen.max())
        label, width = "window of the centroid", twin.window
        axes.add_patch(Rectangle(start, width, width, fill=False, ec="C5", label=label))
        axes.plot(*centre, "C1+", markersize=14, mew=2, label="printed centroid")
        axes.grid(visible=False)
        axes.set(
            title=f"spot {number}",
            xlabel="x (px)",
            ylabel="y (px)",
            xticks=left + np.array([0.5, 4.5, 8.5]),
        )
    figure.colorbar(image, ax=panels, label="electrons per frame")
    legend_below(figure, 2)


def _draw_series(
    figure: Figure, printed: Inputs, inputs: Inputs, group: int, label: str
) -> None:
    """Draw angles about X and Y of the frames of a group and their means, with printed limits."""
    angles, count = _groups(inputs), inputs.count(SMOOTHED)
    frames = np.arange(1, angles.shape[1] + 1)
    # Figures 8 and 9 have one scale.
    reach = 1.05 * np.abs(angles[..., :2]).max()
    columns = zip(
        two_panels(figure, 3.4, 5.4, label),
        "XY",
        angles[group].T,
        map(printed.__getitem__, printed.cells),
        strict=False,
    )
    for axes, axis, series, limit in columns:
        axes.plot(frames, series, lw=0.6, label="single frame")
        means = moving_average(series, count)
        axes.plot(frames[count - 1 :], means, "k", lw=2.5, label=f"mean of {count}")
        for side, name in ((-1, "_"), (1, "printed, 3σ")):
            edge = series.mean() + side * limit * ARCSEC_PER_RADIAN
            axes.axhline(edge, color="k", linestyle="--", linewidth=1, label=name)
        axes.set(xlabel="frame", title=f"about {axis}", ylim=(-reach, reach))
    legend_below(figure, 3)


_draw_transform = _draws_series(
    "chen2023/fig-8", marks=["chen2023/text-accuracy#transform-single-?"]
)(partial(_draw_series, group=0, label="error (arcsec)"))
# The bench had another alignment in the second group, and the paper prints no number for it. A
# constant misalignment moves the whole series and does not change its scatter. The simulated bench
# has none, and the label of the axis states it.
_draw_misalignment = _draws_series(
    "chen2023/fig-9", marks=["chen2023/text-accuracy#misalignment-single-?"]
)(partial(_draw_series, group=1, label="angle minus offset (arcsec)"))


@draws("chen2023/fig-10a", marks=[_POSITIONS])
def _draw_pattern(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the motion pattern of the stage with its five states."""
    positions = printed.pairs(_POSITIONS) * 1e6
    axes = figure.add_subplot()
    axes.plot(*positions.T, "C1^--", linewidth=1, markersize=8)
    for state, (x, y) in enumerate(positions, start=1):
        axes.annotate(f"state {state}", (x + 3.5, y - 4.0), fontsize=9)
    axes.set(
        xlabel="stage along X (µm)",
        ylabel="stage along Y (µm)",
        xlim=(0, 112),
        ylim=(0, 95),
    )


def _draw_test(figure: Figure, printed: Inputs, inputs: Inputs, axis: str) -> None:
    """Draw the whole test with the printed angles, and its differences from the references."""
    set_size(figure, 5.6, 5.6)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    bound = printed[BOUND] * ARCSEC_PER_RADIAN
    monitored, reference = (
        printed.array(f"chen2023/table-5#[2-5].{name}-{axis.lower()}")
        * ARCSEC_PER_RADIAN
        for name in ("monitoring", "reference")
    )
    frames = inputs.count(FRAMES_PER_STATE)
    for telescope, look in (("nominal", "C0-"), ("common", "C1--")):
        length = telescope_length(inputs, "motions", telescope)
        times, _, angles = _stage_test(inputs, telescope)
        angle = angles[:, "XY".index(axis)] * ARCSEC_PER_RADIAN
        upper.plot(times, angle, look, label=f"simulated, {length * 1e3:.0f} mm")
        rest = angle - np.repeat(np.insert(reference, 0, 0.0), frames)
        # An average over a step is not an angle of a state.
        rest[np.arange(len(rest)) % frames < inputs.count(SMOOTHED)] = np.nan
        lower.plot(times, rest, look)
    middles = times[frames + frames // 2 :: frames]
    upper.plot(middles, monitored, "ks", label="printed")
    lower.plot(middles, monitored - reference, "ks")
    lower.axhspan(-bound, bound, fc=("C6", 0.2), ec="C6", label="bound of the paper")
    upper.set_ylabel(f"angle about {axis} (arcsec)")
    lower.set(xlabel="time (s)", ylabel="minus printed\nreference (arcsec)")
    upper.legend()
    lower.legend(loc="lower left")


# The camera rotates about Y while the stage moves along X.
_draw_about_y = _draws_test(
    "chen2023/fig-10b",
    marks=[
        "chen2023/table-5#[2-5].monitoring-y",
        "chen2023/table-5#[2-5].reference-y",
        BOUND,
    ],
)(partial(_draw_test, axis="Y"))
_draw_about_x = _draws_test(
    "chen2023/fig-10c",
    marks=[
        "chen2023/table-5#[2-5].monitoring-x",
        "chen2023/table-5#[2-5].reference-x",
        BOUND,
    ],
)(partial(_draw_test, axis="X"))


@_draws_test("chen2023/fig-1d")
def _draw_example(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw one move of the stage: the mean reaches the reference after its length."""
    set_size(figure, 3.2, 2.8)
    axes, (times, *angles) = figure.add_subplot(), _stage_test(inputs)
    for series, look in zip(angles, ("C1--", "C0-"), strict=True):
        axes.plot(times, series[:, 1] * ARCSEC_PER_RADIAN, look)
    axes.set(
        xlabel="time (s)",
        ylabel="angle about Y (arcsec)",
        # The first state and the step to the second.
        xlim=np.array([0.05, 0.4]) * times[-1],
        ylim=(-2.6, 0.4),
    )
    axes.legend(("reference", "monitored"))
