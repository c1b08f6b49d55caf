"""Tables of our own, which no paper prints: what `table` shows for the key of a study."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

from markupsafe import Markup
from rich.console import RenderableType

from reproduce.judge import rerun as rerunning
from reproduce.judge.studies import studies
from reproduce.papers.study import Column
from reproduce.views import build, numbers
from reproduce.views.grid import Entry, Grid, folded
from reproduce.views.shown import Shown

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["StudyTable"]


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
            return build.once(f"study-{self.key}", self._study), {}
        with rerunning.told_why(self.key, self.changes):
            door, replaced = rerunning.door_under(self._study.given, self._values)
            return self._study(door), replaced

    def frame(self) -> pd.DataFrame:
        """Return the numbers, a row for each row of the table, in the units of the heads."""
        return self._made[0].copy()

    def rerun(
        self, changes: Mapping[str, str | float] | None = None, **settings: object
    ) -> StudyTable:
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
            If the study does not read the cell, the value does not fit it, or anything but a cell
            is to be changed.
        """
        if settings:
            raise rerunning.CannotChangeError(
                f"{self.key} is a table of our own: expected cells that it reads, got "
                f"{', '.join(settings)}"
            )
        return StudyTable(self.key, {**self._changes, **(changes or {})})

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
        frame, folded = self.frame(), self._study.folded
        forms = {column.name: column.form for column in self._study.columns}
        behind = {column.error for column in self._study.columns} | {folded}
        shown = [column for column in self._study.columns if column.name not in behind]
        anchor = f"study-{self.key.replace('/', '-')}" + ("-changed" if self._changes else "")
        parts = [("", frame)] if not folded else frame.groupby(folded, sort=False)
        return {
            str(name): Grid(
                self._caption(),
                [column.name for column in shown],
                [[_entry(row, c, forms) for c in shown] for row in part.to_dict(orient="records")],
                f"{anchor}-{place}" if place else anchor,
                "rp-study",
            )
            for place, (name, part) in enumerate(parts)
        }

    def export(self, form: str) -> str:
        """Return the numbers as csv, json, latex or markdown."""
        from reproduce.views import export as exporting

        return exporting.export_frame(self.frame(), form)

    def cite(self, form: str = "bibtex") -> str:
        """Return how to cite the table and the paper that it stands beside."""
        from reproduce.views import cite as citing

        return citing.beside("Study", self.key, self.key.partition("/")[0], self.title, form)

    def _repr_html_(self) -> str:
        if not self._study.folded:
            return str(self.grids[""].html)
        return "\n".join(
            folded(name, grid.html, opened=not place)
            for place, (name, grid) in enumerate(self.grids.items())
        )

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the title, and the table with its caption, part by part."""
        yield f"{self.key}: {self.title}"
        for name, grid in self.grids.items():
            if name:
                yield f"\n{name}"
            yield from grid.parts(width)


def _entry(row: Mapping[Any, Any], column: Column, forms: Mapping[str, str]) -> Entry:
    error = (row[column.error], forms[column.error]) if column.error else None
    text = numbers.entry(row[column.name], column, error)
    if column.bold and row[column.name] < column.bold:
        return Markup("<strong>{}</strong>").format(text)
    return text
