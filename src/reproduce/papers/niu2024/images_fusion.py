"""What fusion does to a star's centroid and its signal, with and without registration.

Windows around one star, exposed many times, over kind of star, magnitude and place in the field;
the camera, the stand-ins and the units are those of `images`.

Three images are compared: green alone, the sum of three as they are, and the sum of three after
registration. In each the centre is estimated by the centre of gravity and by maximum likelihood.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from functools import partial
from pathlib import Path

import numpy as np
from numpy.random import Generator, SeedSequence

from reproduce.inference.parts import Store, run_parts
from reproduce.papers.niu2024 import experiment, images
from reproduce.papers.study import Fact, studied
from reproduce.papers.words import Column
from reproduce.physics.images.centroids import centre_of_gravity
from reproduce.physics.images.spot_fit import fitted_centre
from reproduce.physics.images.spots import spot_windows, window_corners
from reproduce.physics.optics.simulate import channel_centroids
from reproduce.physics.registration.resample import registered_image
from reproduce.physics.registration.transforms import Registration
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.store import studies

__all__ = [
    "BLACKBODIES", "LIKELY", "MADE", "MAGNITUDES", "MARGIN", "PHASES", "PLACES", "RESULTS",
    "SEED", "STARS", "TEMPERATURE", "TRIALS", "cell", "combinations", "exposures",
    "light_of", "named", "simulate", "stored",
]  # fmt: skip

STUDY = "niu2024-fusion"
SEED = 2024_0103
MAGNITUDES = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
# Places in the field, as shares of the half range to the corner.
PLACES = (0.0, 0.5, 0.95)
PLACE_NAMES = ("centre", "half way", "corner")
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
BLACKBODIES = tuple(star for star, spectrum in STARS.items() if not isinstance(spectrum, str))
MADE = ("green alone", "fused as they are", "fused after registration")
RESULTS = ("error", "bias", "signal_to_noise", "colour")
METHODS = ("centre of gravity", "maximum likelihood")
LIKELY = METHODS.index("maximum likelihood")
MARGIN = 12  # px around the star, so that resampling has something to read
GRAVITY = 5  # px, the window of the centre of gravity
# px, in which the signal is summed: the width that suits a faint Gaussian spot best, about three
# and a half of its radii across.
APERTURE = 3


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
    door, (star, place, magnitude) = given(images.READS), at
    light = light_of(door, list(STARS)[star], MAGNITUDES[magnitude])
    return cell(door, PLACES[place], light, trials, SeedSequence(SEED, spawn_key=at))


def light_of(door: Given, star: str, magnitude: float) -> FloatArray:
    """Return the photons that a star sends to each detector in one exposure, shape (3,)."""
    return images.star_photons(door, magnitude, STARS[star])


def cell(
    door: Given, place: float, photons: FloatArray, trials: int, seed: SeedSequence
) -> tuple[FloatArray, ...]:
    """Compare the three images of one star in one place.

    Arrays of `RESULTS`: root mean square distance of the centre from green's true one and length of
    the mean error, in px, by image and method; signal over noise of the light about the brightest
    pixel, by image; red and blue over green: true value, scatter about it, predicted scatter.
    """
    generator = np.random.default_rng(seed)
    used = images.cameras(door)
    pitch = float(used[0].pixel_pitch / used[0].focal_length)
    errors, signals, colours = [], [], []
    for _ in range(PHASES):
        angles = place * np.array(experiment.half_field(door)) + pitch * generator.uniform(-1, 1, 2)
        spots = channel_centroids(used, experiment.rotations(door), angles[None])[:, 0]
        windows, corner = exposures(spots, photons, trials, generator)
        made = combinations(windows, corner, images.similarities(door))
        errors.append(_centres(made, corner) - spots[0])
        signals.append([signal_to_noise(image) for image in made])
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


def exposures(
    spots: FloatArray, photons: FloatArray, trials: int, generator: Generator
) -> tuple[FloatArray, FloatArray]:
    """Expose the same window about green's spot in all detectors many times.

    In electrons, shape (3, trials, size, size); and the first pixel of the windows.
    """
    size = images.WINDOW + 2 * MARGIN
    corner = window_corners(spots[0], size).astype(np.float64)
    clean = spot_windows(spots, photons, images.RADIUS, np.broadcast_to(corner, (3, 2)), size)
    many = np.broadcast_to(clean[:, None], (3, trials, size, size))
    return images.exposed(many, generator), corner


def combinations(
    windows: FloatArray, corner: FloatArray, transforms: list[Registration]
) -> list[FloatArray]:
    """Return the images of `MADE` in the middle of the windows, shape (trials, window, window)."""
    at = (int(corner[0]), int(corner[1]))
    moved = np.zeros_like(windows[0])
    for layer, transform in zip(windows[1:], transforms, strict=True):
        moved += np.stack([registered_image(window, transform, corner=at) for window in layer])
    middle = (..., slice(MARGIN, -MARGIN), slice(MARGIN, -MARGIN))
    return [image[middle] for image in (windows[0], windows.sum(axis=0), windows[0] + moved)]


def signal_to_noise(image: FloatArray) -> float:
    """Return mean over scatter of the light in an aperture about the brightest pixel."""
    mean = image.mean(axis=0)
    half = APERTURE // 2
    inner = mean[half:-half, half:-half]
    y, x = np.unravel_index(int(inner.argmax()), inner.shape)
    sums = image[:, y : y + APERTURE, x : x + APERTURE].sum(axis=(-2, -1))
    return float(sums.mean() / sums.std(ddof=1))


def _centres(made: list[FloatArray], corner: FloatArray) -> FloatArray:
    """Return centres, shape (3, 2, trials, 2), by image and method."""
    first = corner + MARGIN
    dark = images.SENSOR.noise_electrons()
    found = []
    for image, layers in zip(made, (1, 3, 3), strict=True):
        noise = dark * np.sqrt(layers)
        likely = fitted_centre(image, first, images.RADIUS, read_noise=noise).centre
        found.append([_gravity(image, first), likely])
    return np.array(found)


def _gravity(image: FloatArray, first: FloatArray) -> FloatArray:
    """Return the centre of gravity about the brightest pixel of each trial."""
    half, width = GRAVITY // 2, image.shape[-1]
    inner = image[:, half:-half, half:-half].reshape(len(image), -1)
    y, x = np.divmod(inner.argmax(axis=1), width - 2 * half)
    boxes = np.lib.stride_tricks.sliding_window_view(image, (GRAVITY, GRAVITY), axis=(1, 2))
    cut = boxes[np.arange(len(image)), y, x]
    return centre_of_gravity(np.maximum(cut, 0), np.stack([x, y], axis=-1) + first)


def _colours(windows: FloatArray, spots: FloatArray, corner: FloatArray) -> FloatArray:
    """Return ratio and predicted scatter of red and blue over green, shape (2, 2, trials)."""
    found = []
    for layer, spot in zip(windows, spots, strict=True):
        x, y = window_corners(spot, images.WINDOW) - corner.astype(np.int64)
        found.append(layer[:, y : y + images.WINDOW, x : x + images.WINDOW])
    return np.array(images.ratios(found))


def stored() -> studies.Study:
    """Return the stored comparison: arrays as `simulate` returns them."""
    return studies.read(STUDY)


def named(star: str) -> str:
    """Return what to call a star of the study, with its temperature where it is a blackbody."""
    spectrum = STARS[star]
    if isinstance(spectrum, str):
        return f"{star}, tabulated spectrum"
    return f"{star}, blackbody of {spectrum:,.0f}\u202fK"


def facts() -> dict[str, Fact]:
    """Return what registration is worth: errors in the corner at V = 4, signals of all images."""
    arrays, replicates = stored().arrays, int(stored().note["replicates"])
    at_corner = arrays["error"][:, -1, MAGNITUDES.index(4.0), :, LIKELY]
    green, plain, registered = at_corner[list(STARS).index("solar")]
    alone, raw, fused = np.moveaxis(arrays["signal_to_noise"], -1, 0)
    by_star = np.median(fused / alone, axis=(1, 2))
    frame = images.colours_of_a_frame()
    pulls = np.abs(frame.pulls)
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
        "frame-sent": Fact(frame.sent, "d"),
        "frame-measured": Fact(frame.measured.shape[1], "d"),
        "frame-within-one": Fact(100 * float((pulls < 1).mean()), ".0f", "%"),
        "frame-within-two": Fact(100 * float((pulls < 2).mean()), ".0f", "%"),
    }


@studied(
    "niu2024/fusion",
    columns=(
        Column("Star"),
        Column("Place"),
        Column("V (mag)", "g"),
        Column("Image"),
        *(Column(f"Error, {method} (px)", ".3f") for method in METHODS),
        Column("Bias, maximum likelihood (px)", ".3f"),
        Column("Signal over noise", ".0f"),
    ),
    caption="Centroids against green's true position, with and without registration.",
    folded="Star",
    named=facts,
)
def centroids() -> Iterator[tuple[object, ...]]:
    """Centroid error and signal-to-noise ratio by star, place, magnitude and image."""
    arrays = stored().arrays
    for at in np.ndindex(arrays["signal_to_noise"].shape):
        star, place, magnitude, image = at
        labels = named(list(STARS)[star]), PLACE_NAMES[place], MAGNITUDES[magnitude], MADE[image]
        error, bias, ratio = (arrays[name][at] for name in ("error", "bias", "signal_to_noise"))
        yield (*labels, *error, bias[LIKELY], ratio)


@studied(
    "niu2024/star-colours",
    columns=(
        Column("Star"),
        Column("V (mag)", "g"),
        *(
            Column(f"{ratio}{what}", ".3f")
            for ratio in ("Red / green", "Blue / green")
            for what in ("", ", error", ", error predicted")
        ),
    ),
    caption="Colour of a star from the ratio of two channels.",
)
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
