"""A supplementary table, which is not in a paper."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd

from reproduce.papers.declare import Study, study
from reproduce.views import _numbers as numbers
from reproduce.views._base import Change, Rerunnable
from reproduce.views._blocks import Block, Grid, Html
from reproduce.views._keys import check_choice, element
from reproduce.views._sweep import Point, Sweep

# Largest number of rows on a page, in two screens.
_MAX_ROWS = 60


class StudyTable(Rerunnable):
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

    def compute(self) -> pd.DataFrame:
        """Compute the rows, from the printed or from changed inputs."""
        return self._declared(self._inputs)

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

        Raises
        ------
        ValueError
            If there is no such column of numbers, or no row has such an entry.
        """
        every, chosen = self._declared.text.columns, rows or {}
        for name in chosen:
            check_choice("rows", name, [*self.frame()])
        known = {c.name: c for c in every if c.form}
        for name in columns:
            check_choice("columns", name, known)
        shown = [*columns] or [name for name in known if name != every[0].name]
        heads = [c.name for c in every if not c.form] or [every[0].name]

        def entries(table: StudyTable) -> Iterator[tuple[str, str, float]]:
            """Yield label, text and value of each number."""
            frame = table.frame()
            for name, some in chosen.items():
                frame = frame[frame[name].isin(np.atleast_1d(some))]
            varied = [name for name in heads if frame[name].nunique() > 1]
            for row in frame.to_dict("records"):
                texts = [
                    v if isinstance(v := row[n], str) else f"{n} {v}" for n in varied
                ]
                for name in shown:
                    text = numbers.entry(row[name], known[name])
                    yield ", ".join((*texts, name)), text, row[name]

        before = [*entries(self)]

        def compute(step: Change) -> Iterator[Point]:
            after = [*entries(self.rerun(step))]
            if not before or len(before) != len(after):
                raise ValueError(f"{self.key}: expected the same rows at every value")
            for (label, _, old), (_, text, new) in zip(before, after, strict=True):
                ends = None, None  # not predicted
                yield label, label, "", text, new, *ends, old, *ends

        return Sweep(
            self.title, moved, values, compute, "values for the printed inputs"
        )

    def frame(self) -> pd.DataFrame:
        """Return the numbers, in the units of the column names."""
        frame: pd.DataFrame = self._made
        return frame.copy()

    def blocks(self) -> Iterator[Block]:
        """Yield the formatted table, or its first rows."""
        frame, columns = self.frame(), self._declared.text.columns
        caption = f"{frame.attrs['caption']} {self._setting()}".rstrip()
        rows = [
            [numbers.entry(row[c.name], c) for c in columns]
            for row in frame.head(_MAX_ROWS).to_dict("records")
        ]
        where = element(self.key)
        identifier = f"{where}-changed" if self.changes else where
        yield Grid(
            caption, [column.name for column in columns], rows, identifier, "rp-study"
        )
        if omitted := len(frame) - len(rows):
            yield f"{omitted:,} more rows are in its files."
        if not self.changes:
            yield Html(self._toolbar(where), self.key)
