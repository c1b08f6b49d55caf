"""Results of a rerun, and of reruns for several values of one input with a slider."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from math import isclose
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
from pandas.api.types import is_list_like

from reproduce.judge.ledger import item_ledger
from reproduce.judge.rerun import Rerun
from reproduce.papers.charts import Figure, set_size
from reproduce.printed.cells import anchor, find
from reproduce.printed.number import minus, quantity
from reproduce.printed.quantity import si_value
from reproduce.views import _verdicts as verdicts
from reproduce.views._base import Change, ResultView, setting
from reproduce.views._blocks import Block, Display, Grid, Html, rendered
from reproduce.views._keys import check_choice
from reproduce.views.figure import figure_block

# A number of a step: entries of the columns of a sweep.
Point = tuple[Any, ...]
_NUMBERS = ["computed", "low", "high", "mark", "bottom", "top"]
_COLUMNS = ["cell", "label", "unit", "text", *_NUMBERS]
# Height of a panel in inches, and largest number of panels of a graph.
_PANEL_INCHES, _MAX_PANELS = 1.7, 8


class Changed(ResultView):
    """A table or cell recomputed with changed inputs, without a verdict.

    With options only it is one reading of the text, with the verdict of each cell.

    Parameters
    ----------
    result : reproduce.judge.rerun.Rerun
        Computed values with ``changes``, ``options``, and the printed inputs that recomputed
        values ``replaced``.
    names : collection of str
        Names of the cells to show. Default: all cells.

    Raises
    ------
    ValueError
        If a cell is not computed.
    """

    def __init__(self, result: Rerun, names: Collection[str] = ()) -> None:
        self.result = result
        self.key = result.key
        self.changes = result.changes
        self._changed = result.setting
        known = {one.cell.name: one for one in result.cells}
        for name in names:
            check_choice("cells", name, known)
        self.cells = [known[name] for name in known if not names or name in names]

    def frame(self) -> pd.DataFrame:
        """Return the printed, computed and changed values, and their difference.

        Returns
        -------
        pandas.DataFrame
            One row per computed cell, in the printed unit, with the central 99 % of a prediction.
            A reading of the text has the ``verdict`` of each cell.
        """
        rows = [
            (
                one.cell.name,
                one.cell.text,
                one.unchanged,
                one.value,
                one.value - one.cell.number.value,
                *(one.interval or (None, None)),
                one.cell.symbol,
                one.verdict,
            )
            for one in self.cells
        ]
        columns = (
            "cell,printed,unchanged,changed,changed - printed,low,high,unit,verdict"
        )
        frame = pd.DataFrame(rows, columns=columns.split(",")).set_index("cell")
        return frame if frame["verdict"].any() else frame.drop(columns="verdict")

    def _setting(self) -> str:
        chosen = "your setting" if self.changes else "the printed inputs"
        remark = f"{chosen}, without a verdict"
        if self.result.is_reading:
            remark = "one reading of the text; the verdict of a cell is based on all readings"
        return setting(f"{self.key} with", self._changed, self.result.replaced, remark)

    def blocks(self) -> list[Grid]:
        """Return the numbers and the changes, without empty columns."""
        result = self.result
        value = "changed"
        hidden = ""
        caption = self._setting()
        if any(one.interval for one in self.cells):
            caption += (
                " From and to: the central 99 % of a prediction, or under a reading what rounded "
                "inputs allow."
            )
        if result.is_reading:
            value, hidden = "computed", "unchanged"
            for joint in item_ledger(result.key, **result.options).tables:
                caption += f" {verdicts.joint_sentence(joint)}"
        heads = ("cell", "printed", "unchanged", value, "from", "to", "verdict", "unit")
        rows = []
        for one in self.cells:
            cell = one.cell
            texts = cell.label, minus(cell.text), *one.texts, one.verdict, cell.symbol
            rows.append(dict(zip(heads, texts, strict=True)))
        return [Grid.of(caption, [name for name in heads if name != hidden], rows)]

    def points(self) -> Iterator[Point]:
        """Yield the numbers of a step of a `Sweep`."""
        for one in self.cells:
            cell, (_, value, low, high) = one.cell, one.texts
            text = quantity(value + f" ({low} to {high})" * bool(low), cell.symbol)
            numbers = one.value, *(one.interval or (None, None))
            printed = cell.number.value, *cell.number.interval()
            yield cell.name, cell.label, cell.symbol, text, *numbers, *printed


class Sweep(Display):
    """A table computed again for several values of an input.

    Parameters
    ----------
    place : str
        Table, as the caption names it.
    address : str or sequence of str
        Address of the input, or several addresses that change together.
    values : sequence
        Value of each step as printed; a tuple of values for several cells.
    compute : callable
        Function of a change that yields for each number: cell, label, unit, text, computed, low,
        high, and for its panel the dashed line (mark) and the band (bottom, top).
    dashed : str
        Meaning of the dashed lines, and of the bands.

    Raises
    ------
    ValueError
        If there is no value, or not one value for each input.
    """

    def __init__(
        self,
        place: str,
        address: str | Sequence[str],
        values: Sequence[str | float | Sequence[str | float]],
        compute: Callable[[Change], Iterable[Point]],
        dashed: str = "printed values; shaded: their intervals",
    ) -> None:
        names: list[Any] = [*address] if is_list_like(address) else [address]
        listed: Sequence[Any] = values if is_list_like(values) else []
        steps = [[*value] if is_list_like(value) else [value] for value in listed]
        if {*map(len, steps)} != {len(names)}:
            raise ValueError(
                f"values: expected a list with {names} for each step, got {values!r}"
            )
        if len({*names}) < len(names):
            raise ValueError(f"address: expected different inputs, got {names}")
        self.steps = [
            pd.DataFrame(compute(dict(zip(names, step, strict=True))), columns=_COLUMNS)
            for step in steps
        ]
        cells = [find(name)[0] for name in names]
        printed = [cell.si for cell in cells]
        self.printed = [
            all(map(isclose, map(si_value, cells, step), printed)) for step in steps
        ]
        self.settings = [", ".join(map(str, step)) for step in steps]
        self.label = ", ".join(cell.label for cell in cells)
        self.dashed = dashed
        self.caption = f"{place}. Changed: {self.label}."
        if self.frame()["low"].notna().any():
            self.caption += " In brackets: the central 99 % of the prediction."
        self.name = f"sweep-{anchor('-'.join(names))}"

    def frame(self) -> pd.DataFrame:
        """Return one row per step and cell: value, central 99 % and unit."""
        frame = pd.concat(
            [step.set_index("cell") for step in self.steps],
            keys=self.settings,
            names=["setting"],
        )
        return frame[["computed", "low", "high", "unit"]]

    def blocks(self) -> Iterator[Block]:
        """Yield a table of the steps, on a page with a slider and a graph of each number."""
        lines = [
            (setting + " (printed)" * printed, *step["text"])
            for setting, printed, step in zip(
                self.settings, self.printed, self.steps, strict=True
            )
        ]
        labels, units = self.steps[0][["label", "unit"]].to_numpy().T
        grid = Grid(self.caption, (self.label, *labels), lines)
        numbers = np.array([step[_NUMBERS] for step in self.steps], float)

        def paint(figure: Figure) -> None:
            set_size(figure, 0.4 + _PANEL_INCHES * len(labels))
            panels = figure.subplots(len(labels), sharex=True, squeeze=False)[:, 0]
            parts = zip(panels, labels, units, numbers.transpose(1, 2, 0), strict=True)
            for axes, label, unit, (value, low, high, *marks) in parts:
                mark, *ends = np.transpose(marks)[0]
                axes.axhline(mark, color="C1", linestyle="--")
                if np.isfinite(ends).all():
                    axes.axhspan(*ends, facecolor=("C1", 0.2))
                axes.errorbar(
                    self.settings, value, [value - low, high - value], fmt="C0o"
                )
                axes.set_title(fill(label + f" ({unit})" * bool(unit), 45))
            panels[-1].set_xlabel(self.label)

        def page() -> str:
            shown = self.caption.replace("In brackets", "Bars")
            caption = f"{shown} Dashed: the {self.dashed}."
            graph = ""
            if len(labels) <= _MAX_PANELS:
                graph = figure_block(
                    self.name,
                    paint,
                    f"Graph of the computed values against {self.label}.",
                    caption,
                ).markup
            return rendered("sweep", sweep=self, grid=grid.markup, graph=graph)

        yield Html(page, grid)
