"""Posteriors of the printed registrations, Table 3 and Table 4 (niu2024, 4.1 to 4.3).

The paper prints estimates without uncertainties. The noise follows from the printed residuals, and
the errors of the estimates per unit of noise from the positions of the stars. The simulation prints
their number, range and step without the pattern, so each alternative pattern is a possible design.
For the laboratory neither number nor pattern is printed: the design of the simulation is assumed,
with positions that are as accurate as the test points, or averages of ten.

A residual of the simulation counts both axes, as in (26). If it is the residual of one axis, the
noise is larger by the square root of two.
"""

from __future__ import annotations

from functools import partial
from typing import cast

import numpy as np

from reproduce.inference import LogUniform, Model, Prior, Quantity, Uniform, models
from reproduce.papers.charts import Figure, set_size
from reproduce.papers.declare import Rows, draws, item_text, studied
from reproduce.papers.niu2024 import experiment, simulation
from reproduce.papers.niu2024.simulation import CHANNELS, REGISTERED, ROWS
from reproduce.papers.posteriors import Declaration, book_plan
from reproduce.physics.optics import Camera, channel_centroids
from reproduce.physics.registration import RegistrationFit, fit_registration
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs

# Table and kind of its data, cells of the test points and of the residuals (with a place for the
# channel), instrument and its printed numbers with those of the positions, and measurements that
# are averaged into a position.
_SOURCES = {
    "camera": (
        "Table 4, measured",
        "niu2024/table-4",
        "niu2024/text-experiment#test-points",
        "niu2024/text-experiment#rmse-after-{}-*",
        experiment.instrument,
        (*simulation.ANGLES, *experiment.CAMERAS),
        (1, 10),
    ),
    "simulation": (
        "Table 3, simulated",
        "niu2024/table-3",
        "niu2024/text-simulation#test-points",
        "niu2024/text-simulation#rmse-after-{}",
        simulation.instrument,
        simulation.INPUTS,
        (1,),
    ),
}
_PRIORS: dict[str, Prior] = {
    "scale": Uniform(0.5, 2.0, "between half and double: channels of one telescope"),
    "rotation": Uniform(-0.5, 0.5, "detectors behind one prism are mounted alike"),
    "shift-x": Uniform(-2000.0, 2000.0, "the width of a detector"),
    "shift-y": Uniform(-2000.0, 2000.0, "the width of a detector"),
    "noise": LogUniform(1e-3, 10.0, "no scale preferred between rounding and defocus"),
}


def _noise_free_fit(
    cameras: list[Camera], angles: FloatArray, channel: str
) -> RegistrationFit:
    """Return the registration of noise-free stars, for a noise of 1 px of a pair of coordinates.

    Star positions follow from the rotation angles of the table, shape (n, 2), in rad.
    """
    place = CHANNELS.index(channel)
    spots = channel_centroids(cameras, angles)
    pivot = cameras[place].principal_point
    return fit_registration(spots[place], spots[0], pivot, target_covariance=np.eye(2))


def _against_cameras(parameters: FloatArray, expected: float) -> dict[str, Quantity]:
    """Return the difference between the scale factor and that of noise-free images."""
    difference = (parameters[:, 0] - expected) * 1e6
    return {"scale minus cameras": Quantity(difference, "ppm")}


def _model(inputs: Inputs, kind: str, channel: str) -> Model:
    """Return the printed estimates and residuals of a channel, with all possible designs."""
    _, table, points, residuals, instrument, _, averaged = _SOURCES[kind]
    cells = [f"{table}#{row}.{channel}" for row in ROWS]
    patterns = item_text("niu2024/text-simulation").options["angles"]
    fits = [
        _noise_free_fit(
            instrument(inputs), simulation.arrangement(inputs, name), channel
        )
        for name in patterns
    ]
    errors = np.array([fit.standard_errors for fit in fits])
    likelihood = models.PrintedFit(
        np.array([inputs[cell] for cell in cells]),
        np.array([inputs.half_unit(cell) for cell in cells]),
        np.concatenate([errors / np.sqrt(count) for count in averaged]),
        # Section 4.3 has a residual of each axis.
        inputs.array(residuals.format(channel)),
        inputs.count(points),
    )
    # The first pattern is the literal one.
    expected = fits[0].parameters[0]
    return Model(
        f"{kind}-{channel}",
        tuple(models.registration_parameter(*item) for item in _PRIORS.items()),
        likelihood,
        partial(_against_cameras, expected=expected),
    )


def _declaration(kind: str, channel: str) -> Declaration:
    where, table, points, residuals, _, design, _ = _SOURCES[kind]
    rows = zip(models.TRANSFORM, ROWS, strict=True)
    summary = {name: f"{table}#{row}.{channel}" for name, row in rows}
    return Declaration(
        f"{kind}-{channel}",
        f"Printed registration of {channel} ({where})",
        "niu2024",
        (*design, *summary.values(), points, residuals.format(channel)),
        partial(_model, kind=kind, channel=channel),
        "its data are the printed estimates; registration takes stars",
        plan=book_plan(steps=450, walkers=240),
        summary=summary,
    )


POSTERIORS = tuple(
    _declaration(kind, channel) for kind in _SOURCES for channel in REGISTERED
)


# Possible positions in the laboratory, with the variance of an estimate relative to the simulation.
_DESIGNS = {
    "means of ten": 0.1,
    "positions of the simulation": 1.0,
    "a tenth of the positions": 10.0,
}
_SCALE_INPUTS = (
    *simulation.ANGLES,
    *experiment.CAMERAS,
    "niu2024/table-4#scale.*",
    "niu2024/text-experiment#test-points",
    "niu2024/text-experiment#rmse-after-*",
)


@studied("niu2024/printed-scales", inputs=_SCALE_INPUTS)
def _printed_scales(inputs: Inputs) -> Rows:
    """Compute the difference between scale factors and cameras, with its error by design."""
    for channel in REGISTERED:
        model = _model(inputs, "camera", channel)
        likelihood = cast(models.PrintedFit, model.likelihood)
        centre, _ = likelihood.start()
        [difference] = model.consequences(centre[None]).values()
        rounding = likelihood.half_units[0] / np.sqrt(3)
        noise = centre[-1] * likelihood.errors[0, 0]
        for name, variance in _DESIGNS.items():
            error = np.hypot(rounding, noise * np.sqrt(variance)) * 1e6
            [value] = difference.values
            yield channel, name, value, error, abs(value) / error


@draws("niu2024/drawing-printed-scales", inputs=_SCALE_INPUTS)
def _draw_scales(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the difference between scale factors and cameras, with two standard deviations."""
    set_size(figure, 2.8, 3.4, width=6.0)
    axes = figure.subplots()
    rows = list(_printed_scales.function(inputs))
    for height, (channel, _, value, error, _) in enumerate(rows):
        look = {"red": "C1o", "blue": "C0s"}[channel]
        axes.errorbar(value, -height, xerr=2 * error, fmt=look, capsize=3)
    axes.axvline(0.0, color="k", linewidth=1)
    labels = [f"{channel}: {name}" for channel, name, *_ in rows]
    axes.set(
        xlabel="scale minus cameras (ppm)",
        yticks=-np.arange(len(rows)),
        yticklabels=labels,
    )
