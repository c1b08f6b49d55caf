"""Tables of our own, which no paper prints: what `table` shows for the key of a study."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

from rich.console import RenderableType

from reproduce.papers.catalogue import studies
from reproduce.papers.study import Column
from reproduce.printed.given import given
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
        self.changes = {address: str(value) for address, value in (changes or {}).items()}

    @property
    def title(self) -> str:
        """What it shows, in one sentence."""
        return self._study.title

    @property
    def reads(self) -> tuple[str, ...]:
        """Addresses of all printed cells that it reads."""
        return tuple(given(self._study.given).cells)

    @property
    def source(self) -> str:
        """The text of the function that computes it."""
        return inspect.getsource(self._study.function).rstrip()

    @cached_property
    def _frame(self) -> pd.DataFrame:
        return self._study()

    def frame(self) -> pd.DataFrame:
        """Return the numbers, a row for each row of the table, in the units of the heads."""
        return self._frame

    @property
    def grid(self) -> Grid:
        """The table as a reader sees it."""
        frame = self._frame
        behind = {column.error for column in self._study.columns} - {""}
        shown = [column for column in self._study.columns if column.name not in behind]
        rows = [
            [_entry(row, column) for column in shown] for row in frame.to_dict(orient="records")
        ]
        return Grid(
            frame.attrs["caption"],
            [column.name for column in shown],
            rows,
            f"study-{self.key.replace('/', '-')}",
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


def _entry(row: Mapping[Any, Any], column: Column) -> str:
    value = row[column.name]
    if not column.form or isinstance(value, str):
        return str(value)
    text = number(float(value), column.form, zero=column.zero, infinite=column.infinite)
    if column.error:
        text += f" ± {number(float(row[column.error]), '.1g')}"
    return text
