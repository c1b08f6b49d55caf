"""What the approximations of niu2024 cost with the printed parameters of Tables 1 and 4.

The pivot is off by what (10) leaves out: the source's principal point stands where green's belongs,
and they are as far apart as the tables print. Two of the five effects have a size that the paper
does not print; the stand-ins are ours:

* a detector is tilted about both axes by as much as it is printed to be turned in its plane;
* the second radial term carries what the printed share of the first one leaves, at the corner.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reproduce.papers.niu2024 import laboratory, simulation
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

SHARE = "niu2024/text-approximations#first-term-share"
TABLES = ("Table 1", "Table 4")
READS = (
    *laboratory.INSTRUMENT,
    simulation.IMAGING,
    f"{simulation.TRUTH}#rotation.*",
    f"{simulation.OPTICS}#pixels-*",
    SHARE,
)


@dataclass(frozen=True, eq=False)
class Cost:
    """What one approximation costs in one registration.

    Attributes
    ----------
    table, channel, effect : str
        Where the parameters stand, what is registered, what is left out.
    peak, rms : float
        Length of the error over the detector, largest and root mean square, in px.
    left : float
        Root mean square that a fit of the four parameters leaves of it, in px.
    analytic, simulated : ndarray, shape (4,)
        What it adds to k, theta, shift x, shift y, in rad and px.
    """

    table: str
    channel: str
    effect: str
    peak: float
    rms: float
    left: float
    analytic: FloatArray
    simulated: FloatArray


def half_size(door: Given) -> FloatArray:
    """Return half the sides of the detector.

    Shape (2,). In metres.
    """
    pixels = np.array([door[f"{simulation.OPTICS}#pixels-{axis}"] for axis in "xy"])
    return pixels * door[f"{simulation.OPTICS}#pixel-pitch-x"] / 2


def channels(door: Given, table: str, channel: str) -> Channels:
    """Return a channel beside green, with the printed parameters and our stand-ins."""
    if table not in TABLES:
        raise ValueError(f"table: expected one of {TABLES}, got {table!r}")
    module = simulation if table == TABLES[0] else laboratory
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
    """Return the error field of one effect alone.

    Shape (n, 2). In px.
    """
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
