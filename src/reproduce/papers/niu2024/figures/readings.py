"""The simulation under every reading: distributions, and how the calibration converges."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import draws
from reproduce.papers.niu2024 import readings, simulation, simulation_angles
from reproduce.papers.niu2024.figures.looks import LOOKS, RED
from reproduce.papers.sketch import sized, thin
from reproduce.papers.study import Fact
from reproduce.physics.optics.simulate import channel_centroids
from reproduce.physics.registration.calibration import (
    Calibration,
    calibrate,
    model_points,
    random_starts,
    starting_values,
)
from reproduce.physics.registration.closed_form import rmse
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["chosen", "convergence", "distance_to_end", "draw_distributions"]

TITLES = ("k", "θ", "Δx", "Δy", "RMSE before", "RMSE after")


def chosen() -> dict[str, tuple[int, str]]:
    """Return readings to show: the literal one, and each other choice made in it alone.

    What is other, to the place of the reading in `readings.readings` and the axes that are counted.
    """
    door = given(readings.READS)
    every, literal = readings.readings(door), readings.literal(door)
    both, *counted = readings.COUNTED
    others = {
        "the literal one": literal,
        "noise in red and blue": replace(literal, noisy="red and blue"),
        "noise in green": replace(literal, noisy="green"),
        "ten draws": replace(literal, repeats=readings.REPEATS[1]),
        "shifts of Table 2": replace(literal, shifts="Table 2"),
        "tests among angles": replace(literal, tests=readings.TESTS[1]),
    }
    nearest = replace(literal, shifts="Table 2", tests=readings.TESTS[1])
    return {
        **{name: (every.index(reading), both) for name, reading in others.items()},
        **{f"RMSE of {axes}": (every.index(literal), axes) for axes in counted},
        "Table 2, angles, y": (every.index(nearest), readings.COUNTED[-1]),
    }


def _distances(printed: Mapping[str, float]) -> FloatArray:
    """Return how far each print lies from what each of the chosen readings predicts.

    Shape (readings, channels, numbers). From the middle of the central 99 %, in its half-widths: up
    to one it lies inside.
    """
    quantiles = readings.stored().arrays["quantiles"]
    ends = np.array([readings.counted(quantiles[n], way)[[0, -1]] for n, way in chosen().values()])
    values = np.array([printed[address] for address in readings.ADDRESSES])
    low, high = ends.swapaxes(0, 1)
    result: FloatArray = np.abs(values.reshape(low.shape[1:]) - (low + high) / 2) * 2 / (high - low)
    return result


@draws("niu2024-distributions", marks=readings.ADDRESSES)
def draw_distributions(figure: Figure, printed: Mapping[str, float]) -> None:
    """Which readings predict which printed number, and how far the print lies from the others."""
    found, names = _distances(printed), list(chosen())
    narrow = sized(figure, 6.4, 4.4, 8.2)
    panels = figure.subplots(*((2, 1) if narrow else (1, 2)), sharey=True)
    for axes, channel, table in zip(
        panels, simulation.REGISTERED, found.swapaxes(0, 1), strict=True
    ):
        rows, columns = np.nonzero(table <= 1)
        look = LOOKS[channel]
        axes.plot(columns, rows, look.marker, color=look.colour, markersize=9, label="inside")
        for row, column in zip(*np.nonzero(table > 1), strict=True):
            away = (
                f"{table[row, column]:.1f}"
                if table[row, column] < 10
                else f"{table[row, column]:.0f}"
            )
            axes.text(column, row, away, ha="center", va="center", fontsize=8)
        axes.set_xticks(range(len(TITLES)), TITLES, rotation=90)
        axes.set(title=channel, xlim=(-0.6, len(TITLES) - 0.4))
        axes.tick_params(length=0)
        axes.grid(visible=False)
    panels[0].set_yticks(range(len(names)), names, fontsize=8.5)
    panels[0].set_ylim(len(names) - 0.5, -0.5)


# The paper draws restarts "within a certain range" that it does not print; this one is ours.
HALF_WIDTHS = (0.1, np.radians(5.0), 50.0, 50.0)
RESTARTS = 20


def _imaged(door: Given) -> tuple[FloatArray, FloatArray]:
    """Return the angles of the simulation, and where the channels image them."""
    table = simulation_angles.literal(door).angles
    return table, channel_centroids(simulation.cameras(door), simulation.rotations(door), table)


def convergence() -> tuple[Calibration, Calibration]:
    """Calibrate the red channel of one replicate from the paper's start and from random ones."""
    door = given(readings.READS)
    table, true = _imaged(door)
    noise = readings.numbers(door, 1).calibration[0]
    green, red, _ = true + door[f"{simulation.SETTINGS}#noise"] * noise
    still = np.isclose(table[:, 1], 0.0)
    zero = np.flatnonzero(still & np.isclose(table[:, 0], 0.0)).item()
    pivot, generator = red[zero], np.random.default_rng(readings.SEED)
    start = starting_values(red[still], green[still], pivot, green[zero])
    starts = random_starts(start, HALF_WIDTHS, RESTARTS, generator)
    return calibrate(red, green, pivot, start), calibrate(red, green, pivot, starts)


def convergence_facts() -> dict[str, Fact]:
    """Return what the drawing of the convergence shows, in numbers."""
    own, restarted = convergence()
    mine, theirs = distance_to_end(own), distance_to_end(restarted)
    return {
        "own-start": Fact(mine[0], ".1g", "px"),
        "own-first": Fact(mine[own.first_stage], ".1g", "px"),
        "own-next": Fact(mine[own.first_stage + 1], ".1g", "px"),
        "restart-least": Fact(theirs[0].min(), ".1g", "px"),
        "restart-most": Fact(theirs[0].max(), ".1g", "px"),
        "own-stage": Fact(own.first_stage, "d"),
        "restart-stage": Fact(restarted.first_stage, "d"),
        "restarts": Fact(RESTARTS, "d"),
    }


@draws("niu2024-convergence", named=convergence_facts)
def draw_convergence(figure: Figure) -> None:
    """How far each step of the calibration is from its end."""
    own, restarted = convergence()
    axes = figure.add_subplot()
    lines = axes.plot(distance_to_end(restarted), "k.-", linewidth=0.6, alpha=0.5)
    lines[0].set_label(f"{RESTARTS} random starts")
    (line,) = axes.plot(distance_to_end(own), RED.line, marker=RED.marker, color=RED.colour)
    line.set_label("starting values of section 3.2")
    for begin in (own.first_stage, restarted.first_stage):
        axes.axvline(begin, color="#000000", linestyle=":", linewidth=1)
        axes.text(begin - 0.08, 1e-6, "all four from here on", rotation=90, ha="right", va="center")
    axes.set(yscale="log", ylim=(1e-12, 1e3), xlabel="step", ylabel="distance from the end (px)")
    figure.legend(loc="outside lower center", ncols=1 if thin(figure) else 2)


def distance_to_end(calibration: Calibration) -> FloatArray:
    """Return how far the modelled points are from where they end, after every step.

    Shape (m + 1, ...). Root mean square over the table's points of one frame, in px; never below
    1e-11, where rounding takes over.
    """
    red = _imaged(given(readings.READS))[1][1]
    at = model_points(calibration.history, red, calibration.pivot)
    return np.maximum(rmse(at, np.broadcast_to(at[-1], at.shape)), 1e-11)
