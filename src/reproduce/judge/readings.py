"""All readings of a printed cell: every combination of the options of its computation.

The results of computations with random numbers and options are stored, because they are slow. The
literal reading is always computed and compared with the stored result, which the tables show. A
test recomputes a part of the other readings.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from functools import cache, partial
from itertools import chain, combinations, compress, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reproduce.judge._propagate import result_intervals
from reproduce.judge.verdicts import (
    TOLERANT,
    Frozen,
    Reading,
    joint_probability,
    judge_prediction,
    judge_summary,
    judge_value,
)
from reproduce.papers.declare import Computation
from reproduce.physics.validate import FloatArray
from reproduce.printed.cells import library
from reproduce.printed.inputs import load_inputs
from reproduce.store import studies

_STUDY = "readings"
# Draws that rounding noise of another processor may move across the end of a printed interval.
_NOISE_DRAWS = 4
# Conditions of agreement that a summary lists.
MAX_CONDITIONS = 4


class ReadingSummary(Frozen):
    """Summary of all readings of a cell."""

    count: int
    """number of readings that give different results"""
    agreeing: int
    """number of readings with which the printed number agrees"""
    decided_by: tuple[str, ...]
    """smallest set of options whose choice decides whether a reading agrees"""
    agrees_if: tuple[dict[str, str], ...]
    (
        "smallest choices with which every reading agrees; at most four, those of most "
        "readings first"
    )
    never: dict[str, tuple[str, ...]]
    """alternatives of each option with which no reading agrees"""
    closest: Reading
    """the reading that comes closest to the printed number"""


class Evaluation(NamedTuple):
    """A computation under all readings, in the order of `Computation.readings`.

    Parameters
    ----------
    computation : Computation
        Evaluated computation.
    cells : mapping of str to list of Reading
        Name of each cell to its comparison under every reading.
    joint : ndarray, shape (readings, 2)
        Joint probability of all predicted cells and its Monte Carlo error; NaN if none is
        predicted.
    """

    computation: Computation
    cells: Mapping[str, Sequence[Reading]]
    joint: FloatArray

    def results(self, name: str) -> list[str]:
        """Return the result of a cell under every reading as text, equal for equal results."""
        return [
            " ".join(map("{:.9e}".format, row[:4])) for row in self.stored_rows(name)
        ]

    def stored_rows(self, name: str) -> list[list[float]]:
        """Return the numbers of a predicted cell that the study stores, for every reading."""
        return [
            [one.computed, *one.interval, one.probability or 0.0, one.error or 0.0]
            for one in self.cells[name]
        ]

    def _by_option(self, values: Sequence[Any]) -> NDArray[Any]:
        """Return a value of every reading as an array with an axis for each option."""
        return np.reshape(values, [*map(len, self.computation.options.values())])

    def distinct(self, name: str) -> list[Reading]:
        """Return the readings of a cell that give different results.

        Each contains the choices that affect its result.
        """
        results, different = self._by_option(self.results(name)), []
        for first in np.sort(np.unique(results, return_index=True)[1]):
            place = np.unravel_index(first, results.shape)
            affecting = {
                option: choice
                for i, (option, choice) in enumerate(
                    self.computation.readings[first].items()
                )
                if len({*results[(*place[:i], slice(None), *place[i + 1 :])]}) > 1
            }
            reading = self.cells[name][first]
            different.append(reading.model_copy(update={"choices": affecting}))
        return different

    def summary(self, name: str) -> ReadingSummary:
        """Return the number of readings that agree, and the options that decide."""
        options, distinct = self.computation.options, self.distinct(name)
        agrees = self._by_option([reading.agrees for reading in self.cells[name]])
        decided_by: list[tuple[str, ...]] = []
        conditions: list[dict[str, str]] = []
        never: dict[str, tuple[str, ...]] = {}
        # The smallest sets of options first.
        for names in chain(
            *(combinations(options, size) for size in range(len(options) + 1))
        ):
            rest = tuple(i for i, one in enumerate(options) if one not in names)
            always, sometimes = agrees.all(axis=rest), agrees.any(axis=rest)
            if (always == sometimes).all():
                decided_by.append(names)
            if len(names) == 1 and not sometimes.all():
                never[names[0]] = tuple(
                    compress(options[names[0]], np.atleast_1d(~sometimes))
                )
            for chosen in compress(
                product(*(options[one] for one in names)), always.flat
            ):
                condition = dict(zip(names, chosen, strict=True))
                if not any(c.items() <= condition.items() for c in conditions):
                    conditions.append(condition)
        # Few choices first, then many readings.
        conditions.sort(key=lambda c: (len(c), math.prod(len(options[o]) for o in c)))
        return ReadingSummary(
            count=len(distinct),
            agreeing=sum(reading.agrees for reading in distinct),
            decided_by=decided_by[0],
            agrees_if=tuple(conditions[:MAX_CONDITIONS]),
            never=never,
            closest=max(distinct, key=partial(self._closeness, name)),
        )

    def _closeness(self, name: str, reading: Reading) -> tuple[bool, bool, float]:
        """Return a key that is larger for readings closer to the printed number."""
        near = reading.probability
        if near is None:
            printed = library()[self.computation.key][name].number.value
            near = -abs(reading.computed - printed)
        return reading.agrees, not reading.flags, near


@cache
def evaluate(computation: Computation) -> Evaluation:
    """Compare the results of a computation with the printed cells under all its readings."""
    is_slow = computation.replicates and len(computation.readings) > 1
    arrays, note = _study() if is_slow else ({}, {})
    if computation.name not in note:
        return evaluate_readings(computation, computation.readings)
    if note[computation.name] != fingerprint(computation):
        raise _stale(f"{computation.name} has other inputs or options")
    literal = evaluate_readings(computation, computation.readings[:1])
    table, cells = library()[computation.key], {}
    for name in literal.cells:
        known = arrays[f"{computation.name}:{name}"]
        # Without the error of the median, which may change more.
        row, first = literal.stored_rows(name)[0][:4], known[0, :4]
        draws = _NOISE_DRAWS / computation.replicates
        if not np.allclose(row, first, 1e-6, [0.0, 0.0, 0.0, draws]):
            raise _stale(f"{computation.key}#{name} is {row}, stored {first.tolist()}")
        # The stored numbers of the literal reading too: rounding noise must not split readings.
        cells[name] = [
            judge_summary(table[name].number, numbers, computation.replicates)
            for numbers in known.tolist()
        ]
    return Evaluation(computation, cells, arrays[f"{computation.name}:joint"])


def evaluate_readings(
    computation: Computation, readings: Sequence[Mapping[str, str]]
) -> Evaluation:
    """Compute some readings, without stored results."""
    table, inputs = library()[computation.key], load_inputs(computation.inputs)
    by_cell: dict[str, list[Reading]] = {}
    joint = []
    for choices in readings:
        one_reading = computation.with_options(choices)
        allowed = (
            {} if computation.replicates else result_intervals(one_reading, inputs)
        )
        draws, intervals = [], []
        for name, result in one_reading(inputs).items():
            if not computation.makes(name):
                raise ValueError(
                    f"{computation.name}: expected declared cells, got {name}. Declare it"
                )
            cell, unit = table[name], table[name].si_unit
            scaled = result / unit
            if name in allowed:
                low, high, moving = allowed[name]
                ends = low / unit, high / unit
                wide = any(inputs.cells[a].number.qualifier in TOLERANT for a in moving)
                reading = judge_value(cell.number, scaled, ends, wide=wide)
            else:
                reading = judge_prediction(cell.number, scaled)
                if np.ptp(scaled) > 0 and not cell.unpublished:
                    draws.append(scaled)
                    intervals.append(cell.number.interval())
            by_cell.setdefault(name, []).append(reading)
        joint.append(
            joint_probability(np.array(draws), np.array(intervals))
            if draws
            else (math.nan, math.nan)
        )
    return Evaluation(computation, by_cell, np.array(joint))


def fingerprint(computation: Computation) -> str:
    """Return a digest of everything that the stored readings depend on, except the code."""
    inputs = {a: cell.text for a, cell in load_inputs(computation.inputs).cells.items()}
    cells = library()[computation.key].cells
    printed = {c.address: c.shown for c in cells if computation.makes(c.name)}
    # The text of an alternative may name an arrangement.
    options = [
        [name, *((choice, one.text) for choice, one in choices.items())]
        for name, choices in computation.options.items()
    ]
    content = [options, inputs, printed, computation.replicates, computation.entropy]
    return studies.digest(json.dumps(content).encode())


@cache
def _study() -> studies.StoredStudy:
    return studies.read(_STUDY)


def _stale(reason: str) -> ValueError:
    _, note = _study()
    return ValueError(f"{_STUDY}: {reason}; run again: {note['command']}")
