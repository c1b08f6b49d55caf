"""A table or a cell computed again under a change, or judged under a reading of the text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

from reproduce.judge.rerun import Rerun
from reproduce.printed.units import symbol
from reproduce.views.objects.base import setting
from reproduce.views.writing.blocks import Block, Grid
from reproduce.views.writing.display import Display
from reproduce.views.writing.numbers import minus
from reproduce.views.writing.verdicts import joint_chance

if TYPE_CHECKING:
    import pandas as pd


class Changed(Display):
    """A table or cell computed again under a reader's own change, which has no verdict.

    With nothing but options it is a reading of the text: each cell says what it would be judged as.

    Parameters
    ----------
    result : reproduce.judge.rerun.Rerun
        What was computed: ``changes``, ``options``, and the printed inputs whose place a
        recomputed value took, ``replaced``.
    name : str
        The one cell that is asked for; all of them by default.
    """

    def __init__(self, result: Rerun, name: str = "") -> None:
        self.result = result
        self.changes, self.options, self.replaced = result.changes, result.options, result.replaced
        self._cells = [one for one in result.cells if name in {"", one.cell.name}]

    def frame(self) -> pd.DataFrame:
        """Return printed, computed from the print, value under the change and difference.

        Returns
        -------
        pandas.DataFrame
            One row per computed cell, in the unit of print, with the central 99 % where it is a
            prediction; a reading of the text has the verdict that it ``would be``.
        """
        import pandas as pd

        rows = [
            {
                "cell": one.cell.name,
                "reading": one.reading,
                "printed": one.cell.text,
                "unchanged": one.unchanged,
                "changed": one.value,
                "changed - printed": None
                if one.value is None or not one.cell.is_number
                else one.value - one.cell.number.value,
                "low": one.interval[0] if one.interval else None,
                "high": one.interval[1] if one.interval else None,
                "unit": symbol(one.cell.unit) if one.cell.unit else "",
                "would be": one.would_be,
            }
            for one in self._cells
        ]
        frame = pd.DataFrame(rows).set_index("cell")
        return frame.drop(columns=[n for n in ("reading", "would be") if not frame[n].any()])

    def _caption(self) -> str:
        remark = "a reader's own setting, without a verdict"
        if self.result.is_reading:
            remark = (
                "one reading of the text, with what each cell "
                "would be judged as. The verdict of a cell takes every reading into account"
            )
        changed = {**self.changes, **self.options}
        told = setting(f"{self.result.key} with", changed, self.replaced, remark)
        if any(one.interval for one in self._cells):
            told += " From and to: the central 99 % of the prediction."
        if joint := self.result.joint:
            told += (
                f" The {joint.cells} random cells that no further reading decides are judged "
                f"together: probability {joint_chance(joint)} in {joint.replicates:,} replicates, "
                f"{joint.outside} outside, {joint.expected_outside:.1f} expected by chance."
            )
        return told

    @property
    def grid(self) -> Grid:
        """The cells and what was changed, as a reader sees them."""
        head = ["cell", "printed", "from the print", "changed", "from", "to", "unit"]
        if self.result.is_reading:
            head = ["cell", "printed", "so read", "from", "to", "would be", "unit"]
        rows = []
        for one in self._cells:
            if not one.cell.is_number:
                continue
            values = [one.unchanged, one.value, *(one.interval or (None, None))]
            digits = [
                "" if v is None else minus(one.cell.number.format(v, extra=1)) for v in values
            ]
            if self.result.is_reading:
                digits = [*digits[1:], one.would_be]
            name = f"{one.cell.name} if {one.reading}" if one.reading else one.cell.name
            rows.append((name, minus(one.cell.text), *digits, symbol(one.cell.unit)))
        # Deterministic cells have no ends, and pure numbers no unit.
        spare = {"from", "to", "unit"}
        filled = [i for i, h in enumerate(head) if h not in spare or any(row[i] for row in rows)]
        head, rows = [head[i] for i in filled], [tuple(row[i] for i in filled) for row in rows]
        return Grid(self._caption(), head, rows, whole=range(1, len(head)))

    def blocks(self) -> Iterator[Block]:
        """Yield the cells and what was changed."""
        yield self.grid
