"""What a repeat of the ground tests would print (chen2023, sections V-A to V-C)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.random import Generator

from reproduce.inference import Model, Published
from reproduce.inference.models import AveragingLikelihood, StageTableLikelihood
from reproduce.papers.chen2023 import platform
from reproduce.papers.declare_posterior import OWN_DATA, published_cells, simulated
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

__all__ = ["averaged", "scatter", "stage_table"]

STAGE = "chen2023/table-5"
AVERAGES = "chen2023/table-4"
FRAMES = "chen2023/text-accuracy#frames"
MOVED = (2, 3, 4, 5)
# Of the angles about Y and about X, against the right hand.
# Rows of print, and the two blocks of the table: motion along X, then along Y.
MONITORED = tuple(f"{STAGE}#{state}.monitoring-{axis}" for state in MOVED for axis in "yx")
REFERENCE = tuple(f"{STAGE}#{state}.reference-{axis}" for state in MOVED for axis in "yx")
SCATTER = tuple(
    f"{platform.SCATTER}#{g}-{i}.{a}" for g in (1, 2) for i in range(1, 5) for a in "xy"
)


def scatter(given: Given, model: Model) -> Published:
    """Table III: the scatter of every spot, as the noise of the model would leave it."""
    note = (
        "The noise of the simulation is the rms of these very numbers, so their size proves "
        "nothing; that some lie outside tells against one noise for all spots."
    )
    freedom = given.count(FRAMES) - 1
    noise = model.names.index("noise")

    def repeat(parameters: FloatArray, generator: Generator) -> FloatArray:
        squares = generator.chisquare(freedom, (len(parameters), len(SCATTER))) / freedom
        return np.asarray(platform.SIGMAS * parameters[:, noise, None] * np.sqrt(squares))

    return published_cells(given, SCATTER, repeat, note=note)


def averaged(given: Given, model: Model) -> Published:
    """Table IV, which is the data of the model; its likelihood gives all digits at once."""
    likelihood = model.likelihood_of(AveragingLikelihood)
    addresses = [f"{AVERAGES}#{n}.{column}" for column in likelihood.names
                 for n in likelihood.counts]  # fmt: skip

    def repeat(parameters: FloatArray, generator: Generator) -> FloatArray:
        tables = simulated(model, parameters, generator)
        return platform.SIGMAS * tables.reshape(len(tables), -1)

    return published_cells(given, addresses, repeat, whole=model.log_likelihood, note=OWN_DATA)


def stage_table(given: Given, model: Model) -> Published:
    """Reference and monitored angles of Table V, which are the data of the model."""
    likelihood = model.likelihood_of(StageTableLikelihood)

    return published_cells(
        given, (*REFERENCE, *MONITORED), _both(model), whole=likelihood.log_same, note=OWN_DATA
    )


def _both(model: Model) -> Callable[[FloatArray, Generator], FloatArray]:
    """Repeats of a model whose data are two arrays, both of which are printed."""

    def repeat(parameters: FloatArray, generator: Generator) -> FloatArray:
        pairs = [model.repeat(one, generator) for one in parameters]
        return np.stack([np.concatenate([part.ravel() for part in pair]) for pair in pairs])

    return repeat
