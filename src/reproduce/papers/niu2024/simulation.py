"""The numerical simulation: Figure 4, Table 3 and the four RMSE values (niu2024, 4.1 and 4.2).

The text leaves several readings open. The literal one, written down some minutes before the first
verdicts were:

* the angles are those of `literal`;
* centroids follow (21) to (23) with the imaging parameters of Table 1, principal points included,
  and the rotation angles of Table 2;
* every coordinate of every channel gets its own Gaussian noise of the printed standard deviation,
  drawn once: the averaging over ten repeats belongs to the laboratory procedure of section 3.1;
* the calibration is that of section 3.2: starting values from the row of angles with the external
  frame at zero and from the zero position, then the two-stage Gauss-Newton iteration;
* test points are directions at random, uniform over the printed range, imaged with the same noise;
* the RMSE is (26): one number for both axes.

The text gives a count, a range and a step of the angles. No full rectangle has that count, which is
a prime. The count therefore selects among the arrangements of `physics.optics.arrangements`, and is
an input. The most literal arrangement takes the step as the distance between neighbours of a square
lattice and contains the zero position, which the starting values of section 3.2 need.

Each choice is an option of the computations below; the ledger evaluates all combinations.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng
from numpy.typing import NDArray

from reproduce.papers.declare import Prediction, Results, draws, item_text, reproduces
from reproduce.physics import validate
from reproduce.physics.optics import Camera, arrangement_angles, channel_centroids
from reproduce.physics.registration import (
    Registration,
    fit_registration,
    rmse_per_axis,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs

if TYPE_CHECKING:
    from matplotlib.figure import Figure

IMAGING = "niu2024/table-1"
TRUTH = "niu2024/table-2"
_RESULTS = "niu2024/table-3"
OPTICS = "niu2024/text-optics"
SETTINGS = "niu2024/text-simulation"
NOISE = f"{SETTINGS}#noise"
CHANNELS = ("green", "red", "blue")
REGISTERED = ("red", "blue")
ROWS = ("scale", "rotation", "translation-x", "translation-y")
_REPLICATES = 2000
# Factor of the printed noise in green, red and blue.
_NOISE_FACTORS = {
    "every-channel": (1.0, 1.0, 1.0),
    "red-and-blue": (0.0, 1.0, 1.0),
    "green": (1.0, 0.0, 0.0),
}
_DRAWS_AVERAGED = {"one": 1, "ten": 10}
_OPTIONS = item_text(SETTINGS).options
ANGLES = (
    f"{SETTINGS}#angle-count",
    f"{SETTINGS}#range-x-*",
    f"{SETTINGS}#range-y-*",
    f"{SETTINGS}#step",
)
READS = (*ANGLES, IMAGING, f"{TRUTH}#rotation.*", f"{OPTICS}#pixel-pitch-x", NOISE)


def half_ranges(inputs: Inputs) -> FloatArray:
    """Return half the printed range about x and about y, shape (2,), in radians."""
    low, high = (inputs.array(f"{SETTINGS}#range-?-{end}") for end in ("low", "high"))
    return np.asarray((high - low) / 2)


@cache
def arrangement(
    inputs: Inputs, name: str = next(iter(_OPTIONS["angles"]))
) -> FloatArray:
    """Return the angles of one alternative, shape (n, 2), in radians; default: the literal."""
    half_x, half_y = half_ranges(inputs)
    full = _OPTIONS["angles"][name].text
    angles = arrangement_angles(full, half_x, half_y, inputs[f"{SETTINGS}#step"])
    if len(angles) != (count := inputs.count(f"{SETTINGS}#angle-count")):
        raise ValueError(
            f"{SETTINGS}#angle-count: expected {len(angles)}, which the arrangement {name} "
            f"has over the range, got {count}. Change the count, or choose other angles."
        )
    return angles


def numbers(
    inputs: Inputs, name: str, channels: Sequence[str] = CHANNELS
) -> FloatArray:
    """Return a printed number of each channel, shape (channels,)."""
    return np.array([inputs[f"{name}.{channel}"] for channel in channels])


def points(inputs: Inputs, name: str, channels: Sequence[str] = CHANNELS) -> FloatArray:
    """Return a printed point of each channel, shape (channels, 2), in px."""
    x, y = (numbers(inputs, f"{name}-{axis}", channels) for axis in "xy")
    return np.stack([x, y], axis=-1)


def cameras(inputs: Inputs, translations: str = "table-1") -> list[Camera]:
    """Return the cameras of Table 1, green, red and blue, under one reading of their shifts."""
    principal = points(inputs, f"{IMAGING}#principal-point")
    if translations == "table-2":
        principal[1:] = principal[0] + points(
            inputs, f"{TRUTH}#translation", REGISTERED
        )
    return cameras_of(inputs, IMAGING, principal)


def cameras_of(inputs: Inputs, table: str, principal: FloatArray) -> list[Camera]:
    """Return the cameras of a table with principal points of shape (3, 2)."""
    lengths = numbers(inputs, f"{table}#focal-length")
    distortions = numbers(inputs, f"{table}#radial-distortion")
    every = zip(lengths, principal, distortions, strict=True)
    return [Camera(*one, inputs[f"{OPTICS}#pixel-pitch-x"]) for one in every]


def rotations(inputs: Inputs, table: str = TRUTH) -> list[float]:
    """Return the detectors' rotation angles against green: green, red, blue, in radians."""
    return [0.0, *numbers(inputs, f"{table}#rotation", REGISTERED).tolist()]


