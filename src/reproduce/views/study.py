"""A supplementary table, which is not in a paper."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from reproduce.papers.declare import Study, study
from reproduce.printed.cells import anchor
from reproduce.views import numbers
from reproduce.views.base import Change, ItemView, Rerunnable
from reproduce.views.blocks import Block, Fold, Grid, Html
from reproduce.views.export import table_files, toolbar
from reproduce.views.sweep import Sweep, of_study, swept

if TYPE_CHECKING:
    import pandas as pd

    from reproduce.printed.inputs import Inputs


class StudyTable(Rerunnable, ItemView):
    """A supplementary table of a paper, without verdicts.

    Parameters
    ----------
    key : str
        Such as ``chen2023/heat``.
    changes : mapping, optional
        Address of any cell in `inputs` to a value as printed.
    seed : int, optional
        Seed of the random number generator.
    """

    @property
    def _declared(self) -> Study:
        return study(self.key)

    def _compute(self, inputs: Inputs | None) -> pd.DataFrame:
        return self._declared(inputs)

    def sweep(
        self,
        moved: str | Sequence[str],
        values: Sequence[str | Sequence[str]],
        columns: Sequence[str] = (),
        rows: Mapping[str, Any] | None = None,
    ) -> Sweep:
        """Compute the table for several values of a printed input.

        Parameters
        ----------
        moved : str or sequence of str
            A cell in `inputs`, or several cells that change together.
        values : sequence
            Values as printed: ``["0.02 px", "0.05 px"]``; a tuple of values for several cells.
        columns : sequence of str, optional
            Columns to show; all columns with numbers by default.
        rows : mapping, optional
            Column to the entries of the rows to show; all rows by default.

        Returns
        -------
        Sweep
            One row per value, with a slider on a page.
        """
        declared, before = self._declared, self.frame()

        def compute(step: Change) -> pd.DataFrame:
            return of_study(
                declared, (before, self.rerun(step).frame()), columns, rows or {}
            )

        return swept(
            self.title, moved, values, compute, "values for the printed inputs"
        )

    def frame(self) -> pd.DataFrame:
        """Return the numbers, in the units of the column names."""
        frame: pd.DataFrame = self._made[0]
        return frame.copy()

    @property
    def grid(self) -> Grid:
        """The formatted table; the first part of a folded table."""
        text, frame = self._declared.text, self.frame()
        caption = f"{frame.attrs['caption']} {self._setting()}".rstrip()
        if text.folded:
            frame = frame[frame[text.folded] == frame[text.folded].iloc[0]]
        forms = {column.name: column.form for column in text.columns}
        behind = {*(column.error for column in text.columns), text.folded}
        shown = [column for column in text.columns if column.name not in behind]
        rows = [
            [
                numbers.entry(
                    row[column.name],
                    column,
                    (row[column.error], forms[column.error]) if column.error else None,
                )
                for column in shown
            ]
            for row in frame.to_dict("records")
        ]
        where = f"study-{anchor(self.key)}" + ("-changed" if self.changes else "")
        return Grid(caption, [c.name for c in shown], rows, where, "rp-study")

    def blocks(self) -> Iterator[Block]:
        """Yield the table, or the first part of a folded table."""
        frame, grid, folded = self.frame(), self.grid, self._declared.text.folded
        yield Fold(str(frame[folded].iloc[0]), grid, opened=True) if folded else grid
        if omitted := len(frame) - len(grid.rows):
            yield f"{omitted:,} more rows, by {folded}, are in its files."
        if not self.changes:
            where = f"study-{anchor(self.key)}"
            yield Html(
                toolbar(self.key, where, table_files(self.key), self.source), self.key
            )
