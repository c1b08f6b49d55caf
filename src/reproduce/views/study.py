"""Tables of our own, which no paper prints: what `table` shows for the key of a study."""

from __future__ import annotations

import inspect
import math
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from reproduce.judge import rerun as rerunning
from reproduce.papers.catalogue import studies
from reproduce.papers.study import Column
from reproduce.views.grid import Grid
from reproduce.views.numbers import number
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

    def _caption(self) -> str:
        caption = str(self.frame().attrs["caption"])
        if self._changes:
            setting = ", ".join(f"{name} = {text}" for name, text in self.changes.items())
            caption += f" With {setting}: a reader's own setting."
        if self.replaced:
            caption += f" Recomputed values took the place of: {', '.join(self.replaced)}."
        return caption

    @property
    def grid(self) -> Grid:
        """The table as a reader sees it."""
        frame = self.frame()
        forms = {column.name: column.form for column in self._study.columns}
        behind = {column.error for column in self._study.columns} - {""}
        shown = [column for column in self._study.columns if column.name not in behind]
        rows = [
            [_entry(row, column, forms) for column in shown]
            for row in frame.to_dict(orient="records")
        ]
        return Grid(
            self._caption(),
            [column.name for column in shown],
            rows,
            f"study-{self.key.replace('/', '-')}" + ("-changed" if self._changes else ""),
            "rp-study",
        )

    def export(self, form: str) -> str:
        """Return the numbers as csv, json, latex or markdown."""
        from reproduce.views import export as exporting

        return exporting.export_frame(self.frame(), form)

    def _repr_html_(self) -> str:
        return self.grid._repr_html_()

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the title, the table and its caption."""
        yield f"{self.key}: {self.title}"
        yield from self.grid.parts(width)


def _entry(row: Mapping[Any, Any], column: Column, forms: Mapping[str, str]) -> str:
    value = row[column.name]
    if isinstance(value, float) and math.isnan(value):
        return column.missing
    if not column.form or isinstance(value, str):
        return str(value)
    text = number(float(value), column.form, zero=column.zero, infinite=column.infinite)
    if column.error:
        text += f" ± {number(float(row[column.error]), forms[column.error] or '.1g')}"
    return text
