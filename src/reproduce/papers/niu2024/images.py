"""From starlight to a fused image, with the camera of niu2024 (section 2).

The paper gives the bands, the size of the detector, the pixel pitch, the exposure and the
calibrated camera of Table 4. The constants below are assumed, because the paper does not print
them. They are typical of a small camera with a modern CMOS sensor. The results on these images are
therefore examples and have no verdict.

Images are arrays [y, x] in electrons, without dark signal and offset. Channels are always in the
order green, red, blue. Positions are in px, x before y, the centre of the first pixel at (0, 0).

The stored study exposes windows around one star many times, for several kinds of stars, magnitudes
and places in the field. It compares three images: green only, the sum of three images, and the sum
of three images after registration. Centre and flux of the star are those of maximum likelihood.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from itertools import product

import numpy as np
from numpy.random import Generator, SeedSequence

from reproduce.papers.charts import Figure, legend_below, set_size
from reproduce.papers.declare import Results, Rows, draws, studied
from reproduce.papers.niu2024 import experiment
from reproduce.papers.niu2024.simulation import CHANNELS
from reproduce.physics.images import (
    Detector,
    blackbody_band,
    electrons,
    expose,
    fitted_spots,
    spot_windows,
    tabulated_star,
    window_corners,
)
from reproduce.physics.optics import Camera, channel_centroids, detector_centre
from reproduce.physics.registration import (
    Registration,
    registered_image,
    rmse,
    similarity_between,
)
from reproduce.physics.validate import FloatArray, IntArray
from reproduce.printed.inputs import Inputs
from reproduce.store import studies
from reproduce.store.measured import spectra

INPUTS = (
    *experiment.INSTRUMENT,
    "niu2024/text-optics#pixels-*",
    "niu2024/text-optics#band-*",
    "niu2024/text-experiment#exposure",
)
# Diameter in metres, at f/2; transmission of the optics; radius of a spot, in px.
APERTURE, TRANSMISSION, RADIUS = 12.5e-3, 0.8, 0.8
_WINDOW_PIXELS = 9
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
KINDS = ("green only", "fused without registration", "fused after registration")
RESULTS = ("error", "bias", "signal_to_noise")
# Margin around the window, so that resampling has all pixels that it needs.
_MARGIN_PIXELS = 12
_MIDDLE_SLICE = slice(_MARGIN_PIXELS, -_MARGIN_PIXELS)


def _instrument(inputs: Inputs) -> list[Camera]:
    """Return the cameras of Table 4 with green's principal point at the detector's centre."""
    pixels = inputs.array("niu2024/text-optics#pixels-?")
    return experiment.instrument(inputs, detector_centre(pixels))


def similarities(inputs: Inputs) -> list[Registration]:
    """Return the transforms of red and blue to green of a perfect calibration."""
    green, *others = _instrument(inputs)
    return [similarity_between(camera, green) for camera in others]


def photons_from(inputs: Inputs, star: str, magnitude: float) -> FloatArray:
    """Return the photons from one of `STARS` at each detector in one exposure, shape (3,)."""
    if isinstance(spectrum := STARS[star], str):
        photons = partial(tabulated_star, magnitude, *spectra()[spectrum])
    else:
        photons = partial(blackbody_band, magnitude, spectrum)
    bands = (inputs.array(f"niu2024/text-optics#band-{name}-*") for name in CHANNELS)
    # Square metres and seconds of an exposure.
    collected = np.pi / 4 * APERTURE**2 * TRANSMISSION
    return (
        collected
        * inputs["niu2024/text-experiment#exposure"]
        * np.stack([photons(*band) for band in bands])
    )


def compare_images(
    inputs: Inputs,
    place: float,
    photons: FloatArray,
    trials: int,
    seed: SeedSequence,
    transforms: Sequence[Registration] = (),
) -> tuple[FloatArray, ...]:
    """Compare the three images of one star at one place.

    Parameters
    ----------
    inputs : Inputs
        `INPUTS`.
    place : float
        Place in the field, as a fraction of the half range to the corner.
    photons : ndarray, shape (3,)
        Photons at each detector, as from `photons_from`.
    trials : int
        Number of exposures for each of the `PHASES` positions of the star in its pixel.
    seed : numpy.random.SeedSequence
        Seed of the random number generator.
    transforms : sequence of Registration
        Transforms of red and blue. Default: `similarities`.

    Returns
    -------
    error, bias, signal_to_noise : ndarray, shape (3,)
        By image of `KINDS`: root mean square distance of the centre from the true centre in green,
        and length of the mean error, in px; signal-to-noise ratio of the fitted flux: its mean over
        its scatter.
    """
    generator = np.random.default_rng(seed)
    cameras, half = _instrument(inputs), experiment.half_field(inputs)
    pitch = cameras[0].pixel_pitch / cameras[0].focal_length
    noise = SENSOR.noise_electrons() * np.sqrt([[1], [3], [3]])
    transforms = transforms or similarities(inputs)
    errors, signals = [], []
    for _ in range(PHASES):
        angles = place * half + pitch * generator.uniform(-1, 1, 2)
        spots = channel_centroids(cameras, angles[None])[:, 0]
        windows, corner = _exposures(spots, photons, trials, generator)
        fused = _combinations(windows, corner, transforms)
        fitted = fitted_spots(fused, corner + _MARGIN_PIXELS, RADIUS, noise)
        errors.append(fitted.centre - spots[0])
        flux = fitted.light
        signals.append(flux.mean(axis=1) / flux.std(axis=1, ddof=1))
    misses = np.concatenate(errors, axis=1)  # image, trial, axis
    return (
        rmse(misses, 0 * misses),
        np.hypot(*misses.mean(axis=1).T),
        np.mean(signals, axis=0),
    )


def _exposures(
    spots: FloatArray, photons: FloatArray, trials: int, generator: Generator
) -> tuple[FloatArray, IntArray]:
    """Return exposures of one window around green's spot in all detectors, and its first pixel.

    In electrons, shape (3, trials, size, size).
    """
    size = _WINDOW_PIXELS + 2 * _MARGIN_PIXELS
    corner = window_corners(spots[0], size)
    clean = spot_windows(spots, photons, RADIUS, corner, size)
    repeated = np.repeat(clean[:, None], trials, axis=1)
    return electrons(expose(repeated, SENSOR, generator), SENSOR), corner


def _combinations(
    windows: FloatArray, corner: IntArray, transforms: Sequence[Registration]
) -> FloatArray:
    """Return the images of `KINDS` in the middle of the windows, (3, trials, window, window)."""
    moved = [
        [registered_image(window, transform, corner=corner) for window in layer]
        for layer, transform in zip(windows[1:], transforms, strict=True)
    ]
    registered = windows[0] + np.sum(moved, axis=0)
    images = np.stack([windows[0], windows.sum(axis=0), registered])
    return images[..., _MIDDLE_SLICE, _MIDDLE_SLICE]


def _stored() -> studies.StoredStudy:
    """Return the stored comparison: `RESULTS` by star, place, magnitude and image."""
    return studies.read("niu2024-fusion")


def _facts(inputs: Inputs) -> Results:
    """Return the gain in the signal-to-noise ratio, and the number of trials."""
    arrays, note = _stored()
    single, _, fused = np.moveaxis(arrays["signal_to_noise"], -1, 0)
    gains = np.median(fused / single, axis=(1, 2))
    return {
        "gain-least": gains.min(),
        "gain-most": gains.max(),
        "trials": int(note["replicates"]),
    }


@studied("niu2024/fusion", named=_facts)
def _centroids(inputs: Inputs) -> Rows:
    """Return the stored errors and signal-to-noise ratios by star, place, magnitude and image."""
    arrays, _ = _stored()
    labels = product(STARS, PLACES, MAGNITUDES, KINDS)
    columns = (arrays[name].ravel() for name in RESULTS)
    for label, *row in zip(labels, *columns, strict=True):
        yield (*label, *row)


_CHANNEL_MARKS = {"red": "C1s", "green": "C2o", "blue": "C0^"}


@draws("niu2024/drawing-fusion-star", inputs=INPUTS)
def _draw_star(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw one star near the corner of the field: three channels, and both sums of them."""
    from matplotlib.patheffects import withStroke

    angles = 0.95 * experiment.half_field(inputs)
    spots = channel_centroids(_instrument(inputs), angles[None])[:, 0]
    photons = photons_from(inputs, "solar", magnitude=3.0)
    windows, corner = _exposures(spots, photons, 1, np.random.default_rng(9))
    # Red, green and blue, and both sums.
    images = [
        *windows[[1, 0, 2]][..., _MIDDLE_SLICE, _MIDDLE_SLICE],
        *_combinations(windows, corner, similarities(inputs))[1:],
    ]
    titles = (*_CHANNEL_MARKS, *KINDS[1:])
    places = dict(zip(CHANNELS, spots - corner - _MARGIN_PIXELS + 0.5, strict=True))
    halo = [withStroke(linewidth=3.5, foreground="white")]  # for dark pixels
    shape = (3, 2) if set_size(figure, 4.6, 5.6) else (2, 3)
    grid = figure.subplots(*shape, sharex=True, sharey=True)
    for axes, title, [flux] in zip(grid.flat, titles, images, strict=False):
        root = np.sqrt(flux.clip(0))
        # Never quite black, which follows the text of the page and is white on a dark page.
        axes.pcolormesh(root, cmap="gray_r", vmin=0, vmax=1.1 * root.max())
        for name in [title] if title in places else _CHANNEL_MARKS:
            look = _CHANNEL_MARKS[name]
            place = places["green" if title == KINDS[2] else name]
            axes.plot(*place, look, mfc="none", ms=9, mew=1.3, path_effects=halo)
        axes.set(aspect="equal", title=title, xticks=[0, 3, 6, 9], yticks=[0, 3, 6, 9])
        axes.grid(visible=False)
    figure.supxlabel("x (px)")
    figure.supylabel("y (px)")
    grid[-1, -1].set_axis_off()


@draws("niu2024/drawing-fusion-errors")
def _draw_errors(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the centroid error of the solar star against magnitude, for three images."""
    set_size(figure, 3.6, 3.8)
    axes = figure.add_subplot()
    arrays, _ = _stored()
    errors = arrays["error"][list(STARS).index("solar"), 0]
    for error, name, look in zip(
        errors.T, KINDS, ("C6^:", "C1s--", "C0o-"), strict=True
    ):
        axes.semilogy(MAGNITUDES, error, look, label=name)
    axes.set(xlabel="V (mag)", ylabel="centroid error, RMS (px)")
    legend_below(figure, 2)
