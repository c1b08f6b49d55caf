"""A table or a cell: printed beside computed, with where each comes from."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from reproduce.judge import rerun as rerunning
from reproduce.judge.ledger import Ledger, Record, TableRecord, WholeReading, erratum, reason
from reproduce.judge.rerun import ChangedCell, Rerun
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Computation
from reproduce.printed.cells import Cell as PrintedCell
from reproduce.printed.cells import anchor, find, library
from reproduce.printed.number import symbol
from reproduce.views import keys, verdicts
from reproduce.views.base import Item, Shown, by_row, setting, text_of
from reproduce.views.blocks import Block, Box, Entry, Fold, Grid, Html, badge, grid, html
from reproduce.views.computed import item_ledger
from reproduce.views.display import Display
from reproduce.views.export import bar, citation, export, full_frame, table_files
from reproduce.views.numbers import minus
from reproduce.views.sweep import Sweep, of_cells, swept

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
        if len(table.columns) <= 1:
            return by_row(entries, [*wanted, "unit"])
        shaped = {
            (column.id, what): [entries[f"{row.id}.{column.id}"][i] for row in table.rows]
            for column in table.columns
            for i, what in enumerate(wanted)
        }
        return pd.DataFrame(shaped, index=[row.id for row in table.rows])

    def cells(self) -> pd.DataFrame:
        """Return one row per cell, with every field of the ledger."""
        return full_frame(self._ledger.of(self.key))

    def rerun(
        self,
        changes: Mapping[str, str | float] | None = None,
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
        return Changed(
            rerunning.rerun(self.key, changes, seed=seed, replicates=replicates, chosen=options)
        )

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
        return swept(
            self.key,
            address,
            values,
            lambda step: of_cells(rerunning.rerun(self.key, step, replicates=replicates), cells),
        )

    def export(self, form: str) -> str:
        """Return the table as csv, json, latex or markdown."""
        return export(self._ledger, self.key, form)

    def blocks(self) -> Iterator[Block]:
        """Yield the table with its notes, readings, reasons and where it comes from."""
        place, records = self._printed.place, self._ledger.of(self.key)
        files, inputs = table_files(self.key), self._inputs()
        yield self._whole()
        yield from _noted(self._printed.cells)
        if joint := self._ledger.table(self.key):
            yield _joint_sentence(joint)
        if readings := _readings(place, records):
            fits = self._ledger.whole_readings(self.key)
            whole = grid(f"Readings of {place}, at once", _WHOLE, fits, kind="rp-small")
            yield verdicts.fitting(fits)
            yield Fold("Readings of the text, side by side", (*readings, whole))
        if results := [record for record in records if record.role == "result"]:
            yield Fold("How each cell was judged", tuple(_judged(place, results)))
        below = bar(self.key, anchor(self.key), files, self.source, inputs=inputs)
        yield Html(below, f"{self.key}: reproduce show {self.key}#CELL shows all about a cell")

    def _whole(self) -> Grid:
        printed, records = self._printed, self._records
        caption = Markup("<strong>{}.</strong> {}.").format(printed.place, printed.title)
        rows: list[list[Entry | Box]] = []
        if len(printed.columns) <= 1:
            elsewhere = any(cell.place != printed.place for cell in printed.cells)
            for cell in printed.cells:
                record = records[cell.name]
                texts: list[Entry] = [_printed(cell), _computed(record), _verdict(record)]
                texts += [cell.place] if elsewhere else []
                kind = f"rp-cell rp-{record.verdict}"
                rows.append([cell.label, *(Box(text, kind=kind) for text in texts)])
            head = ["Quantity", "Printed", "Computed", "Verdict", *["Where"] * elsewhere]
            anchors = [cell.anchor for cell in printed.cells]
            named = list(printed.by_name)
            return Grid(caption, head, rows, anchor(self.key), anchors=anchors, names=named)
        if any(record.role == "result" for record in records.values()):
            caption += " In each cell: printed, then computed, then the verdict."
        for row in printed.rows:
            names = [f"{row.id}.{column.id}" for column in printed.columns]
            rows.append([row.label, *(_cell(printed[name], records[name]) for name in names)])
        head = ["", *(column.label for column in printed.columns)]
        stacked = ("printed", "computed", "verdict")
        return Grid(caption, head, rows, anchor(self.key), stacked=stacked)

    def _inputs(self) -> Markup:
        """Say what the table is computed from, each printed cell a link; nothing if it is not."""
        if not self.reads:
            return Markup("")
        made = [one for one in catalogue()[self.key].computations if one.replicates]
        told = [f"{one.function.__name__} draws random numbers: seed {_seed(one)}." for one in made]
        told = [f"Printed in {self.place}.", *told, "Reads, directly or through other items:"]
        link = Markup('<a href="#{}"><code>{}</code></a>')
        items = [
            Markup("<li><code>{}</code>{}</li>").format(
                lead, Markup(", ").join(link.format(anchor(lead + end), end) for end in ends)
            )
            for lead, ends in keys.alike(self.reads).items()
        ]
        said = Markup("").join(map(Markup("<p>{}</p>").format, told))
        return said + Markup("<ul>{}</ul>").format(Markup("").join(items))


def _cell(cell: PrintedCell, record: Record) -> Box:
    parts = (_printed(cell), _computed(record), _verdict(record))
    shown = parts if cell.is_number else (parts[0], "", "")
    return Box(shown, cell.anchor, f"rp-cell rp-{record.verdict}", cell.name)


def _printed(cell: PrintedCell) -> Markup:
    shown = Markup('<span class="rp-printed">{}</span>').format(cell.shown)
    if cell.sigma:
        shown += Markup(' <span class="rp-sigma">{}σ</span>').format(cell.sigma)
    return shown + Markup("").join(Markup(" <small>{}</small>").format(n) for n in _notes(cell))


def _notes(cell: PrintedCell) -> dict[str, str]:
    """Return what stands beside a print in a word or two, and why."""
    notes = {"unit ours": cell.unit_assumed if cell.is_number else "", "misprint?": cell.misprint}
    return {word: text for word, text in notes.items() if text}


def _noted(cells: Iterable[PrintedCell]) -> Iterator[Markup]:
    """Yield in full what stands beside the prints, once for all cells that share it."""
    shared: dict[tuple[str, str], list[str]] = {}
    for cell in cells:
        for note in _notes(cell).items():
            shared.setdefault(note, []).append(cell.label)
    line = Markup("<small>{}</small>, {}: {}")
    for (word, text), labels in shared.items():
        yield line.format(word, "; ".join(labels) if len(labels) < FEW else f"{len(labels)} cells",
                          text)  # fmt: skip


def _computed(record: Record) -> Entry:
    text = verdicts.computed(record)
    return Markup('<span class="rp-computed">{}</span>').format(text) if text else ""


def _verdict(record: Record) -> Markup:
    marks = verdicts.flags(record.flags, {*verdicts.WEAK, "stand_in"})
    link = Markup('<a href="#{}">{}</a>').format(anchor(record.cell), badge(record.verdict))
    return link + (Markup(' <span class="rp-flag">{}</span>').format(marks) if marks else "")


def _judged(place: str, records: Sequence[Record]) -> Iterator[Block]:
    """Yield how results were judged: cell by cell, then each reason and flag once."""
    yield grid(f"Details of {place}", _DETAILS, records, kind="rp-small", spare=True)
    reasons: dict[Entry, list[Record]] = {}
    for one in records:
        if one.verdict in {"differs", "blocked"}:
            reasons.setdefault(_reason(one), []).append(one)
    if reasons:
        yield grid(f"Reasons, {place}", _REASONS, reasons.values(), kind="rp-small", words=3)


def _reason(record: Record) -> Entry:
    why = minus(reason(record.cell) or record.why)
    if known := erratum(record.cell):
        told = '{0} <a href="#{1}">Erratum {1}</a><br>The authors\' reply: {2}'
        return Markup(told).format(why, known, _replied(known))
    return why


def _replied(known: str) -> Entry:
    from reproduce.views.contradictions import replied  # only now: it loads the audit

    return replied(known)


def _link(record: Record) -> Markup:
    link = Markup('<a href="#{}"><code>{}</code></a>')
    return link.format(anchor(record.cell), verdicts.name_of(record))


_DETAILS: dict[str, Callable[[Record], Entry]] = {
    "Cell": _link,
    "Printed": lambda one: verdicts.cell_of(one).shown,
    "Computed": lambda one: verdicts.computed(one, extra=1),
    "Allowed or predicted": verdicts.interval,
    "Probability": verdicts.probability,
    "Share of tolerance": lambda one: "" if one.share is None else f"{one.share:.2f}",
    "Verdict": lambda one: one.verdict,
}
EVERY: dict[str, Callable[[Record], Entry]] = {
    "Cell": _link,
    "Table": lambda one: one.key,
    "Place": lambda one: one.place,
    **{head: _DETAILS[head] for head in ("Printed", "Computed", "Share of tolerance")},
    "Verdict": lambda one: badge(one.verdict, verdicts.qualified(one)),
    "Why": _reason,
}
_REASONS: dict[str, Callable[[Sequence[Record]], Entry]] = {
    "Cells": lambda some: Markup(", ").join(map(_link, some)),
    "Verdict": lambda some: some[0].verdict,
    "Why": lambda some: _reason(some[0]),
}


def _readings(place: str, records: tuple[Record, ...]) -> list[Grid]:
    """Lay out the readings of blocked cells, one table for cells that share their readings."""
    groups: dict[tuple[tuple[str, str], ...], list[Record]] = {}
    for record in records:
        if record.readings:
            names = tuple((one.name, f"{one.place}; added {one.added}") for one in record.readings)
            groups.setdefault(names, []).append(record)
    grids = []
    for number, (names, group) in enumerate(groups.items(), start=1):
        head = [Markup("{}<br><small>{}</small>").format(name, place) for name, place in names]
        cells = [
            Markup("{} {}").format(_link(record), verdicts.cell_of(record).shown)
            for record in group
        ]
        body = [[verdicts.read(record, one) for one in record.readings] for record in group]
        if len(group) <= len(names):
            head, cells, body = cells, head, [list(row) for row in zip(*body, strict=True)]
        rows = [[label, *row] for label, row in zip(cells, body, strict=True)]
        grids.append(Grid(f"Readings of {place}, {number}", ["", *head], rows, kind="rp-small"))
    return grids


_WHOLE: dict[str, Callable[[WholeReading], Entry]] = {
    "Reading of all open cells at once": lambda one: one.name,
    "Added": lambda one: one.added,
    "Cells that agree": lambda one: verdicts.whole(one).partition(";")[0],
    "Together": verdicts.chance_of,
}


def _joint_sentence(joint: TableRecord) -> str:
    return (
        f"Outside the central 99 % of the prediction lie {joint.outside} of {joint.cells} "
        f"predicted cells; chance alone would put {joint.expected_outside:.2g} there. The "
        "probability of a table as surprising as the printed one, or more, is "
        f"{verdicts.joint_chance(joint)} ({joint.replicates:,} tables simulated)."
    )


def _seed(made: Computation) -> str:
    """Say where the random numbers of a computation come from, empty where there are none."""
    if not made.replicates:
        return ""
    project, own = made.entropy
    return f"{project} of the project, {own} of this function; {made.replicates:,} replicates"


def _braced(lead: str, ends: Sequence[str]) -> str:
    return f"{lead}{ends[0]}" if len(ends) == 1 else f"{lead}{{{','.join(ends)}}}"


class Changed(Display):
    """A table or cell computed again under a reader's own change, which has no verdict.

    With nothing but options it is a reading of the text: each cell says what it would be judged as.

    Parameters
    ----------
    result : reproduce.judge.rerun.Rerun
        What was computed: ``changes``, ``options``, and the printed inputs whose place a
        recomputed value took, ``replaced``.
    name : str
        The one cell that is asked for; all of them by default.
    """

    def __init__(self, result: Rerun, name: str = "") -> None:
        self.result = result
        self.changes, self.options, self.replaced = result.changes, result.options, result.replaced
        self._cells = [one for one in result.cells if name in {"", one.cell.name}]

    def frame(self) -> pd.DataFrame:
        """Return printed, computed from the print, value under the change and difference.

        Returns
        -------
        pandas.DataFrame
            One row per computed cell, in the unit of print, with the central 99 % where it is a
            prediction; a reading of the text has the verdict that it ``would be``.
        """
        import pandas as pd

        frame = pd.DataFrame(map(_row, self._cells)).set_index("cell")
        return frame.drop(columns=[n for n in ("reading", "would be") if not frame[n].any()])

    def _caption(self) -> str:
        remark = "a reader's own setting, without a verdict"
        if self.result.is_reading:
            remark = (
                "one reading of the text, with what each cell "
                "would be judged as. The verdict of a cell takes every reading into account"
            )
        changed = {**self.changes, **self.options}
        told = setting(f"{self.result.key} with", changed, self.replaced, remark)
        if any(one.interval for one in self._cells):
            told += " From and to: the central 99 % of the prediction."
        if self.result.joint:
            told += f" {_joint_sentence(self.result.joint)}"
        return told

    @property
    def grid(self) -> Grid:
        """The cells and what was changed, as a reader sees them; without empty columns."""
        rows = [one for one in self._cells if one.cell.is_number]
        shown = {head: write for head, write in self._columns().items() if any(map(write, rows))}
        return grid(self._caption(), shown, rows, whole=range(1, len(shown)))

    def _columns(self) -> dict[str, Callable[[ChangedCell], str]]:
        reading = self.result.is_reading
        return {
            "cell": lambda one: one.cell.name + f" if {one.reading}" * bool(one.reading),
            "printed": lambda one: minus(one.cell.text),
            "from the print": lambda one: "" if reading else _digits(one, one.unchanged),
            "so read" if reading else "changed": lambda one: _digits(one, one.value),
            "from": lambda one: _digits(one, (one.interval or (None, None))[0]),
            "to": lambda one: _digits(one, (one.interval or (None, None))[1]),
            "would be": lambda one: one.would_be,
            "unit": lambda one: symbol(one.cell.unit),
        }

    def blocks(self) -> Iterator[Block]:
        """Yield the cells and what was changed."""
        yield self.grid


def _digits(one: ChangedCell, value: float | None) -> str:
    return "" if value is None else minus(one.cell.number.format(value, extra=1))


def _row(one: ChangedCell) -> dict[str, Any]:
    value, cell = one.value, one.cell
    return {
        "cell": cell.name,
        "reading": one.reading,
        "printed": cell.text,
        "unchanged": one.unchanged,
        "changed": value,
        "changed - printed": value - cell.number.value
        if value is not None and cell.is_number
        else None,
        "low": (one.interval or (None, None))[0],
        "high": (one.interval or (None, None))[1],
        "unit": symbol(cell.unit) if cell.unit else "",
        "would be": one.would_be,
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
        self._maker = rerunning.maker(self.address)

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

    def rerun(self, changes: Mapping[str, str | float] | None = None, **settings: Any) -> Changed:
        """Compute the cell again with something that it reads changed, as `Table.rerun` does."""
        rerunning.checked_values(self.address, changes or {})
        return Changed(self.table.rerun(changes, **settings).result, self._cell.name)

    def export(self, form: str) -> str:
        """Return its record as csv, json, latex or markdown."""
        return export(item_ledger(self.table.key), self.address, form)

    def _lines(self) -> list[tuple[str, Entry]]:
        record, maker, paper = self.record, self._maker, self.key.partition("/")[0]
        value = verdicts.computed(record, extra=1)
        predicted = record.probability is not None
        meaning = "predicted, central 99 %" if predicted else "allowed by rounded inputs"
        link, unit = Markup('<a href="#{}">{}</a>').format, verdicts.unit(record)
        numbers = (link(f"equation-{paper}-{one}", f"({one})") for one in record.equations)
        reads = (link(anchor(lead + ends[0]), _braced(lead, ends))
                 for lead, ends in keys.alike(self.reads).items())  # fmt: skip
        known, apart = erratum(self.address), verdicts.difference(record)
        lines: list[tuple[str, Entry]] = [
            ("printed", self.printed),
            ("which may mean", verdicts.loosely(record)),
            ("computed", verdicts.quantity(value, unit) if value else ""),
            (meaning, verdicts.interval(record, unit=True)),
            ("difference", verdicts.quantity(apart, unit) if apart else ""),
            ("share of the tolerance", "" if record.share is None else f"{record.share:.2f}"),
            ("probability", verdicts.probability(record)),
            ("verdict", ", ".join((record.verdict, *record.flags))),
            ("why", minus(reason(self.address) or record.why)),
            ("function", f"{record.function} ({maker.line})" if maker else ""),
            ("equations", Markup(", ").join(numbers)),
            ("seed", _seed(maker) if maker else ""),
            ("reads", Markup(", ").join(reads)),
            ("erratum", link(known, known) if known else ""),
            ("the authors' reply", _replied(known) if known else ""),
            *((f"if {one.name}", verdicts.read(record, one)) for one in record.readings),
        ]
        return [(name, text) for name, text in lines if text]

    def blocks(self) -> Iterator[Block]:
        """Yield all that is known of the cell, a line each."""
        lines = self._lines()
        yield Grid(self._cell.label, ("Cell", self.address), lines, kind="rp-one", words=2)

    def card(self) -> str:
        """Return what a page shows beside a link to the cell: all of it, and what to take away."""
        again = f'rp.table("{self.address}")'
        if changed := next((one for one in self.reads if find(one)[0].is_number), ""):
            again += f'.rerun({{"{changed}": "{find(changed)[0].text}"}})'
        forms = {"citation": "text", "BibTeX": "bibtex", "RIS": "ris"}
        copied = {name: citation(self.address, form) for name, form in forms.items()}
        button = Markup('<button type="button" data-{}="{}">Copy {}</button>').format
        taken = [button("link", f"#{self._cell.anchor}", "link")]
        taken += [button("copy", text, name) for name, text in (copied | {"code": again}).items()]
        taken.append(Markup('<a href="#tables/{}.json">JSON</a>').format(anchor(self.table.key)))
        return Markup("<p>{}</p>").format(Markup(" ").join(taken)) + Markup(html(self.blocks()))
