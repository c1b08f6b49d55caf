"""How results follow their inputs: the interval that rounding allows, and plain copies."""

from __future__ import annotations

import math
from dataclasses import replace
from decimal import Decimal

from reproduce.papers.declare import Blocked, Computation
from reproduce.printed.cells import Cell
from reproduce.printed.given import Given
from reproduce.printed.number import Interval


def result_intervals(computation: Computation, given: Given) -> dict[str, Interval]:
    """Propagate the rounding of the printed inputs through a deterministic computation.

    Each input is moved to both ends of its rounding interval on its own to see which way every
    result goes (both, because a smallest or largest value may answer to one side alone); then all
    inputs are moved together to the corner that makes the result smallest and to the one that
    makes it largest. These corners are the exact ends of a result that is monotone in each input.
    That every one here is, is proven: an enclosure of its formula (`reproduce.audit`) gives the
    same interval.

    Cell name to the smallest and largest result, in SI; for a reading of a blocked cell, the name
    that `reading_name` gives.
    """
    if computation.replicates:
        raise ValueError(f"{computation.name}: expected a deterministic computation")
    centre = numbers(computation, given)
    slopes: dict[str, dict[str, float]] = {name: {} for name in centre}
    for cell in given.numbers():
        for side in (1.0, -1.0):
            moved = numbers(computation, given.shifted({cell.address: side}))
            for name, value in moved.items():
                if value != centre[name]:
                    slopes[name][cell.address] = side if value > centre[name] else -side
    found = {name: (value, value) for name, value in centre.items()}
    for name, signs in slopes.items():
        if signs:
            moves = ({a: side * sign for a, sign in signs.items()} for side in (-1.0, 1.0))
            ends = [numbers(computation, given.shifted(one))[name] for one in moves]
            found[name] = min(ends), max(ends)
    return found


def plain_results(computation: Computation, given: Given) -> dict[str, str]:
    """Find the results that hardly compute anything: copies and differences of two cells.

    Every input is moved by one unit of its last digit, up and down, to see which results follow
    it and by how much.

    Cell name to ``repeated`` (the result is one input, moves one to one with it and with no other)
    or ``difference`` (one input less another, or less itself); no other names.
    """
    centre = numbers(computation, given)
    follows: dict[str, dict[str, set[float]]] = {name: {} for name in centre}
    for cell in given.cells.values():
        if not cell.is_number:
            continue
        for steps in (1, -1):
            moved = Given({**given.cells, cell.address: _moved(cell, steps)})
            step = moved[cell.address] - given[cell.address]
            for name, value in numbers(computation, moved).items():
                follows[name].setdefault(cell.address, set()).add(
                    round((value - centre[name]) / step, 9)
                )
    found = {}
    for name, value in centre.items():
        slopes = {address: seen for address, seen in follows[name].items() if seen != {0.0}}
        rising, falling = ([a for a, s in slopes.items() if s == {side}] for side in (1.0, -1.0))
        if len(slopes) == len(rising) == 1 and given[rising[0]] == value:
            found[name] = "repeated"
        elif (len(slopes), len(rising), len(falling)) == (2, 1, 1):
            if math.isclose(value, given[rising[0]] - given[falling[0]], rel_tol=1e-9):
                found[name] = "difference"
        elif given.cells and not slopes and value == 0:
            found[name] = "difference"
    return found


def _moved(cell: Cell, steps: int) -> Cell:
    number = cell.number
    text = Decimal(number.text) + steps * Decimal(1).scaleb(number.exponent)
    return replace(cell, content=replace(number, text=str(text)))


def reading_name(cell: str, reading: str) -> str:
    """Return the name of one reading of a blocked cell among the results of its computation."""
    return f"{cell} ({reading})"


def numbers(computation: Computation, given: Given) -> dict[str, float]:
    """Return the numbers that a computation makes, those of every reading under their own name."""
    found: dict[str, float] = {}
    for name, result in computation(given).items():
        if isinstance(result, int | float):
            found[name] = float(result)
        elif isinstance(result, Blocked):
            found |= {
                reading_name(name, reading.name): float(reading.result)
                for reading in result.readings
                if isinstance(reading.result, int | float)
            }
    return found
