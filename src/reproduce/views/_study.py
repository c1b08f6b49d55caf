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
from reproduce.views._export import export_frame
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
        address: str | Sequence[str],
        values: Sequence[str | Sequence[str]],
        columns: Sequence[str] = (),
        rows: Mapping[str, Any] = {},
    ) -> Sweep:
        """Compute the table for several values of a printed input.

        Parameters
        ----------
        address : str or sequence of str
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
        TypeError
            If the address is not text.
        ValueError
            If there is no such column of numbers, or no row has such an entry.
        """
        every = self._declared.text.columns
        known = {c.name: c for c in every if c.form}
        for name in columns:
            check_choice("columns", name, known)
        for name in rows:
            check_choice("rows", name, [c.name for c in every])
        first = every[0].name
        shown = columns or [name for name in known if name != first]
        heads = [c.name for c in every if not c.form] or [first]

        def selected(table: StudyTable) -> pd.DataFrame:
            """Return the rows to show."""
            frame = table.frame()
            for name, entries in rows.items():
                frame = frame[frame[name].isin(np.atleast_1d(entries))]
            return frame

        before = selected(self)
        varied = [name for name in heads if before[name].nunique() > 1]
        labels = [
            [v if isinstance(v, str) else f"{name} {v}" for name, v in row.items()]
            for row in before[varied].to_dict("records")
        ]

        def compute(step: Change) -> Iterator[Point]:
            after = selected(self.rerun(step))
            if before.empty or len(before) != len(after):
                raise ValueError(f"{self.key}: expected the same rows at every value")
            both = before.to_dict("records"), after.to_dict("records")
            for texts, old, new in zip(labels, *both, strict=True):
                for name in shown:
                    label = ", ".join((*texts, name))
                    text = numbers.entry(new[name], known[name])
                    ends = (None, None)
                    yield label, label, "", text, new[name], *ends, old[name], *ends

        return Sweep(
            self.title, address, values, compute, "values for the printed inputs"
        )

    def frame(self) -> pd.DataFrame:
        """Return the numbers, in the units of the column names."""
        frame: pd.DataFrame = self._made
        return frame.copy()

    def export(self, form: str) -> str:
        """Return the numbers as csv or json, or the displayed digits as latex or markdown."""
        frame = self.frame() if form in {"csv", "json"} else self._displayed()
        return export_frame(frame, form, self.provenance)

    def _displayed(self) -> pd.DataFrame:
        """Return the numbers in the format of their columns."""
        frame = self.frame()
        columns = self._declared.text.columns
        return pd.DataFrame(
            {c.name: [numbers.entry(v, c) for v in frame[c.name]] for c in columns}
        )

    def blocks(self) -> Iterator[Block]:
        """Yield the formatted table, or its first rows."""
        frame = self._displayed()
        caption = f"{self._made.attrs['caption']} {self._setting()}".rstrip()
        rows = frame.head(_MAX_ROWS).to_numpy().tolist()
        # A link leads to the table without a change.
        where = "" if self.changes else element(self.key)
        yield Grid(caption, [*frame], rows, where, "rp-study")
        if omitted := len(frame) - len(rows):
            yield f"{omitted:,} more rows are in its files."
        if where:
            yield Html(self._toolbar(where), self.key)
