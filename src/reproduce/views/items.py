"""Tables, cells and figures: printed beside computed, with where each comes from."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import RenderableType

from reproduce.judge import rerun as rerunning
from reproduce.judge.expected import reason
from reproduce.judge.ledger import Ledger, Record
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Computation, Drawing
from reproduce.printed.cells import Cell as PrintedCell
from reproduce.printed.cells import library
from reproduce.printed.units import symbol
from reproduce.views import keys, record_text, terminal
from reproduce.views.build import item_ledger
from reproduce.views.changed import Changed
from reproduce.views.grid import Grid
from reproduce.views.shown import Shown

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure as MatplotlibFigure

    from reproduce.views.sweep import Sweep

__all__ = ["Cell", "Figure", "Panels", "Table"]


class Item(Shown):
    """What tables, cells and figures share: where they come from."""

    def __init__(self, key: str) -> None:
        self.key = keys.check_key(key)

    @property
    def options(self) -> pd.DataFrame:
        """What the text leaves open: one row for each alternative, the literal one first."""
        import pandas as pd

        rows = [
            (name, way, words_of)
            for name, ways in rerunning.options(self.key).items()
            for way, words_of in ways.items()
        ]
        frame = pd.DataFrame(rows, columns=["option", "alternative", "what it stands for"])
        return frame.set_index(["option", "alternative"])

    @property
    def title(self) -> str:
        """What the item holds, in our words."""
        return keys.title(self.key)

    @property
    def place(self) -> str:
        """Where it stands in the paper."""
        return keys.place(self.key)

    @property
    def reads(self) -> tuple[str, ...]:
        """Addresses of all printed cells that it reads, directly or through other items."""
        return rerunning.changeable(self.key)

    @property
    def source(self) -> str:
        """The text of the functions that compute and draw it."""
        item = catalogue()[self.key]
        texts = [text_of(one) for one in item.computations]
        return "\n\n".join(texts if item.draw is None else [*texts, text_of(item.draw)])

    def cite(self, form: str = "bibtex") -> str:
        """Return how to cite the item and its paper: bibtex, csl or text."""
        from reproduce.views import cite as citing

        return citing.citation(self.key, form)


def text_of(computation: Computation | Drawing) -> str:
    """Return the text of the function that computes or draws."""
    return inspect.getsource(inspect.unwrap(computation.function)).rstrip()


class Table(Item):
    """A table or a group of quoted numbers: printed beside computed, with verdicts.

    Parameters
    ----------
    key : str
        Such as ``niu2024/table-3``.
    """

    def __init__(self, key: str) -> None:
        super().__init__(key)
        if self.key not in library():
            raise ValueError(f"{key} holds no printed numbers; try figure({key!r})")

    @cached_property
    def _ledger(self) -> Ledger:
        return item_ledger(self.key)

    def __getitem__(self, name: str) -> Cell:
        """Return one cell by its name, such as ``scale.red``."""
        return Cell(library()[self.key][name].address)

    def frame(self) -> pd.DataFrame:
        """Return the table in its own shape.

        Returns
        -------
        pandas.DataFrame
            Rows as in print. A table has columns as in print, each with printed, computed and
            verdict; a group of quoted numbers has these and the unit.
        """
        import pandas as pd

        table, wanted = library()[self.key], ("printed", "computed", "verdict")
        records = {record.cell.partition("#")[2]: record for record in self._ledger.of(self.key)}
        if len(table.columns) <= 1:
            rows = {name: (*_entry(one), symbol(one.unit) if one.unit else "")
                    for name, one in records.items()}  # fmt: skip
            return pd.DataFrame.from_dict(rows, orient="index", columns=[*wanted, "unit"])
        entries = {
            (column.id, what): [_entry(records[f"{row.id}.{column.id}"])[i] for row in table.rows]
            for column in table.columns
            for i, what in enumerate(wanted)
        }
        return pd.DataFrame(entries, index=[row.id for row in table.rows])

    def cells(self) -> pd.DataFrame:
        """Return one row per cell, with every field of the ledger."""
        from reproduce.views import export as exporting

        return exporting.full_frame(self._ledger.of(self.key))

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

    def sweep(self, address: str, values: Sequence[str], cells: Sequence[str] = ()) -> Sweep:
        """Compute the table again for several values of one printed input.

        Parameters
        ----------
        address : str
            One of the cells in `reads`.
        values : sequence of str
            Values as in the print: ``["0.02 px", "0.05 px", "0.2 px"]``.
        cells : sequence of str, optional
            Names of the cells to show; all of them by default.

        Returns
        -------
        Sweep
            One row per value; on a page a slider.
        """
        from reproduce.views.sweep import Sweep

        if not values:
            raise ValueError("expected at least one value to move the cell to, got none")
        for name in cells:
            self[name]
        reruns = tuple(rerunning.rerun(self.key, {address: value}) for value in values)
        return Sweep(address, tuple(values), reruns, tuple(cells))

    def export(self, form: str) -> str:
        """Return the table as csv, json, latex or markdown."""
        from reproduce.views import export as exporting

        return exporting.export(self._ledger, self.key, form)

    def _repr_html_(self) -> str:
        from reproduce.views import pages

        return pages.table(self.key)._repr_html_()

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield what a terminal of this many columns shows."""
        yield f"{self.key}: {self.title}"
        yield self.place
        yield terminal.records_table(self._ledger.of(self.key), width)
        yield from terminal.remarks(self._ledger, self.key)


