"""Every printed number as a mark in its own table, by verdict: the whole score in one picture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from markupsafe import Markup

from reproduce.judge.ledger import Record
from reproduce.printed.cells import PrintedTable, anchor, library
from reproduce.views import keys
from reproduce.views.writing import verdicts

PITCH = 14  # from one mark to the next, in CSS pixels
ACROSS = 10  # marks in a row of a group of quoted numbers
# Each verdict has a shape of its own, so that colour is not needed.
SHAPES = {
    "exact": "M-4.5-4.5h9v9h-9z",
    "consistent": "M-4.9 0a4.9 4.9 0 1 0 9.8 0a4.9 4.9 0 1 0-9.8 0z",
    "differs": "M0-6.5 6.5 0 0 6.5-6.5 0z",
    "blocked": "M0-5 5.5 4.5h-11z",
    "input": "M-2.1 0a2.1 2.1 0 1 0 4.2 0a2.1 2.1 0 1 0-4.2 0z",
}


def wall(records: Iterable[Record]) -> Markup:
    """Draw every record as a mark that leads to its cell, one small picture for each item."""
    items: dict[str, dict[str, Record]] = {}
    for record in records:
        items.setdefault(record.key, {})[record.cell] = record
    blocks = Markup("\n").join(_block(library()[key], found) for key, found in items.items())
    return Markup('<div class="rp-wall">\n{}\n</div>').format(blocks)


def legend(records: Sequence[Record]) -> Markup:
    """Say what each mark means, and how many there are."""
    counts = verdicts.tally(tuple(records))
    hollow = sum(verdicts.weak_agreement(one) for one in records)
    entries = [
        _entry(f"rp-mark-{verdict}", verdict, f"{counts[verdict]} {verdict}", meaning)
        for verdict, meaning in verdicts.MEANINGS.items()
    ]
    weak = "agrees, but in a way that says little: a copy, a difference, a wide interval"
    entries.insert(
        2, _entry("rp-mark-exact rp-mark-weak", "exact", f"{hollow} of these weak", weak)
    )
    return Markup('<ul class="rp-wall-legend">\n{}\n</ul>').format(Markup("\n").join(entries))


def _entry(kind: str, verdict: str, count: str, meaning: str) -> Markup:
    picture = Markup(
        '<svg viewBox="-7 -7 14 14" width="14" height="14" aria-hidden="true">'
        '<path class="{}" d="{}"/></svg>'
    ).format(kind, SHAPES[verdict])
    return Markup("<li>{} <strong>{}</strong>: {}</li>").format(picture, count, meaning)


def _block(table: PrintedTable, records: dict[str, Record]) -> Markup:
    """Draw one item: its name, and its cells in the shape of the print."""
    across = len(table.columns) if len(table.columns) > 1 else ACROSS
    places = [
        (records[cell.address], number % across, number // across)
        for number, cell in enumerate(table.cells)
        if cell.address in records
    ]
    wide = PITCH * (1 + max(x for _, x, _ in places))
    high = PITCH * (1 + max(y for _, _, y in places))
    marks = Markup("").join(_mark(record, x, y) for record, x, y in places)
    name = keys.place(table.key).partition(",")[0]
    name = table.key.partition("/")[2].removeprefix("text-") if name == "Text" else name
    tally = verdicts.tally(tuple(records.values()))
    told = ", ".join(f"{count} {verdict}" for verdict, count in tally.items() if count)
    return Markup(
        '<div class="rp-wall-item"><a href="#{}" title="{}: {}">{}</a>\n'
        '<svg viewBox="0 0 {} {}" width="{}" height="{}" role="group" aria-label="{}: {}">{}</svg>'
        "</div>"
    ).format(anchor(table.key), table.title, told, name, wide, high, wide, high, name, told, marks)


def _mark(record: Record, across: int, down: int) -> Markup:
    cell = verdicts.cell_of(record)
    value = verdicts.computed(record)
    told = f"{cell.label}: {cell.shown} printed"
    told += f", {value} computed" if value and record.role == "result" else ""
    weak = " rp-mark-weak" if verdicts.weak_agreement(record) else ""
    # The name of the item leads a keyboard to its table; 300 stops on the way would not help it.
    return Markup(
        '<a href="#{}" tabindex="-1"><title>{}, {}</title>'
        '<g transform="translate({} {})"><path class="rp-hit" d="M-7-7h14v14h-14z"/>'
        '<path class="rp-mark-{}{}" d="{}"/></g></a>'
    ).format(
        cell.anchor,
        told,
        verdicts.qualified(record),
        PITCH * across + PITCH // 2,
        PITCH * down + PITCH // 2,
        record.verdict,
        weak,
        SHAPES[record.verdict],
    )
