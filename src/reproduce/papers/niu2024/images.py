"""From starlight to a fused image and to colours, with the camera of niu2024 (section 2).

Bands, detector size, pixel pitch, exposure and the calibrated camera of Table 4 are the paper's.
What it does not print is ours, in the constants below, and typical of a small camera with a
modern CMOS sensor: the aperture, what the optics let through, the sensor's parameters, the spot's
size. The results on these images are therefore examples and carry no verdict.

Images are arrays [y, x] in electrons, dark signal and offset taken away; channels are always in the
order green, red, blue; positions are in px, x before y, the centre of the first pixel at (0, 0).
Colours are red / green and blue / green.

The stored study exposes windows around one star many times, over kind of star, magnitude and place
in the field. Three images are compared: green alone, the sum of three as they are, and the sum of
three after registration. In each the centre is estimated by the centre of gravity and by maximum
likelihood.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator, SeedSequence
from numpy.typing import ArrayLike

from reproduce.inference import Store, run_parts
from reproduce.papers.declare import draws
from reproduce.papers.niu2024 import experiment
from reproduce.papers.niu2024.index import LOOKS
from reproduce.papers.niu2024.simulation import CHANNELS, OPTICS
from reproduce.papers.sketch import Look, sized
from reproduce.papers.study import Fact, studied
from reproduce.physics.images import (
    Detector,
    blackbody_band,
    centre_of_gravity,
    channel_ratio,
    detect_spots,
    electrons,
    expose,
    fitted_centre,
    render_frame,
    spot_windows,
    tabulated_star,
    window_corners,
)
from reproduce.physics.optics import Camera, channel_centroids, detector_centre
from reproduce.physics.registration import Registration, registered_image, similarity_between
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.store import studies
from reproduce.store.stars import spectra

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_OUTCOME = experiment.OUTCOME
READS = (
    *experiment.INSTRUMENT,
    f"{OPTICS}#pixels-*",
    f"{OPTICS}#band-*",
    f"{_OUTCOME}#exposure",
)
_APERTURE = 12.5e-3  # diameter in metres: half the focal length, f/2
_TRANSMISSION = 0.8
RADIUS = 0.8  # of a spot, in px
WINDOW = 9
# The detector of every channel: a 12-bit sensor of small pixels.
SENSOR = Detector(
    quantum_efficiency=0.6,
    gain=4095 / 10_500,
    dark_signal=1.0,
    read_noise=3.0,
    full_well=10_500,
    offset=60,
    bits=12,
)
_STUDY = "niu2024-fusion"
SEED = 2024_0103
MAGNITUDES = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
# Places in the field, as shares of the half range to the corner.
PLACES = (0.0, 0.5, 0.95)
_PLACE_NAMES = ("centre", "half way", "corner")
PHASES, TRIALS = 8, 60
TEMPERATURE = 5800.0
# Blackbodies by their temperature in kelvin, tabulated spectra by their name.
STARS: dict[str, float | str] = {
    "cool": 3500.0,
    "solar": TEMPERATURE,
    "hot": 15000.0,
    "Sun": "sun",
    "Vega": "vega",
}
_BLACKBODIES = tuple(star for star, spectrum in STARS.items() if not isinstance(spectrum, str))
_MADE = ("green alone", "fused as they are", "fused after registration")
RESULTS = ("error", "bias", "signal_to_noise", "colour")
_METHODS = ("centre of gravity", "maximum likelihood")
LIKELY = _METHODS.index("maximum likelihood")
_MARGIN = 12  # px around the star, so that resampling has something to read
_GRAVITY = 5  # px, the window of the centre of gravity
# px, in which the signal is summed: the width that suits a faint Gaussian spot best, about three
# and a half of its radii across.
_SUMMED = 3


def _shape(door: Given) -> tuple[int, int]:
    """Return width and height of the detector, in px."""
    return int(door[f"{OPTICS}#pixels-x"]), int(door[f"{OPTICS}#pixels-y"])


def cameras(door: Given) -> list[Camera]:
    """Return the cameras of Table 4 with green's principal point in the detector's middle."""
    middle = detector_centre(_shape(door))
    return [
        replace(camera, principal_point=camera.principal_point + middle)
        for camera in experiment.cameras(door)
    ]


def similarities(door: Given) -> list[Registration]:
    """Return the transforms of red and blue onto green that a perfect calibration would find."""
    used, turns = cameras(door), experiment.rotations(door)
    return [similarity_between(used[i], turns[i], used[0]) for i in (1, 2)]


def _imaged(door: Given, angles: FloatArray) -> FloatArray:
    """Return where the channels image stars, shape (3, n, 2)."""
    return channel_centroids(cameras(door), experiment.rotations(door), angles)


def star_photons(door: Given, magnitude: ArrayLike, star: ArrayLike | str) -> FloatArray:
    """Return the photons that stars send to each detector in one exposure, shape (3, ...).

    Blackbodies by their temperature in kelvin, a tabulated spectrum by its name.
    """
    bands = []
    for channel in CHANNELS:
        low, high = (door[f"{OPTICS}#band-{channel}-{edge}"] for edge in ("low", "high"))
        if isinstance(star, str):
            bands.append(tabulated_star(magnitude, *spectra()[star], low, high))
        else:
            bands.append(blackbody_band(magnitude, star, low, high))
    # Square metres and seconds that an exposure collects.
    collected = float(np.pi / 4 * _APERTURE**2 * _TRANSMISSION * door[f"{_OUTCOME}#exposure"])
    return collected * np.stack(bands)


@dataclass(frozen=True, eq=False)
class _Frames:
    """Three exposures of the same stars, with the truth."""

    images: list[FloatArray]
    positions: FloatArray  # of the spots, shape (3, n, 2)
    photons: FloatArray  # shape (3, n)


def exposed(image: FloatArray, generator: Generator) -> FloatArray:
    """Return one exposure of a noiseless image, brought back to electrons."""
    return electrons(expose(image, SENSOR, generator), SENSOR)


def frames(
    door: Given, angles: ArrayLike, magnitude: ArrayLike, temperature: ArrayLike, seed: int
) -> _Frames:
    """Render and expose a full frame in all three channels."""
    positions = _imaged(door, np.asarray(angles))
    photons = star_photons(door, magnitude, temperature)
    streams = SeedSequence(seed).spawn(len(photons))
    images = [
        exposed(render_frame(spots, light, RADIUS, _shape(door)), np.random.default_rng(stream))
        for spots, light, stream in zip(positions, photons, streams, strict=True)
    ]
    return _Frames(images, positions, photons)


def register(images: Sequence[FloatArray], transforms: Sequence[Registration]) -> list[FloatArray]:
    """Return green as it is, and the other images on the pixels of green."""
    return [images[0], *map(registered_image, images[1:], transforms)]


def extract(image: FloatArray, layers: int, significance: float = 6.0) -> FloatArray:
    """Return maximum-likelihood centres of the spots of an image, shape (n, 2), brightest first.

    Spots at the edge are left out, and those whose fit does not converge.
    """
    noise = SENSOR.noise_electrons() * np.sqrt(layers)
    found = detect_spots(image, significance * noise)
    half = WINDOW // 2
    inside = (found >= half) & (found < np.flip(image.shape) - half)
    kept = found[inside.all(axis=-1)]
    if not len(kept):
        return np.empty((0, 2))
    corners = window_corners(kept, WINDOW)
    x, y = corners.T
    windows = np.lib.stride_tricks.sliding_window_view(image, (WINDOW, WINDOW))[y, x]
    centres = fitted_centre(windows, corners, RADIUS, read_noise=noise)
    return centres[np.isfinite(centres).all(axis=-1)]


def matched_errors(found: FloatArray, truth: FloatArray, within: float = 3.0) -> FloatArray:
    """Return found minus true position of every star, shape (n, 2), nan where it is not found."""
    if not len(found):
        return np.full(truth.shape, np.nan)
    distance = np.linalg.norm(truth[:, None] - found, axis=-1)
    nearest = found[distance.argmin(axis=1)]
    return np.where(distance.min(axis=1, keepdims=True) <= within, nearest - truth, np.nan)


def _ratios(windows: Iterable[FloatArray]) -> tuple[FloatArray, FloatArray]:
    """Return red and blue over green by windows of each channel, and the predicted deviations."""
    light = np.array([window.sum(axis=(-2, -1)) for window in windows])
    variance = np.maximum(light, 0) + (WINDOW * SENSOR.noise_electrons()) ** 2
    return channel_ratio(light[1:], np.maximum(light[0], 1.0), variance[1:], variance[0])


@studied("niu2024/image-stand-ins")
def _stand_ins() -> Iterator[tuple[object, ...]]:
    """What the paper does not print of the images and we had to choose."""
    yield "aperture", _APERTURE * 1e3, "mm"
    yield "transmission of the optics", _TRANSMISSION, ""
    yield "radius of a spot (one standard deviation)", RADIUS, "px"
    yield "quantum efficiency", SENSOR.quantum_efficiency, ""
    yield "read noise", SENSOR.read_noise, "electrons"
    yield "dark signal in one exposure", SENSOR.dark_signal, "electrons"
    yield "full well", SENSOR.full_well, "electrons"
    yield "digital output", SENSOR.bits, "bits"


def simulate(
    trials: int = TRIALS,
    executor: Executor | None = None,
    store: Store | None = None,
) -> dict[str, FloatArray]:
    """Run the comparison, on any executor, with the same result.

    Arrays as `cell` returns them, by star, place and magnitude, which are the first axes.
    """
    shape = (len(STARS), len(PLACES), len(MAGNITUDES))
    found = run_parts(partial(_part, trials), list(np.ndindex(shape)), executor, store)
    stacked = (np.stack(arrays) for arrays in zip(*found, strict=True))
    whole = (array.reshape(*shape, *array.shape[1:]) for array in stacked)
    return dict(zip(RESULTS, whole, strict=True))


def _part(trials: int, at: tuple[int, ...]) -> tuple[FloatArray, ...]:
    door, (star, place, magnitude) = given(READS), at
    light = light_of(door, list(STARS)[star], MAGNITUDES[magnitude])
    return cell(door, PLACES[place], light, trials, SeedSequence(SEED, spawn_key=at))


def light_of(door: Given, star: str, magnitude: float) -> FloatArray:
    """Return the photons that a star sends to each detector in one exposure, shape (3,)."""
    return star_photons(door, magnitude, STARS[star])


def cell(
    door: Given, place: float, photons: FloatArray, trials: int, seed: SeedSequence
) -> tuple[FloatArray, ...]:
    """Compare the three images of one star in one place.

    Arrays of `RESULTS`: root mean square distance of the centre from green's true one and length of
    the mean error, in px, by image and method; signal over noise of the light about the brightest
    pixel, by image; red and blue over green: true value, scatter about it, predicted scatter.
    """
    generator = np.random.default_rng(seed)
    used = cameras(door)
    pitch = float(used[0].pixel_pitch / used[0].focal_length)
    errors, signals, colours = [], [], []
    for _ in range(PHASES):
        angles = place * np.array(experiment.half_field(door)) + pitch * generator.uniform(-1, 1, 2)
        spots = _imaged(door, angles[None])[:, 0]
        windows, corner = _exposures(spots, photons, trials, generator)
        made = _combinations(windows, corner, similarities(door))
        errors.append(_centres(made, corner) - spots[0])
        signals.append([_signal_to_noise(image) for image in made])
        colours.append(_colours(windows, spots, corner))
    left = np.concatenate(errors, axis=2)  # image, method, trial, axis
    ratio, sigma = np.concatenate(colours, axis=-1)
    truth = photons[1:] / photons[0]
    scatter = np.sqrt(np.square(ratio - truth[:, None]).mean(axis=-1))
    return (
        np.sqrt(np.square(left).sum(axis=-1).mean(axis=-1)),
        np.hypot(*np.moveaxis(left.mean(axis=2), -1, 0)),
        np.mean(signals, axis=0),
        np.stack([truth, scatter, np.sqrt(np.square(sigma).mean(axis=-1))], axis=-1),
    )


def _exposures(
    spots: FloatArray, photons: FloatArray, trials: int, generator: Generator
) -> tuple[FloatArray, FloatArray]:
    """Expose the same window about green's spot in all detectors many times.

    In electrons, shape (3, trials, size, size); and the first pixel of the windows.
    """
    size = WINDOW + 2 * _MARGIN
    corner = window_corners(spots[0], size).astype(np.float64)
    clean = spot_windows(spots, photons, RADIUS, np.broadcast_to(corner, (3, 2)), size)
    many = np.broadcast_to(clean[:, None], (3, trials, size, size))
    return exposed(many, generator), corner


def _combinations(
    windows: FloatArray, corner: FloatArray, transforms: list[Registration]
) -> list[FloatArray]:
    """Return the images of `MADE` in the middle of the windows, shape (trials, window, window)."""
    at = (int(corner[0]), int(corner[1]))
    moved = np.zeros_like(windows[0])
    for layer, transform in zip(windows[1:], transforms, strict=True):
        moved += np.stack([registered_image(window, transform, corner=at) for window in layer])
    middle = (..., slice(_MARGIN, -_MARGIN), slice(_MARGIN, -_MARGIN))
    return [image[middle] for image in (windows[0], windows.sum(axis=0), windows[0] + moved)]


def _signal_to_noise(image: FloatArray) -> float:
    """Return mean over scatter of the light in an aperture about the brightest pixel."""
    mean = image.mean(axis=0)
    half = _SUMMED // 2
    inner = mean[half:-half, half:-half]
    y, x = np.unravel_index(int(inner.argmax()), inner.shape)
    sums = image[:, y : y + _SUMMED, x : x + _SUMMED].sum(axis=(-2, -1))
    return float(sums.mean() / sums.std(ddof=1))


def _centres(made: list[FloatArray], corner: FloatArray) -> FloatArray:
    """Return centres, shape (3, 2, trials, 2), by image and method."""
    first = corner + _MARGIN
    dark = SENSOR.noise_electrons()
    found = []
    for image, layers in zip(made, (1, 3, 3), strict=True):
        noise = dark * np.sqrt(layers)
        likely = fitted_centre(image, first, RADIUS, read_noise=noise)
        found.append([_gravity(image, first), likely])
    return np.array(found)


def _gravity(image: FloatArray, first: FloatArray) -> FloatArray:
    """Return the centre of gravity about the brightest pixel of each trial."""
    half, width = _GRAVITY // 2, image.shape[-1]
    inner = image[:, half:-half, half:-half].reshape(len(image), -1)
    y, x = np.divmod(inner.argmax(axis=1), width - 2 * half)
    boxes = np.lib.stride_tricks.sliding_window_view(image, (_GRAVITY, _GRAVITY), axis=(1, 2))
    cut = boxes[np.arange(len(image)), y, x]
    return centre_of_gravity(np.maximum(cut, 0), np.stack([x, y], axis=-1) + first)


def _colours(windows: FloatArray, spots: FloatArray, corner: FloatArray) -> FloatArray:
    """Return ratio and predicted scatter of red and blue over green, shape (2, 2, trials)."""
    found = []
    for layer, spot in zip(windows, spots, strict=True):
        x, y = window_corners(spot, WINDOW) - corner.astype(np.int64)
        found.append(layer[:, y : y + WINDOW, x : x + WINDOW])
    return np.array(_ratios(found))


def stored() -> studies.Study:
    """Return the stored comparison: arrays as `simulate` returns them."""
    return studies.read(_STUDY)


def named(star: str) -> str:
    """Return what to call a star of the study, with its temperature where it is a blackbody."""
    spectrum = STARS[star]
    if isinstance(spectrum, str):
        return f"{star}, tabulated spectrum"
    return f"{star}, blackbody of {spectrum:,.0f}\u202fK"


def _facts() -> dict[str, Fact]:
    """Return what registration is worth: errors in the corner at V = 4, signals of all"""
    arrays, replicates = stored().arrays, int(stored().note["replicates"])
    at_corner = arrays["error"][:, -1, MAGNITUDES.index(4.0), :, LIKELY]
    green, plain, registered = at_corner[list(STARS).index("solar")]
    alone, raw, fused = np.moveaxis(arrays["signal_to_noise"], -1, 0)
    by_star = np.median(fused / alone, axis=(1, 2))
    return {
        "green": Fact(green, ".3f", "px"),
        "plain": Fact(plain, ".2f", "px"),
        "registered": Fact(registered, ".3f", "px"),
        "plain-least": Fact(at_corner[:, 1].min(), ".2f", "px"),
        "plain-most": Fact(at_corner[:, 1].max(), ".2f", "px"),
        "plain-least-star": Fact(list(STARS)[int(at_corner[:, 1].argmin())]),
        "plain-most-star": Fact(list(STARS)[int(at_corner[:, 1].argmax())]),
        "registered-bias": Fact(arrays["bias"][..., 2, LIKELY].max(), ".3f", "px"),
        "gain-least": Fact(by_star.min(), ".2f"),
        "gain-most": Fact(by_star.max(), ".2f"),
        "loss": Fact(100 * (1 - float(np.median(raw / fused))), ".0f", "%"),
        "trials": Fact(replicates, ","),
    }


@studied("niu2024/fusion", named=_facts)
def centroids() -> Iterator[tuple[object, ...]]:
    """Centroid error and signal-to-noise ratio by star, place, magnitude and image."""
    arrays = stored().arrays
    for at in np.ndindex(arrays["signal_to_noise"].shape):
        star, place, magnitude, image = at
        labels = named(list(STARS)[star]), _PLACE_NAMES[place], MAGNITUDES[magnitude], _MADE[image]
        error, bias, ratio = (arrays[name][at] for name in ("error", "bias", "signal_to_noise"))
        yield (*labels, *error, bias[LIKELY], ratio)


@studied("niu2024/star-colours")
def star_colours() -> Iterator[tuple[object, ...]]:
    """The channel ratios of every star in the middle of the field, and their errors."""
    colour = stored().arrays["colour"]
    for i, star in enumerate(STARS):
        for j, magnitude in enumerate(MAGNITUDES):
            yield named(star), magnitude, *colour[i, 0, j].ravel()


def recomputed(
    executor: Executor, folder: Path, note: Mapping[str, str]
) -> tuple[dict[str, FloatArray], int]:
    """Simulate again in parts that a folder keeps: arrays as in `simulate`, and their number."""
    store = Store(folder, {**note, "trials": str(TRIALS)})
    return simulate(TRIALS, executor=executor, store=store), PHASES * TRIALS


# The star that is drawn: its V, and the seed of its noise.
_MAGNITUDE, _NOISE_SEED = 3.0, 9
_KINDS = (
    Look("green", "#777777", ":", "^"),
    Look("raw", "#D55E00", "--", "s"),
    Look("fused", "#0072B2", "-", "o"),
)


def _spots() -> FloatArray:
    """Return where the star stands in green, red and blue, in px, near the corner of the field."""
    door = given(READS)
    angles = 0.95 * np.array(experiment.half_field(door))
    return _imaged(door, angles[None])[:, 0]


def _star_facts() -> dict[str, Fact]:
    """Return what the drawing of one star shows, in numbers."""
    spots = _spots()
    apart = max(np.hypot(*(one - other)) for one in spots for other in spots)
    return {"apart": Fact(float(apart), ".1f", "px")}


@draws("niu2024/drawing-fusion-star", named=_star_facts)
def _draw_star(figure: Figure) -> None:
    """One star near the corner of the field: three channels, and both ways to add them up."""
    door, spots = given(READS), _spots()
    photons = star_photons(door, _MAGNITUDE, TEMPERATURE)
    windows, corner = _exposures(spots, photons, 1, np.random.default_rng(_NOISE_SEED))
    green, plain, registered = _combinations(windows, corner, similarities(door))
    middle = slice(_MARGIN, -_MARGIN)
    # What is seen, and which spots are marked in it, at which place each.
    at = dict(zip(("green", "red", "blue"), spots - corner - _MARGIN + 0.5, strict=True))
    panels = {
        "red": (windows[1, 0, middle, middle], {"red": at["red"]}),
        "green": (green[0], {"green": at["green"]}),
        "blue": (windows[2, 0, middle, middle], {"blue": at["blue"]}),
        "fused as they are": (plain[0], {name: at[name] for name in LOOKS}),
        "fused after registration": (registered[0], dict.fromkeys(LOOKS, at["green"])),
    }
    shape = (3, 2) if sized(figure, 6.4, 4.6, 5.6) else (2, 3)
    grid = figure.subplots(*shape, sharex=True, sharey=True)
    for axes, (title, (light, marks)) in zip(grid.flat, panels.items(), strict=False):
        root = np.sqrt(np.maximum(light, 0))
        # Never quite black: what is drawn in black follows the page, and is white on a dark one.
        axes.pcolormesh(root, cmap="gray_r", shading="flat", vmin=0, vmax=1.1 * root.max())
        for name, place in marks.items():
            look = LOOKS[name]
            for width, colour in ((3.5, "white"), (1.3, look.colour)):  # a halo, for dark pixels
                mark = axes.plot(*place, look.marker, color=colour, fillstyle="none", markersize=9)
                mark[0].set_markeredgewidth(width)
        axes.set(aspect="equal", title=title, xticks=[0, 3, 6, 9], yticks=[0, 3, 6, 9])
        axes.grid(visible=False)
    for axes in grid[-1]:
        axes.set_xlabel("x (px)")
    for axes in grid[:, 0]:
        axes.set_ylabel("y (px)")
    grid[-1, -1].set_axis_off()


def _error_facts() -> dict[str, Fact]:
    """Return what the drawing of the errors shows, in numbers: the middle star, in the corner."""
    row = list(STARS).index(_BLACKBODIES[len(_BLACKBODIES) // 2])
    green, raw, fused = stored().arrays["error"][row, -1, :, :, LIKELY].T
    values = {
        "green-bright": green[0],
        "green-faint": green[-1],
        "fused-bright": fused[0],
        "fused-faint": fused[-1],
        "raw-least": raw.min(),
        "raw-most": raw.max(),
    }
    return {name: Fact(value, ".2g", "px") for name, value in values.items()}


@draws("niu2024/drawing-fusion-errors", named=_error_facts)
def _draw_errors(figure: Figure) -> None:
    """Centroid error and signal-to-noise ratio over magnitude: cool, solar and hot star."""
    arrays, stars = stored().arrays, len(_BLACKBODIES)
    if narrow := sized(figure, 6.4, 5.6, 7.6):
        grid = figure.subplots(stars, 2, sharex=True, sharey="col")
    else:
        grid = figure.subplots(2, stars, sharex=True, sharey="row").T
    for (above, below), star in zip(grid, _BLACKBODIES, strict=True):
        row = list(STARS).index(star)
        for kind, (name, look) in enumerate(zip(_MADE, _KINDS, strict=True)):
            for place, where, fill in ((0, "centre", "none"), (-1, "corner", look.colour)):
                error = arrays["error"][row, place, :, kind, LIKELY]
                ratio = arrays["signal_to_noise"][row, place, :, kind]
                for axes, values in ((above, error), (below, ratio)):
                    (line,) = axes.semilogy(MAGNITUDES, values, look.line, c=look.colour)
                    line.set(marker=look.marker, mfc=fill, label=f"{name}, {where}")
        above.set_title(f"{star}: {STARS[star]:,.0f} K")
        if not narrow or above is grid[-1, 0]:
            below.set_xlabel("V (mag)")
    grid[-1, 0].set_xlabel("V (mag)" if narrow else "")
    for axes in grid if narrow else grid[:1]:
        axes[0].set_ylabel("centroid error, RMS (px)")
        axes[1].set_ylabel("signal over noise (1)")
    handles, labels = grid[0, 0].get_legend_handles_labels()
    columns = 1 if narrow else 2
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, fontsize=8)