def _entry(record: Record) -> tuple[str, str, str]:
    return record.printed, record_text.computed(record), record.verdict


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

    @property
    def address(self) -> str:
        """The cell's only name."""
        return self._cell.address

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
    def reads(self) -> tuple[str, ...]:
        """Addresses that the function that makes it reads itself."""
        made = rerunning.maker(self.address)
        return () if made is None else rerunning.reads(made)

    @property
    def source(self) -> str:
        """The text of the function that makes it, empty for an input."""
        made = rerunning.maker(self.address)
        return "" if made is None else text_of(made)

    def frame(self) -> pd.DataFrame:
        """Return its record as a column."""
        import pandas as pd

        return pd.DataFrame({self.address: self.record.model_dump()})

    @property
    def options(self) -> pd.DataFrame:
        """What the text leaves open of its table."""
        return self.table.options

    def rerun(
        self,
        changes: Mapping[str, str | float] | None = None,
        *,
        seed: int | None = None,
        replicates: int | None = None,
        **options: str,
    ) -> Changed:
        """Compute the cell again with something changed, as `Table.rerun` does."""
        whole = self.table.rerun(changes, seed=seed, replicates=replicates, **options)
        return Changed(whole.result, self._cell.name)

    def export(self, form: str) -> str:
        """Return its record as csv, json, latex or markdown."""
        from reproduce.views import export as exporting

        return exporting.export(item_ledger(self.table.key), self.address, form)

    def cite(self, form: str = "bibtex") -> str:
        """Return how to cite the cell's table and its paper."""
        from reproduce.views import cite as citing

        return citing.citation(self.table.key, form, self.address)

    def _lines(self) -> list[tuple[str, str]]:
        record = self.record
        value = record_text.computed(record, extra=1)
        unit = record_text.unit(record)
        lines = [
            ("printed", self.printed),
            ("computed", f"{value} {unit}".strip() if value else ""),
            ("allowed or predicted", record_text.interval(record)),
            ("probability", record_text.probability(record)),
            ("verdict", ", ".join((record.verdict, *record.flags))),
            ("why", reason(self.address) or record.why),
            ("function", record.function or ""),
            ("equations", ", ".join(f"({one})" for one in record.equations)),
            ("seed", ", ".join(map(str, record.seed or ()))),
            ("reads", ", ".join(self.reads)),
        ]
        lines += [
            (f"if {reading.name}", record_text.read(record, reading)) for reading in record.readings
        ]
        return [(name, text) for name, text in lines if text]

    def _repr_html_(self) -> str:
        return Grid(self._cell.label, ("", self.address), self._lines())._repr_html_()

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the cell with all that is known of it, a line each."""
        yield f"{self.address}: {self._cell.label}"
        yield from (f"  {name}: {text}" for name, text in self._lines())


class Figure(Item):
    """A figure, drawn from its caption and the text.

    Parameters
    ----------
    key : str
        Such as ``chen2023/fig-11a``.
    changes : mapping, optional
        Address of any cell in `reads` to a value as in the print.
    """

    def __init__(self, key: str, changes: Mapping[str, str | float] | None = None) -> None:
        super().__init__(key)
        drawing = catalogue()[self.key].draw
        if drawing is None:
            from reproduce.views import figures

            known = ", ".join(figures.drawable())
            raise ValueError(f"{key} has no figure; these have one: {known}")
        self._drawing = drawing
        self.changes = {address: str(value) for address, value in (changes or {}).items()}
        self._values = rerunning.checked_values(self.key, changes or {})

    @cached_property
    def _made(self) -> tuple[MatplotlibFigure, dict[str, float]]:
        from reproduce.views import figures

        if not self.changes:
            return figures.draw(self.key), {}
        with rerunning.told_why(self.key, self.changes):
            door, replaced = rerunning.door_under(self._drawing.given, self._values)
            return figures.draw(self.key, door), replaced

    @property
    def drawn(self) -> MatplotlibFigure:
        """The matplotlib figure."""
        return self._made[0]

    @property
    def replaced(self) -> dict[str, float]:
        """Printed inputs whose place a recomputed value took, in the unit of print."""
        return self._made[1]

    @cached_property
    def data(self) -> pd.DataFrame:
        """The lines and points that are drawn, in the units of the axes."""
        from reproduce.views import figures

        return figures.data(self.drawn)

    def frame(self) -> pd.DataFrame:
        """Return `data`."""
        return self.data

    def rerun(self, changes: Mapping[str, str | float] | None = None, **settings: object) -> Figure:
        """Return the figure computed and drawn again with other values for cells that it reads.

        Parameters
        ----------
        changes : mapping
            Address of any cell in `reads` to a value as in the print. What is marked as printed
            stays the print.

        Returns
        -------
        Figure
            With its own `data`.

        Raises
        ------
        ValueError
            If the figure does not read the cell, the value does not fit it, or anything but a
            cell is to be changed.
        """
        if settings:
            raise rerunning.CannotChangeError(
                f"{self.key} is a figure: expected cells that it reads, got {', '.join(settings)}"
            )
        return Figure(self.key, {**self.changes, **(changes or {})})

    def export(self, form: str) -> str:
        """Return the data as csv, json, latex or markdown."""
        from reproduce.views import export as exporting

        return exporting.export_frame(self.data, form)

    def save(self, path: str | Path) -> Path:
        """Write the figure; the ending chooses svg, pdf or png."""
        from reproduce.views import figures

        figures.check_ending(Path(path))  # before anything is drawn
        figures.save(self.drawn, Path(path))
        return Path(path)

    def _told(self) -> str:
        if not self.changes:
            return ""
        changed = ", ".join(f"{name} = {text}" for name, text in self.changes.items())
        told = f"With {changed}: a reader's own setting; what is marked as printed stays the print."
        if self.replaced:
            told += f" Recomputed values took the place of: {', '.join(self.replaced)}."
        return told

    def _repr_html_(self) -> str:
        from reproduce.printed.cells import anchor
        from reproduce.views.inline_svg import inline
        from reproduce.views.numbers import powers_in_html

        name = f"figure-{anchor(self.key)}" + ("-changed" if self.changes else "")
        return powers_in_html(inline(self.drawn, name, f"{self.title}. {self._told()}".rstrip()))

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield what the figure shows and how to look at it."""
        curves = self.data["curve"].nunique() if len(self.data) else 0
        yield f"{self.key}: {self.title}"
        yield f"{self.place}; {curves} curves, {len(self.data)} points in .data"
        if told := self._told():
            yield told
        setting = "".join(f' --set {name}="{text}"' for name, text in self.changes.items())
        yield f"Draw it with `reproduce figure {self.key} --out FILE.svg{setting}`."


