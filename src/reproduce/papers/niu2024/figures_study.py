"""Drawings of the simulation study of niu2024 that the paper does not have."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.niu2024 import angles, simulation, study
from reproduce.papers.niu2024.sketch import RED
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
from reproduce.printed.given import given

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# The paper draws restarts "within a certain range" that it does not print; this one is ours.
HALF_WIDTHS = (0.1, np.radians(5.0), 50.0, 50.0)
RESTARTS = 20


def convergence(seed: int = study.SEED) -> tuple[Calibration, Calibration]:
    """Calibrate the red channel of one replicate from the paper's start and from random ones."""
    door = given(study.READS)
    table = angles.literal(door).angles
    true = channel_centroids(simulation.cameras(door), simulation.rotations(door), table)
    noise = study.numbers(door, 1, seed=seed).calibration[0]
    green, red, _ = true + door[f"{simulation.SETTINGS}#noise"] * noise
    still = np.isclose(table[:, 1], 0.0)
    zero = np.flatnonzero(still & np.isclose(table[:, 0], 0.0)).item()
    start = starting_values(red[still], green[still], red[zero], green[zero])
    starts = random_starts(start, HALF_WIDTHS, RESTARTS, np.random.default_rng(seed))
    pivot = red[zero]
    return calibrate(red, green, pivot, start), calibrate(red, green, pivot, starts)


def facts() -> dict[str, str]:
    """Return what the drawing of the convergence shows, in numbers."""
    own, restarted = convergence()
    mine, theirs = distance_to_end(own), distance_to_end(restarted)
    distances = {
        "own-start": mine[0],
        "own-first": mine[own.first_stage],
        "own-next": mine[own.first_stage + 1],
        "restart-least": theirs[0].min(),
        "restart-most": theirs[0].max(),
    }
    said = {name: f"{d:.1g}\u202fpx" for name, d in distances.items()}
    return said | {
        "own-stage": f"{own.first_stage}",
        "restart-stage": f"{restarted.first_stage}",
        "restarts": f"{RESTARTS}",
    }


def draw_convergence(figure: Figure) -> None:
    """How far each step of the calibration is from its end."""
    own, restarted = convergence()
    axes = figure.add_subplot()
    lines = axes.plot(
        distance_to_end(restarted), color="#000000", linewidth=0.6, marker=".", alpha=0.5
    )
    lines[0].set_label(f"{RESTARTS} random starts")
    axes.plot(
        distance_to_end(own),
        RED.line,
        marker=RED.marker,
        color=RED.colour,
        label="starting values of section 3.2",
    )
    for begin in (own.first_stage, restarted.first_stage):
        axes.axvline(begin, color="#000000", linestyle=":", linewidth=1)
        axes.text(begin - 0.08, 1e-6, "all four from here on", rotation=90, ha="right", va="center")
    axes.set(yscale="log", ylim=(1e-12, 1e3), xlabel="step", ylabel="distance from the end (px)")
    figure.legend(loc="outside lower center", ncols=2)


def distance_to_end(calibration: Calibration) -> FloatArray:
    """Return how far the modelled points are from where they end, after every step.

    Shape (m + 1, ...). Root mean square over the table's points of one frame, in px; never below
    1e-11, where rounding takes over.
    """
    door = given(study.READS)
    table = angles.literal(door).angles
    true = channel_centroids(simulation.cameras(door), simulation.rotations(door), table)[1]
    at = model_points(calibration.history, true, calibration.pivot)
    return np.maximum(rmse(at, np.broadcast_to(at[-1], at.shape)), 1e-11)
