"""One printed input moved over several values: a small table, and on a page a slider over it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from math import isclose
from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup
from rich.console import RenderableType

from reproduce.judge.rerun import ChangedCell, Rerun, in_si
from reproduce.printed.cells import Cell, library
from reproduce.printed.units import symbol
from reproduce.views.writing.display import Display, Grid, columns, fits
from reproduce.views.writing.numbers import minus

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Sweep"]

WIDE, HIGH, MARGIN = 220, 96, 8  # of one picture, in CSS pixels


@dataclass(frozen=True, repr=False)
class Sweep(Display):
    """An item computed again for several values of one printed input.

    Parameters
    ----------
    addresses : tuple of str
        The input that is moved, or several that move together.
    steps : tuple of tuples of str
        What they are moved to, as in the print.
    reruns : tuple of reproduce.judge.rerun.Rerun
        What was computed for each.
    names : tuple of str
        The cells to show; all of them by default.
    """

    addresses: tuple[str, ...]
    steps: tuple[tuple[str, ...], ...]
    reruns: tuple[Rerun, ...]
    names: tuple[str, ...] = ()

    @cached_property
    def _columns(self) -> list[list[ChangedCell]]:
        """What each shown cell becomes, value by value; one list for each reading of it."""
        chosen = [
            [one for one in rerun.cells if one.cell.is_number and self._wanted(one.cell)]
            for rerun in self.reruns
        ]
        return [list(column) for column in zip(*chosen, strict=True)]

    def _wanted(self, cell: Cell) -> bool:
        return not self.names or cell.name in self.names

    @cached_property
    def _inputs(self) -> list[Cell]:
        keys = (address.partition("#") for address in self.addresses)
        return [library()[key][name] for key, _, name in keys]

    @property
    def _label(self) -> str:
        return ", ".join(cell.label for cell in self._inputs)

    @property
    def values(self) -> list[str]:
        """The settings of all inputs, in one string for each step."""
        return [", ".join(step) for step in self.steps]

    def frame(self) -> pd.DataFrame:
        """Return one row per value and cell: the value, the ends of its central 99 %, the unit."""
        import pandas as pd

        rows = [
            {
                "setting": value,
                "cell": one.cell.name,
                "reading": one.reading,
                "computed": one.value,
                "low": one.interval[0] if one.interval else None,
                "high": one.interval[1] if one.interval else None,
                "unit": symbol(one.cell.unit),
            }
            for column in self._columns
            for value, one in zip(self.values, column, strict=True)
        ]
        frame = pd.DataFrame(rows).set_index(["setting", "cell"])
        return frame if frame["reading"].any() else frame.drop(columns="reading")

    @cached_property
    def _shown(self) -> tuple[str, list[str], list[list[str]]]:
        """The caption, the head, and for each value what becomes of each cell."""
        head = [self._label, *(_name(column[0]) for column in self._columns)]
        rows = [
            [self._setting(step), *(_written(column[number]) for column in self._columns)]
            for number, step in enumerate(self.steps)
        ]
        moved = " and ".join(self.addresses)
        caption = f"{self.reruns[0].key} for {len(rows)} values of {moved}, all computed"
        predicted = any(one.interval for column in self._columns for one in column)
        caption += "; in brackets the central 99 % of the prediction." if predicted else "."
        return caption, head, rows

    @property
    def grid(self) -> Grid:
        """The table of values and what becomes of each cell."""
        return Grid(*self._shown)

    def _printed(self, step: tuple[str, ...]) -> bool:
        return all(
            isclose(in_si(c, text), c.si) for c, text in zip(self._inputs, step, strict=True)
        )

    def _setting(self, step: tuple[str, ...]) -> str:
        return ", ".join(step) + (" (printed)" if self._printed(step) else "")

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the table; a block for each cell where it is wider than the terminal."""
        caption, head, rows = self._shown
        table = columns(head, rows, whole=range(len(head)))
        if fits(table, width):
            yield table
        else:
            for place, name in enumerate(head[1:], start=1):
                pairs = [(row[0], row[place]) for row in rows]
                yield name
                yield columns(["", ""], pairs, words=2, whole=(1,), show_header=False)
                yield ""
        yield caption

    def _repr_html_(self) -> str:
        printed = list(map(self._printed, self.steps))
        at = printed.index(True) if any(printed) else 0
        pictures = Markup("\n").join(_picture(column, self.values) for column in self._columns)
        return str(
            Markup(
                '<div class="rp-sweep">\n<p class="rp-dial" hidden><label>{}: '
                '<input type="range" min="0" max="{}" step="1" value="{}"></label> '
                "<output></output></p>\n{}\n"
                '<div class="rp-sweep-pictures">{}</div></div>'
            ).format(self._label, len(self.steps) - 1, at, self.grid.html, pictures)
        )


def _name(one: ChangedCell) -> str:
    return f"{one.cell.name} if {one.reading}" if one.reading else one.cell.name


def _written(one: ChangedCell) -> str:
    if one.value is None:
        return "none"
    number = one.cell.number
    text = number.format(one.value, extra=1)
    if one.interval is not None:
        text += f" ({' to '.join(number.format(end, extra=1) for end in one.interval)})"
    unit = symbol(one.cell.unit) if one.cell.unit else ""
    return minus(f"{text} {unit}".strip())


def _picture(column: list[ChangedCell], values: list[str]) -> Markup:
    """Draw a cell over the values: median, central 99 %, and the print as a dashed line."""
    printed = column[0].cell.number
    middle = np.array([np.nan if one.value is None else one.value for one in column])
    ends = np.array([one.interval or (v, v) for one, v in zip(column, middle, strict=True)])
    # No closer than the last printed digit: rounding noise is not to look like a difference.
    seen = np.concatenate([ends.ravel(), printed.interval()])
    low, high = np.nanmin(seen), np.nanmax(seen)
    x = np.linspace(2 * MARGIN, WIDE - 2 * MARGIN, len(column)).round(1)

    def y(value: float) -> float:
        return round(HIGH - MARGIN - (HIGH - 2 * MARGIN) * float((value - low) / (high - low)), 1)

    mark = '<g class="rp-at"><path d="M{} {}V{}"/><circle cx="{}" cy="{}" r="3.5"/></g>'
    marks = Markup("").join(
        Markup(mark).format(at, y(end[0]), y(end[1]), at, y(value))
        for at, value, end in zip(x, middle, ends, strict=True)
        if np.isfinite(value)
    )
    name = _name(column[0])
    told = f"{name} from {values[0]} to {values[-1]}; dashed: printed"
    return Markup(
        '<figure><svg viewBox="0 0 {} {}" role="img" aria-label="{}">'
        '<path class="rp-dashed" d="M{} {}H{}"/>{}</svg><figcaption>{}</figcaption></figure>'
    ).format(WIDE, HIGH, told, MARGIN, y(printed.value), WIDE - MARGIN, marks, name)
