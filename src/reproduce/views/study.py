"""Tables of our own, which no paper prints: what `table` shows for the key of a study."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any

from markupsafe import Markup
from rich.console import RenderableType

from reproduce.judge.studies import studies
from reproduce.papers.study import Column
from reproduce.printed.given import given
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
    def grids(self) -> dict[str, Grid]:
        """The table as a reader sees it: whole, or in the parts that it is folded into, by name."""
        frame, folded = self._frame, self._study.folded
        behind = {column.error for column in self._study.columns} | {folded}
        shown = [column for column in self._study.columns if column.name not in behind]
        parts = [("", frame)] if not folded else frame.groupby(folded, sort=False)
        return {
            str(name): Grid(
                frame.attrs["caption"],
                [column.name for column in shown],
                [[_entry(row, c) for c in shown] for row in part.to_dict(orient="records")],
                "-".join(["study", *self.key.split("/"), *([str(number)] if number else [])]),
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


def _entry(row: Mapping[Any, Any], column: Column) -> Entry:
    value = row[column.name]
    text = numbers.entry(value, column, row[column.error] if column.error else None)
    if column.bold and value < column.bold:
        return Markup("<strong>{}</strong>").format(text)
    return text
