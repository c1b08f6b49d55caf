"""A table or a cell: printed and computed values with verdicts and sources."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from functools import cached_property
from typing import Any

import pandas as pd
from markupsafe import Markup

from reproduce.judge import rerun as rerunning
from reproduce.judge.ledger import Ledger, Record, item_ledger, record_of
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import changeable, computation_for
from reproduce.physics.validate import Text, checked
from reproduce.printed.cells import PrintedCell, anchor, library
from reproduce.printed.number import minus
from reproduce.views import _keys as keys
from reproduce.views import _verdicts as verdicts
from reproduce.views._base import NO_CHANGE, Change, ItemView, ResultView, text_of
from reproduce.views._blocks import (
    LOOKS,
    Block,
    Entry,
    Grid,
    Html,
    fold,
    link,
    plain,
    rendered,
    written,
)
from reproduce.views._export import (
    export_frame,
    full_frame,
    provenance_of,
    table_files,
)
from reproduce.views._readings import Readings
from reproduce.views._study import StudyTable
from reproduce.views._sweep import Changed, Point, Sweep


@checked
def table(address: Text) -> Table | Cell | StudyTable:
    """Return a table, a group of quoted numbers, one cell of it, or a supplementary table.

    Parameters
    ----------
    address : str
        Key such as ``niu2024/table-3``, cell such as ``niu2024/table-3#scale.red``, or
        supplementary table such as ``chen2023/heat``.

    Returns
    -------
    Table, Cell or StudyTable
        Printed next to computed values, with verdicts. A supplementary table has no verdicts.

    Raises
    ------
    TypeError
        If the address is not text.
    KeyError
        If there is no such item or cell.
    ValueError
        If it is a figure without printed numbers.

    Examples
    --------
    >>> table("niu2024/table-2")["scale.red"].verdict
    'exact'
    """
    key, _, name = address.partition("#")
    if name and key in library():
        return Cell(library()[key][name])
    if address in catalogue("studies"):
        return StudyTable(address)
    return Table(address)


class _Judged(ResultView):
    """A table or a cell of a paper."""

    @property
    def rerun_code(self) -> str:
        """A line of code that computes it with another value of an input that changes it."""
        change = rerunning.effective_change(self.key)
        call = '.rerun({{"{}": "{}"}})'.format(*change) if change else ""
        return f'rp.table("{self.key}"){call}'


class Table(ItemView, _Judged):
    """A table or a group of quoted numbers: printed and computed values with verdicts.

    Parameters
    ----------
    key : str
        Such as ``niu2024/table-3``.
    """

    def __init__(self, key: str) -> None:
        self.key = keys.check_key(key)
        if key not in library():
            raise ValueError(
                f"key: expected printed numbers, got the figure {key}. Use figure({key!r})"
            )
        self._printed = library()[key]

    @cached_property
    def _ledger(self) -> Ledger:
        return item_ledger(self.key)

    @checked
    def __getitem__(self, name: Text) -> Cell:
        """Return one cell by its name, such as ``scale.red``."""
        return Cell(self._printed[name])

    def frame(self) -> pd.DataFrame:
        """Return the table in the layout of the paper.

        Returns
        -------
        pandas.DataFrame
            Rows and columns as in the paper, each column with printed, computed and verdict. A
            group of quoted numbers has these columns and the unit.
        """
        records = self._ledger.records
        rows = [(r.printed, verdicts.computed(r), r.verdict) for r in records]
        frame = pd.DataFrame(rows, columns=["printed", "computed", "verdict"])
        if len(self._printed.columns) <= 1:
            frame.index = pd.Index(self._printed.by_name)
            units = [cell.symbol for cell in self._printed.cells]
            return frame.assign(unit=units)
        frame.index = self._lines("id")
        wide = pd.DataFrame(frame.unstack(sort=False)).swaplevel(axis=1)
        return wide[frame.index.unique(1)]

    def _lines(self, name: str) -> pd.MultiIndex:
        """Return the id or the label of the row and of the column of each cell."""
        parts = self._printed.rows, self._printed.columns
        lines = [[getattr(line, name) for line in part] for part in parts]
        return pd.MultiIndex.from_product(lines)

    @property
    def readings(self) -> Readings:
        """All readings of the text: every combination of `options`."""
        return Readings(self.key)

    def rerun(
        self,
        changes: Change = NO_CHANGE,
        *,
        seed: int | None = None,
        replicates: int | None = None,
        **options: str,
    ) -> Changed:
        """Compute the table with changed inputs, or under a reading of the text.

        Parameters
        ----------
        changes : mapping, optional
            Address of any cell in `inputs` to a value as printed: ``"0.2 px"``.
        seed, replicates : int, optional
            Seed and number of the simulated tables, if the table draws random numbers.
        **options : str
            An alternative for an option of the text: ``angles="rectangle"``. `options` lists
            them.

        Returns
        -------
        Changed
            The computed values without and with the change, without a verdict. With options
            only, the verdict of each cell under that reading.

        Raises
        ------
        TypeError
            If the changes are no mapping of addresses, or a number is not whole.
        ValueError
            If a cell is not an input, a value does not fit its cell, or an option is unknown.
        """
        return Changed(
            rerunning.Rerun(
                self.key, changes, seed=seed, replicates=replicates, chosen=options
            )
        )

    def sweep(
        self,
        address: str | Sequence[str],
        values: Sequence[str | Sequence[str]],
        cells: Sequence[str] = (),
        *,
        replicates: int | None = None,
    ) -> Sweep:
        """Compute the table for several values of a printed input.

        Parameters
        ----------
        address : str or sequence of str
            A cell in `inputs`, or several cells that change together.
        values : sequence of str, or of sequences of str
            Values as printed: ``["0.02 px", "0.05 px", "0.2 px"]``; a tuple of values for
            several cells.
        cells : sequence of str, optional
            Names of the cells to show; all of them by default.
        replicates : int, optional
            Number of tables simulated for each value; that of the book by default.

        Returns
        -------
        Sweep
            One row per value, with a slider on a page.

        Raises
        ------
        TypeError
            If the address is not text.
        ValueError
            If a value does not fit its cell, or a cell to show is not computed.
        """

        def compute(step: Change) -> Iterator[Point]:
            changed = self.rerun(step, replicates=replicates)
            return Changed(changed.result, cells).points()

        return Sweep(self._printed.place, address, values, compute)

    def export(self, form: str) -> str:
        """Return the table as csv, json, latex, markdown or covariance.

        A table with several columns has the layout of the paper, with a line for each value:
        printed, recomputed, and the ends of its interval. A group of quoted numbers has a row for
        each cell. JSON contains every field of the ledger. The covariance is between the cells.
        """
        keys.check_choice("format", form, table_files(self.key).values())
        if form == "covariance":
            from reproduce.views._reports import covariance

            given = provenance_of(self.cite("text"), "covariance, literal reading")
            return export_frame(covariance(self.key), "csv", given)
        if form == "json":
            return self._ledger.model_copy(update=self.provenance).model_dump_json(
                indent=2
            )
        table = self._printed
        records = self._ledger.records
        frame = pd.DataFrame([_values(record, form) for record in records])
        frame = frame.loc[:, frame.any()]
        if len(table.columns) > 1:
            frame.index = self._lines("label")
            stacked = pd.Series(frame.stack()).unstack(1, sort=False)
            frame = stacked[stacked.any(axis=1)].reset_index(names=["row", "value"])
            if form != "csv":
                frame.loc[frame["row"].duplicated(), "row"] = ""
                frame = frame.rename(columns={"row": "", "value": ""})
        else:
            frame.insert(0, "quantity", [cell.label for cell in table.cells])
            places = [cell.place for cell in table.cells]
            if len({*places}) > 1:
                frame["place"] = places
        return export_frame(
            frame,
            form,
            self.provenance,
            self.key,
            caption=f"{table.place}. {table.title}.",
            legend=written("legend.txt", records=records),
        )

    def blocks(self) -> Iterator[Block]:
        """Yield the table with its notes, readings, reasons and sources."""
        table = self._printed
        records = self._ledger.records
        results = [record for record in records if record.role == "result"]
        caption = f"{table.place}. {table.title}."
        if results and len(table.columns) > 1:
            caption += " In each cell: printed, then computed, then the verdict."
        page = rendered(
            "table",
            table=table,
            records=dict(zip(table.by_name, records, strict=True)),
            verdicts=verdicts,
            flags=verdicts.flags,
            notes=_notes,
            caption=caption,
        )
        rows = [
            {
                "cell": cell.name,
                "Printed": " ".join((verdicts.printed(cell), *_notes(cell))),
                "Computed": verdicts.computed(record),
                "Verdict": " ".join(
                    (verdicts.qualified(record), verdicts.replied_state(record))
                ).rstrip(),
            }
            for cell, record in zip(table.cells, records, strict=True)
        ]
        yield Html(page, Grid.of(caption, rows[0], rows))
        notes = Counter(note for cell in table.cells for note in _notes(cell).items())
        for (word, text), count in notes.items():
            cells = f"{count} cells" if count > 1 else "1 cell"
            yield Markup("<small>{}</small>, {}: {}").format(word, cells, text)
        for joint in self._ledger.tables:
            yield verdicts.joint_sentence(joint)
        shown = [verdicts.texts(record) for record in results]
        if readings := [row for row in shown if "closest reading" in row]:
            yield Grid.of(
                f"Readings of {table.place}, cell by cell",
                (
                    "cell",
                    "printed",
                    "readings that agree",
                    "agrees with",
                    "closest reading",
                ),
                readings,
                kind="rp-small rp-readings",
            )
            whole = Html(
                lambda: self.readings.markup,
                f'rp.table("{self.key}").readings lists them',
            )
            yield fold("All readings of the text", whole)
        if results:
            yield fold(
                "How each cell was judged", *_judged(table.place, results, shown)
            )

        yield Html(
            lambda: self._toolbar(anchor(self.key)),
            f"{self.key}: reproduce show {self.key}#CELL shows all about a cell",
        )


def _values(record: Record, form: str) -> dict[str, str]:
    """Return the values of a record with the displayed digits.

    In CSV unit, standard deviations and verdict have their own names.
    """
    cell = record.printed_cell
    computed = verdicts.computed(record)
    ends = [minus(cell.number.format(e)) for e in record.interval or ()]
    low, high = ends if len({*ends}) > 1 else ("", "")
    texts = {
        "printed": verdicts.printed(cell),
        "recomputed": computed,
        "from": low,
        "to": high,
    }
    if form == "csv":
        texts |= {
            "printed": cell.text,
            "unit": cell.symbol,
            "sigma": str(cell.sigma or ""),
            "verdict": record.verdict if cell.is_number else "",
        }
        return {name: text.replace("−", "-") for name, text in texts.items()}
    if sign := LOOKS[record.verdict]["sign"]:
        weak = "*" * verdicts.weak([record])
        texts["recomputed"] = f"{computed or '–'}{sign}{weak}"
    return texts


def _notes(cell: PrintedCell) -> dict[str, str]:
    """Return the notes on a printed value, by the words next to it."""
    unit = cell.unit_assumed if cell.is_number else ""
    notes = {"assumed unit": unit, "possible misprint": cell.misprint}
    return {word: text for word, text in notes.items() if text}


def _judged(
    place: str, records: Sequence[Record], rows: list[dict[str, Entry]]
) -> Iterator[Block]:
    """Yield the numbers of results, the reasons of verdicts, and the computations."""
    columns = ("cell", *verdicts.NUMBERS, "verdict")
    kind = "rp-small rp-numbers"
    yield Html(Grid.of(f"Details of {place}", columns, rows, kind=kind).markup)
    reasons = [row for row, one in zip(rows, records, strict=True) if not one.agrees]
    if reasons:
        yield _grouped(f"Reasons, {place}", ["verdict", "why"], reasons)
    made = _grouped(f"What computes {place}", ["function", "equations", "seed"], rows)
    yield Html(made.markup)


def _grouped(caption: str, columns: list[str], rows: list[dict[str, Entry]]) -> Grid:
    """Return a table with a row for each combination of texts, and its cells."""
    frame = pd.DataFrame(rows, columns=["cell", *columns], dtype=object).fillna("")
    groups = frame.groupby(columns, sort=False)["cell"].agg(Markup(", ").join)
    lines = groups.reset_index(name="cells").set_index("cells")
    return Grid.of_frame(caption, lines, kind="rp-small")


class Cell(_Judged):
    """One printed number: the printed value, the computed value, the verdict and its reason.

    Parameters
    ----------
    cell : PrintedCell
        The printed cell.
    """

    def __init__(self, cell: PrintedCell) -> None:
        self._cell, self.key, self.address = cell, cell.address, cell.address

    @property
    def table(self) -> Table:
        """Its table."""
        return Table(self._cell.key)

    @cached_property
    def record(self) -> Record:
        """The record of the ledger."""
        return record_of(self.address)

    @property
    def printed(self) -> str:
        """The printed value with its unit."""
        return self._cell.shown

    @property
    def computed(self) -> float | None:
        """Computed value or median of the prediction, in the printed unit."""
        return self.record.computed

    @property
    def verdict(self) -> str:
        """The verdict in one word."""
        return self.record.verdict

    @property
    def source(self) -> str:
        """Source code of the function that computes the cell, empty for an input."""
        made = computation_for(self.address)
        return text_of(made.function) if made else ""

    def frame(self) -> pd.DataFrame:
        """Return its record as a column."""
        return pd.DataFrame({self.address: self.record.model_dump()})

    def rerun(self, changes: Change = NO_CHANGE, **settings: Any) -> Changed:
        """Compute the cell again with changed inputs, as `Table.rerun`."""
        rerunning.checked_values(self.address, changes)
        return Changed(self.table.rerun(changes, **settings).result, [self._cell.name])

    def export(self, form: str) -> str:
        """Return its record as csv, json, latex or markdown."""
        if form == "json":
            part = Ledger(records=(self.record,), tables=())
            return part.model_copy(update=self.provenance).model_dump_json(indent=2)
        frame = full_frame([self.record])
        if form != "csv":
            (grid,) = self.blocks()
            frame = pd.DataFrame(grid.rows, columns=[*grid.head]).map(plain)
        return export_frame(
            frame, form, self.provenance, self.address, f"{self._cell.label}."
        )

    def blocks(self) -> list[Grid]:
        """Return a table with a row for each property of the cell."""
        meaning = LOOKS[self.verdict]["meaning"]
        shown = verdicts.texts(self.record) | {
            "cell": "",  # named above
            "verdict": f"{verdicts.qualified(self.record)}: {meaning}",
            "inputs": Markup(", ").join(
                link(anchor(a), a) for a in changeable(self.key)
            ),
        }
        lines = [line for line in shown.items() if line[1]]
        return [Grid(self._cell.label, ("Cell", self.address), lines, kind="rp-one")]
