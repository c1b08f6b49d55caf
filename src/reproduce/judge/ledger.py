"""The ledger, with a record for every printed cell and stochastic table, and frozen verdicts."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from functools import cache
from itertools import chain
from typing import Any, Literal

import numpy as np
from pydantic import model_validator

from reproduce.judge._propagate import plain_results
from reproduce.judge.readings import Evaluation, ReadingSummary, evaluate
from reproduce.judge.verdicts import (
    CENTRAL,
    OUTSIDE,
    Comparison,
    Frozen,
    Reading,
    Verdict,
)
from reproduce.locate import data_files, read_toml
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import computations
from reproduce.printed.cells import PrintedCell, PrintedTable, find, library
from reproduce.printed.inputs import load_inputs

_Reply = Literal["", "none", "received", "disputed", "settled"]


class _Printed(Frozen):
    """A printed cell, and its role."""

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
    """result if a computation makes the cell, or the cell needs unpublished data"""


class Record(Comparison, _Printed):
    """Result of one printed cell; the comparison is that of the literal reading."""

    computed: float | None = None
    """value, median of the prediction, or assumed value"""
    interval: tuple[float, float] | None = None
    """results that rounded inputs allow, or the central 99 % of the prediction"""
    tolerance: float | None = None
    """half the printed interval, or half the predicted one"""
    why: str
    """the verdict in words"""
    function: str | None = None
    """function that computes the cell"""
    line: str | None = None
    """file and line of this function"""
    inputs: tuple[str, ...] = ()
    """addresses of its declared inputs"""
    equations: tuple[str, ...] = ()
    """equations of the paper that it implements"""
    seed: tuple[int, ...] | None = None
    """root and key of the random stream"""
    readings: ReadingSummary | None = None
    """all readings of the text in short; null if there is one reading"""
    reason: str = ""
    """reason of the frozen verdict"""
    reply: _Reply = ""
    """state of the authors' reply to the question on the cell; empty without a question"""

    @property
    def paper(self) -> str:
        """Name of the paper."""
        return self.key.partition("/")[0]

    @property
    def printed_cell(self) -> PrintedCell:
        """The printed cell."""
        return find(self.cell)[0]


class TableRecord(Frozen):
    """Joint comparison of the predicted cells of a table.

    The probability is that of the literal reading.
    """

    key: str
    cells: int
    """cells with a predicted distribution"""
    outside: int
    """of these, cells that differ"""
    expected_outside: float
    """cells expected to differ by chance"""
    joint_probability: float
    """probability of a table as far out as the printed one, all cells simulated together"""
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

    def changed_verdicts(self) -> list[tuple[str, str, str]]:
        """Return the cells whose verdict is not the frozen one, with both, frozen first."""
        known = {address: one.verdict for address, one in frozen().items()}
        return [
            (one.cell, before, one.verdict)
            for one in self.records
            if one.verdict != (before := known.get(one.cell, "none"))
        ]

    def of(self, key: str) -> list[Record]:
        """Return the records of one item, in printed order."""
        return [record for record in self.records if record.key == key]


def build(keys: Collection[str] = ()) -> Ledger:
    """Run the computations of the items and judge every printed cell.

    Parameters
    ----------
    keys : collection of str, optional
        Keys of the items. Default: all items.

    Returns
    -------
    Ledger
        One record per printed cell.

    Raises
    ------
    KeyError
        If a key is unknown.
    """
    parts = [*map(item_ledger, dict.fromkeys(keys or catalogue()))]
    return Ledger(
        records=tuple(record for part in parts for record in part.records),
        tables=tuple(table for part in parts for table in part.tables),
    )


@cache
def item_ledger(key: str, **choices: str) -> Ledger:
    """Return the ledger of an item; with the choices of some options, of one reading."""
    if key not in catalogue():
        raise KeyError(key)
    if key not in library():  # a figure contains no printed numbers
        return Ledger(records=(), tables=())
    records = {cell.name: _unjudged(cell) for cell in library()[key].cells}
    tables = []
    for computation in computations(key):
        if choices:
            computation = computation.with_options(choices)
        evaluation = evaluate(computation)
        records |= _results(evaluation, library()[key])
        if not np.isnan(evaluation.joint[0, 0]):
            tables.append(_table_record(evaluation))
    return Ledger(records=tuple(records.values()), tables=tuple(tables))


def record_of(address: str, **choices: str) -> Record:
    """Return the record of one cell; with the choices of some options, of one reading."""
    for record in item_ledger(address.partition("#")[0], **choices).records:
        if record.cell == address:
            return record
    raise KeyError(
        f"address: expected a printed cell, got {address!r}. `reproduce contents` lists "
        "the keys."
    )


def _unjudged(cell: PrintedCell) -> Record:
    """Return the record of a cell that no computation makes."""
    missing = cell.is_number and cell.unpublished
    known = expected(cell.address)
    ends, why = None, "words or a dash"
    if cell.is_number:
        low, high = (e if math.isfinite(e) else None for e in cell.number.interval())
        ends, why = (low, high), f"taken from the paper ({cell.role})"
    return Record(
        key=cell.key,
        cell=cell.address,
        printed=cell.text,
        unit=cell.unit,
        place=cell.place,
        stands_for=ends,
        role="result" if missing else "given",
        verdict="unpublished" if missing else "input",
        why=f"needs {missing}" if missing else why,
        reason=known.reason,
        reply=known.reply,
    )


