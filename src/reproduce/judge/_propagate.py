"""The rounding of printed inputs, propagated to the results of a computation."""

from __future__ import annotations

import math

import numpy as np

from reproduce.judge.verdicts import Flag
from reproduce.papers.declare import Computation
from reproduce.printed.corners import corner_intervals
from reproduce.printed.inputs import Inputs

# Decimals of a slope, whose size is one if a result follows an input, and relative difference of
# two equal results.
_SLOPE_DECIMALS, _SIZE_RATIO = 9, 1e-9


def result_intervals(
    computation: Computation, inputs: Inputs
) -> dict[str, tuple[float, float, list[str]]]:
    """Propagate the rounding of the printed inputs through a deterministic computation.

    Tests compare every interval with results at random points inside the rounding intervals.

    Parameters
    ----------
    computation : Computation
        Computation under one reading.
    inputs : Inputs
        Its printed inputs.

    Returns
    -------
    dict
        Name of each cell to the ends of its interval and the inputs that change it, by
        `corner_intervals`.
    """
    return corner_intervals(
        lambda sides: computation(inputs.shifted(sides)),
        inputs.rounded(),
    )


def plain_results(computation: Computation, inputs: Inputs) -> dict[str, Flag]:
    """Return the results that copy an input or are the difference of two inputs.

    Every input moves by one unit of its last digit, up and down, which gives the slopes of the
    results.

    Parameters
    ----------
    computation : Computation
        A deterministic computation.
    inputs : Inputs
        Its printed inputs.

    Returns
    -------
    dict
        Cell name to ``copy`` (one input, also through a sign, an absolute value, a minimum or a
        maximum, ties included) or ``difference`` (one input minus another, or minus itself).
        Other cells are not in it.
    """
    moved = {}
    for address in (a for a, cell in inputs.cells.items() if cell.is_number):
        step = 2 * inputs.half_unit(address) or 1.0  # a count moves by one
        moved[address] = [
            (change, computation(inputs.changed({address: inputs[address] + change})))
            for change in (step, -step)
        ]
    kinds: dict[str, Flag] = {}
    for name, value in computation(inputs).items():
        sizes = {
            address: {
                abs(round((after[name] - value) / change, _SLOPE_DECIMALS))
                for change, after in results
            }
            for address, results in moved.items()
        }
        if not set() < set().union(*sizes.values()) <= {0.0, 1.0}:
            continue
        followed = [inputs[address] for address, found in sizes.items() if 1.0 in found]
        if followed and np.allclose(np.abs(followed), abs(value), _SIZE_RATIO, 0):
            kinds[name] = "copy"
        elif len(followed) in {0, 2}:
            difference = abs(np.diff(followed).sum())
            if math.isclose(difference, abs(value), rel_tol=_SIZE_RATIO):
                kinds[name] = "difference"
    return kinds