class Panels(Shown):
    """A figure of several panels, such as ``chen2023/fig-11``, each drawn on its own.

    Parameters
    ----------
    key : str
        The key of the panels without their letters.
    panels : tuple of Figure
        One or more.
    """

    def __init__(self, key: str, panels: tuple[Figure, ...]) -> None:
        self.key, self.panels = key, panels

    @property
    def reads(self) -> tuple[str, ...]:
        """Addresses of all printed cells that any panel reads."""
        return tuple(dict.fromkeys(address for one in self.panels for address in one.reads))

    @property
    def source(self) -> str:
        """The text of the functions that compute and draw the panels."""
        return "\n\n".join(one.source for one in self.panels)

    @cached_property
    def data(self) -> pd.DataFrame:
        """The lines and points of all panels, with the key of each."""
        import pandas as pd

        return pd.concat([one.data.assign(figure=one.key) for one in self.panels])

    def frame(self) -> pd.DataFrame:
        """Return `data`."""
        return self.data

    def rerun(self, changes: Mapping[str, str | float] | None = None, **settings: object) -> Panels:
        """Return the panels drawn again; each takes the changes of cells that it reads."""
        told = dict(changes or {})
        if strays := [address for address in told if address not in self.reads]:
            raise rerunning.CannotChangeError(
                f"{self.key} does not read {', '.join(strays)}; it reads: "
                f"{', '.join(self.reads) or 'nothing'}"
            )
        again = (
            one.rerun({a: value for a, value in told.items() if a in one.reads}, **settings)
            for one in self.panels
        )
        return Panels(self.key, tuple(again))

    def export(self, form: str) -> str:
        """Return the data as csv, json, latex or markdown."""
        from reproduce.views import export as exporting

        return exporting.export_frame(self.data, form)

    def cite(self, form: str = "bibtex") -> str:
        """Return how to cite the panels and their paper."""
        return "\n\n".join(one.cite(form) for one in self.panels)

    def save(self, path: str | Path) -> list[Path]:
        """Write a file for each panel, its letter behind the name: fig.svg becomes fig-a.svg."""
        path = Path(path)
        return [one.save(path.with_stem(f"{path.stem}-{one.key[-1]}")) for one in self.panels]

    def _repr_html_(self) -> str:
        return "".join(one._repr_html_() for one in self.panels)

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield what each panel shows."""
        for one in self.panels:
            yield from one.parts(width)