def _results(evaluation: Evaluation, table: PrintedTable) -> dict[str, Record]:
    """Return the records of the cells that a computation makes."""
    computation, records = evaluation.computation, {}
    inputs = load_inputs(computation.inputs)
    plain = {} if computation.replicates else plain_results(computation, inputs)
    for name, (literal, *_) in evaluation.cells.items():
        cell, summary = table[name], evaluation.summary(name)
        fields: dict[str, Any] = {
            "role": "result",
            "computed": literal.computed,
            "function": computation.name,
            "line": computation.line,
            "inputs": tuple(inputs.cells),
            "equations": computation.equations,
            "seed": computation.entropy or None,
        }
        if cell.unpublished:
            fields["flags"] = ("stand_in",)
        else:
            fields |= literal.model_dump(exclude={"choices"})
            fields["why"] = _why(cell, literal)
            if literal.verdict == "exact" and name in plain:
                kept = (flag for flag in literal.flags if flag != "rounding")
                fields["flags"] = (*kept, plain[name])
            if summary.count > 1:
                fields["readings"] = summary
            if 0 < summary.agreeing < summary.count:
                fields |= {"verdict": "ambiguous", "flags": (), "share": None}
                fields["why"] = (
                    f"depends on {', '.join(summary.decided_by)}: the printed number agrees "
                    f"with {summary.agreeing} of {summary.count} readings"
                )
        records[name] = _unjudged(cell).model_copy(update=fields)
    return records


def _why(cell: PrintedCell, reading: Reading) -> str:
    """Return the verdict of the literal reading in words."""
    agrees, p = reading.agrees, reading.probability
    numbers = (reading.computed, *reading.interval)
    value, low, high = map(cell.number.format, numbers)
    if p is not None:
        side = "inside" if agrees else "outside"
        chance = f"probability {p:.2g}" if p else "beyond every replicate"
        part = f"{side} the central {100 * CENTRAL:g} % of the prediction"
        return f"{part}, {low} to {high} ({chance})"
    if "bound" in reading.flags:
        return f"{value} {'keeps' if agrees else 'breaks'} the bound"
    allowed = f"rounded inputs allow {low} to {high}"
    if not agrees:
        return f"{value}; {allowed}, which excludes the printed number"
    if (reading.share or 0) > 1 or "rounding" in reading.flags:
        return f"{value} does not round to the printed digits; {allowed}"
    if cell.number.rounds(reading.computed):
        return f"{value} rounds to the printed digits"
    return f"{value} is within the tolerance of the word {cell.number.qualifier}"


def _table_record(evaluation: Evaluation) -> TableRecord:
    """Return the joint record of the predicted cells of a computation."""
    key, cells = evaluation.computation.key, evaluation.cells
    table = library()[key]
    results = np.array([evaluation.results(name) for name in cells])
    distinct = np.sort(np.unique(results, axis=1, return_index=True)[1])
    judged = [name for name in cells if not table[name].unpublished]
    agreeing = np.sum([[r.agrees for r in cells[name]] for name in judged], axis=0)
    joint = evaluation.joint[:, 0]
    fits = (agreeing == len(judged)) & (joint >= OUTSIDE)
    closest = max(distinct, key=lambda i: (fits[i], agreeing[i], joint[i]))
    return TableRecord(
        key=key,
        cells=len(judged),
        outside=len(judged) - int(agreeing[0]),
        expected_outside=len(judged) * OUTSIDE,
        joint_probability=joint[0],
        mcse=evaluation.joint[0, 1],
        replicates=evaluation.computation.replicates,
        readings=len(distinct),
        fitting=int(fits[distinct].sum()),
        closest=evaluation.computation.readings[closest],
        closest_agreeing=int(agreeing[closest]),
        closest_probability=joint[closest],
    )


class Expectation(Frozen):
    """Frozen verdict of some cells, with its reason, erratum and question."""

    cells: tuple[str, ...] = ()
    verdict: Verdict
    reason: str = ""
    erratum: str = ""
    answer: str = ""
    """reply of the authors to the erratum, from the register"""
    question: str = ""
    reply: _Reply = ""
    """state of their reply to the question, from the letters"""

    @model_validator(mode="after")
    def _has_reason(self) -> Expectation:
        if self.verdict == "differs" and not self.reason:
            raise ValueError(
                f"reason: expected the reason why {self.cells} differ, got none. Add it"
            )
        return self


def entries(file: str, name: str) -> Iterator[dict[str, Any]]:
    """Yield the entries of a TOML file of every data folder."""
    for path in data_files(file):
        yield from read_toml(path, dict)[name]


@cache
def frozen() -> dict[str, Expectation]:
    """Return the frozen verdicts by address."""
    expectations: dict[str, Expectation] = {}
    errata = entries("errata.toml", "erratum")
    replies = {one["id"]: one.get("reply", "") for one in errata}
    letters = entries("letters.toml", "question")
    states = {one["id"]: one.get("state", "none") for one in letters}
    for entry in entries("verdicts.toml", "expect"):
        expectation = Expectation(
            answer=replies.get(entry.get("erratum"), ""),
            reply=states.get(entry.get("question"), ""),
            **entry,
        )
        for cell in chain.from_iterable(map(find, expectation.cells)):
            if cell.address in expectations:
                raise ValueError(
                    f"verdicts.toml: expected {cell.address} once, got it twice. Remove one"
                )
            expectations[cell.address] = expectation
    return expectations


def expected(address: str) -> Expectation:
    """Return the frozen verdict of a cell, by default that of an input."""
    return frozen().get(address, Expectation(verdict="input"))
