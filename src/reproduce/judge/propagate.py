"""The rounding of printed inputs, propagated to the results of a computation."""

from __future__ import annotations

import math

import numpy as np

from reproduce.judge.verdicts import TOLERANT, Flag, Propagated
from reproduce.papers.declare import Computation, Prediction
from reproduce.printed.corners import corner_intervals
from reproduce.printed.inputs import Inputs

# Decimals of a slope, whose size is one if a result follows an input, and relative difference of
# two equal results.
_SLOPE_DECIMALS, _SIZE_RATIO = 9, 1e-9


def result_intervals(computation: Computation, inputs: Inputs) -> dict[str, Propagated]:
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
        Name of each cell to its interval, by `corner_intervals`.
    """
    corners = corner_intervals(
        lambda sides: _values(computation, inputs.shifted(sides)),
        inputs.rounded(),
    )
    intervals = {}
    for name, (low, high, sides) in corners.items():
        qualifiers = {inputs.cells[address].number.qualifier for address in sides}
        wide = not qualifiers.isdisjoint(TOLERANT)
        intervals[name] = Propagated(low, high, wide)
    return intervals


def _values(computation: Computation, inputs: Inputs) -> dict[str, float]:
    """Return the results of a computation, without predictions."""
    return {
        name: float(value)
        for name, value in computation(inputs).items()
        if not isinstance(value, Prediction)
    }


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
    centre = _values(computation, inputs)
    slopes: dict[str, dict[str, set[float]]] = {name: {} for name in centre}
    for address in (a for a, cell in inputs.cells.items() if cell.is_number):
        step = 2 * inputs.half_unit(address) or 1.0  # a count moves by one
        for change in (step, -step):
            moved = inputs.changed({address: inputs[address] + change})
            for name, value in _values(computation, moved).items():
                slope = round((value - centre[name]) / change, _SLOPE_DECIMALS)
                if slope:
                    slopes[name].setdefault(address, set()).add(abs(slope))
    kinds: dict[str, Flag] = {}
    for name, size in ((name, abs(value)) for name, value in centre.items()):
        values = [inputs[address] for address in slopes[name]]
        if any(slope != {1.0} for slope in slopes[name].values()):
            continue
        if not values and inputs.cells and not size:
            kinds[name] = "difference"
        elif values and np.allclose(np.abs(values), size, rtol=_SIZE_RATIO, atol=0):
            kinds[name] = "copy"
        elif len(values) == 2 and math.isclose(
            abs(values[0] - values[1]), size, rel_tol=_SIZE_RATIO
        ):
            kinds[name] = "difference"
    return kinds
