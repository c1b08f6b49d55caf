"""The numerical simulation: Figure 4, Table 3 and the four RMSE values (niu2024, 4.1 and 4.2).

The text allows several readings. The literal reading, recorded before the first verdicts, is:

* the angles are a square lattice with the printed step between neighbours. It contains the zero
  position, which the starting values of section 3.2 need;
* centroids follow (21) to (23) with the imaging parameters of Table 1, principal points included,
  and the rotation angles of Table 2;
* every coordinate of every channel has independent Gaussian noise of the printed standard
  deviation, drawn once. The average of ten repeats belongs to the laboratory procedure of 3.1;
* the calibration is the two-stage Gauss-Newton iteration of section 3.2, with starting values
  from the angles with the external frame at zero and from the zero position;
* test points are random directions, uniform over the printed range, imaged with the same noise;
* the RMSE is (26): one number for both axes.

The text gives a count, a range and a step of the angles. The count is a prime number, so no full
rectangle has it. It selects among the arrangements of `physics.optics`, and is an
input.

Each choice is an option of the computations below. The ledger evaluates all combinations.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng

from reproduce.papers.charts import Figure, plot_range, set_size
from reproduce.papers.declare import (
    Results,
    by_cell,
    draws,
    item_text,
    reproduces,
)
from reproduce.physics import validate
from reproduce.physics.optics import Camera, arrangement_angles, channel_centroids
from reproduce.physics.registration import (
    Registration,
    closed_similarity,
    rmse_per_axis,
)
from reproduce.physics.validate import FloatArray, IntArray
from reproduce.printed.inputs import Inputs

NOISE = "niu2024/text-simulation#noise"
CHANNELS = ("green", "red", "blue")
REGISTERED = CHANNELS[1:]
# The order of `CHANNELS` in the columns of the tables: red, green, blue.
_GREEN_FIRST = [1, 0, 2]
ROWS = ("scale", "rotation", "translation-x", "translation-y")
_REPLICATES = 2000
# Factor of the printed noise in green, red and blue.
_NOISE_FACTORS = {
    "every-channel": (1.0, 1.0, 1.0),
    "red-and-blue": (0.0, 1.0, 1.0),
    "green": (1.0, 0.0, 0.0),
}
_DRAWS_AVERAGED = {"one": 1, "ten": 10}
_OPTIONS = item_text("niu2024/text-simulation").options
ANGLES = (
    "niu2024/text-simulation#angle-count",
    "niu2024/text-simulation#range-x-*",
    "niu2024/text-simulation#range-y-*",
    "niu2024/text-simulation#step",
)
INPUTS = (
    *ANGLES,
    "niu2024/table-1",
    "niu2024/table-2#rotation.*",
    "niu2024/text-optics#pixel-pitch-x",
    NOISE,
)


def half_ranges(inputs: Inputs) -> FloatArray:
    """Return half the printed range about x and about y, shape (2,), in radians."""
    ends = inputs.pairs("niu2024/text-simulation#range-?-*")
    return np.ptp(ends, axis=1) / 2


def _lattice(inputs: Inputs, name: str) -> FloatArray:
    """Return the angles of one alternative with any count, shape (n, 2), in radians.

    The text of an alternative in ``data/captions/niu2024.toml`` is the name of its arrangement
    for `arrangement_angles`. A change of the text changes the computation.
    """
    half_x, half_y = half_ranges(inputs)
    return arrangement_angles(
        _OPTIONS["angles"][name].text,
        half_x,
        half_y,
        inputs["niu2024/text-simulation#step"],
    )


@cache
def arrangement(
    inputs: Inputs, name: str = next(iter(_OPTIONS["angles"]))
) -> FloatArray:
    """Return the angles of one alternative, by default the literal one, (n, 2), in radians."""
    angles = _lattice(inputs, name)
    if len(angles) != (count := inputs.count("niu2024/text-simulation#angle-count")):
        raise ValueError(
            f"niu2024/text-simulation#angle-count: expected {len(angles)}, which the "
            f"arrangement {name} has over the range, got {count}. Change the count, or choose "
            "other angles."
        )
    return angles


def principal_points(inputs: Inputs) -> FloatArray:
    """Return the principal points of Table 1 for green, red and blue, shape (3, 2), in px."""
    printed = inputs.array("niu2024/table-1#principal-point-?.*")
    return printed.reshape(2, 3).T[_GREEN_FIRST]


def translations(inputs: Inputs, table: str) -> FloatArray:
    """Return the translations of red and blue in a table, shape (2, 2), in px."""
    return inputs.pairs(f"{table}#translation-?.*").T


def instrument_of(
    inputs: Inputs, imaging: str, rotations: str, principal: FloatArray
) -> list[Camera]:
    """Return the cameras of two tables, with principal points of shape (3, 2), in px."""
    lengths, distortions = (
        inputs.array(f"{imaging}#{name}.*")[_GREEN_FIRST]
        for name in ("focal-length", "radial-distortion")
    )
    pitch = inputs["niu2024/text-optics#pixel-pitch-x"]
    turns = [0.0, *inputs.array(f"{rotations}#rotation.*")]
    return [*map(Camera, lengths, principal, distortions, [pitch] * 3, turns)]


def instrument(inputs: Inputs, source: str = "table-1") -> list[Camera]:
    """Return green, red and blue of the simulation under one alternative of the translations."""
    principal = principal_points(inputs)
    if source == "table-2":
        principal[1:] = principal[0] + translations(inputs, "niu2024/table-2")
    return instrument_of(inputs, "niu2024/table-1", "niu2024/table-2", principal)


def _zero_positions(angles: FloatArray) -> IntArray:
    """Return the indices of the zero position among angles of shape (n, 2)."""
    return np.flatnonzero(np.isclose(angles, 0.0).all(axis=-1))


def registered_points(
    measured: FloatArray, angles: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the points and the pivots of the registrations of red and blue to green.

    The pivots are the spots at the zero position, as in section 3.2.

    Parameters
    ----------
    measured : ndarray, shape (..., 3, n, 2)
        Centroids of green, red and blue, in px.
    angles : ndarray, shape (n, 2)
        Angles of the table, in radians, with the zero position.

    Returns
    -------
    source : ndarray, shape (..., 2, n, 2)
        Centroids of red and blue.
    target : ndarray, shape (..., 1, n, 2)
        Centroids of green.
    pivot : ndarray, shape (..., 2, 2)
        Pivots of red and blue.
    """
    green, others = np.split(measured, [1], axis=-3)
    [zero] = _zero_positions(angles)
    return others, green, others[..., zero, :]


