"""Results at the corners of the rounding intervals of printed inputs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import NamedTuple


class Corners(NamedTuple):
    """Lowest and highest result, and the inputs that it responds to.

    Each input has its sides at the lowest and at the highest result.
    """

    low: float
    high: float
    sides: Mapping[str, tuple[float, float]]


def corner_intervals(
    results: Callable[[Mapping[str, float]], Mapping[str, float]], inputs: Iterable[str]
) -> dict[str, Corners]:
    """Return the interval of each result over the rounding intervals of the inputs.

    Each input first moves separately to both ends, to find the direction in which every result
    moves. Both ends are necessary, because a smallest or largest value may respond to one of them
    only. Then all inputs move to the corner of the smallest and of the largest result. An input
    that does not change the result separately remains as printed. The interval is exact for a
    result that is strictly monotone in each input.

    Parameters
    ----------
    results : callable
        Function that returns results by name. Its argument maps inputs to -1 (low end of the
        interval), 0 (as printed) or 1 (high end). Other inputs are as printed.
    inputs : iterable of str
        Names of the inputs.

    Examples
    --------
    >>> corner_intervals(lambda sides: {"half": (5 + 0.5 * sides.get("a", 0)) / 2}, ["a", "b"])
    {'half': Corners(low=2.25, high=2.75, sides={'a': (-1.0, 1.0)})}
    """
    centre = results({})
    sides: dict[str, dict[str, tuple[float, float]]] = {name: {} for name in centre}
    for moved in inputs:
        # An end precedes the printed value, in case of equal results.
        ends = {side: results({moved: side}) for side in (-1.0, 1.0)} | {0.0: centre}
        for name, responses in sides.items():
            values = {side: result[name] for side, result in ends.items()}
            low, high = (
                choose(values, key=values.__getitem__) for choose in (min, max)
            )
            if values[low] != values[high]:
                responses[moved] = (low, high)
    intervals = {}
    for name, responses in sides.items():
        corners = [
            results({moved: pair[end] for moved, pair in responses.items()})[name]
            for end in (0, 1)
        ]
        intervals[name] = Corners(min(corners), max(corners), responses)
    return intervals
