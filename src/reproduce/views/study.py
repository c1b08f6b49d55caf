"""Tables of our own, which no paper prints: what `table` shows for the key of a study."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from markupsafe import Markup
from rich.console import RenderableType

from reproduce.judge import rerun as rerunning
from reproduce.judge.studies import studies
from reproduce.papers.study import Column
from reproduce.views import numbers
from reproduce.views.grid import Entry, Grid
from reproduce.views.shown import Shown

if TYPE_CHECKING:
    import pandas as pd


class StudyTable(Shown):
    """A table that stands beside a paper, judged against nothing.

    Parameters
    ----------
    key : str
        Such as ``chen2023/heat``.
    changes : mapping, optional
        Address of any cell in `reads` to a value as in the print.
    """

    def __init__(self, key: str, changes: Mapping[str, str | float] | None = None) -> None:
        self.key = key
        self._study = studies()[key]
        self._changes = dict(changes or {})
        self._values = rerunning.checked_values(key, self._changes)

    @property
    def title(self) -> str:
        """What it shows, in one sentence."""
        return self._study.title

    @property
    def reads(self) -> tuple[str, ...]:
        """Addresses of all printed cells that it reads, directly or through other items."""
        return rerunning.changeable(self.key)

    @property
    def changes(self) -> dict[str, str]:
        """What was changed: address to the value as given."""
        return {address: str(value) for address, value in self._changes.items()}

    @property
    def replaced(self) -> dict[str, float]:
        """Printed inputs whose place a recomputed value took, in the unit of print."""
        return self._made[1]

    @property
    def source(self) -> str:
        """The text of the function that computes it."""
        return inspect.getsource(self._study.function).rstrip()

    @cached_property
    def _made(self) -> tuple[pd.DataFrame, dict[str, float]]:
        if not self._changes:
            return self._study(), {}
        with rerunning.told_why(self.key, self.changes):
            door, replaced = rerunning.door_under(self._study.given, self._values)
            return self._study(door), replaced

    def frame(self) -> pd.DataFrame:
        """Return the numbers, a row for each row of the table, in the units of the heads."""
        return self._made[0]

    def rerun(self, changes: Mapping[str, str | float]) -> StudyTable:
        """Return the table computed again with other values for cells that it reads.

        Parameters
        ----------
        changes : mapping
            Address of any cell in `reads` to a value as in the print.

        Returns
        -------
        StudyTable
            With `changes` and what they `replaced`.

        Raises
        ------
        ValueError
            If the study does not read the cell, or the value does not fit it.
        """
        return StudyTable(self.key, {**self._changes, **changes})

    def _row(self, entries: Mapping[Any, Any], shown: Sequence[Column]) -> list[Entry]:
        forms = {column.name: column.form for column in self._study.columns}
        row: list[Entry] = []
        for column in shown:
            value, error = entries[column.name], entries.get(column.error)
            text = numbers.entry(value, column, error, forms.get(column.error, ""))
            bold = column.bold and value < column.bold
            row.append(Markup("<strong>{}</strong>").format(text) if bold else text)
        return row

    def _caption(self) -> str:
        caption = str(self.frame().attrs["caption"])
        if self._changes:
            setting = ", ".join(f"{name} = {text}" for name, text in self.changes.items())
            caption += f" With {setting}: a reader's own setting."
        if self.replaced:
            caption += f" Recomputed values took the place of: {', '.join(self.replaced)}."
        return caption

    @property
    def grids(self) -> dict[str, Grid]:
        """The table as a reader sees it: whole, or in the parts that it is folded into, by name."""
        frame, study = self.frame(), self._study
        behind = {column.error for column in study.columns} | {study.folded}
        shown = [column for column in study.columns if column.name not in behind]
        parts = [("", frame)] if not study.folded else frame.groupby(study.folded, sort=False)
        anchor = "-".join(["study", *self.key.split("/"), *(["changed"] if self._changes else [])])
        return {
            str(name): Grid(
                self._caption(),
                [column.name for column in shown],
                [self._row(entries, shown) for entries in part.to_dict(orient="records")],
                f"{anchor}-{number}" if number else anchor,
                "rp-study",
            )
            for number, (name, part) in enumerate(parts)
        }

    def export(self, form: str) -> str:
        """Return the numbers as csv, json, latex or markdown."""
        from reproduce.views import export as exporting

        return exporting.export_frame(self.frame(), form)

    def _repr_html_(self) -> str:
        if not self._study.folded:
            return str(self.grids[""].html)
        fold = Markup('<details class="rp-details"{}>\n<summary>{}</summary>\n{}\n</details>')
        parts = enumerate(self.grids.items())
        return "\n".join(
            fold.format(Markup("" if number else " open"), name, grid.html)
            for number, (name, grid) in parts
        )

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the title, and the table with its caption, part by part."""
        yield f"{self.key}: {self.title}"
        for name, grid in self.grids.items():
            if name:
                yield f"\n{name}"
            yield from grid.parts(width)