def noise(inputs: Inputs) -> float:
    """Return the standard deviation of a coordinate of a centroid, in px, zero or more."""
    return float(validate.non_negative(NOISE, inputs[NOISE]))


def _measuring(
    inputs: Inputs,
    generator: Generator,
    replicates: int,
    noisy: str,
    repeats: str,
    translations: str,
) -> Callable[[FloatArray], FloatArray]:
    """Return a function of angles, (..., n, 2), that draws centroids, (replicates, 3, n, 2), in px.

    A mean of several draws has their noise divided by the root of their number.
    """
    cameras = instrument(inputs, translations)
    factors = np.reshape(_NOISE_FACTORS[noisy], (3, 1, 1))
    sigma = noise(inputs) * factors / np.sqrt(_DRAWS_AVERAGED[repeats])

    def measured(angles: FloatArray) -> FloatArray:
        true = channel_centroids(cameras, angles)
        return generator.normal(true, sigma, (replicates, *true.shape[-3:]))

    return measured


def _calibrated(
    measured: Callable[[FloatArray], FloatArray], table: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the calibrated parameters of red and blue, (replicates, 2, 4), and the pivots.

    The fit is the closed form, which is the limit of the iteration of section 3.2. A zero position
    that is not in an arrangement is measured in addition to its points, without a weight.
    """
    angles = table
    if not _zero_positions(table).size:
        angles = np.vstack([table, [[0.0, 0.0]]])
    points = registered_points(measured(angles), angles)
    weights = (np.arange(len(angles)) < len(table)).astype(float)
    return closed_similarity(*points, weights)[0], points[-1]


def _test_angles(
    inputs: Inputs,
    generator: Generator,
    replicates: int,
    table: FloatArray,
    tests: str,
) -> FloatArray:
    """Return the angles of random test points, shape (replicates, points, 2), in radians."""
    count = inputs.count("niu2024/text-simulation#test-points")
    if tests == "range":
        half = half_ranges(inputs)
        return generator.uniform(-half, half, (replicates, count, 2))
    rows = np.tile(np.arange(len(table)), (replicates, 1))
    return table[generator.permuted(rows, axis=1)[:, :count]]


def _printed(inputs: Inputs, translations: str) -> Registration:
    """Return the transforms of Table 3 about the principal points of red and blue."""
    _, *others = instrument(inputs, translations)
    pivots = np.stack([camera.principal_point for camera in others])
    parameters = inputs.pairs("niu2024/table-3").T
    return Registration("similarity", parameters, pivots)


@reproduces(
    "niu2024/table-3",
    cells=["scale.*", "rotation.*", "translation-*"],
    inputs=[*INPUTS, "niu2024/table-2#translation-*"],
    replicates=_REPLICATES,
    options=_OPTIONS,
)
def calibrated_parameters(
    inputs: Inputs,
    seed: SeedSequence,
    replicates: int,
    *,
    angles: str,
    noise: str,
    repeats: str,
    translations: str,
) -> Results:
    """Compute the registration parameters calibrated from noisy simulated centroids.

    Implements: niu2024 (14), (17), (18), (19), (20), (21), (22), (23), (24), (25).
    """
    measured = _measuring(
        inputs, default_rng(seed), replicates, noise, repeats, translations
    )
    parameters, _ = _calibrated(measured, arrangement(inputs, angles))
    return by_cell("{1}.{0}", parameters, REGISTERED, ROWS)


@reproduces(
    "niu2024/text-simulation",
    cells=["rmse-*"],
    inputs=[
        *INPUTS,
        "niu2024/table-2#translation-*",
        "niu2024/text-simulation#test-points",
        "niu2024/table-3#*",
    ],
    replicates=_REPLICATES,
)
def registration_rmse(
    inputs: Inputs,
    seed: SeedSequence,
    replicates: int,
    *,
    angles: str,
    noise: str,
    repeats: str,
    translations: str,
    tests: str,
    parameters: str,
    rmse: str,
) -> Results:
    """Compute the RMSE at test points before and after registration.

    Implements: niu2024 (17), (18), (26).
    """
    generator, table = default_rng(seed), arrangement(inputs, angles)
    measured = _measuring(inputs, generator, replicates, noise, repeats, translations)
    # The test points are drawn first: the RMSE before registration is then equal for every
    # calibration.
    points = measured(_test_angles(inputs, generator, replicates, table, tests))
    if parameters == "table-3":
        transforms = _printed(inputs, translations)
    else:
        transforms = Registration("similarity", *_calibrated(measured, table))
    before = points[:, 1:]
    both = np.stack([before, transforms.apply(before)], axis=1)
    x, y = np.moveaxis(rmse_per_axis(both, points[:, None, :1]), -1, 0)
    whole = np.hypot(x, y)
    values = {"both": whole, "one": whole / np.sqrt(2), "x": x, "y": y}[rmse]
    return by_cell("rmse-{}-{}", values, ("before", "after"), REGISTERED)


@draws("niu2024/fig-4", inputs=ANGLES)
def _draw_angles(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the arrangements of the angles that the text allows, the literal one first."""
    size = 1.2 if set_size(figure, 5.6, 3.9) else 2.4
    x, y = np.degrees(half_ranges(inputs))
    outline = [-x, x, x, -x, -x], [-y, -y, y, y, -y]
    grid = figure.subplots(3, 3, sharex=True, sharey=True).flat
    for axes, name in zip(grid, _OPTIONS["angles"], strict=True):
        angles = np.degrees(_lattice(inputs, name))
        axes.plot(*angles.T, "o", markersize=size, label=name)
        axes.plot(*outline, "--", linewidth=1, label="printed range")
        axes.set(aspect="equal", xticks=(-8, 0, 8), yticks=(-6, 0, 6))
        axes.set_title(name.replace("-", "\n", 1).replace("-", " "), fontsize=8.5)
        axes.grid(visible=False)
    figure.supxlabel("middle frame (°)")
    figure.supylabel("external frame (°)")


_AGREEING = ("none agrees", "one agrees", "both agree")


@draws(
    "niu2024/drawing-table-3",
    inputs=(*INPUTS, "niu2024/table-2#*"),
    marks=["niu2024/table-3#*"],
    random=True,
)
def _draw_parameters(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the parameters of Table 3 and their predicted ranges under both readings."""
    shape = (8, 1) if set_size(figure, 5.2, 8.8) else (4, 2)
    grid = figure.subplots(*shape, sharey=True).flat
    predicted = {
        look: calibrated_parameters.with_options({"translations": table})(inputs)
        for look, table in (("C0s", "table-2"), ("C1o", "table-1"))
    }
    for axes, cell in zip(grid, printed.cells.values(), strict=True):
        value, half, agreeing = cell.number.value, cell.number.half_unit, 0
        unit = cell.si / value
        for y, (look, results) in enumerate(predicted.items()):
            ends = plot_range(axes, [y], [results[cell.name]], look, unit=unit)
            agreeing += bool(ends[0] - half <= value <= ends[2] + half)
        axes.errorbar(value, 2, xerr=half, fmt="kD", mfc="k" if agreeing else "none")
        axes.axvline(inputs[f"niu2024/table-2#{cell.name}"] / unit, c="k", ls=":", lw=1)
        sign = f" ({cell.symbol})" if cell.symbol else ""
        title = cell.name.replace(".", ", ") + sign
        axes.set_title(title, loc="left", fontsize=9)
        axes.set_title(_AGREEING[agreeing], loc="right", fontsize=9, weight="bold")
        axes.set_yticks(range(3), ("if Table 2", "if Table 1", "printed"))
        axes.margins(y=0.25)
        axes.locator_params(axis="x", nbins=4)
