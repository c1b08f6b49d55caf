"""Tables for the terminal: aligned, with verdict words, readable without colour."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from rich import box
from rich.table import Table
from rich.text import Text

from reproduce.judge.expected import erratum, reason
from reproduce.judge.ledger import Ledger, Record
from reproduce.judge.verdicts import VERDICTS
from reproduce.views import record_text

__all__ = ["items_table", "records_table", "remarks", "score_table", "weak_line"]

_STYLES = {
    "exact": "green",
    "consistent": "green",
    "differs": "bold red",
    "blocked": "yellow",
    "pending": "magenta",
    "input": "dim",
}


def items_table(rows: Iterable[tuple[str, str, str]], width: int) -> Table:
    """Return the list of items."""
    table = Table(box=box.SIMPLE_HEAD, width=min(width, 110), pad_edge=False)
    table.add_column("key", no_wrap=True)
    table.add_column("in the paper")
    table.add_column("what")
    for row in rows:
        table.add_row(*row)
    return table


def records_table(records: tuple[Record, ...], width: int) -> Table:
    """Return one item's cells, computed beside printed."""
    wide = width >= 110
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    table.add_column("cell", overflow="fold")
    table.add_column("printed", justify="right", no_wrap=True)
    table.add_column("computed", justify="right", no_wrap=True)
    table.add_column("unit", no_wrap=True)
    table.add_column("verdict", no_wrap=True)
    if wide:
        table.add_column("allowed or predicted", no_wrap=True)
        table.add_column("probability", no_wrap=True)
    for record in records:
        cells: list[str | Text] = [
            record.cell.partition("#")[2],
            record.printed,
            record_text.computed(record).replace("−", "-"),
            record_text.unit(record),
            Text(record.verdict, style=_STYLES[record.verdict]),
        ]
        if wide:
            cells += [
                record_text.interval(record).replace("−", "-"),
                record_text.probability(record),
            ]
        table.add_row(*cells)
    return table


def aligned(head: Sequence[str], rows: Iterable[Sequence[str]]) -> Table:
    """Return any rows under their heads, numbers to the right."""
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    for i, name in enumerate(head):
        table.add_column(name, justify="right" if i else "left", overflow="fold")
    for row in rows:
        table.add_row(*row)
    return table


def remarks(ledger: Ledger, key: str) -> list[str]:
    """Return what a reader needs beside the table: joint probability, flags, reasons."""
    lines = []
    joint = ledger.table(key)
    if joint is not None:
        lines.append(
            f"The table as a whole: probability {record_text.joint_chance(joint)}, from "
            f"{joint.replicates:,} "
            f"replicates; {joint.outside} of {joint.cells} cells outside, "
            f"{joint.expected_outside:.1f} expected by chance."
        )
    records = ledger.of(key)
    for flag, meaning in record_text.FLAG_MEANINGS.items():
        flagged = [r.cell.partition("#")[2] for r in records if flag in r.flags]
        if flagged:
            lines.append(f"{flag} ({meaning}): {', '.join(flagged)}")
    reasons: dict[str, list[str]] = {}
    for record in records:
        if record.verdict in {"differs", "blocked", "pending"}:
            text = reason(record.cell) or record.why
            if known := erratum(record.cell):
                text = f"{text} Erratum {known}."
            reasons.setdefault(f"{record.verdict}: {text}", []).append(
                record.cell.partition("#")[2]
            )
    lines += [f"{text} ({', '.join(cells)})" for text, cells in reasons.items()]
    for record in records:
        lines += [
            f"{record.cell.partition('#')[2]}, if {reading.name} ({reading.place}): "
            f"{record_text.read(record, reading).replace('−', '-')}"
            for reading in record.readings
        ]
    return lines


def score_table(ledger: Ledger) -> Table:
    """Return the number of cells by verdict, item by item."""
    # Without a box the table fits 80 columns with every word whole.
    table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
    table.add_column("item", no_wrap=True)
    for verdict in VERDICTS:
        table.add_column(verdict, justify="right", no_wrap=True)
    table.add_column("(weak)", justify="right", no_wrap=True)
    paper = ""
    for key in dict.fromkeys(record.key for record in ledger.records):
        if key.partition("/")[0] != paper:
            paper = key.partition("/")[0]
            table.add_row()
            table.add_row(Text(paper, style="bold"))
        table.add_row(key.partition("/")[2], *_counts(ledger.of(key)))
    table.add_row()
    table.add_row("all", *_counts(ledger.records), style="bold")
    return table


def _counts(records: tuple[Record, ...]) -> list[str]:
    tally = record_text.tally(records)
    weak = tally["exact"] + tally["consistent"] - record_text.strong(records)
    return [str(count) if count else "·" for count in (*tally.values(), weak)]


def weak_line(records: tuple[Record, ...]) -> str:
    """Return what makes agreement weak, and how often, in one sentence."""
    counts = {flag: count for flag, count in record_text.weak(records).items() if count}
    listed = ", ".join(f"{count} {flag.replace('_', ' ')}" for flag, count in counts.items())
    return f"Weak agreement, counted apart: {listed}." if counts else ""
