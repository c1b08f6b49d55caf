"""All readings of a printed cell: every combination of the options of its computation.

Computations with random numbers and options are slow to evaluate under every reading. Their results
are stored (`STUDY`); the literal reading is always computed and must be the stored one. A test
recomputes a part of the others.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import chain, combinations

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from reproduce.judge.verdicts import (
    Frozen,
    Propagated,
    Reading,
    joint_probability,
    judge,
    predicted,
    result_intervals,
)
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Computation, Prediction, Results, unpublished
from reproduce.printed.cells import Cell, PrintedTable, library
from reproduce.printed.given import given
from reproduce.printed.number import si_factor
from reproduce.store import studies

Array = NDArray[np.float64]
STUDY = "readings"
# Draws that rounding noise of another processor may move across the end of a printed interval.
_SAME_DRAWS = 4
# Conditions of agreement that a summary lists.
_CONDITIONS = 4


class ReadingSummary(Frozen):
    """All readings of a cell in short."""

    count: int = Field(description="number of readings that give different results")
    agreeing: int = Field(
        description="number of readings with which the printed number agrees"
    )
    decided_by: tuple[str, ...] = Field(
        description="smallest set of options whose choice decides whether a reading agrees"
    )
    agrees_if: tuple[dict[str, str], ...] = Field(
        description="smallest choices with which every reading agrees; at most four, those of most "
        "readings first"
    )
    never: dict[str, tuple[str, ...]] = Field(
        description="alternatives of each option with which no reading agrees"
    )
    closest: Reading = Field(
        description="the reading that comes closest to the printed number"
    )


@dataclass(frozen=True, eq=False)
class Evaluation:
    """A computation under all readings, in the order of `Computation.readings`.

    Parameters
    ----------
    computation : Computation
    cells : mapping of str to list of Reading
        Name of each cell to its comparison under every reading.
    joint : ndarray, shape (readings, 2)
        Joint probability of all predicted cells and its Monte Carlo error; NaN if none is
        predicted.
    """

    computation: Computation
    cells: Mapping[str, Sequence[Reading]]
    joint: Array

    def distinct(self, name: str) -> list[Reading]:
        """Return the readings of a cell that give different results.

        Each has the choices that affect its result.
        """
        groups = self.groups(name)
        affects = [
            np.broadcast_to(
                (groups != groups.take([0], axis)).any(axis, keepdims=True),
                groups.shape,
            )
            for axis in range(groups.ndim)
        ]
        _, places = np.unique(groups, return_index=True)
        found = []
        for place in sorted(places.tolist()):
            pairs = zip(self.computation.readings[place].items(), affects, strict=True)
            choices = dict(
                choice for choice, affecting in pairs if affecting.flat[place]
            )
            found.append(
                self.cells[name][place].model_copy(update={"choices": choices})
            )
        return found

    def summary(self, name: str) -> ReadingSummary:
        """Return how the readings of a cell fare."""
        found = self.distinct(name)
        agrees = self._shaped([one.agrees for one in self.cells[name]])
        decisive = next(
            axes for axes in _subsets(agrees.ndim) if _decides(agrees, axes)
        )
        return ReadingSummary(
            count=len(found),
            agreeing=sum(one.agrees for one in found),
            decided_by=tuple(list(self.computation.options)[axis] for axis in decisive),
            agrees_if=tuple(self._conditions(agrees)),
            never=self._never(agrees),
            closest=max(found, key=lambda one: self._closeness(name, one)),
        )

    def _closeness(self, name: str, one: Reading) -> tuple[bool, bool, float]:
        """Return a key that is larger for readings closer to the printed number."""
        printed = library()[self.computation.key][name].number.value
        near = (
            -abs(one.computed - printed) if one.probability is None else one.probability
        )
        return one.agrees, not one.flags, near

    def _conditions(self, agrees: NDArray[np.generic]) -> list[dict[str, str]]:
        """Return the smallest choices with which every reading agrees."""
        options = [(name, [*ways]) for name, ways in self.computation.options.items()]
        found: list[dict[str, str]] = []
        sizes: list[int] = []
        for axes in _subsets(agrees.ndim):
            if len(found) >= _CONDITIONS and len(axes) > len(found[-1]):
                break
            sure = np.asarray(agrees.all(axis=_without(agrees.ndim, axes)))
            for index in np.argwhere(sure).tolist():
                pairs = ((options[a], i) for a, i in zip(axes, index, strict=True))
                one = {name: ways[i] for (name, ways), i in pairs}
                if not any(known.items() <= one.items() for known in found):
                    found.append(one)
                    sizes.append(agrees.size // max(1, sure.size))
        order = sorted(range(len(found)), key=lambda i: (len(found[i]), -sizes[i]))
        return [found[i] for i in order[:_CONDITIONS]]

    def _never(self, agrees: NDArray[np.generic]) -> dict[str, tuple[str, ...]]:
        """Return the alternatives with which no reading agrees, by option."""
        found = {}
        for axis, (option, ways) in enumerate(self.computation.options.items()):
            some = np.asarray(
                np.moveaxis(agrees, axis, 0).reshape(len(ways), -1).any(axis=1)
            )
            found[option] = tuple(
                w for w, one in zip(ways, some.tolist(), strict=True) if not one
            )
        return {option: ways for option, ways in found.items() if ways}

    def _shaped(self, values: Sequence[object]) -> NDArray[np.generic]:
        """Return one value per reading as an array with an axis for each option."""
        return np.array(values).reshape(
            [len(ways) for ways in self.computation.options.values()]
        )

    def groups(self, name: str) -> NDArray[np.int64]:
        """Return the number of the result of each reading, equal for equal results."""
        numbers: dict[tuple[str, ...], int] = {}
        found = [
            numbers.setdefault(
                tuple(
                    f"{v:.9e}"
                    for v in (one.computed, *one.interval, one.probability or 0.0)
                ),
                len(numbers),
            )
            for one in self.cells[name]
        ]
        return np.asarray(self._shaped(found), dtype=np.int64)


def _subsets(count: int) -> Iterator[tuple[int, ...]]:
    """Yield the subsets of so many axes, the smallest first."""
    return chain.from_iterable(
        combinations(range(count), size) for size in range(count + 1)
    )


def _without(count: int, axes: tuple[int, ...]) -> tuple[int, ...]:
    return tuple(axis for axis in range(count) if axis not in axes)


def _decides(agrees: NDArray[np.generic], axes: tuple[int, ...]) -> bool:
    """Return whether agreement depends on the options of some axes only."""
    others = _without(agrees.ndim, axes)
    return bool((agrees.all(axis=others) == agrees.any(axis=others)).all())


@cache
def evaluate(computation: Computation) -> Evaluation:
    """Compare the results of a computation with the printed cells under all its readings."""
    table = library()[computation.key]
    several = computation.replicates and len(computation.readings) > 1
    stored = _stored(computation) if several else None
    if stored is None:
        return evaluate_readings(computation, computation.readings)
    literal = evaluate_readings(computation, computation.readings[:1])
    for name, (live,) in literal.cells.items():
        *summary, probability, _ = stored[name][0].tolist()
        numbers = [live.computed, *live.interval]
        counted = abs((live.probability or 0.0) - probability) * computation.replicates
        if (
            not np.allclose(numbers, summary, rtol=1e-6, atol=0)
            or counted > _SAME_DRAWS
        ):
            raise _stale(f"{computation.key}#{name} is {numbers}, stored {summary}")
    # The stored numbers of the literal reading too: rounding noise must not split readings.
    every = {
        name: [
            _restored(table[name], choices, row, computation.replicates)
            for choices, row in zip(
                computation.readings, stored[name].tolist(), strict=True
            )
        ]
        for name in literal.cells
    }
    return Evaluation(computation, every, stored["joint"])


def evaluate_readings(
    computation: Computation, readings: Sequence[Mapping[str, str]]
) -> Evaluation:
    """Compute some readings, each on its own."""
    table, inputs = library()[computation.key], given(computation.given)
    found: dict[str, list[Reading]] = {}
    joint = []
    for choices in readings:
        one_reading = computation.under(choices)
        results = one_reading(inputs)
        ends: dict[str, Propagated] = {}
        if strays := [name for name in results if not computation.makes(name)]:
            raise ValueError(
                f"{computation.name} makes cells it does not declare: {strays}"
            )
        if not computation.replicates:
            ends = result_intervals(one_reading, inputs)
        for name, result in results.items():
            one = judge(table[name], result, choices, ends.get(name))
            found.setdefault(name, []).append(one)
        joint.append(_joint(table, results))
    return Evaluation(computation, found, np.array(joint))


def _joint(table: PrintedTable, results: Results) -> tuple[float, float]:
    """Return the joint probability of all predicted cells; NaN if none is predicted."""
    drawn = [
        (table[name].number.interval(), result.draws / si_factor(table[name].unit))
        for name, result in results.items()
        if isinstance(result, Prediction)
        and np.ptp(result.draws) > 0
        and not unpublished(table.key, name)
    ]
    if not drawn:
        return np.nan, np.nan
    intervals, columns = zip(*drawn, strict=True)
    return joint_probability(np.stack(columns), np.array(intervals))


def _restored(
    cell: Cell, choices: dict[str, str], row: Sequence[float], replicates: int
) -> Reading:
    computed, low, high, probability, error = row
    return predicted(
        cell.number,
        choices,
        computed=computed,
        interval=(low, high),
        probability=probability,
        error=error,
        replicates=replicates,
    )


def all_readings() -> Iterator[tuple[str, Reading]]:
    """Yield the address and every reading of each cell that has several."""
    for item in catalogue().values():
        for computation in item.computations:
            if computation.options:
                found = evaluate(computation)
                for name in found.cells:
                    if len(own := found.distinct(name)) > 1:
                        yield from ((f"{computation.key}#{name}", one) for one in own)


def packed(evaluation: Evaluation) -> dict[str, Array]:
    """Return an evaluation as arrays, by the names under which the study stores them."""
    arrays = {
        name: np.array(
            [[r.computed, *r.interval, r.probability, r.error] for r in found]
        )
        for name, found in evaluation.cells.items()
    }
    arrays["joint"] = evaluation.joint
    return {
        f"{evaluation.computation.name}:{name}": array for name, array in arrays.items()
    }


def fingerprint(computation: Computation) -> str:
    """Return a digest of everything that the stored readings depend on, except the code."""
    inputs = {a: cell.text for a, cell in given(computation.given).cells.items()}
    table = library()[computation.key]
    printed = {c.address: c.shown for c in table.cells if computation.makes(c.name)}
    options = [list(map(list, one.items())) for one in computation.readings]
    content = [options, inputs, printed, computation.replicates, computation.entropy]
    return hashlib.sha256(json.dumps(content).encode()).hexdigest()


def _stored(computation: Computation) -> dict[str, Array] | None:
    """Return the stored results by cell, or None if the computation is not in the study."""
    study = _study()
    if (recorded := study.note.get(computation.name)) is None:
        return None
    if recorded != fingerprint(computation):
        raise _stale(f"{computation.name} has other inputs or options")
    lead = f"{computation.name}:"
    return {
        name.removeprefix(lead): array
        for name, array in study.arrays.items()
        if name.startswith(lead)
    }


@cache
def _study() -> studies.Study:
    return studies.read(STUDY)


def _stale(reason: str) -> studies.StudyError:
    command = _study().note["command"]
    return studies.StudyError(f"{STUDY}: {reason}; run again: {command}")
