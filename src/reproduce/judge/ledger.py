"""The ledger: one record for every printed cell, one for every stochastic table; and the frozen
verdicts, with the reason of each `differs`."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal

import numpy as np
from pydantic import Field

from reproduce.judge.readings import Evaluation, ReadingSummary, evaluate
from reproduce.judge.verdicts import (
    CENTRAL,
    VERDICTS,
    Flag,
    Frozen,
    Reading,
    Verdict,
    plain_results,
)
from reproduce.locate import data_folders
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Computation, unpublished
from reproduce.printed.cells import Cell, PrintedTable, altered_files, find, library
from reproduce.printed.given import given

_TOGETHER = (
    "probability of a table as far out as the printed one, all cells simulated together"
)


class Record(Frozen):
    """Result of one printed cell; numbers are in the printed unit.

    The fields of `Reading` are those of the literal reading.
    """

    key: str = Field(description="table, figure or group of quoted numbers")
    cell: str = Field(description="address of the cell: key#row.column or key#name")
    printed: str = Field(description="the digits or words as printed")
    unit: str = Field(description="printed unit; empty for words")
    place: str = Field(description="table or section of the paper")
    stands_for: tuple[float | None, float | None] | None = Field(
        description="interval of values that agree with the printed number; null if open or words"
    )
    role: Literal["result", "given"] = Field(
        description="result if a computation makes the cell"
    )
    computed: float | None = Field(
        description="value, median of the prediction, or assumed value"
    )
    interval: tuple[float, float] | None = Field(
        description="results that rounded inputs allow, or the central 99 % of the prediction"
    )
    verdict: Verdict = Field(
        description="verdict; the page on verdicts of the book defines each word"
    )
    flags: tuple[Flag, ...] = Field(description="qualifications of the verdict")
    tolerance: float | None = Field(
        description="half the printed interval, or half the predicted one"
    )
    share: float | None = Field(
        description="|computed - printed| over half the printed interval (exact), "
        "(1 - probability)/0.99 (consistent)"
    )
    probability: float | None = Field(
        description="two-sided mid-p over the printed interval"
    )
    mcse: float | None = Field(
        description="Monte Carlo standard error of the probability"
    )
    error: float | None = Field(
        description="Monte Carlo standard error of a predicted median"
    )
    why: str = Field(description="the verdict in words")
    function: str | None = Field(description="the function that computes the cell")
    line: str | None = Field(description="file and line of that function")
    reads: tuple[str, ...] = Field(description="the printed cells that it was given")
    equations: tuple[str, ...] = Field(description="the paper's equations it rests on")
    seed: tuple[int, ...] | None = Field(
        description="root and key of the random stream"
    )
    readings: ReadingSummary | None = Field(
        description="all readings of the text in short; null if there is one reading"
    )
    reason: str = Field(
        default="", description="why, as written down with the frozen verdict"
    )


class TableRecord(Frozen):
    """Joint comparison of a table whose cells were drawn or measured together.

    The probability is that of the literal reading.
    """

    key: str
    cells: int = Field(description="cells with a predicted distribution")
    outside: int = Field(description="of these, cells that differ")
    expected_outside: float = Field(description="cells expected to differ by chance")
    joint_probability: float = Field(description=_TOGETHER)
    mcse: float
    replicates: int
    readings: int = Field(description="number of readings of the table")
    fitting: int = Field(
        description="readings with which all cells agree, each and together"
    )
    closest: dict[str, str] = Field(description="choices of the closest reading")
    closest_agreeing: int = Field(
        description="cells that agree with the closest reading"
    )
    closest_probability: float = Field(description="its joint probability")


class Ledger(Frozen):
    """All records, in the order of the papers."""

    records: tuple[Record, ...]
    tables: tuple[TableRecord, ...]
    altered: tuple[str, ...] = Field(
        default=(), description="files of printed numbers with another checksum"
    )
    software: str = Field(
        default="", description="name, version, date and commit of the software"
    )
    citation: str = Field(
        default="", description="how to cite an export, and the paper"
    )

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
    wanted = [key for key in items if key in asked]
    found: list[Ledger] = []
    for done, key in enumerate(wanted, start=1):
        found.append(_judged(key))
        if progress is not None:
            progress(done, len(wanted))
    return Ledger(
        records=tuple(record for one in found for record in one.records),
        tables=tuple(table for one in found for table in one.tables),
        altered=altered_files(),
    )


def reread(key: str, choices: Mapping[str, str]) -> Ledger:
    """Return the ledger of an item under one reading of the text."""
    return _judged(key, tuple(choices.items()))


@cache
def _judged(key: str, choices: tuple[tuple[str, str], ...] = ()) -> Ledger:
    table = library().get(key)
    if table is None:  # a figure: nothing of it is printed as a number
        return Ledger(records=(), tables=())
    made: dict[str, Record] = {}
    joint: list[TableRecord] = []
    for computation in catalogue()[key].computations:
        found = evaluate(computation.under(dict(choices)) if choices else computation)
        records = _records(found, table)
        if doubly := made.keys() & records.keys():
            raise ValueError(f"{key}: cells made by two computations: {sorted(doubly)}")
        made |= records
        joint += _table_records(found)
    if len(joint) > 1:
        raise ValueError(
            f"{key}: expected one computation of all its random cells, got several"
        )
    return Ledger(
        records=tuple(
            made.get(cell.name) or _without_result(cell) for cell in table.cells
        ),
        tables=tuple(joint),
    )


def _records(found: Evaluation, table: PrintedTable) -> dict[str, Record]:
    computation = found.computation
    plain = (
        {}
        if computation.replicates
        else plain_results(computation, given(computation.given))
    )
    return {name: _record(found, table[name], plain.get(name)) for name in found.cells}


def _source(computation: Computation) -> dict[str, Any]:
    """Return the fields of a record that name the function of a cell and its inputs."""
    return {
        "role": "result",
        "function": computation.name,
        "line": computation.line,
        "reads": tuple(given(computation.given).cells),
        "equations": computation.equations,
        "seed": computation.entropy or None,
    }


def _record(found: Evaluation, cell: Cell, plain: Flag | None) -> Record:
    literal = found.cells[cell.name][0]
    made = _source(found.computation)
    if missing := unpublished(cell.key, cell.name):
        stand_in = {
            "verdict": "unpublished",
            "computed": literal.computed,
            "flags": ("stand_in",),
        }
        return _make(cell, f"needs {missing}", {**made, **stand_in})
    summary = found.summary(cell.name)
    fields: dict[str, Any] = {n: getattr(literal, n) for n in Reading.model_fields}
    del fields["choices"]
    if plain and literal.verdict == "exact":
        fields["flags"] = (*(f for f in literal.flags if f != "rounding"), plain)
    why = _why(cell, literal)
    if summary.count > 1:
        fields["readings"] = summary
        if 0 < summary.agreeing < summary.count:
            fields["verdict"] = "ambiguous"
            fields["flags"] = ()
            fields["share"] = None
            why = (
                f"depends on {', '.join(summary.decided_by)}: the printed number agrees with "
                f"{summary.agreeing} of {summary.count} readings"
            )
    return _make(cell, why, {**made, **fields})


def _without_result(cell: Cell) -> Record:
    missing = unpublished(cell.key, cell.name) if cell.is_number else ""
    if missing:
        fields = {"role": "result", "verdict": "unpublished"}
        return _make(cell, f"needs {missing}", fields)
    why = f"taken from the paper ({cell.role})" if cell.is_number else "words or a dash"
    return _make(cell, why, {"role": "given", "verdict": "input"})


def _make(cell: Cell, why: str, fields: dict[str, Any]) -> Record:
    blank = dict.fromkeys(
        n for n, field in Record.model_fields.items() if field.is_required()
    )
    own = {
        "key": cell.key,
        "cell": cell.address,
        "printed": cell.text,
        "unit": cell.unit,
        "place": cell.place,
        "stands_for": _ends(cell),
        "why": why,
    }
    empty: dict[str, Any] = {"flags": (), "equations": (), "reads": ()}
    return Record.model_validate(blank | empty | own | fields)


def _ends(cell: Cell) -> tuple[float | None, ...] | None:
    """Return the interval of values that agree with a cell; None for an open end, and for words."""
    if not cell.is_number:
        return None
    return tuple(end if math.isfinite(end) else None for end in cell.number.interval())


def _why(cell: Cell, found: Reading) -> str:
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
        return f"{value} {'keeps' if found.agrees else 'breaks'} the bound"
    if found.verdict == "differs":
        return f"{value}; rounded inputs allow {low} to {high}, which excludes the printed number"
    if (found.share is not None and found.share > 1) or "rounding" in found.flags:
        return f"{value} does not round to the printed digits; rounded inputs allow {low} to {high}"
    return f"{value} rounds to the printed digits"


def _table_records(found: Evaluation) -> list[TableRecord]:
    """Return the joint record of the predicted cells of a computation, if there are any."""
    if np.isnan(found.joint[0, 0]):
        return []
    key = found.computation.key
    cells = {n: rs for n, rs in found.cells.items() if not unpublished(key, n)}
    agreeing = np.array(
        [[one.agrees for one in readings] for readings in cells.values()]
    ).sum(0)
    probable = found.joint[:, 0] >= 1 - CENTRAL
    distinct = np.unique(_results(found), axis=0, return_index=True)[1]
    ranks = [
        (
            bool(probable[i]) and int(agreeing[i]) == len(cells),
            int(agreeing[i]),
            float(found.joint[i, 0]),
            -int(i),
        )
        for i in distinct
    ]
    *_, best = max(ranks)
    probability, mcse = found.joint[0].tolist()
    return [
        TableRecord(
            key=key,
            cells=len(cells),
            outside=len(cells) - int(agreeing[0]),
            expected_outside=len(cells) * (1 - CENTRAL),
            joint_probability=probability,
            mcse=mcse,
            replicates=found.computation.replicates,
            readings=len(ranks),
            fitting=sum(fits for fits, *_ in ranks),
            closest=found.computation.readings[-best],
            closest_agreeing=int(agreeing[-best]),
            closest_probability=float(found.joint[-best, 0]),
        )
    ]


def _results(found: Evaluation) -> np.ndarray[Any, Any]:
    """Return the number of the result of every cell under each reading, (readings, cells)."""
    return np.stack([found.groups(name).ravel() for name in found.cells], axis=-1)


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
    texts = [
        (one / "verdicts.toml").read_text(encoding="utf-8") for one in data_folders()
    ]
    for entry in (entry for text in texts for entry in tomllib.loads(text)["expect"]):
        one = Expectation(
            **{name: text for name, text in entry.items() if name != "cells"}
        )
        if one.verdict not in VERDICTS:
            raise ValueError(
                f"verdicts.toml: unknown verdict {one.verdict!r}; one of {VERDICTS}"
            )
        if one.verdict == "differs" and not one.reason:
            raise ValueError(
                f"verdicts.toml: {entry['cells']}: a differs needs its reason"
            )
        for address in (
            cell.address for pattern in entry["cells"] for cell in find(pattern)
        ):
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
    return [
        Surprise(r.cell, verdict, r.verdict)
        for r, verdict in wanted
        if verdict != r.verdict
    ]


def reason(address: str) -> str:
    """Return the written reason for the frozen verdict of a cell, empty where there is none."""
    return frozen()[address].reason if address in frozen() else ""


def erratum(address: str) -> str:
    """Return the id of the erratum behind a `differs`, empty where the register has none."""
    return frozen()[address].erratum if address in frozen() else ""


@cache
def replies() -> dict[str, str]:
    """Return the reply of the authors to each erratum, by its id; empty without a reply."""
    texts = [
        (one / "errata.toml").read_text(encoding="utf-8") for one in data_folders()
    ]
    entries = (entry for text in texts for entry in tomllib.loads(text)["erratum"])
    return {entry["id"]: entry.get("reply", "") for entry in entries}
