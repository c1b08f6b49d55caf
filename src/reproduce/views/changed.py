"""A table or a cell computed again under a change, or judged under a reading of the text."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

from rich.console import RenderableType

from reproduce.judge.rerun import Rerun
from reproduce.printed.units import symbol
from reproduce.views import record_text
from reproduce.views.grid import Grid
from reproduce.views.shown import Shown

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Changed"]


@dataclass(frozen=True, repr=False)
class Changed(Shown):
    """A table or cell computed again under a reader's own change, which has no verdict.

    With nothing but options it is a reading of the text: each cell says what it would be judged as.

    Parameters
    ----------
    result : reproduce.judge.rerun.Rerun
        What was computed.
    name : str
        The one cell that is asked for; all of them by default.
    """

    result: Rerun
    name: str = ""

    @property
    def changes(self) -> dict[str, str]:
        """What was changed: addresses, ``seed``, ``replicates``."""
        return self.result.changes

    @property
    def options(self) -> dict[str, str]:
        """Which alternative was taken of what the text leaves open."""
        return self.result.options

    @property
    def replaced(self) -> dict[str, float]:
        """Printed inputs whose place a recomputed value took, in the unit of print."""
        return self.result.replaced

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
            for one in self.result.cells
            if self.name in {"", one.cell.name}
        ]
        frame = pd.DataFrame(rows).set_index("cell")
        unused = [name for name in ("reading", "would be") if not frame[name].any()]
        return frame.drop(columns=unused)

    def _told(self) -> str:
        setting = {**self.changes, **self.options}
        changed = ", ".join(f"{name} = {text}" for name, text in setting.items()) or "nothing"
        if not self.result.is_reading:
            told = f"{self.result.key} with {changed}: a reader's own setting, without a verdict."
            if self.replaced:
                told += f" Recomputed values took the place of: {', '.join(self.replaced)}."
            return told
        told = (
            f"{self.result.key} with {changed}: one reading of the text, with what each cell "
            "would be judged as. The verdict of a cell takes every reading into account."
        )
        joint = self.result.joint
        if joint is not None:
            told += (
                f" The table as a whole: probability {record_text.joint_chance(joint)}; "
                f"{joint.outside} of {joint.cells} cells outside, "
                f"{joint.expected_outside:.1f} expected by chance."
            )
        return told

    def _shown(self) -> list[tuple[str, ...]]:
        rows = []
        for one in self.result.cells:
            if self.name not in {"", one.cell.name} or not one.cell.is_number:
                continue
            number = one.cell.number
            values = [one.unchanged, one.value, *(one.interval or (None, None))]
            digits = ["" if v is None else number.format(v, extra=1) for v in values]
            name = f"{one.cell.name} if {one.reading}" if one.reading else one.cell.name
            if self.result.is_reading:
                digits = [*digits[1:], one.would_be]
            rows.append((name, one.cell.text, *digits, symbol(one.cell.unit)))
        return rows

    @property
    def _head(self) -> tuple[str, ...]:
        if self.result.is_reading:
            return ("cell", "printed", "so read", "from", "to", "would be", "unit")
        return ("cell", "printed", "from the print", "changed", "from", "to", "unit")

    @property
    def grid(self) -> Grid:
        """The cells and what was changed, as a reader sees them."""
        return Grid(self._told(), self._head, self._shown())

    def _repr_html_(self) -> str:
        return self.grid._repr_html_()

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the cells and what was changed."""
        yield from self.grid.parts(width)
