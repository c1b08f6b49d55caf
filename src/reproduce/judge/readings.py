"""The printed simulation of niu2024 held against every reading of its text.

Rows are the readings of `reproduce.papers.niu2024.readings`, each with every way of counting the
axes of (26), the ledger's first; columns are the printed cells of `ADDRESSES`.

Draws can tell a probability down to about one over their number. Below that, the law that they
follow is used, see `tools/evidence/laws.py`.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from reproduce.judge.verdicts import CENTRAL
from reproduce.papers.declare import LEAST_DRAWS, Column, Fact, studied
from reproduce.papers.niu2024 import readings, simulation
from reproduce.printed.given import given

Array = NDArray[np.float64]
RESIDUAL = np.array(["rmse" in address for address in readings.ADDRESSES])
_SCALE = np.array(["#scale" in address for address in readings.ADDRESSES])
# Groups of cells that get a joint probability, and which cells are in each.
GROUPS = {
    "Table 3": ~RESIDUAL,
    "residuals": RESIDUAL,
    "all but the scales": ~_SCALE,
    "all": np.ones(len(readings.ADDRESSES), dtype=bool),
}
# Smaller probabilities are not told apart: the law is an extrapolation so far out.
_LEAST = 1e-12
_LEAST_CORRECTED = 1e3 * _LEAST  # a correction multiplies by nearly a thousand readings


def _corrected(joint: Array, readings: int) -> Array:
    """Return joint probabilities corrected for having tried so many readings.

    Examples
    --------
    >>> _corrected(np.array([0.001, 0.5]), 20)
    array([0.02, 1.  ])
    """
    return np.minimum(1.0, joint * readings)


def _resolved(counted: Array, law: Array, replicates: int = readings.REPLICATES) -> Array:
    """Return probabilities by count where the draws can tell, else by their law.

    Examples
    --------
    >>> _resolved(np.array([0.3, 0.0]), np.array([-0.5, -9.0]), 10_000)
    array([3.e-01, 1.e-09])
    """
    return np.asarray(np.where(counted * replicates >= LEAST_DRAWS, counted, 10.0**law))


def _stored() -> tuple[Array, Array, Array]:
    """Return tails (readings, 4, 12), joint probabilities and distances (readings, 4, 4)."""
    arrays = readings.stored().arrays
    tails, joint = (_resolved(arrays[name], arrays[f"law_{name}"]) for name in ("tails", "joint"))
    return tails, joint, arrays["distance"]


def _outside() -> NDArray[np.int64]:
    """Return how many cells lie outside the central part of their prediction, (readings, 4)."""
    return np.asarray((_stored()[0] < 1 - CENTRAL).sum(axis=-1))


def _fewest() -> list[tuple[int, int]]:
    """Return the readings that leave the fewest cells outside, the likeliest as a whole first."""
    counts = _outside()
    places = [(int(r), int(c)) for r, c in np.argwhere(counts == counts.min())]
    law = readings.stored().arrays["law_joint"][..., -1]
    return sorted(places, key=lambda place: -float(law[place]))


def _facts() -> dict[str, Fact]:
    """Return how the print fares under the readings that come closest, and under the best ones."""
    note, door = readings.stored().note, given(readings.READS)
    (tails, joint, distance), every, counts = _stored(), readings.readings(door), _outside()
    least, groups = _fewest(), {name: place for place, name in enumerate(GROUPS)}
    green = [place for place, reading in enumerate(every) if reading.noisy == "green"]
    whole, but_scales = joint[..., groups["all"]], joint[..., groups["all but the scales"]]
    residuals = groups["residuals"]

    def count(number: int) -> Fact:
        return Fact(int(number), ",")

    def largest(values: Array, zero: float = _LEAST) -> Fact:
        return Fact(float(values.max()), "chance", zero=zero)

    def common(values: Iterable[str]) -> Fact:
        return Fact(" or ".join(sorted(set(values))))

    return {
        "readings": count(counts.size),
        "cells": count(tails.shape[-1]),
        "replicates": count(int(note["replicates"])),
        "seconds": Fact(float(note["processor_seconds"]), ".0f", "s"),
        "fewest-outside": count(counts.min()),
        "ledger-outside": count(counts[every.index(readings.literal(door)), 0]),
        "closest": count(len(least)),
        "closest-shifts": common(every[r].shifts for r, _ in least),
        "closest-noise": common(every[r].noisy for r, _ in least),
        "closest-draws": common(str(every[r].repeats) for r, _ in least),
        "closest-tests": common(every[r].tests for r, _ in least),
        "closest-axes": common(readings.COUNTED[c] for _, c in least),
        "closest-before-far": Fact(min(distance[r, c, residuals] for r, c in least), ".0f"),
        "closest-before": largest(np.array([joint[r, c, residuals] for r, c in least])),
        "best-joint": largest(whole),
        "best-corrected": largest(_corrected(whole, counts.size), _LEAST_CORRECTED),
        "best-but-scales": largest(but_scales),
        "best-but-scales-corrected": largest(_corrected(but_scales, counts.size), _LEAST_CORRECTED),
        "best-green": largest(but_scales[green]),
        "best-scale": largest(tails[..., _SCALE]),
        "least-counted": count(LEAST_DRAWS),
    }


_chance = partial(Column, form="chance", zero=_LEAST, draws=readings.REPLICATES)
_AXES = Column("RMSE of")
_OUTSIDE = Column("Cells outside", "d")
_CORRECTED = Column("p, all, corrected", "chance", _LEAST_CORRECTED)


@studied(
    "niu2024/readings",
    columns=(
        *readings.CHOICES,
        _AXES,
        *(
            _chance(f"{name}, {channel}", bold=1 - CENTRAL)
            for channel in simulation.REGISTERED
            for name in ("k", "θ", "Δx", "Δy", "before", "after")
        ),
        *(_chance(f"p, {name}") for name in GROUPS),
        _CORRECTED,
        _OUTSIDE,
    ),
    caption="Probability of the print under every reading: of each number, and of several at once.",
    folded=readings.ARRANGEMENT,
    named=_facts,
)
def _probabilities() -> Iterator[tuple[object, ...]]:
    """How likely the printed numbers of the simulation are under every reading."""
    (tails, joint, _), counts = _stored(), _outside()
    for row, labels in enumerate(readings.choices()):
        for column, axes in enumerate(readings.COUNTED):
            whole = _corrected(joint[row, column, -1:], counts.size)
            yield (
                *(*labels, axes),
                *(*tails[row, column], *joint[row, column], *whole, counts[row, column]),
            )


@studied(
    "niu2024/closest-readings",
    columns=(
        Column("Reading"),
        *readings.CHOICES,
        _AXES,
        _OUTSIDE,
        *(
            column
            for name in GROUPS
            for column in (
                _chance(f"p, {name}"),
                Column(f"Distance, {name} (σ)", ".0f"),
            )
        ),
        _CORRECTED,
    ),
    caption="Readings that come closest to the print; distances are Mahalanobis distances.",
)
def _closest() -> Iterator[tuple[object, ...]]:
    """The literal reading beside those that come closest to the print."""
    (_, joint, distance), counts = _stored(), _outside()
    door, labels = given(readings.READS), list(readings.choices())
    law = readings.stored().arrays["law_joint"]
    picked = {
        "the literal one": (readings.readings(door).index(readings.literal(door)), 0),
        "fewest cells outside": _fewest()[0],
    }
    for place, group in enumerate(GROUPS):
        picked[f"best for: {group}"] = divmod(int(law[..., place].argmax()), law.shape[1])
    for name, (row, column) in picked.items():
        pairs = np.stack([joint[row, column], distance[row, column]], axis=-1).ravel()
        whole = _corrected(joint[row, column, -1:], counts.size)
        axes = readings.COUNTED[column]
        yield name, *labels[row], axes, counts[row, column], *pairs, *whole