def imaged(
    inputs: Inputs, angles: FloatArray, translations: str = "table-1"
) -> FloatArray:
    """Return where green, red and blue image the star without noise, shape (..., 3, n, 2)."""
    return channel_centroids(cameras(inputs, translations), rotations(inputs), angles)


def zero_places(angles: FloatArray) -> NDArray[np.intp]:
    """Return the places of the zero position among angles of shape (n, 2)."""
    return np.flatnonzero(np.isclose(angles, 0.0).all(axis=-1))


def noise(inputs: Inputs) -> float:
    """Return the standard deviation of a centroid's coordinate, in px, zero or more."""
    return float(validate.non_negative(NOISE, inputs[NOISE]))


@dataclass(frozen=True)
class _Bench:
    """The simulated bench under one reading: printed settings and alternatives of its options."""

    inputs: Inputs
    angles: str
    noise: str
    repeats: str
    translations: str

    @property
    def table(self) -> FloatArray:
        """Angles of the calibration, shape (n, 2), in radians."""
        return arrangement(self.inputs, self.angles)

    def measured(
        self, generator: Generator, replicates: int, angles: FloatArray
    ) -> FloatArray:
        """Return centroids with noise, shape (replicates, 3, n, 2).

        A mean of several draws has their noise divided by the root of their number.
        """
        true = imaged(self.inputs, angles, self.translations)
        sigma = noise(self.inputs) / np.sqrt(_DRAWS_AVERAGED[self.repeats])
        factors = np.array(_NOISE_FACTORS[self.noise])[:, None, None]
        unit = generator.standard_normal((replicates, *true.shape[-3:]))
        return np.asarray(true + sigma * factors * unit)

    def calibrated(
        self, generator: Generator, replicates: int
    ) -> dict[str, Registration]:
        """Simulate and calibrate both channels: transforms of shape (replicates,).

        The fit is the closed form, which is where the iteration of section 3.2 ends. A zero
        position that is not in an arrangement is measured in addition to its points.
        """
        count, zero = len(self.table), zero_places(self.table)
        angles = self.table if zero.size else np.vstack([self.table, np.zeros((1, 2))])
        measured = self.measured(generator, replicates, angles)
        pivots = measured[:, 1:, zero.item() if zero.size else count]
        green, *others = np.moveaxis(measured[:, :, :count], 1, 0)
        return {
            channel: fit_registration(points, green, pivot).transform
            for channel, points, pivot in zip(
                REGISTERED, others, np.moveaxis(pivots, 1, 0), strict=True
            )
        }

    def tested(self, generator: Generator, replicates: int, tests: str) -> FloatArray:
        """Return centroids of random test points, shape (replicates, 3, points, 2)."""
        count = self.inputs.count(f"{SETTINGS}#test-points")
        if tests == "range":
            half = half_ranges(self.inputs)
            points = generator.uniform(-half, half, (replicates, count, 2))
        else:
            rows = np.tile(np.arange(len(self.table)), (replicates, 1))
            points = self.table[generator.permuted(rows, axis=1)[:, :count]]
        return self.measured(generator, replicates, points)

    def printed(self) -> dict[str, Registration]:
        """Return the transforms of Table 3 about the principal points of the channels."""
        pivots = [
            one.principal_point for one in cameras(self.inputs, self.translations)
        ]
        scales, turns = (
            numbers(self.inputs, f"{_RESULTS}#{row}", REGISTERED) for row in ROWS[:2]
        )
        shifts = points(self.inputs, f"{_RESULTS}#translation", REGISTERED)
        every = zip(scales, turns, shifts, pivots[1:], strict=True)
        found = (
            Registration.similarity(k, turn, *places) for k, turn, *places in every
        )
        return dict(zip(REGISTERED, found, strict=True))


