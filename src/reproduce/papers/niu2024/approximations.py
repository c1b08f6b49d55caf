"""What the approximations of niu2024 cost with the printed parameters of Tables 1 and 4.

The pivot is off by what (10) leaves out: the source's principal point stands where green's belongs,
and they are as far apart as the tables print. Two of the five effects have a size that the paper
does not print; the stand-ins are ours:

* a detector is tilted about both axes by as much as it is printed to be turned in its plane;
* the second radial term carries what the printed share of the first one leaves, at the corner.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import product

import numpy as np

from reproduce.papers.declare import Results, reproduces
from reproduce.papers.niu2024 import experiment, simulation
from reproduce.papers.niu2024.registration import IMAGING, scale_factors
from reproduce.papers.niu2024.simulation import OPTICS
from reproduce.papers.study import Fact, studied
from reproduce.papers.words import Column
from reproduce.physics.optics.camera import Camera
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
from reproduce.printed.given import Given, given

__all__ = ["NOISE", "READS", "ROUNDING", "TABLES", "TITLES", "Cost", "costs", "facts"]

APPROXIMATIONS = "niu2024/text-approximations"
SHARE = f"{APPROXIMATIONS}#first-term-share"
TABLES = {"Table 1": simulation, "Table 4": experiment}
READS = (
    *experiment.CAMERAS,
    simulation.IMAGING,
    f"{simulation.TRUTH}#rotation.*",
    f"{OPTICS}#pixels-*",
    SHARE,
)
NOISE = f"{simulation.SETTINGS}#noise"
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

    labels: tuple[str, str, str]  # what is left out, whose parameters, what is registered
    peak: float  # largest length of the error over the detector
    rms: float  # its root mean square
    left: float  # what a fit of the four parameters leaves of it
    analytic: FloatArray  # what it adds to k, theta, shift x, shift y
    simulated: FloatArray  # the same, by a fit


def half_size(door: Given) -> FloatArray:
    """Return half the sides of the detector, shape (2,), in metres."""
    return door.array(f"{OPTICS}#pixels-?") * door[f"{OPTICS}#pixel-pitch-x"] / 2


def channels(door: Given, table: str, channel: str) -> Channels:
    """Return a channel beside green, with the printed parameters and our stand-ins."""
    place = simulation.CHANNELS.index(channel)
    cameras: list[Camera] = TABLES[table].cameras(door)
    source, green, rotation = cameras[place], cameras[0], TABLES[table].rotations(door)[place]
    corner, lean = np.hypot(*half_size(door)), float(np.tan(abs(rotation)))
    second = [second_term_from_share(one, door[SHARE], corner) for one in (source, green)]
    x, y = (green.principal_point - source.principal_point).tolist()
    return Channels(source, green, rotation, (x, y), (lean, lean), (second[0], second[1]))


def costs(door: Given, across: int = 200) -> list[Cost]:
    """Return what every approximation costs, for both tables and both channels."""
    sides = half_size(door)
    positions = even_positions(sides, across)
    found = []
    for table, channel, effect in product(TABLES, simulation.REGISTERED, EFFECTS):
        whole = channels(door, table, channel)
        error = isolated(error_field, whole, effect, positions)
        length = np.hypot(*error.T)
        # The same projection that a fit makes: onto scale, rotation and shift of the positions.
        left = fit_registration(positions * 1e6, positions * 1e6 + error, (0.0, 0.0)).residuals
        cost = Cost(
            (TITLES[effect], table, channel),
            float(length.max()),
            float(np.sqrt(np.square(length).mean())),
            float(np.sqrt(np.square(left).sum(axis=-1).mean())),
            analytic_bias(whole, effect, sides),
            isolated(simulated_bias, whole, effect, positions),
        )
        found.append(cost)
    return found


def isolated(
    measured: Callable[[Channels, FloatArray], FloatArray],
    whole: Channels,
    effect: str,
    positions: FloatArray,
) -> FloatArray:
    """Return what is measured of one effect alone."""
    found = measured(whole.only(effect), positions)
    return found - measured(whole.only("cube"), positions) if effect == "coefficients" else found


LABELS = (Column("Left out"), Column("Parameters of"), Column("Channel"))


def facts(door: Given) -> dict[str, Fact]:
    """Return ``EFFECT-TABLE-CHANNEL-rms``, and the printed noise over both axes as they are."""
    noise = Fact(np.sqrt(2.0) * given([NOISE])[NOISE], ".2g", "px")
    names = product(TABLES, simulation.REGISTERED, EFFECTS)
    return {
        f"{effect}-{table}-{channel}-rms".lower().replace(" ", "-"): Fact(
            cost.rms, ".2g", "px", ROUNDING
        )
        for (table, channel, effect), cost in zip(names, costs(door), strict=True)
    } | {"noise-rms": noise}


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
            Column(f"{name}, {source}", ".2e", ROUNDING if "px" in name else 1e-12)
            for name in ("k", "θ (rad)", "Δx (px)", "Δy (px)")
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
