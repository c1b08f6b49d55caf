"""Results of a rerun, and of reruns for several values of one input with a slider."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isclose
from typing import TYPE_CHECKING, Any

import numpy as np

from reproduce.judge.rerun import Rerun
from reproduce.papers.declare import Study
from reproduce.printed.cells import PrintedCell, find
from reproduce.printed.number import symbol
from reproduce.printed.quantity import si_value
from reproduce.views import verdicts
from reproduce.views.base import Change, setting
from reproduce.views.blocks import Block, Display, Grid, Html, rendered
from reproduce.views.numbers import between, entry, minus, quantity

if TYPE_CHECKING:
    import pandas as pd

# Size of a picture, its margin, and the room of its axes, in CSS pixels.
_WIDTH_PX, _HEIGHT_PX, _MARGIN_PX = 220, 110, 8
_LEFT_PX, _FOOT_PX = 56, 16
# Relative change of a number of a supplementary table that fills the height of a picture.
_MIN_CHANGE_RATIO = 0.05


class Changed(Display):
    """A table or cell recomputed with changed inputs, without a verdict.

    With options only it is one reading of the text, with the verdict of each cell.

    Parameters
    ----------
    result : reproduce.judge.rerun.Rerun
        Computed values with ``changes``, ``options``, and the printed inputs that recomputed
        values ``replaced``.
    name : str
        Name of the only cell to show. Default: all cells.
    """

    def __init__(self, result: Rerun, name: str = "") -> None:
        self.result = result
        self.changes, self.options = result.changes, result.options
        self.replaced = result.replaced
        self._cells = [cell for cell in result.cells if name in {"", cell.cell.name}]

    def frame(self) -> pd.DataFrame:
        """Return the printed, computed and changed values, and their difference.

        Returns
        -------
        pandas.DataFrame
            One row per computed cell, in the printed unit, with the central 99 % of a prediction.
            A reading of the text has the ``verdict`` of each cell.
        """
        import pandas as pd

        rows = []
        for one in self._cells:
            cell, value, ends = one.cell, one.value, one.interval or (None, None)
            difference = None
            if value is not None and cell.is_number:
                difference = value - cell.number.value
            row: dict[str, Any] = {
                "cell": cell.name,
                "printed": cell.text,
                "unchanged": one.unchanged,
                "changed": value,
                "changed - printed": difference,
                "low": ends[0],
                "high": ends[1],
                "unit": cell.unit and symbol(cell.unit),
            }
            rows.append(row | ({"verdict": one.verdict} if one.verdict else {}))
        return pd.DataFrame(rows).set_index("cell")

    @property
    def grid(self) -> Grid:
        """The numbers and the changes in the displayed format, without empty columns."""
        value, remark = "changed", "your setting, without a verdict"
        if self.result.is_reading:
            value = "computed"
            remark = "one reading of the text; the verdict of a cell is based on all readings"
        changes = self.changes | self.options
        caption = setting(f"{self.result.key} with", changes, self.replaced, remark)
        if any(changed.interval for changed in self._cells):
            caption += " From and to: the central 99 % of the prediction."
        if self.result.joint:
            caption += f" {verdicts.joint_sentence(self.result.joint)}"
        heads = ("cell", "printed", "unchanged", value, "from", "to", "verdict", "unit")
        rows = []
        for one in self._cells:
            if (cell := one.cell).is_number:
                before = None if self.result.is_reading else one.unchanged
                numbers = (before, one.value, *(one.interval or (None, None)))
                texts = (_text(cell, number) for number in numbers)
                words = (cell.label, minus(cell.text), *texts)
                row = (*words, one.verdict, symbol(cell.unit))
                rows.append(dict(zip(heads, row, strict=True)))
        return Grid.of(caption, heads, rows)

    def blocks(self) -> Iterator[Block]:
        """Yield the table of the cells."""
        yield self.grid


def _text(cell: PrintedCell, value: float | None) -> str:
    return "" if value is None else minus(cell.number.format(value, extra=1))


@dataclass(frozen=True, repr=False)
class Sweep(Display):
    """A table computed again for several values of an input.

    Parameters
    ----------
    caption, label : str
        Caption of the table, and names of the input.
    printed : list of bool
        Whether the value of a step is the printed one.
    rows : DataFrame
        One row per step and number, which are its index: setting, cell, label, computed, low, high,
        unit, text, and for its picture the height of the dashed line (mark) and the smallest range
        (bottom, top).
    dashed : str
        Meaning of the dashed lines of the pictures.
    """

    caption: str
    label: str
    printed: list[bool]
    rows: pd.DataFrame
    dashed: str

    def frame(self) -> pd.DataFrame:
        """Return one row per step and cell: value, central 99 % and unit."""
        frame = self.rows.set_index(["setting", "cell"])
        return frame[["computed", "low", "high", "unit"]]

    @property
    def grid(self) -> Grid:
        """The numbers in the displayed format, one row per step."""
        steps = [part for _, part in self.rows.groupby(level="step")]
        lines = [
            (part["setting"].iloc[0] + " (printed)" * printed, *part["text"])
            for printed, part in zip(self.printed, steps, strict=True)
        ]
        return Grid(self.caption, (self.label, *steps[0]["label"]), lines)

    def blocks(self) -> Iterator[Block]:
        """Yield the table, on a page with a slider and a picture of each number."""
        grid = self.grid
        page = rendered(
            "sweep",
            sweep=self,
            grid=grid.markup,
            ends=self.rows["setting"].iloc[[0, -1]].tolist(),
            size=(_WIDTH_PX, _HEIGHT_PX),
            axis=(_LEFT_PX, _WIDTH_PX - _MARGIN_PX),
            pictures=[_picture(part) for _, part in self.rows.groupby(level="number")],
        )
        yield Html(page, grid)


def _picture(rows: pd.DataFrame) -> dict[str, Any]:
    """Return the places of a number in its picture: median, central 99 %, and a dashed line."""
    first = rows.iloc[0]
    values = rows[["low", "computed", "high"]].to_numpy(float)
    values = np.where(np.isnan(values), values[:, [1]], values)
    seen = np.array([*values.ravel(), first["bottom"], first["top"]], dtype=float)
    seen = seen[np.isfinite(seen)]
    low, high = (seen.min(), seen.max()) if len(seen) else (0.0, 0.0)
    room = _HEIGHT_PX - _FOOT_PX - 2 * _MARGIN_PX

    def height(value: Any) -> Any:
        part = (value - low) / (high - low or 1)
        return np.round(_HEIGHT_PX - _FOOT_PX - _MARGIN_PX - room * part, 1)

    start, end = _LEFT_PX + 2 * _MARGIN_PX, _WIDTH_PX - 2 * _MARGIN_PX
    x = np.linspace(start, end, len(values)).round(1)
    marks = np.column_stack([x, height(values)])
    return {
        "label": first["label"],
        "unit": first["unit"],
        "marks": marks[np.isfinite(values[:, 1])].tolist(),
        "dashed": height(first["mark"]) if np.isfinite(first["mark"]) else None,
        "ends": [(between(end, high - low or 1), height(end)) for end in (low, high)],
    }


def swept(
    place: str,
    moved: str | Sequence[str],
    values: Sequence[str | float | Sequence[str | float]],
    compute: Callable[[Change], pd.DataFrame],
    dashed: str = "printed",
) -> Sweep:
    """Compute a table for each value of an input; `compute` returns the rows of a step.

    Raises
    ------
    ValueError
        If there is no value, or not one value for each input.
    """
    import pandas as pd

    names = [moved] if isinstance(moved, str) else [*moved]
    steps = [
        [value] if isinstance(value, str | int | float) else [*value]
        for value in ([] if isinstance(values, str) else values)
    ]
    if {*map(len, steps)} != {len(names)}:
        listed = ", ".join(names)
        raise ValueError(
            f"values: expected a list with {listed} for each step, got {values!r}"
        )
    cells, printed, parts = [find(name)[0] for name in names], [], []
    for step in steps:
        numbers = zip(cells, map(si_value, cells, step), strict=True)
        printed.append(all(isclose(number, cell.si) for cell, number in numbers))
        change = dict(zip(names, step, strict=True))
        parts.append(compute(change).assign(setting=", ".join(map(str, step))))
    rows = pd.concat(parts, keys=range(len(parts)), names=["step", "number"])
    inputs = "an input" if len(names) == 1 else f"{len(names)} inputs"
    caption = f"{place}, for {len(steps)} values of {inputs}."
    if rows["low"].notna().any():
        caption += " In brackets: the central 99 % of the prediction."
    label = ", ".join(cell.label for cell in cells)
    return Sweep(caption, label, printed, rows, dashed)


def of_cells(rerun: Rerun, names: Sequence[str]) -> pd.DataFrame:
    """Return the rows of the named cells of a table under a change. Default: all cells."""
    import pandas as pd

    rows = []
    for changed in rerun.cells:
        cell, (low, high) = changed.cell, changed.interval or (None, None)
        if cell.is_number and (not names or cell.name in names):
            text, unit = _text(cell, changed.value), symbol(cell.unit)
            if changed.interval:
                text += f" ({_text(cell, low)} to {_text(cell, high)})"
            bottom, top = cell.number.interval()
            row = (cell.name, cell.label, changed.value, low, high, unit)
            text = quantity(text, unit) or "none"
            rows.append((*row, text, cell.number.value, bottom, top))
    return pd.DataFrame(rows, columns=_COLUMNS)


_COLUMNS = ["cell", "label", "computed", "low", "high", "unit", "text", "mark"]
_COLUMNS += ["bottom", "top"]


def of_study(
    study: Study,
    frames: Sequence[pd.DataFrame],
    names: Sequence[str],
    chosen: Mapping[str, Any],
) -> pd.DataFrame:
    """Return the rows of a supplementary table, which is given without and with a change.

    `names` are the columns to show. `chosen` maps columns to the entry, or entries, of the rows to
    show.

    Raises
    ------
    ValueError
        If there is no such column of numbers, or no row has such an entry.
    """
    import pandas as pd

    for name, entries in chosen.items():
        frames = [frame[frame[name].isin(np.atleast_1d(entries))] for frame in frames]
    before, after = frames
    if before.empty or len(before) != len(after):
        raise ValueError(f"{study.key}: expected the same rows at every value")
    first, hidden = study.columns[0].name, {column.error for column in study.columns}
    columns = {c.name: c for c in study.columns if c.form and c.name not in hidden}
    if unknown := {*names} - {*columns}:
        raise ValueError(f"columns: expected some of {list(columns)}, got {unknown}")
    labels = [c.name for c in study.columns if not c.form] or [first]
    labels = [name for name in labels if before[name].nunique() > 1]
    rows = []
    pairs = zip(before.to_dict("records"), after.to_dict("records"), strict=True)
    for old, new in pairs:
        texts = [old[n] if isinstance(old[n], str) else f"{n} {old[n]}" for n in labels]
        for name in names or [name for name in columns if name != first]:
            mark, text = float(old[name]), entry(new[name], columns[name])
            room = _MIN_CHANGE_RATIO * abs(mark)
            cell = ": ".join(filter(None, (", ".join(texts), name)))
            row = (cell, cell, float(new[name]), None, None, "", text)
            rows.append((*row, mark, mark - room, mark + room))
    return pd.DataFrame(rows, columns=_COLUMNS)
