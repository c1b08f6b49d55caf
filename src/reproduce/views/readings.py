"""The readings of a table: all of them, and a summary for each cell."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from reproduce.judge.ledger import Record
from reproduce.judge.readings import Evaluation, evaluate
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import unpublished
from reproduce.printed.cells import PrintedCell, library
from reproduce.views import verdicts
from reproduce.views.blocks import Block, Display, Grid, Html, rendered
from reproduce.views.numbers import minus

if TYPE_CHECKING:
    import pandas as pd


class Readings(Display):
    """All readings of a table: every combination of the options of its text.

    Parameters
    ----------
    key : str
        Such as ``niu2024/table-3``.
    """

    def __init__(self, key: str) -> None:
        self.key = key
        computations = [c for c in catalogue()[key].computations if c.options]
        computations.sort(key=lambda c: len(c.options), reverse=True)
        evaluations = map(evaluate, computations)
        self._evaluations = [
            (e, names) for e in evaluations if (names := _open_cells(e))
        ]
        options = (name for e, _ in self._evaluations for name in e.computation.options)
        self._options = list(dict.fromkeys(options))

    def frame(self) -> pd.DataFrame:
        """Return one row per reading.

        Returns
        -------
        pandas.DataFrame
            A column for each option; for each cell its computed value in the printed unit,
            its probability if it is predicted, and whether it agrees; the number of cells that
            agree; the joint probability of the predicted cells.
        """
        import pandas as pd

        frame = pd.DataFrame({})
        for evaluation, names in self._evaluations:
            part = _frame(evaluation, names)
            shared = [name for name in evaluation.computation.options if name in frame]
            frame = frame.merge(part, how="left", on=shared) if len(frame) else part
        agrees = [name for name in frame if str(name).endswith(" agrees")]
        frame["agreeing"] = frame[agrees].eq(True).sum(axis=1)
        # Readings that differ only in options without effect on the results are one reading.
        effects = frame.drop(columns=self._options).round(12)
        return frame[~effects.duplicated()].reset_index(drop=True)

    def blocks(self) -> list[Block]:
        """Return the table of all readings, which a page can sort."""
        frame = self.frame()
        if frame.empty:
            return [f"{self.key} has one reading."]
        cells = [
            library()[self.key][n] for _, names in self._evaluations for n in names
        ]
        shown: dict[str, Any] = {
            "caption": f"All {len(frame)} readings of {library()[self.key].place}. Bold: the "
            "printed number agrees. A predicted cell has its probability, any other cell its "
            "computed value.",
            "options": self._options,
            "cells": cells,
            "rows": [
                row | {cell.name: _text(cell, row) for cell in cells}
                for row in frame.to_dict("records")
            ],
            "joint": "joint p" in frame,
        }
        names = [*self._options, *(cell.name for cell in cells), "agreeing", "joint p"]
        terminal = Grid.of(shown["caption"], names, shown["rows"])
        return [Html(rendered("readings", **shown), terminal)]


def _text(cell: PrintedCell, row: Mapping[Any, Any]) -> str:
    """Return the probability of a predicted cell, or its value; nothing if it has none."""
    p = row.get(f"{cell.name} p")
    value = minus(cell.number.format(row[cell.name], 1)) if p is None else f"{p:.3g}"
    return value if row[cell.name] == row[cell.name] else ""


def _open_cells(evaluation: Evaluation) -> list[str]:
    """Return the cells of a computation whose result depends on the reading."""
    key = evaluation.computation.key
    return [
        n
        for n in evaluation.cells
        if not unpublished(key, n) and len(evaluation.distinct(n)) > 1
    ]


def _frame(evaluation: Evaluation, names: Iterable[str]) -> pd.DataFrame:
    """Return the choices and the results of one computation under all its readings."""
    import pandas as pd

    frame = pd.DataFrame(evaluation.computation.readings)
    for name in names:
        readings = evaluation.cells[name]
        frame[name] = [float(f"{reading.computed:.9g}") for reading in readings]
        if readings[0].probability is not None:
            frame[f"{name} p"] = [reading.probability for reading in readings]
            frame["joint p"] = evaluation.joint[:, 0]
        frame[f"{name} agrees"] = [reading.agrees for reading in readings]
    return frame


def summary(label: str, records: Iterable[Record]) -> Grid:
    """Return a summary of the readings of each cell."""
    columns = ("cell", "printed", "readings that agree", "agrees with")
    return Grid.of(
        f"Readings of {label}, cell by cell",
        (*columns, "closest reading"),
        [verdicts.texts(record) for record in records if record.readings],
        kind="rp-small rp-readings",
    )
