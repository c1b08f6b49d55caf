"""A table or a cell: printed beside computed, with where each comes from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from itertools import groupby
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from reproduce.judge import rerun as rerunning
from reproduce.judge.ledger import Ledger, Record, erratum, reason
from reproduce.papers.catalogue import catalogue, maker
from reproduce.papers.declare import Computation
from reproduce.printed.cells import Cell as PrintedCell
from reproduce.printed.cells import anchor, library
from reproduce.views import keys, readings, verdicts
from reproduce.views.base import Change, Item, Shown, by_row, text_of
from reproduce.views.blocks import (
    Block,
    Box,
    Entry,
    Fold,
    Grid,
    Html,
    badge,
    grid,
    html,
    link,
)
from reproduce.views.computed import item_ledger
from reproduce.views.export import bar, export, full_frame, table_files
from reproduce.views.numbers import minus
from reproduce.views.readings import Readings
from reproduce.views.sweep import Changed, Point, Sweep, of_cells, swept

if TYPE_CHECKING:
    import pandas as pd

# Cells that share a note are counted from here on.
FEW = 4


class Table(Item):
    """A table or a group of quoted numbers: printed beside computed, with verdicts.

    Parameters
    ----------
    key : str
        Such as ``niu2024/table-3``.
    """

    def __init__(self, key: str) -> None:
        self.key = keys.check_key(key)
        if self.key not in library():
            raise ValueError(f"{key} holds no printed numbers; try figure({key!r})")
        self._printed = library()[self.key]

    @cached_property
    def _ledger(self) -> Ledger:
        return item_ledger(self.key)

    @property
    def _records(self) -> dict[str, Record]:
        return {verdicts.name_of(one): one for one in self._ledger.of(self.key)}

    def __getitem__(self, name: str) -> Cell:
        """Return one cell by its name, such as ``scale.red``."""
        return Cell(self._printed[name].address)

    def frame(self) -> pd.DataFrame:
        """Return the table in its own shape.

        Returns
        -------
        pandas.DataFrame
            Rows as in print. A table has columns as in print, each with printed, computed and
            verdict; a group of quoted numbers has these and the unit.
        """
        import pandas as pd

        table, wanted = self._printed, ["printed", "computed", "verdict"]
        entries = {
            name: (one.printed, verdicts.computed(one), one.verdict, verdicts.unit(one))
            for name, one in self._records.items()
        }
        cells = by_row(entries, [*wanted, "unit"])
        if len(table.columns) <= 1:
            return cells
        rows = [row.id for row in table.rows]
        parts = {
            c.id: cells.loc[[f"{row}.{c.id}" for row in rows], wanted]
            for c in table.columns
        }
        return pd.concat(
            [one.set_axis(rows) for one in parts.values()], axis=1, keys=parts
        )

    def cells(self) -> pd.DataFrame:
        """Return one row per cell, with every field of the ledger."""
        return full_frame(self._ledger.of(self.key))

    @property
    def readings(self) -> Readings:
        """All readings of the text: every combination of `options`."""
        return Readings(self.key)

    def rerun(
        self,
        changes: Change | None = None,
        *,
        seed: int | None = None,
        replicates: int | None = None,
        **options: str,
    ) -> Changed:
        """Compute the table again with something changed, or under a reading of the text.

        Parameters
        ----------
        changes : mapping, optional
            Address of any cell in `reads` to a value as in the print: ``"0.2 px"``.
        seed, replicates : int, optional
            Of the random numbers, where the table draws some.
        **options : str
            What the text leaves open, one of its alternatives each: ``angles="rectangle"``;
            `options` lists them.

        Returns
        -------
        Changed
            The computed values from the print and under the change, without a verdict; with
            options alone, what each cell would be judged as under that reading.

        Raises
        ------
        ValueError
            If the table does not read the cell, a value does not fit it, or there is no such
            option; the message lists what there is.
        """
        numbers = {"seed": seed, "replicates": replicates}
        return Changed(rerunning.rerun(self.key, changes, **numbers, chosen=options))

    def sweep(
        self,
        address: str | Sequence[str],
        values: Sequence[str | Sequence[str]],
        cells: Sequence[str] = (),
        *,
        replicates: int | None = None,
    ) -> Sweep:
        """Compute the table again for several values of one printed input.

        Parameters
        ----------
        address : str or sequence of str
            One of the cells in `reads`, or several that move together.
        values : sequence of str, or of sequences of str
            Values as in the print: ``["0.02 px", "0.05 px", "0.2 px"]``; one for each cell where
            several move together.
        cells : sequence of str, optional
            Names of the cells to show; all of them by default.
        replicates : int, optional
            Tables simulated for each value; those of the book by default.

        Returns
        -------
        Sweep
            One row per value; on a page a slider.
        """
        for name in cells:
            self[name]

        def compute(step: Change) -> Iterator[Point]:
            return of_cells(
                rerunning.rerun(self.key, step, replicates=replicates), cells
            )

        return swept(self.key, address, values, compute)

    def export(self, form: str) -> str:
        """Return the table as csv, json, latex or markdown."""
        return export(self._ledger, self.key, form, self._whole())

    def blocks(self) -> Iterator[Block]:
        """Yield the table with its notes, readings, reasons and where it comes from."""
        place, records = self._printed.place, self._ledger.of(self.key)
        yield self._whole()
        yield from _noted(self._printed.cells)
        if joint := self._ledger.table(self.key):
            yield verdicts.joint_sentence(joint)
        if any(record.readings for record in records):
            if joint and joint.readings > 1:
                yield verdicts.fitting(joint)
            yield readings.summary(place, records)
            listed = f'rp.table("{self.key}").readings lists them'
            whole = Html(lambda: html(self.readings.blocks()), listed)
            yield Fold("All readings of the text", (whole,))
        if results := [record for record in records if record.role == "result"]:
            made = catalogue()[self.key].computations
            yield Fold("How each cell was judged", tuple(_judged(place, results, made)))
        yield Html(
            self._bar,
            f"{self.key}: reproduce show {self.key}#CELL shows all about a cell",
        )

    def _bar(self) -> Markup:
        inputs = Markup(
            "<p>Printed in {}. Again: <code>{}</code></p>"
            "<p>Reads, directly or through other items: {}</p>"
        ).format(self.place, self.again, _linked(self.reads))
        files, where = table_files(self.key), anchor(self.key)
        return bar(self.key, where, files, self.source, inputs if self.reads else "")

    def _whole(self) -> Grid:
        printed, records = self._printed, self._records
        caption = Markup("<strong>{}.</strong> {}.").format(
            printed.place, printed.title
        )
        rows: list[list[Entry | Box]] = []
        if len(printed.columns) <= 1:
            anchors, named = [cell.anchor for cell in printed.cells], [*records]
            elsewhere = any(cell.place != printed.place for cell in printed.cells)
            for cell in printed.cells:
                parts = (write(records[cell.name]) for write in _PARTS.values())
                boxes = (Box(part, kind="rp-cell") for part in parts)
                rows.append([cell.label, *boxes, *[cell.place] * elsewhere])
            head = ["Quantity", *_PARTS, *["Where"] * elsewhere]
            return Grid(
                caption, head, rows, anchor(self.key), anchors=anchors, names=named
            )
        if any(record.role == "result" for record in records.values()):
            caption += " In each cell: printed, then computed, then the verdict."
        for row in printed.rows:
            own = (records[f"{row.id}.{column.id}"] for column in printed.columns)
            rows.append([row.label, *map(_stacked, own)])
        head = ["", *(column.label for column in printed.columns)]
        return Grid(
            caption, head, rows, anchor(self.key), stacked=[*map(str.lower, _PARTS)]
        )


def _stacked(record: Record) -> Box:
    cell, (printed, *rest) = (
        verdicts.cell_of(record),
        (w(record) for w in _PARTS.values()),
    )
    shown = (printed, *rest) if cell.is_number else (printed, "", "")
    return Box(shown, cell.anchor, "rp-cell", cell.name)


def _printed(record: Record) -> Markup:
    cell = verdicts.cell_of(record)
    shown = Markup('<span class="rp-printed">{}</span>').format(cell.shown)
    if cell.sigma:
        shown += Markup(' <span class="rp-sigma">{}σ</span>').format(cell.sigma)
    return shown + Markup("").join(
        Markup(" <small>{}</small>").format(n) for n in _notes(cell)
    )


def _notes(cell: PrintedCell) -> dict[str, str]:
    """Return what stands beside a print in a word or two, and why."""
    notes = {
        "unit ours": cell.unit_assumed if cell.is_number else "",
        "misprint?": cell.misprint,
    }
    return {word: text for word, text in notes.items() if text}


def _noted(cells: Iterable[PrintedCell]) -> Iterator[Markup]:
    """Yield in full what stands beside the prints, once for all cells that share it."""
    shared: dict[tuple[str, str], list[str]] = {}
    for cell in cells:
        for note in _notes(cell).items():
            shared.setdefault(note, []).append(cell.label)
    line = Markup("<small>{}</small>, {}: {}")
    for (word, text), labels in shared.items():
        yield line.format(
            word,
            "; ".join(labels) if len(labels) < FEW else f"{len(labels)} cells",
            text,
        )


def _computed(record: Record) -> Entry:
    text = verdicts.computed(record)
    return Markup('<span class="rp-computed">{}</span>').format(text) if text else ""


def _verdict(record: Record) -> Markup:
    marks = verdicts.flags(record.flags)
    flag = Markup(' <span class="rp-flag">{}</span>').format(marks) if marks else ""
    return link(anchor(record.cell), badge(record.verdict)) + flag


_PARTS = {"Printed": _printed, "Computed": _computed, "Verdict": _verdict}


def _judged(
    place: str, records: Sequence[Record], made: Sequence[Computation]
) -> Iterator[Block]:
    """Yield how results were judged: cell by cell, then each reason once, and what made them."""
    looks: dict[str, Any] = {"kind": "rp-small rp-numbers", "spare": True}
    yield grid(f"Details of {place}", {"cell": _link, **_NUMBERS}, records, **looks)
    reasons: dict[Entry, list[Record]] = {}
    for one in records:
        if one.verdict in {"differs", "ambiguous", "unpublished"}:
            reasons.setdefault(_reason(one), []).append(one)
    if reasons:
        yield grid(
            f"Reasons, {place}", _REASONS, reasons.values(), kind="rp-small", words=3
        )
    makes = {"makes": lambda one: ", ".join(one.cells)}
    yield grid(f"What computes {place}", makes | _MADE, made, words=4, **looks)


def _reason(record: Record) -> Entry:
    why = minus(reason(record.cell) or record.why)
    if known := erratum(record.cell):
        told = "{} {}<br>The authors' reply: {}"
        return Markup(told).format(
            why, link(known, f"Erratum {known}"), verdicts.replied(known)
        )
    return why


def _link(record: Record) -> Markup:
    return link(
        anchor(record.cell), Markup("<code>{}</code>").format(verdicts.name_of(record))
    )


_SHARE = "share of the tolerance"
_NUMBERS: dict[str, Callable[[Record], Entry]] = {
    "printed": lambda one: verdicts.cell_of(one).shown,
    "stands for": lambda one: verdicts.between(one, one.stands_for),
    "computed": lambda one: verdicts.quantity(
        verdicts.computed(one, extra=1), verdicts.unit(one)
    ),
    "Monte Carlo error": verdicts.error,
    "allowed by rounded inputs": lambda one: (
        verdicts.interval(one) * (one.probability is None)
    ),
    "predicted, central 99 %": lambda one: (
        verdicts.interval(one) * (one.probability is not None)
    ),
    _SHARE: lambda one: "" if one.share is None else f"{one.share:.2f}",
    "probability": verdicts.probability,
    "verdict": lambda one: one.verdict,
}
_SEED = "{} of the project, {} of this function; {:,} replicates"
_MADE: dict[str, Callable[[Computation], Entry]] = {
    "function": lambda one: Markup("{} ({})").format(
        link(f"function-{anchor(one.key)}-{one.function.__name__}", one.name), one.line
    ),
    "equations": lambda one: Markup(", ").join(
        link(f"equation-{one.key.partition('/')[0]}-{number}", f"({number})")
        for number in one.equations
    ),
    "seed": lambda one: (
        _SEED.format(*one.entropy, one.replicates) if one.replicates else ""
    ),
}
EVERY: dict[str, Callable[[Record], Entry]] = {
    "Cell": _link,
    "Table": lambda one: one.key,
    "Place": lambda one: one.place,
    **{head.capitalize(): _NUMBERS[head] for head in ("printed", "computed", _SHARE)},
    "Verdict": lambda one: badge(one.verdict, verdicts.qualified(one)),
    "Why": _reason,
}
_REASONS: dict[str, Callable[[Sequence[Record]], Entry]] = {
    "Cells": lambda some: Markup(", ").join(map(_link, some)),
    "Verdict": lambda some: some[0].verdict,
    "Why": lambda some: _reason(some[0]),
}


def _linked(addresses: Iterable[str]) -> Markup:
    """Write addresses, each a link; what several in a row begin with is said once."""

    def lead(address: str) -> str:
        name = address.partition("#")[2]
        return address.removesuffix(name.rpartition("." if "." in name else "-")[2])

    parts = []
    for start, some in groupby(addresses, lead):
        links = {one: link(anchor(one), one.removeprefix(start)) for one in some}
        alone = [link(anchor(one), one) for one in links if len(links) == 1]
        together = Markup("{}{{{}}}").format(start, Markup(",").join(links.values()))
        parts += alone or [together]
    return Markup(", ").join(parts)


def _read(record: Record) -> dict[str, Entry]:
    """Return the lines on the readings of a cell."""
    if record.readings is None:
        return {}
    found = record.readings
    closest = f"{verdicts.choices_text(found.closest.choices)}: "
    return {
        "readings": f"{found.agreeing} of {found.count} agree",
        "agrees with": verdicts.deciding(found),
        "closest reading": closest + verdicts.read(record, found.closest),
    }


class Cell(Shown):
    """One printed number: what the paper prints, what we compute, the verdict and why.

    Parameters
    ----------
    address : str
        Such as ``niu2024/table-3#scale.red``.
    """

    def __init__(self, address: str) -> None:
        key, _, name = address.partition("#")
        self.table = Table(key)
        self._cell: PrintedCell = library()[self.table.key][name]
        self.key = self.address = self._cell.address
        self._maker = maker(self.address)

    @cached_property
    def record(self) -> Record:
        """Everything that the ledger says of it."""
        return item_ledger(self.table.key).cell(self.address)

    @property
    def printed(self) -> str:
        """As a reader sees it, with its unit."""
        return self._cell.shown

    @property
    def computed(self) -> float | None:
        """Recomputed value or median of the prediction, in the unit of print."""
        return self.record.computed

    @property
    def verdict(self) -> str:
        """The verdict in one word."""
        return self.record.verdict

    @property
    def source(self) -> str:
        """The text of the function that makes it, empty for an input."""
        return "" if self._maker is None else text_of(self._maker.function)

    @property
    def options(self) -> pd.DataFrame:
        """What the text leaves open of its table."""
        return self.table.options

    def frame(self) -> pd.DataFrame:
        """Return its record as a column."""
        import pandas as pd

        return pd.DataFrame({self.address: self.record.model_dump()})

    def rerun(self, changes: Change | None = None, **settings: Any) -> Changed:
        """Compute the cell again with something that it reads changed, as `Table.rerun` does."""
        rerunning.checked_values(self.address, changes or {})
        return Changed(self.table.rerun(changes, **settings).result, self._cell.name)

    def export(self, form: str) -> str:
        """Return its record as csv, json, latex or markdown."""
        return export(item_ledger(self.table.key), self.address, form, self._whole())

    def blocks(self) -> Iterator[Block]:
        """Yield all that is known of the cell, a line each."""
        yield self._whole()

    def _whole(self) -> Grid:
        record, maker, known = self.record, self._maker, erratum(self.address)
        made = {head: write(maker) for head, write in _MADE.items()} if maker else {}
        told: dict[str, Entry] = {
            **{head: write(record) for head, write in _NUMBERS.items()},
            "verdict": f"{verdicts.qualified(record)}: {verdicts.MEANINGS[record.verdict]}",
            "why": minus(reason(self.address) or record.why),
            **made,
            "reads": _linked(self.reads),
            "erratum": link(known, known) if known else "",
            "the authors' reply": verdicts.replied(known) if known else "",
            **_read(record),
        }
        lines = [line for line in told.items() if line[1]]
        return Grid(
            self._cell.label, ("Cell", self.address), lines, kind="rp-one", words=2
        )
