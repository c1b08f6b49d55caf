"""Results at the corners of the rounding intervals of printed inputs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping


def corner_intervals(
    results: Callable[[Mapping[str, int]], Mapping[str, float]], inputs: Iterable[str]
) -> dict[str, tuple[float, float, list[str]]]:
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

    Returns
    -------
    dict
        Name of each result to its lowest and highest value, and the inputs that it responds to.

    Examples
    --------
    >>> corner_intervals(lambda sides: {"half": (5 + 0.5 * sides.get("a", 0)) / 2}, ["a", "b"])
    {'half': (2.25, 2.75, ['a'])}
    """
    centre = results({})
    # An end precedes the printed value, in case of equal results.
    alone = {
        moved: {side: results({moved: side}) for side in (-1, 1)} | {0: centre}
        for moved in inputs
    }
    intervals = {}
    for name in centre:
        lowest, highest = {}, {}
        for moved, found in alone.items():
            values = {side: result[name] for side, result in found.items()}
            low = min(values, key=values.__getitem__)
            high = max(values, key=values.__getitem__)
            if values[low] != values[high]:
                lowest[moved], highest[moved] = low, high
        corners = [results(sides)[name] for sides in (lowest, highest)]
        intervals[name] = min(corners), max(corners), [*lowest]
    return intervals
