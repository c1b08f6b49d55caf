"""A table or a cell computed again under a change, or judged under a reading of the text."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

from reproduce.judge.rerun import ChangedCell, Rerun
from reproduce.printed.units import symbol
from reproduce.views.objects.base import setting
from reproduce.views.writing.blocks import Block, Grid, grid
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

        frame = pd.DataFrame(map(_row, self._cells)).set_index("cell")
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
        """The cells and what was changed, as a reader sees them; without empty columns."""
        rows = [one for one in self._cells if one.cell.is_number]
        shown = {head: write for head, write in self._columns().items() if any(map(write, rows))}
        return grid(self._caption(), shown, rows, whole=range(1, len(shown)))

    def _columns(self) -> dict[str, Callable[[ChangedCell], str]]:
        reading = self.result.is_reading
        return {
            "cell": lambda one: one.cell.name + f" if {one.reading}" * bool(one.reading),
            "printed": lambda one: minus(one.cell.text),
            "from the print": lambda one: "" if reading else _digits(one, one.unchanged),
            "so read" if reading else "changed": lambda one: _digits(one, one.value),
            "from": lambda one: _digits(one, _ends(one)[0]),
            "to": lambda one: _digits(one, _ends(one)[1]),
            "would be": lambda one: one.would_be,
            "unit": lambda one: symbol(one.cell.unit),
        }

    def blocks(self) -> Iterator[Block]:
        """Yield the cells and what was changed."""
        yield self.grid


def _digits(one: ChangedCell, value: float | None) -> str:
    return "" if value is None else minus(one.cell.number.format(value, extra=1))


def _ends(one: ChangedCell) -> tuple[float | None, float | None]:
    return one.interval or (None, None)


def _row(one: ChangedCell) -> dict[str, Any]:
    value, cell = one.value, one.cell
    return {
        "cell": cell.name,
        "reading": one.reading,
        "printed": cell.text,
        "unchanged": one.unchanged,
        "changed": value,
        "changed - printed": value - cell.number.value
        if value is not None and cell.is_number
        else None,
        "low": _ends(one)[0],
        "high": _ends(one)[1],
        "unit": symbol(cell.unit) if cell.unit else "",
        "would be": one.would_be,
    }
