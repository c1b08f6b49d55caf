"""The ledger: one record for every printed cell, one for every stochastic table; and the frozen
verdicts, with the reason of each `differs`."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import chain
from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from reproduce.judge.propagate import plain_results
from reproduce.judge.readings import Evaluation, ReadingSummary, evaluate
from reproduce.judge.verdicts import CENTRAL, Flag, Frozen, Reading, Verdict
from reproduce.locate import data_folders
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import unpublished
from reproduce.printed.cells import PrintedCell, PrintedTable, find, library
from reproduce.printed.inputs import load_inputs

_TOGETHER = (
    "probability of a table as far out as the printed one, all cells simulated together"
)


class Record(Frozen):
    """Result of one printed cell; numbers are in the printed unit.

    The fields of `Reading` are those of the literal reading.
    """

    key: str
    """table, figure or group of quoted numbers"""
    cell: str
    """address of the cell: key#row.column or key#name"""
    printed: str
    """the digits or words as printed"""
    unit: str
    """printed unit; empty for words"""
    place: str
    """table or section of the paper"""
    stands_for: tuple[float | None, float | None] | None
    """interval of values that agree with the printed number; null if open or words"""
    role: Literal["result", "given"]
    """result if a computation makes the cell"""
    computed: float | None
    """value, median of the prediction, or assumed value"""
    interval: tuple[float, float] | None
    """results that rounded inputs allow, or the central 99 % of the prediction"""
    verdict: Verdict
    """verdict; the page on verdicts of the book defines each word"""
    flags: tuple[Flag, ...]
    """qualifications of the verdict"""
    tolerance: float | None
    """half the printed interval, or half the predicted one"""
    share: float | None
    (
        "abs(computed - printed) over half the printed interval (exact), (1 - "
        "probability)/0.99 (consistent)"
    )
    probability: float | None
    """two-sided mid-p over the printed interval"""
    mcse: float | None
    """Monte Carlo standard error of the probability"""
    error: float | None
    """Monte Carlo standard error of a predicted median"""
    why: str
    """the verdict in words"""
    function: str | None
    """the function that computes the cell"""
    line: str | None
    """file and line of that function"""
    inputs: tuple[str, ...]
    """the printed cells that it was given"""
    equations: tuple[str, ...]
    """the paper's equations it rests on"""
    seed: tuple[int, ...] | None
    """root and key of the random stream"""
    readings: ReadingSummary | None
    """all readings of the text in short; null if there is one reading"""
    reason: str = ""
    """why, as written down with the frozen verdict"""


class TableRecord(Frozen):
    """Joint comparison of a table whose cells were drawn or measured together.

    The probability is that of the literal reading.
    """

    key: str
    cells: int
    """cells with a predicted distribution"""
    outside: int
    """of these, cells that differ"""
    expected_outside: float
    """cells expected to differ by chance"""
    joint_probability: float = Field(description=_TOGETHER)
    mcse: float
    replicates: int
    readings: int
    """number of readings of the table"""
    fitting: int
    """readings with which all cells agree, each and together"""
    closest: dict[str, str]
    """choices of the closest reading"""
    closest_agreeing: int
    """cells that agree with the closest reading"""
    closest_probability: float
    """its joint probability"""


class Ledger(Frozen):
    """All records, in the order of the papers."""

    records: tuple[Record, ...]
    tables: tuple[TableRecord, ...]
    altered: tuple[str, ...] = ()
    """files of printed numbers with another checksum"""
    software: str = ""
    """name, version, date and commit of the software"""
    citation: str = ""
    """how to cite an export, and the paper"""

    def of(self, key: str) -> tuple[Record, ...]:
        """Return the records of one item, in printed order."""
        return tuple(record for record in self.records if record.key == key)

    def cell(self, address: str) -> Record:
        """Return the record of one cell."""
        for record in self.records:
            if record.cell == address:
                return record
        raise KeyError(f"no record of {address!r}; `reproduce list` shows the keys")

    def table(self, key: str) -> TableRecord | None:
        """Return the joint record of a table, or None where nothing in it is stochastic."""
        return next((table for table in self.tables if table.key == key), None)


