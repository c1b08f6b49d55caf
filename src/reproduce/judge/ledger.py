"""The ledger: one record for every printed cell, one for every stochastic table; and
the frozen verdicts: what it must say, and why where it says `differs`."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import groupby
from typing import Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from reproduce.judge.verdicts import (
    CENTRAL,
    VERDICTS,
    Judgement,
    Verdict,
    joint_probability,
    judge_prediction,
    judge_value,
    plain_results,
    reading_name,
    result_intervals,
)
from reproduce.locate import data_folders
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import (
    Blocked,
    Computation,
    Prediction,
    Reading,
    Result,
    Results,
    agree,
)
from reproduce.printed.cells import Cell, PrintedTable, altered_files, find, library
from reproduce.printed.given import given
from reproduce.printed.number import Interval, si_factor

Flag = Literal[
    "through_rounding",
    "repeated",
    "difference",
    "uninformative",
    "bound",
    "stand_in",
    "about",
    "nominal",
]


_INTERVAL = "results that rounded inputs allow, or the central 99 % of the prediction"
_TOGETHER = "how often the cells, simulated together, lie as far out as the print"


class _Frozen(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ReadingRecord(_Frozen):
    """What a cell would be judged as under one reading of the text."""

    name: str = Field(description="the reading in a few words")
    place: str = Field(description="where the text leaves room for it")
    added: str = Field(description="the day on which it came into the history of this project")
    computed: float = Field(description="the value, or the median of the prediction")
    interval: tuple[float, float] = Field(description=_INTERVAL)
    verdict: Verdict = Field(description="what the cell would be judged as")
    flags: tuple[Flag, ...] = Field(description="what qualifies that verdict")
    probability: float | None = Field(description="two-sided mid-p over the printed interval")
    mcse: float | None = Field(description="Monte Carlo standard error of the probability")

    @property
    def agrees(self) -> bool:
        """Whether the print agrees with this reading."""
        return self.verdict in {"exact", "consistent"}


class Record(_Frozen):
    """What became of one printed cell. Numbers are in the unit of print."""

    key: str = Field(description="table, figure or group of quoted numbers")
    cell: str = Field(description="address of the cell: key#row.column or key#name")
    printed: str = Field(description="the digits or words as printed")
    unit: str = Field(description="unit of print; empty for words")
    place: str = Field(description="where in the paper it stands")
    stands_for: tuple[float | None, float | None] | None = Field(
        description="the interval of values that print so, null where it is open; null for words"
    )
    role: Literal["result", "given"] = Field(description="result if a computation makes the cell")
    computed: float | None = Field(description="value, median of the prediction, or our stand-in")
    interval: tuple[float, float] | None = Field(description=_INTERVAL)
    verdict: Verdict = Field(description="what became of the cell; see the book's page on verdicts")
    flags: tuple[Flag, ...] = Field(description="what qualifies the verdict")
    tolerance: float | None = Field(description="half the interval of print, or of prediction")
    share: float | None = Field(
        description="|computed - printed| over half the printed interval (exact), "
        "(1 - probability)/0.99 (consistent)"
    )
    probability: float | None = Field(description="two-sided mid-p over the printed interval")
    mcse: float | None = Field(description="Monte Carlo standard error of the probability")
    error: float | None = Field(description="Monte Carlo standard error of a predicted median")
    why: str = Field(description="the verdict in words")
    function: str | None = Field(description="the function that computes the cell")
    line: str | None = Field(description="file and line of that function")
    reads: tuple[str, ...] = Field(description="the printed cells that it was given")
    equations: tuple[str, ...] = Field(description="the paper's equations it rests on")
    seed: tuple[int, ...] | None = Field(description="root and key of the random stream")
    readings: tuple[ReadingRecord, ...] = Field(description="each way tried to read the text")
    reason: str = Field(default="", description="why, as written down with the frozen verdict")


class TableRecord(_Frozen):
    """The joint verdict on a table whose cells were drawn or measured together."""

    key: str
    cells: int = Field(description="cells with a predicted distribution")
    outside: int = Field(description="of these, cells that differ")
    expected_outside: float = Field(description="cells expected to differ by chance alone")
    joint_probability: float = Field(description=_TOGETHER)
    mcse: float
    replicates: int


class WholeReading(_Frozen):
    """How one reading of the text fares on all cells of an item that depend on a reading.

    Cells that agree through rounding only may ask for other values of an input that they share.
    """

    key: str
    name: str = Field(description="the reading in a few words")
    added: str = Field(description="the day on which the last part of it came into the history")
    cells: int = Field(description="cells that it says something of")
    agreeing: int = Field(description="of these, cells that agree one by one")
    apart: int = Field(description="of these, cells that agree through rounding only")
    joint_probability: float | None = Field(description=_TOGETHER)
    mcse: float | None
    replicates: int = Field(description="of the joint probability; zero without one")

    @property
    def fits(self) -> bool:
        """Whether all cells agree one by one, and together."""
        likely = self.joint_probability is None or self.joint_probability >= 1 - CENTRAL
        return self.agreeing == self.cells and likely and self.apart <= 1


class Ledger(_Frozen):
    """All records, in the order of print."""

    records: tuple[Record, ...]
    tables: tuple[TableRecord, ...]
    readings: tuple[WholeReading, ...] = ()
    altered: tuple[str, ...] = Field(default=(), description="printed files that miss their sums")
    software: str = Field(default="", description="what made an export: name, version, day, commit")
    citation: str = Field(default="", description="how to cite an export, and the paper")

    def of(self, key: str) -> tuple[Record, ...]:
        """Return the records of one item, in the order of print."""
        return tuple(record for record in self.records if record.key == key)

    def cell(self, address: str) -> Record:
        """Return the record of one cell."""
        for record in self.records:
            if record.cell == address:
                return record
        raise KeyError(f"no record of {address!r}; `reproduce list` shows the keys")

    def whole_readings(self, key: str) -> tuple[WholeReading, ...]:
        """Return how each reading of an item fares on all its cells at once; none without."""
        return tuple(one for one in self.readings if one.key == key)

    def table(self, key: str) -> TableRecord | None:
        """Return the joint record of a table, or None where nothing in it is stochastic."""
        return next((table for table in self.tables if table.key == key), None)


def build(
    keys: Iterable[str] | None = None, progress: Callable[[int, int], None] | None = None
) -> Ledger:
    """Run the computations of the items and judge every printed cell."""
    items = catalogue()
    asked = set(items if keys is None else keys)
    if unknown := asked - set(items):
        raise KeyError(f"unknown key {sorted(unknown)}; expected some of {list(items)}")
    wanted = [key for key in items if key in asked]
    found: list[Ledger] = []
    for done, key in enumerate(wanted, start=1):
        found.append(_judged(key))
        if progress is not None:
            progress(done, len(wanted))
    return Ledger(
        records=tuple(record for one in found for record in one.records),
        tables=tuple(table for one in found for table in one.tables),
        readings=tuple(reading for one in found for reading in one.readings),
        altered=altered_files(),
    )


def reread(key: str, chosen: Mapping[str, str]) -> Ledger:
    """Return what the cells of an item would be judged as under one reading of the text."""
    return _judged(key, tuple(sorted(chosen.items())))


@cache
def _judged(key: str, chosen: tuple[tuple[str, str], ...] = ()) -> Ledger:
    table = library().get(key)
    if table is None:  # a figure: nothing of it is printed as a number
        return Ledger(records=(), tables=())
    made: dict[str, Record] = {}
    results: dict[str, Result] = {}
    for computation in catalogue()[key].computations:
        records, found = _run(computation.under(dict(chosen)), table)
        if doubly := made.keys() & records.keys():
            raise ValueError(f"{key}: cells made by two computations: {sorted(doubly)}")
        made |= records
        results |= found
    return Ledger(
        records=tuple(made.get(cell.name) or _input(cell) for cell in table.cells),
        tables=_joint(table, results, made),
        readings=_whole_readings(table, results, made),
    )


def _run(computation: Computation, table: PrintedTable) -> tuple[dict[str, Record], Results]:
    door = given(computation.given)
    results = computation(door)
    strays = [name for name in results if not computation.makes(name)]
    if strays:
        raise ValueError(f"{computation.name} makes cells it does not declare: {strays}")
    intervals, plain = {}, {}
    if not computation.replicates:
        intervals, plain = result_intervals(computation, door), plain_results(computation, door)
    records = {
        name: judge_result(computation, table[name], result, intervals, plain.get(name))
        for name, result in results.items()
    }
    return records, results


def judge_result(
    computation: Computation,
    cell: Cell,
    result: Result,
    intervals: Mapping[str, Interval],
    plain: str | None = None,
) -> Record:
    """Judge what a computation found for a printed cell, under every reading that it gives."""
    source: dict[str, object] = {
        "role": "result",
        "function": computation.name,
        "line": computation.line,
        "reads": tuple(given(computation.given).cells),
        "equations": computation.equations,
        "seed": computation.entropy or None,
    }
    name = cell.name
    if isinstance(result, Blocked):
        readings = tuple(_reading(cell, one, intervals) for one in result.readings)
        if len({reading.agrees for reading in readings}) != 1:
            return _blocked(cell, result, readings, source)
        # All readings give one verdict: the literal one stands for them.
        source["readings"] = readings
        name, result = reading_name(name, result.readings[0].name), _literal(result)
    found = _judgement(cell, name, result, intervals)
    weak = (plain,) if plain and found.verdict == "exact" else ()
    return _make(cell, _why(cell, found), source, weak, **vars(found))


def _blocked(
    cell: Cell, result: Blocked, readings: tuple[ReadingRecord, ...], source: Mapping[str, object]
) -> Record:
    stand_in = None if result.stand_in is None else result.stand_in / si_factor(cell.unit)
    why = f"needs {result.missing}"
    if readings:
        agreeing = sum(reading.agrees for reading in readings)
        why = (
            f"depends on {result.missing}: "
            f"the print agrees with {agreeing} of {len(readings)} readings"
        )
    own = {"verdict": "blocked", "computed": stand_in, "readings": readings}
    return _make(cell, why, {**source, **own}, flags=() if stand_in is None else ("stand_in",))


def _literal(result: Result) -> float | Prediction:
    """Return a result, or of several readings the literal one."""
    return result.readings[0].result if isinstance(result, Blocked) else result


def _judgement(
    cell: Cell, name: str, result: float | Prediction, intervals: Mapping[str, Interval]
) -> Judgement:
    unit = si_factor(cell.unit)
    if isinstance(result, Prediction):
        return judge_prediction(cell.number, result.draws / unit)
    low, high = intervals.get(name, (result, result))
    return judge_value(cell.number, result / unit, (low / unit, high / unit))


def _reading(cell: Cell, one: Reading, intervals: Mapping[str, Interval]) -> ReadingRecord:
    name = reading_name(cell.name, one.name)
    found = {**vars(one), **vars(_judgement(cell, name, one.result, intervals))}
    return ReadingRecord.model_validate({n: found[n] for n in ReadingRecord.model_fields})


def _input(cell: Cell) -> Record:
    why = f"taken from the paper ({cell.role})" if cell.is_number else "words or a dash"
    return _make(cell, why, {"role": "given", "equations": (), "reads": ()}, verdict="input")


def _make(
    cell: Cell,
    why: str,
    source: Mapping[str, object],
    weak: tuple[str, ...] = (),
    flags: tuple[str, ...] = (),
    **found: object,
) -> Record:
    qualifier = cell.number.qualifier if cell.is_number else None
    if qualifier in {"about", "nominal"}:
        flags += (qualifier,)
    flags += weak
    own = {"key": cell.key, "cell": cell.address, "printed": cell.text, "unit": cell.unit,
           "place": cell.place, "stands_for": _ends(cell)}  # fmt: skip
    blank = dict.fromkeys(n for n, field in Record.model_fields.items() if field.is_required())
    blank |= {"readings": (), "flags": flags, "why": why}
    return Record.model_validate(blank | own | dict(source) | found)


def _ends(cell: Cell) -> tuple[float | None, ...] | None:
    """Return the interval of values that print so; None for an open end, and for words."""
    if not cell.is_number:
        return None
    return tuple(end if math.isfinite(end) else None for end in cell.number.interval())


def _why(cell: Cell, found: Judgement) -> str:
    def digits(value: float) -> str:
        return cell.number.format(value, extra=1)

    low, high = (digits(value) for value in found.interval)
    if found.probability is not None:
        chance = f"probability {found.probability:.2g}"
        if found.probability == 0.0:
            chance = "beyond every replicate"
        side = "inside" if found.verdict == "consistent" else "outside"
        return f"{side} the central {CENTRAL:.0%} of the prediction, {low} to {high} ({chance})"
    value = digits(found.computed)
    if "bound" in found.flags:
        return f"{value} {'keeps' if found.verdict == 'exact' else 'breaks'} the bound"
    if "through_rounding" in found.flags:
        return (
            f"{value} does not round to the print, but the inputs' rounding allows {low} to {high}"
        )
    if found.verdict == "exact":
        return f"{value} rounds to the printed digits"
    return f"{value}; the inputs' rounding allows {low} to {high}, not the print"


def _joint(
    table: PrintedTable, results: Results, records: Mapping[str, Record]
) -> tuple[TableRecord, ...]:
    own = [
        (cell, results[cell.name])
        for cell in table.cells
        if cell.name in records and records[cell.name].probability is not None
    ]
    together = _together((cell, _literal(result)) for cell, result in own)
    if not together["replicates"]:
        return ()
    outside = sum(records[cell.name].verdict == "differs" for cell, _ in own)
    chance = len(own) * (1 - CENTRAL)
    record = {"key": table.key, "cells": len(own), "outside": outside, "expected_outside": chance}
    return (TableRecord.model_validate(record | together),)


def _whole_readings(
    table: PrintedTable, results: Results, records: Mapping[str, Record]
) -> tuple[WholeReading, ...]:
    """Judge every reading of the text on all cells that depend on one, at once."""
    every = [
        (cell, one, record)
        for cell in table.cells
        if isinstance(result := results.get(cell.name), Blocked) and result.readings
        for one, record in zip(result.readings, records[cell.name].readings, strict=True)
    ]
    return tuple(
        _whole(table.key, [part for part in every if part[1].choices.items() <= chosen.items()])
        for chosen in _combined(every)
    )


def _combined(every: Iterable[tuple[Cell, Reading, ReadingRecord]]) -> list[Mapping[str, str]]:
    """Return every way to choose all options that the readings of some cells leave open."""
    ways: list[Mapping[str, str]] = []
    for _, group in groupby(every, lambda part: part[0].name):
        readings = [one.choices for _, one, _ in group]
        grown: list[Mapping[str, str]] = []
        for way in ways or [{}]:
            # A cell that no reading fits to what is chosen leaves it as it is.
            grown += [{**way, **c} for c in readings if agree(c, way)] or [way]
        ways = [way for place, way in enumerate(grown) if way not in grown[:place]]
    return ways


def _whole(key: str, parts: Sequence[tuple[Cell, Reading, ReadingRecord]]) -> WholeReading:
    names = list(dict.fromkeys(one.name for _, one, _ in parts))
    longest = [name for name in names if not any(o != name and o.startswith(name) for o in names)]
    return WholeReading(
        key=key,
        name="; ".join(longest),
        added=max(one.added for _, one, _ in parts),
        cells=len(parts),
        agreeing=sum(record.agrees for *_, record in parts),
        apart=sum("through_rounding" in record.flags for *_, record in parts),
        **_together((cell, one.result) for cell, one, _ in parts),
    )


def _together(predicted: Iterable[tuple[Cell, float | Prediction]]) -> dict[str, Any]:
    """Return how often cells simulated together lie as far out as the print, error and number.

    None and zero where nothing is drawn; what all replicates give alike has no share.
    """
    drawn = [
        (cell.number.interval(), result.draws / si_factor(cell.unit))
        for cell, result in predicted
        if isinstance(result, Prediction) and np.ptp(result.draws) > 0
    ]
    if not drawn:
        return {"joint_probability": None, "mcse": None, "replicates": 0}
    intervals, columns = zip(*drawn, strict=True)
    probability, error = joint_probability(np.stack(columns), np.array(intervals))
    return {"joint_probability": probability, "mcse": error, "replicates": columns[0].size}


@dataclass(frozen=True)
class Expectation:
    """The verdict frozen for a cell, with reason, erratum and question where they are due."""

    verdict: str
    reason: str = ""
    erratum: str = ""
    question: str = ""


@cache
def frozen() -> dict[str, Expectation]:
    """Return the frozen verdicts by address."""
    expectations: dict[str, Expectation] = {}
    texts = [(one / "verdicts.toml").read_text(encoding="utf-8") for one in data_folders()]
    for entry in (entry for text in texts for entry in tomllib.loads(text)["expect"]):
        one = Expectation(**{name: text for name, text in entry.items() if name != "cells"})
        if one.verdict not in VERDICTS:
            raise ValueError(f"verdicts.toml: unknown verdict {one.verdict!r}; one of {VERDICTS}")
        if one.verdict == "differs" and not one.reason:
            raise ValueError(f"verdicts.toml: {entry['cells']}: a differs needs its reason")
        for address in (cell.address for pattern in entry["cells"] for cell in find(pattern)):
            if address in expectations:
                raise ValueError(f"verdicts.toml: {address} stands twice; keep one")
            expectations[address] = one
    return expectations


@dataclass(frozen=True)
class Surprise:
    """A cell whose verdict is not the frozen one."""

    cell: str
    expected: str
    found: str


def surprises(ledger: Ledger) -> list[Surprise]:
    """Compare the ledger's verdicts with the frozen ones."""
    unknown = Expectation("none")
    wanted = [(r, frozen().get(r.cell, unknown).verdict) for r in ledger.records]
    return [Surprise(r.cell, verdict, r.verdict) for r, verdict in wanted if verdict != r.verdict]


def reason(address: str) -> str:
    """Return the written reason for the frozen verdict of a cell, empty where there is none."""
    return frozen()[address].reason if address in frozen() else ""


def erratum(address: str) -> str:
    """Return the id of the erratum behind a `differs`, empty where the register has none."""
    return frozen()[address].erratum if address in frozen() else ""
