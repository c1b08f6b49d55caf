"""What the book shows of the simulated images of niu2024: tables and sentences."""

from __future__ import annotations

import functools

import numpy as np

from reproduce.papers.niu2024 import colours as star_colours
from reproduce.papers.niu2024 import fusion, images
from reproduce.printed.given import given
from reproduce.store import studies
from reproduce.views.pages import Html
from reproduce.views.studies import FUSION
from reproduce.views.study_pages import plain_table, templates

PLACES = ("centre", "half way", "corner")


@functools.cache
def _study() -> studies.Study:
    return studies.read(FUSION)


@functools.cache
def _frame() -> star_colours.Colours:
    return star_colours.of_a_frame(given(images.READS))


def centroids() -> Html:
    """Show centroid error and signal-to-noise by star, place, magnitude and image."""
    tables = [(named(star), _of_star(number).text) for number, star in enumerate(fusion.STARS)]
    return Html(templates().get_template("folded.html").render(tables=tables))


def _of_star(number: int) -> Html:
    arrays, rows = _study().arrays, []
    for i, place in enumerate(PLACES):
        for j, magnitude in enumerate(fusion.MAGNITUDES):
            for k, made in enumerate(fusion.MADE):
                error = arrays["error"][number, i, j, k]
                bias = arrays["bias"][number, i, j, k]
                numbers = [f"{value:.3f}" for value in (error[0], error[1], bias[1])]
                signal = f"{arrays['signal_to_noise'][number, i, j, k]:.0f}"
                rows.append([f"{place}, V = {magnitude:g}", made, *numbers, signal])
    heads = ["Star", "Image", *(f"Error, {m} (px)" for m in fusion.METHODS)]
    heads += ["Bias, maximum likelihood (px)", "Signal over noise"]
    caption = "Centroids against green's true position, with and without registration."
    return plain_table(caption, heads, rows)


def named(star: str) -> str:
    """Return what to call a star of the study, with its temperature where it is a blackbody."""
    spectrum = fusion.STARS[star]
    if isinstance(spectrum, str):
        return f"{star}, tabulated spectrum"
    return f"{star}, blackbody of {spectrum:,.0f}\u202fK"


def colours() -> Html:
    """Show the channel ratios of every star and their errors."""
    arrays, rows = _study().arrays, []
    for i, star in enumerate(fusion.STARS):
        for j, magnitude in enumerate(fusion.MAGNITUDES):
            row = [named(star), f"{magnitude:g}"]
            for truth, scatter, predicted in arrays["colour"][i, 0, j]:
                row += [f"{truth:.3f}", f"{scatter:.3f}", f"{predicted:.3f}"]
            rows.append(row)
    heads = ["Star", "V"]
    for name in ("red / green", "blue / green"):
        heads += [name, "error", "error predicted"]
    return plain_table("Colour of a star from the ratio of two channels.", heads, rows)


def stand_ins() -> Html:
    """Show what the paper does not print and we had to choose."""
    sensor = images.SENSOR
    rows = [
        ["aperture", f"{images.APERTURE * 1e3:g} mm"],
        ["transmission of the optics", f"{images.TRANSMISSION:g}"],
        ["radius of a spot (one standard deviation)", f"{images.RADIUS:g} px"],
        ["quantum efficiency", f"{sensor.quantum_efficiency:g}"],
        ["read noise", f"{sensor.read_noise:g} electrons"],
        ["dark signal in one exposure", f"{sensor.dark_signal:g} electron"],
        ["full well", f"{sensor.full_well:,.0f} electrons"],
        ["digital output", f"{sensor.bits} bits"],
    ]
    return plain_table("Stand-ins for what the paper does not print.", ["What", "Ours"], rows)


def sayings() -> dict[str, str]:
    """Return what sentences may say of the images: label to text."""
    arrays = _study().arrays
    likely = fusion.METHODS.index("maximum likelihood")
    fourth = fusion.MAGNITUDES.index(4.0)
    solar = list(fusion.STARS).index("solar")
    at_corner = arrays["error"][:, -1, fourth, :, likely]
    green, plain, registered = at_corner[solar]
    gain = arrays["signal_to_noise"][..., 2] / arrays["signal_to_noise"][..., 0]
    loss = arrays["signal_to_noise"][..., 1] / arrays["signal_to_noise"][..., 2]
    frame = _frame()
    off = np.abs(frame.pulls)
    return {
        "green": f"{green:.3f}\u202fpx",
        "plain": f"{plain:.2f}\u202fpx",
        "registered": f"{registered:.3f}\u202fpx",
        "plain-least": f"{at_corner[:, 1].min():.2f}\u202fpx",
        "plain-most": f"{at_corner[:, 1].max():.2f}\u202fpx",
        "plain-least-star": list(fusion.STARS)[int(at_corner[:, 1].argmin())],
        "plain-most-star": list(fusion.STARS)[int(at_corner[:, 1].argmax())],
        "registered-bias": f"{arrays['bias'][..., 2, likely].max():.3f}\u202fpx",
        "gain": f"{np.median(gain):.2f}",
        "gain-least": f"{np.median(gain, axis=(1, 2)).min():.2f}",
        "gain-most": f"{np.median(gain, axis=(1, 2)).max():.2f}",
        "loss": f"{1 - np.median(loss):.0%}".replace("%", "\u202f%"),
        "trials": f"{int(_study().note['replicates']):,}",
        "frame-sent": str(frame.sent),
        "frame-measured": str(frame.measured.shape[1]),
        "frame-within-one": f"{(off < 1).mean():.0%}".replace("%", "\u202f%"),
        "frame-within-two": f"{(off < 2).mean():.0%}".replace("%", "\u202f%"),
    }
