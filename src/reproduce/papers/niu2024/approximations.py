"""What the approximations of niu2024 cost with the printed parameters of Tables 1 and 4.

The pivot is off by what (10) leaves out: the source's principal point stands where green's belongs,
and they are as far apart as the tables print. Two of the five effects have a size that the paper
does not print; the stand-ins are ours:

* a detector is tilted about both axes by as much as it is printed to be turned in its plane;
* the second radial term carries what the printed share of the first one leaves, at the corner.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from reproduce.papers.declare import Results, reproduces
from reproduce.papers.niu2024 import experiment, simulation
from reproduce.papers.niu2024.registration import IMAGING, scale_factors
from reproduce.papers.study import Column, Fact, studied
from reproduce.physics.registration.approximations import (
    EFFECTS,
    Channels,
    analytic_bias,
    error_field,
    even_positions,
    second_term_from_share,
    simulated_bias,
)
from reproduce.physics.registration.fit import fit_registration
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

__all__ = ["READS", "ROUNDING", "TABLES", "TITLES", "Cost", "channels", "costs", "facts"]

APPROXIMATIONS = "niu2024/text-approximations"
SHARE = f"{APPROXIMATIONS}#first-term-share"
TABLES = ("Table 1", "Table 4")
READS = (
    *experiment.CAMERAS,
    simulation.IMAGING,
    f"{simulation.TRUTH}#rotation.*",
    f"{simulation.OPTICS}#pixels-*",
    SHARE,
)
TITLES = {
    "coefficients": "unequal coefficients",
    "cube": "k³ for k",
    "pivot": "green's pivot",
    "tilt": "tilt",
    "second term": "second radial term",
}
# Lengths in px below this are what rounding leaves of zero.
ROUNDING = 1e-9


@reproduces(
    APPROXIMATIONS,
    cells=["scale-approximation"],
    given=[f"{IMAGING}#focal-length.*"],
    equations=["6"],
)
def scale_near_one(given: Given) -> Results:
    """The scale factor of Table 1 that lies farthest from one."""
    return {
        "scale-approximation": max(scale_factors(given).values(), key=lambda scale: abs(scale - 1))
    }


@reproduces(
    APPROXIMATIONS,
    cells=["parameters"],
    given=[f"{APPROXIMATIONS}#parameters-per-channel", "niu2024/text-context#detectors"],
)
def parameter_count(given: Given) -> Results:
    """Parameters of the whole model: those of one channel, for every channel but green."""
    registered = given.count("niu2024/text-context#detectors") - 1
    per_channel = given.count(f"{APPROXIMATIONS}#parameters-per-channel")
    return {"parameters": float(registered * per_channel)}


@dataclass(frozen=True, eq=False)
class Cost:
    """What one approximation costs in one registration: lengths in px, biases in rad and px."""

    table: str
    channel: str
    effect: str
    peak: float  # largest length of the error over the detector
    rms: float  # its root mean square
    left: float  # what a fit of the four parameters leaves of it
    analytic: FloatArray  # what it adds to k, theta, shift x, shift y
    simulated: FloatArray  # the same, by a fit

    @property
    def labels(self) -> tuple[str, str, str]:
        """What is left out, where the parameters stand, what is registered."""
        return TITLES[self.effect], self.table, self.channel


def half_size(door: Given) -> FloatArray:
    """Return half the sides of the detector, shape (2,), in metres."""
    pixels = np.array([door[f"{simulation.OPTICS}#pixels-{axis}"] for axis in "xy"])
    return pixels * door[f"{simulation.OPTICS}#pixel-pitch-x"] / 2


def channels(door: Given, table: str, channel: str) -> Channels:
    """Return a channel beside green, with the printed parameters and our stand-ins."""
    if table not in TABLES:
        raise ValueError(f"table: expected one of {TABLES}, got {table!r}")
    module = simulation if table == TABLES[0] else experiment
    place = simulation.CHANNELS.index(channel)
    used, rotation = module.cameras(door), module.rotations(door)[place]
    corner, share = np.hypot(*half_size(door)), door[SHARE]
    second = [second_term_from_share(used[i], share, corner) for i in (place, 0)]
    lean = float(np.tan(abs(rotation)))
    off = used[0].principal_point - used[place].principal_point
    return Channels(
        used[place],
        used[0],
        rotation,
        (float(off[0]), float(off[1])),
        (lean, lean),
        (second[0], second[1]),
    )


def costs(door: Given, across: int = 200) -> list[Cost]:
    """Return what every approximation costs, for both tables and both channels."""
    positions = even_positions(half_size(door), across)
    return [
        _cost(table, channel, effect, channels(door, table, channel), positions, half_size(door))
        for table in TABLES
        for channel in simulation.REGISTERED
        for effect in EFFECTS
    ]


def isolated_error(whole: Channels, effect: str, positions: FloatArray) -> FloatArray:
    """Return the error field of one effect alone, shape (n, 2), in px."""
    error = error_field(whole.only(effect), positions)
    if effect == "coefficients":
        error = error - error_field(whole.only("cube"), positions)
    return error


def _cost(
    table: str,
    channel: str,
    effect: str,
    whole: Channels,
    positions: FloatArray,
    sides: FloatArray,
) -> Cost:
    error = isolated_error(whole, effect, positions)
    simulated = simulated_bias(whole.only(effect), positions)
    if effect == "coefficients":
        simulated = simulated - simulated_bias(whole.only("cube"), positions)
    length = np.hypot(*error.T)
    # The same projection that a fit makes: onto scale, rotation and shift of the positions.
    left = fit_registration(positions * 1e6, positions * 1e6 + error, (0.0, 0.0)).residuals
    return Cost(
        table,
        channel,
        effect,
        float(length.max()),
        float(np.sqrt(np.square(length).mean())),
        float(np.sqrt(np.square(left).sum(axis=-1).mean())),
        analytic_bias(whole, effect, sides),
        simulated,
    )


LABELS = (Column("Left out"), Column("Parameters of"), Column("Channel"))


def facts(door: Given) -> dict[str, Fact]:
    """Return ``EFFECT-TABLE-CHANNEL-rms``, ``-left`` and ``-peak``."""
    found = {}
    for cost in costs(door):
        name = "-".join((cost.effect, cost.table, cost.channel)).lower().replace(" ", "-")
        for size in ("rms", "left", "peak"):
            found[f"{name}-{size}"] = Fact(getattr(cost, size), ".2g", "px", ROUNDING)
    return found


@studied(
    "niu2024/approximations",
    columns=(
        *LABELS,
        *(Column(n, ".2g", ROUNDING) for n in ("Largest (px)", "RMS (px)", "RMS after a fit (px)")),
    ),
    caption="Errors of the approximations over the detector.",
    given=READS,
    named=facts,
)
def errors(door: Given) -> Iterator[tuple[object, ...]]:
    """How large each error is over the detector, and what a fit leaves of it."""
    for cost in costs(door):
        yield (*cost.labels, cost.peak, cost.rms, cost.left)


@studied(
    "niu2024/approximation-biases",
    columns=(
        *LABELS,
        *(
            Column(f"{name}, {source}", ".2e", rounding)
            for name, rounding in (
                ("k", 1e-12),
                ("θ (rad)", 1e-12),
                ("Δx (px)", ROUNDING),
                ("Δy (px)", ROUNDING),
            )
            for source in ("analytic", "simulated")
        ),
    ),
    caption="Biases that the approximations put on the parameters.",
    given=READS,
)
def biases(door: Given) -> Iterator[tuple[object, ...]]:
    """What each approximation adds to the parameters, analytic and simulated."""
    for cost in costs(door):
        yield (*cost.labels, *np.stack([cost.analytic, cost.simulated], axis=-1).ravel().tolist())