@reproduces(
    _RESULTS,
    cells=["scale.*", "rotation.*", "translation-*"],
    inputs=[*READS, f"{TRUTH}#translation-*"],
    equations=["14", "17", "18", "19", "20", "21", "22", "23", "24", "25"],
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
    """Registration parameters calibrated from noisy simulated centroids."""
    bench = _Bench(inputs, angles, noise, repeats, translations)
    transforms = bench.calibrated(default_rng(seed), replicates)
    return {
        f"{row}.{channel}": Prediction(draws)
        for channel, transform in transforms.items()
        for row, draws in zip(ROWS, transform.parameters.T, strict=True)
    }


@lru_cache(maxsize=2)
def _residuals(
    bench: _Bench, seed: SeedSequence, replicates: int, tests: str, parameters: str
) -> dict[str, FloatArray]:
    """Return the RMSE per axis at test points, by cell name, shape (replicates, 2).

    The test points are drawn first: the RMSE before registration is then the same for every
    calibration.
    """
    generator = default_rng(seed)
    measured = bench.tested(generator, replicates, tests)
    if parameters == "table-3":
        transforms = bench.printed()
    else:
        transforms = bench.calibrated(generator, replicates)
    green, *others = np.moveaxis(measured, 1, 0)
    before = dict(zip(REGISTERED, others, strict=True))
    after = {c: transforms[c].apply(points) for c, points in before.items()}
    return {
        f"rmse-{name}-{channel}": rmse_per_axis(points, green)
        for name, registered in (("before", before), ("after", after))
        for channel, points in registered.items()
    }


@reproduces(
    SETTINGS,
    cells=["rmse-*"],
    inputs=[
        *READS,
        f"{TRUTH}#translation-*",
        f"{SETTINGS}#test-points",
        f"{_RESULTS}#*",
    ],
    equations=["17", "18", "26"],
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
    """RMSE at test points before and after registration."""
    bench = _Bench(inputs, angles, noise, repeats, translations)
    found = _residuals(bench, seed, replicates, tests, parameters)
    return {
        name: Prediction(
            axes[:, "xy".index(rmse)]
            if rmse in {"x", "y"}
            else np.hypot(*axes.T) / (1.0 if rmse == "both" else np.sqrt(2))
        )
        for name, axes in found.items()
    }


@draws("niu2024/fig-4", inputs=ANGLES)
def _draw_angles(figure: Figure, printed: Mapping[str, float], inputs: Inputs) -> None:
    """Rotation angles of the rotary table in the simulation."""
    angles = np.degrees(arrangement(inputs))
    axes = figure.add_subplot()
    axes.plot(
        *angles.T, "o", markersize=4, label=f"{len(angles)} angles of the simulation"
    )
    corners = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]])
    outline = np.degrees(corners * half_ranges(inputs)).T
    axes.plot(*outline, linestyle="--", linewidth=1, label="printed range")
    axes.set(aspect="equal", xlabel="middle frame (°)", ylabel="external frame (°)")
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)
