"""The rounding of printed inputs, propagated to the results of a computation."""

from __future__ import annotations

import math
from collections.abc import Mapping

from reproduce.judge.verdicts import TOLERANT, Flag, Propagated
from reproduce.papers.declare import Computation, Prediction
from reproduce.printed.corners import corner_intervals
from reproduce.printed.inputs import Inputs

# Decimals of a slope; its size is one if a result follows an input.
_SLOPE_DECIMALS = 9


def result_intervals(computation: Computation, inputs: Inputs) -> dict[str, Propagated]:
    """Propagate the rounding of the printed inputs through a deterministic computation.

    The result maps each cell name to its interval, by `corner_intervals`. Tests compare every
    interval with results at random points inside the rounding intervals.
    """
    corners = corner_intervals(
        lambda sides: _values(computation, inputs.shifted(sides)),
        inputs.rounded(),
    )
    found = {}
    for name, (low, high, sides) in corners.items():
        qualifiers = {inputs.cells[address].number.qualifier for address in sides}
        found[name] = Propagated(low, high, not qualifiers.isdisjoint(TOLERANT))
    return found


def _values(computation: Computation, inputs: Inputs) -> dict[str, float]:
    """Return the results of a computation without random numbers."""
    results = computation(inputs).items()
    return {
        name: float(value)
        for name, value in results
        if not isinstance(value, Prediction)
    }


def plain_results(computation: Computation, inputs: Inputs) -> dict[str, Flag]:
    """Find the results that hardly compute anything.

    Every input is moved by one unit of its last digit, up and down, to find the results that
    follow it, and their slopes.

    The result maps a cell name to ``copy`` (one input, also through a sign, an absolute value, a
    minimum or a maximum, ties included) or ``difference`` (one input minus another, or minus
    itself). Other cells are not in it.
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
    kinds = {name: _kind(value, slopes[name], inputs) for name, value in centre.items()}
    return {name: kind for name, kind in kinds.items() if kind}


def _kind(
    value: float, slopes: Mapping[str, set[float]], inputs: Inputs
) -> Flag | None:
    """Return the kind of a result from the sizes of its slopes, by input."""
    values = [inputs[address] for address in slopes]
    if not values:
        return "difference" if inputs.cells and value == 0 else None
    if any(sizes != {1.0} for sizes in slopes.values()):
        return None
    if all(math.isclose(abs(one), abs(value), rel_tol=1e-9) for one in values):
        return "copy"
    if len(values) == 2:
        difference = abs(values[0] - values[1])
        if math.isclose(difference, abs(value), rel_tol=1e-9):
            return "difference"
    return None