def build(
    keys: Iterable[str] | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Ledger:
    """Run the computations of the items and judge every printed cell."""
    items = catalogue()
    asked = set(items if keys is None else keys)
    if unknown := asked - set(items):
        raise KeyError(f"unknown key {sorted(unknown)}; expected some of {list(items)}")
    found: list[Ledger] = []
    for key in (key for key in items if key in asked):
        found.append(_judged(key))
        if progress is not None:
            progress(len(found), len(asked))
    return Ledger(
        records=tuple(chain.from_iterable(one.records for one in found)),
        tables=tuple(chain.from_iterable(one.tables for one in found)),
    )


def reread(key: str, choices: Mapping[str, str]) -> Ledger:
    """Return the ledger of an item under one reading of the text."""
    return _judged(key, tuple(choices.items()))


@cache
def _judged(key: str, choices: tuple[tuple[str, str], ...] = ()) -> Ledger:
    table = library().get(key)
    if table is None:  # a figure contains no printed numbers
        return Ledger(records=(), tables=())
    made: dict[str, Record] = {}
    tables = []
    for computation in catalogue()[key].computations:
        found = evaluate(
            computation.with_options(dict(choices)) if choices else computation
        )
        made |= _results(found, table)
        if not np.isnan(found.joint[0, 0]):
            tables.append(_table_record(found))
    records = (made.get(cell.name) or _without_result(cell) for cell in table.cells)
    return Ledger(records=tuple(records), tables=tuple(tables))


def _results(found: Evaluation, table: PrintedTable) -> dict[str, Record]:
    """Return the records of the cells that a computation makes."""
    computation = found.computation
    plain: Mapping[str, Flag] = {}
    if not computation.replicates:
        plain = plain_results(computation, load_inputs(computation.inputs))
    return {
        name: _result(found, table[name], plain.get(name, "rounding"))
        for name in found.cells
    }


def _result(found: Evaluation, cell: PrintedCell, plain: Flag) -> Record:
    """Return the record of a cell; `plain` replaces the flag of agreement through rounding."""
    computation, literal = found.computation, found.cells[cell.name][0]
    summary = found.summary(cell.name)
    verdict: Verdict = literal.verdict
    flags, share, why = literal.flags, literal.share, _why(cell, literal)
    if plain != "rounding" and verdict == "exact":
        flags = (*(flag for flag in flags if flag != "rounding"), plain)
    if 0 < summary.agreeing < summary.count:
        verdict, flags, share = "ambiguous", (), None
        why = (
            f"depends on {', '.join(summary.decided_by)}: the printed number agrees with "
            f"{summary.agreeing} of {summary.count} readings"
        )
    fields: dict[str, Any] = {
        "role": "result",
        "computed": literal.computed,
        "verdict": verdict,
        "flags": flags,
        "why": why,
        "function": computation.name,
        "line": computation.line,
        "inputs": tuple(load_inputs(computation.inputs).cells),
        "equations": computation.equations,
        "seed": computation.entropy or None,
    }
    if missing := unpublished(cell.key, cell.name):
        fields |= {"verdict": "unpublished", "flags": ("stand_in",)}
        fields["why"] = f"needs {missing}"
    else:
        numbers = ("interval", "tolerance", "probability", "mcse", "error")
        fields |= {name: getattr(literal, name) for name in numbers}
        fields |= {"share": share, "readings": summary if summary.count > 1 else None}
    return _blank(cell).model_copy(update=fields)


def _without_result(cell: PrintedCell) -> Record:
    """Return the record of a cell that no computation makes."""
    record = _blank(cell)
    if cell.is_number and (missing := unpublished(cell.key, cell.name)):
        verdict = {"role": "result", "verdict": "unpublished"}
        return record.model_copy(update={**verdict, "why": f"needs {missing}"})
    return record


def _blank(cell: PrintedCell) -> Record:
    """Return the record of an input."""
    ends: Any = None
    if cell.is_number:
        ends = [e if math.isfinite(e) else None for e in cell.number.interval()]
    return Record(
        key=cell.key,
        cell=cell.address,
        printed=cell.text,
        unit=cell.unit,
        place=cell.place,
        stands_for=ends,
        role="given",
        computed=None,
        interval=None,
        verdict="input",
        flags=(),
        tolerance=None,
        share=None,
        probability=None,
        mcse=None,
        error=None,
        why=f"taken from the paper ({cell.role})" if ends else "words or a dash",
        function=None,
        line=None,
        inputs=(),
        equations=(),
        seed=None,
        readings=None,
    )


def _why(cell: PrintedCell, found: Reading) -> str:
    """Return the verdict of the literal reading in words."""
    value, low, high = (
        cell.number.format(number, extra=1)
        for number in (found.computed, *found.interval)
    )
    if found.probability is not None:
        probability = f"probability {found.probability:.2g}"
        if found.probability == 0.0:
            probability = "beyond every replicate"
        side = "inside" if found.agrees else "outside"
        return (
            f"{side} the central {CENTRAL:.0%} of the prediction, {low} to {high} "
            f"({probability})"
        )
    if "bound" in found.flags:
        return f"{value} {'keeps' if found.agrees else 'breaks'} the bound"
    allowed = f"rounded inputs allow {low} to {high}"
    if not found.agrees:
        return f"{value}; {allowed}, which excludes the printed number"
    if (found.share or 0) > 1 or "rounding" in found.flags:
        return f"{value} does not round to the printed digits; {allowed}"
    return f"{value} rounds to the printed digits"


def _table_record(found: Evaluation) -> TableRecord:
    """Return the joint record of the predicted cells of a computation."""
    key, names = found.computation.key, list(found.cells)
    groups = np.stack([found.groups(name).ravel() for name in names], axis=-1)
    distinct = np.unique(groups, axis=0, return_index=True)[1]
    judged = [name for name in names if not unpublished(key, name)]
    agreeing = np.sum([[r.agrees for r in found.cells[n]] for n in judged], axis=0)
    joint = found.joint[:, 0]
    fits = (agreeing == len(judged)) & (joint >= 1 - CENTRAL)
    closest = max(distinct, key=lambda i: (fits[i], agreeing[i], joint[i], -i))
    return TableRecord(
        key=key,
        cells=len(judged),
        outside=len(judged) - int(agreeing[0]),
        expected_outside=len(judged) * (1 - CENTRAL),
        joint_probability=joint[0],
        mcse=found.joint[0, 1],
        replicates=found.computation.replicates,
        readings=len(distinct),
        fitting=int(fits[distinct].sum()),
        closest=found.computation.readings[closest],
        closest_agreeing=int(agreeing[closest]),
        closest_probability=joint[closest],
    )


class Expectation(Frozen):
    """Frozen verdict of some cells, with its reason, erratum and question."""

    cells: tuple[str, ...] = ()
    verdict: Verdict
    reason: str = ""
    erratum: str = ""
    question: str = ""

    @model_validator(mode="after")
    def _has_reason(self) -> Expectation:
        if self.verdict == "differs" and not self.reason:
            raise ValueError(f"{self.cells}: a differs needs its reason")
        return self


def _entries(file: str, name: str) -> Iterator[dict[str, Any]]:
    """Yield the entries of a TOML file of every data folder."""
    for folder in data_folders():
        yield from tomllib.loads((folder / file).read_text(encoding="utf-8"))[name]


@cache
def frozen() -> dict[str, Expectation]:
    """Return the frozen verdicts by address."""
    expectations: dict[str, Expectation] = {}
    for entry in _entries("verdicts.toml", "expect"):
        one = Expectation.model_validate(entry)
        for cell in chain.from_iterable(map(find, one.cells)):
            if cell.address in expectations:
                raise ValueError(f"verdicts.toml: expected {cell.address} once")
            expectations[cell.address] = one
    return expectations


@dataclass(frozen=True)
class VerdictChange:
    """A cell whose verdict is not the frozen one."""

    cell: str
    expected: str
    found: str


def changed_verdicts(ledger: Ledger) -> list[VerdictChange]:
    """Compare the ledger's verdicts with the frozen ones."""
    found = []
    for record in ledger.records:
        wanted = "none"
        if record.cell in frozen():
            wanted = frozen()[record.cell].verdict
        if record.verdict != wanted:
            found.append(VerdictChange(record.cell, wanted, record.verdict))
    return found


def reason(address: str) -> str:
    """Return the written reason for the frozen verdict of a cell; empty without a reason."""
    return frozen()[address].reason if address in frozen() else ""


def erratum(address: str) -> str:
    """Return the id of the erratum behind a `differs`; empty without an erratum."""
    return frozen()[address].erratum if address in frozen() else ""


@cache
def replies() -> dict[str, str]:
    """Return the reply of the authors to each erratum, by its id; empty without a reply."""
    return {
        entry["id"]: entry.get("reply", "")
        for entry in _entries("errata.toml", "erratum")
    }
