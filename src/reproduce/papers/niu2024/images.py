"""From starlight to a fused image, with the camera of niu2024 (section 2).

Bands, detector size, pixel pitch, exposure and the calibrated camera of Table 4 are the paper's.
What it does not print is assumed in the constants below, and typical of a small camera with a
modern CMOS sensor: the aperture, what the optics let through, the sensor's parameters, the spot's
size. The results on these images are therefore examples and carry no verdict.

Images are arrays [y, x] in electrons, dark signal and offset taken away; channels are always in the
order green, red, blue; positions are in px, x before y, the centre of the first pixel at (0, 0).

The stored study exposes windows around one star many times, over kind of star, magnitude and place
in the field. Three images are compared: green only, the sum of three as they are, and the sum of
three after registration. In each the centre is the one of maximum likelihood.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator, SeedSequence

from reproduce.papers.charts import Look, sized
from reproduce.papers.declare import Fact, draws, studied
from reproduce.papers.niu2024 import experiment
from reproduce.papers.niu2024.simulation import CHANNELS, OPTICS
from reproduce.physics import images
from reproduce.physics.optics import Camera, channel_centroids, detector_centre
from reproduce.physics.registration import (
    Registration,
    registered_image,
    similarity_between,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs, load_inputs
from reproduce.store import studies
from reproduce.store.measured import spectra

if TYPE_CHECKING:
    from matplotlib.figure import Figure

READS = (
    *experiment.INSTRUMENT,
    f"{OPTICS}#pixels-*",
    f"{OPTICS}#band-*",
    f"{experiment.OUTCOME}#exposure",
)
# Diameter in metres: half the focal length, f/2; what the optics let through; of a spot, in px.
APERTURE, TRANSMISSION, RADIUS = 12.5e-3, 0.8, 0.8
_WINDOW_PIXELS = 9
# The detector of every channel: a 12-bit sensor of small pixels.
SENSOR = images.Detector(
    quantum_efficiency=0.6,
    gain=4095 / 10_500,
    dark_signal=1.0,
    read_noise=3.0,
    full_well=10_500,
    offset=60,
    bits=12,
)
MAGNITUDES = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
# Places in the field, as fractions of the half range to the corner.
PLACES = {"centre": 0.0, "half way": 0.5, "corner": 0.95}
PHASES = 8
# Blackbodies by their temperature in kelvin, tabulated spectra by their name.
STARS: dict[str, float | str] = {
    "cool": 3500.0,
    "solar": 5800.0,
    "hot": 15000.0,
    "Sun": "sun",
    "Vega": "vega",
}
MADE = ("green alone", "fused as they are", "fused after registration")
RESULTS = ("error", "bias", "signal_to_noise")
_MARGIN_PIXELS = 12  # px around the star, so that resampling has something to read
_MIDDLE_SLICE = slice(_MARGIN_PIXELS, -_MARGIN_PIXELS)
# px, in which the signal is summed: the width that suits a faint Gaussian spot best, about three
# and a half of its radii across.
_SUMMED_PIXELS = 3


def _cameras(inputs: Inputs) -> list[Camera]:
    """Return the cameras of Table 4 with green's principal point in the detector's middle."""
    middle = detector_centre(inputs.array(f"{OPTICS}#pixels-?"))
    used = experiment.cameras(inputs)
    return [replace(one, principal_point=one.principal_point + middle) for one in used]


def similarities(inputs: Inputs) -> list[Registration]:
    """Return the transforms of red and blue onto green that a perfect calibration would find."""
    used, turns = _cameras(inputs), experiment.rotations(inputs)
    return [similarity_between(used[i], turns[i], used[0]) for i in (1, 2)]


def _imaged(inputs: Inputs, angles: FloatArray) -> FloatArray:
    """Return where the channels image the star at some table angles, shape (3, 2)."""
    return channel_centroids(
        _cameras(inputs), experiment.rotations(inputs), angles[None]
    )[:, 0]


def light_of(inputs: Inputs, star: str, magnitude: float) -> FloatArray:
    """Return the photons that one of `STARS` sends to each detector in one exposure, shape (3,)."""
    spectrum, light = STARS[star], []
    for channel in CHANNELS:
        low, high = inputs.array(f"{OPTICS}#band-{channel}-*").tolist()
        if isinstance(spectrum, str):
            table = spectra()[spectrum]
            light.append(images.tabulated_star(magnitude, *table, low, high))
        else:
            light.append(images.blackbody_band(magnitude, spectrum, low, high))
    # Square metres and seconds that an exposure collects.
    collected = float(
        np.pi
        / 4
        * APERTURE**2
        * TRANSMISSION
        * inputs[f"{experiment.OUTCOME}#exposure"]
    )
    return collected * np.stack(light)


def cell(
    inputs: Inputs,
    place: float,
    photons: FloatArray,
    trials: int,
    seed: SeedSequence,
    transforms: Sequence[Registration] = (),
) -> tuple[FloatArray, ...]:
    """Compare the three images of one star in one place.

    Arrays of `RESULTS` by image: root mean square distance of the centre from green's true one and
    length of the mean error, in px; signal over noise of the light about the brightest pixel.
    Registered by `transforms` of red and blue in place of the true ones.
    """
    generator = np.random.default_rng(seed)
    green, half = _cameras(inputs)[0], experiment.half_field(inputs)
    pitch = float(green.pixel_pitch / green.focal_length)
    errors, signals = [], []
    for _ in range(PHASES):
        angles = place * half + pitch * generator.uniform(-1, 1, 2)
        spots = _imaged(inputs, angles)
        windows, corner = _exposures(spots, photons, trials, generator)
        made = _combinations(windows, corner, transforms or similarities(inputs))
        errors.append(_centres(made, corner) - spots[0])
        signals.append([_signal_to_noise(image) for image in made])
    left = np.concatenate(errors, axis=1)  # image, trial, axis
    return (
        np.sqrt(np.square(left).sum(axis=-1).mean(axis=-1)),
        np.hypot(*left.mean(axis=1).T),
        np.mean(signals, axis=0),
    )


def _exposures(
    spots: FloatArray, photons: FloatArray, trials: int, generator: Generator
) -> tuple[FloatArray, FloatArray]:
    """Expose the same window about green's spot in all detectors many times.

    In electrons, shape (3, trials, size, size); and the first pixel of the windows.
    """
    size = _WINDOW_PIXELS + 2 * _MARGIN_PIXELS
    corner = images.window_corners(spots[0], size).astype(np.float64)
    clean = images.spot_windows(
        spots, photons, RADIUS, np.broadcast_to(corner, (3, 2)), size
    )
    many = np.broadcast_to(clean[:, None], (3, trials, size, size))
    return images.electrons(images.expose(many, SENSOR, generator), SENSOR), corner


def _combinations(
    windows: FloatArray, corner: FloatArray, transforms: Sequence[Registration]
) -> list[FloatArray]:
    """Return the images of `MADE` in the middle of the windows, shape (trials, window, window)."""
    at = (int(corner[0]), int(corner[1]))
    moved = np.zeros_like(windows[0])
    for layer, transform in zip(windows[1:], transforms, strict=True):
        moved += np.stack(
            [registered_image(window, transform, corner=at) for window in layer]
        )
    made = (windows[0], windows.sum(axis=0), windows[0] + moved)
    return [image[..., _MIDDLE_SLICE, _MIDDLE_SLICE] for image in made]


def _signal_to_noise(image: FloatArray) -> float:
    """Return mean over scatter of the light in an aperture about the brightest pixel."""
    mean = image.mean(axis=0)
    half = _SUMMED_PIXELS // 2
    inner = mean[half:-half, half:-half]
    y, x = np.unravel_index(int(inner.argmax()), inner.shape)
    sums = image[:, y : y + _SUMMED_PIXELS, x : x + _SUMMED_PIXELS].sum(axis=(-2, -1))
    return float(sums.mean() / sums.std(ddof=1))


def _centres(made: list[FloatArray], corner: FloatArray) -> FloatArray:
    """Return centres by image, shape (3, trials, 2)."""
    noise = SENSOR.noise_electrons() * np.sqrt([1, 3, 3])
    pairs = zip(made, noise, strict=True)
    first = corner + _MARGIN_PIXELS
    return np.array(
        [images.fitted_centre(i, first, RADIUS, read_noise=n) for i, n in pairs]
    )


def _stored() -> studies.StoredStudy:
    """Return the stored comparison: `RESULTS` by star, place, magnitude and image."""
    return studies.read("niu2024-fusion")


def _facts() -> dict[str, Fact]:
    """Return what registration is worth: errors in the corner at V = 4, signals of all"""
    arrays, replicates = _stored().arrays, int(_stored().note["replicates"])
    at_corner = arrays["error"][:, -1, MAGNITUDES.index(4.0)]
    green, plain, registered = at_corner[list(STARS).index("solar")]
    alone, _, fused = np.moveaxis(arrays["signal_to_noise"], -1, 0)
    by_star = np.median(fused / alone, axis=(1, 2))
    return {
        "green": Fact(green, ".3f", "px"),
        "plain": Fact(plain, ".2f", "px"),
        "registered": Fact(registered, ".3f", "px"),
        "plain-least": Fact(at_corner[:, 1].min(), ".2f", "px"),
        "plain-most": Fact(at_corner[:, 1].max(), ".2f", "px"),
        "registered-bias": Fact(arrays["bias"][..., 2].max(), ".3f", "px"),
        "gain-least": Fact(by_star.min(), ".2f"),
        "gain-most": Fact(by_star.max(), ".2f"),
        "trials": Fact(replicates, ","),
    }


@studied("niu2024/fusion", named=_facts)
def _centroids() -> Iterator[tuple[object, ...]]:
    """Centroid error and signal-to-noise ratio by star, place, magnitude and image."""
    arrays = _stored().arrays
    numbers = np.stack([arrays[name] for name in RESULTS], axis=-1)
    labels = product(STARS, PLACES, MAGNITUDES, MADE)
    for label, row in zip(labels, numbers.reshape(-1, len(RESULTS)), strict=True):
        yield (*label, *row)


_CHANNEL_LOOKS = {
    "red": Look("red", "#D55E00", "--", "s"),
    "green": Look("green", "#009E73", "-.", "o"),
    "blue": Look("blue", "#0072B2", ":", "^"),
}
_IMAGE_LOOKS = (
    Look("green", "#777777", ":", "^"),
    Look("raw", "#D55E00", "--", "s"),
    Look("fused", "#0072B2", "-", "o"),
)


@draws("niu2024/drawing-fusion-star")
def _draw_star(figure: Figure) -> None:
    """One star near the corner of the field: three channels, and both ways to add them up."""
    from matplotlib.patheffects import withStroke

    inputs = load_inputs(READS)
    spots = _imaged(inputs, 0.95 * experiment.half_field(inputs))
    photons = light_of(inputs, "solar", magnitude=3.0)
    windows, corner = _exposures(spots, photons, 1, np.random.default_rng(9))
    green, plain, registered = _combinations(windows, corner, similarities(inputs))
    places = dict(zip(CHANNELS, spots - corner - _MARGIN_PIXELS + 0.5, strict=True))
    panels = {
        "red": windows[1][:, _MIDDLE_SLICE, _MIDDLE_SLICE],
        "green": green,
        "blue": windows[2][:, _MIDDLE_SLICE, _MIDDLE_SLICE],
        "fused as they are": plain,
        MADE[2]: registered,
    }
    halo = [withStroke(linewidth=3.5, foreground="white")]  # for dark pixels
    shape = (3, 2) if sized(figure, 6.4, 4.6, 5.6) else (2, 3)
    grid = figure.subplots(*shape, sharex=True, sharey=True)
    for axes, (title, [light]) in zip(grid.flat, panels.items(), strict=False):
        root = np.sqrt(np.maximum(light, 0))
        # Never quite black: what is drawn in black follows the page, and is white on a dark one.
        axes.pcolormesh(
            root, cmap="gray_r", shading="flat", vmin=0, vmax=1.1 * root.max()
        )
        for name, look in _CHANNEL_LOOKS.items():
            if title in (name, *MADE[1:]):
                place = places["green" if title == MADE[2] else name]
                [mark] = axes.plot(*place, look.marker, c=look.colour, mfc="none")
                mark.set(markersize=9, markeredgewidth=1.3, path_effects=halo)
        axes.set(aspect="equal", title=title, xticks=[0, 3, 6, 9], yticks=[0, 3, 6, 9])
        axes.grid(visible=False)
    figure.supxlabel("x (px)", fontsize=9)
    figure.supylabel("y (px)", fontsize=9)
    grid[-1, -1].set_axis_off()


@draws("niu2024/drawing-fusion-errors")
def _draw_errors(figure: Figure) -> None:
    """Centroid error of the solar star over magnitude, with and without registration."""
    sized(figure, 4.9, 4.4)
    axes, errors = (
        figure.add_subplot(),
        _stored().arrays["error"][list(STARS).index("solar")],
    )
    for kind, (name, look) in enumerate(zip(MADE, _IMAGE_LOOKS, strict=True)):
        for place, where, fill in ((0, "centre", "none"), (-1, "corner", look.colour)):
            (line,) = axes.semilogy(
                MAGNITUDES, errors[place, :, kind], look.line, c=look.colour
            )
            line.set(marker=look.marker, mfc=fill, label=f"{name}, {where}")
    axes.set(xlabel="V (mag)", ylabel="centroid error, RMS (px)")
    figure.legend(loc="outside lower center", fontsize=8)
