"""What a rerun changed; and one input moved over several values, on a page with a slider."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isclose
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from markupsafe import Markup

from reproduce.judge.rerun import ChangedCell, Rerun
from reproduce.papers.declare import Study
from reproduce.printed.cells import find
from reproduce.printed.number import Interval, symbol
from reproduce.printed.quantity import si_value
from reproduce.views import verdicts
from reproduce.views.base import Change, setting
from reproduce.views.blocks import Block, Display, Grid, Html, grid
from reproduce.views.numbers import between, entry, minus

if TYPE_CHECKING:
    import pandas as pd

WIDE, HIGH, MARGIN = 220, 110, 8  # of one picture, in CSS pixels
LEFT, FOOT = 56, 16  # of that, for the values on its axes
# A number of our own that moves by a smaller share than this does not fill the height of a picture.
_NOTICED = 0.05


_OWN = "a reader's own setting, without a verdict"
_READING = (
    "one reading of the text; the verdict of a cell takes all readings into account"
)


class Point(NamedTuple):
    """One number at one value of the input.

    `interval` is its central 99 %, `text` what a reader sees, `mark` where the dashed line of its
    picture lies, and `span` what the picture shows at least: rounding noise is no difference.
    """

    cell: str
    unit: str
    value: float | None
    interval: Interval | None
    text: str
    mark: float
    span: Interval


class Changed(Display):
    """A table or cell computed again under a reader's own change, which has no verdict.

    With options only it is one reading of the text, with the verdict of each cell.

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
        self.changes, self.options, self.replaced = (
            result.changes,
            result.options,
            result.replaced,
        )
        self._cells = [one for one in result.cells if name in {"", one.cell.name}]

    def frame(self) -> pd.DataFrame:
        """Return printed, computed from the print, value under the change and difference.

        Returns
        -------
        pandas.DataFrame
            One row per computed cell, in the unit of print, with the central 99 % where it is a
            prediction; a reading of the text has the ``verdict`` of each cell.
        """
        import pandas as pd

        heads = (
            "cell",
            "printed",
            "unchanged",
            "changed",
            "changed - printed",
            "low",
            "high",
            "unit",
            "verdict",
        )
        frame = pd.DataFrame(map(_row, self._cells), columns=heads).set_index("cell")
        return frame if frame["verdict"].any() else frame.drop(columns="verdict")

    def _caption(self) -> str:
        remark = _READING if self.result.is_reading else _OWN
        changed = self.changes | self.options
        told = setting(f"{self.result.key} with", changed, self.replaced, remark)
        if any(one.interval for one in self._cells):
            told += " From and to: the central 99 % of the prediction."
        if self.result.joint:
            told += f" {verdicts.joint_sentence(self.result.joint)}"
        return told

    @property
    def grid(self) -> Grid:
        """The cells and what was changed, as a reader sees them; without empty columns."""
        reading = self.result.is_reading
        columns: dict[str, Callable[[ChangedCell], str]] = {
            "cell": lambda one: one.cell.name,
            "printed": lambda one: minus(one.cell.text),
            "from the print": lambda one: (
                "" if reading else _digits(one, one.unchanged)
            ),
            "computed" if reading else "changed": lambda one: _digits(one, one.value),
            "from": lambda one: _digits(one, one.interval and one.interval[0]),
            "to": lambda one: _digits(one, one.interval and one.interval[1]),
            "verdict": lambda one: one.verdict,
            "unit": lambda one: symbol(one.cell.unit),
        }
        rows = [one for one in self._cells if one.cell.is_number]
        return grid(self._caption(), columns, rows, whole=range(1, len(columns)))

    def blocks(self) -> Iterator[Block]:
        """Yield the cells and what was changed."""
        yield self.grid


def _digits(one: ChangedCell, value: float | None) -> str:
    return "" if value is None else minus(one.cell.number.format(value, extra=1))


def _row(one: ChangedCell) -> tuple[Any, ...]:
    value, cell = one.value, one.cell
    apart = value - cell.number.value if value is not None and cell.is_number else None
    told = (cell.name, cell.text, one.unchanged, value, apart)
    return (
        *told,
        *(one.interval or (None, None)),
        cell.unit and symbol(cell.unit),
        one.verdict,
    )


@dataclass(frozen=True, repr=False)
class Sweep(Display):
    """A table computed again for several values of an input.

    Parameters
    ----------
    key : str
        The table.
    names : tuple of str
        Addresses of printed cells that move together.
    label : str
        What they are, in words.
    steps : sequence of mapping
        Name to value, at each step.
    quantities : list of tuple of Point
        What becomes of each number over the steps.
    dashed : str
        What the dashed lines of the pictures are.
    """

    key: str
    names: tuple[str, ...]
    label: str
    steps: Sequence[Change]
    quantities: list[tuple[Point, ...]]
    dashed: str

    @property
    def values(self) -> list[str]:
        """The settings of all inputs, in one string for each step."""
        return [", ".join(map(str, step.values())) for step in self.steps]

    @property
    def _printed(self) -> list[bool]:
        return [all(_as_printed(*one) for one in step.items()) for step in self.steps]

    def frame(self) -> pd.DataFrame:
        """Return one row per value and cell: the value, the ends of its central 99 %, the unit."""
        import pandas as pd

        rows = [
            (value, one.cell, one.value, *(one.interval or (None, None)), one.unit)
            for points in self.quantities
            for value, one in zip(self.values, points, strict=True)
        ]
        heads = ["setting", "cell", "computed", "low", "high", "unit"]
        return pd.DataFrame(rows, columns=heads).set_index(["setting", "cell"])

    @property
    def grid(self) -> Grid:
        """The table of values and what becomes of each number."""
        head = [self.label, *(points[0].cell for points in self.quantities)]
        pairs = zip(self.values, self._printed, strict=True)
        settings = (value + " (printed)" * printed for value, printed in pairs)
        texts = [[one.text for one in points] for points in self.quantities]
        rows = list(zip(settings, *texts, strict=True))
        caption = f"{self.key} for {len(rows)} values of {' and '.join(self.names)}, all computed"
        predicted = any(one.interval for points in self.quantities for one in points)
        caption += (
            "; in brackets the central 99 % of the prediction." if predicted else "."
        )
        return Grid(caption, head, rows, whole=range(len(head)))

    def blocks(self) -> Iterator[Block]:
        """Yield the table, and on a page a slider over it with a picture of each number."""
        at = self._printed.index(True) if any(self._printed) else 0
        dial = Markup(
            '<div class="rp-sweep">\n<p class="rp-dial" hidden><label>{}: '
            '<input type="range" min="0" max="{}" step="1" value="{}"></label> '
            "<output></output>; all {} settings were computed beforehand</p>"
        )
        yield Html(dial.format(self.label, len(self.steps) - 1, at, len(self.steps)))
        yield self.grid
        pictures = Markup("\n").join(map(self._picture, self.quantities))
        yield Html(
            Markup('<div class="rp-sweep-pictures">{}</div></div>').format(pictures)
        )

    def _picture(self, points: Sequence[Point]) -> Markup:
        """Draw a number over the values: median, central 99 %, and a dashed line."""
        one = points[0]
        middle = np.array([point.value for point in points], dtype=float)
        pairs = zip(points, middle, strict=True)
        ends = np.array([point.interval or (value, value) for point, value in pairs])
        seen = np.concatenate([ends.ravel(), one.span])
        seen = seen[np.isfinite(seen)]
        low, high = (seen.min(), seen.max()) if len(seen) else (0.0, 0.0)
        scale = (HIGH - FOOT - 2 * MARGIN) / (high - low if high > low else 1)
        x = np.linspace(LEFT + 2 * MARGIN, WIDE - 2 * MARGIN, len(middle)).round(1)

        def y(value: float) -> float:
            return round(HIGH - FOOT - MARGIN - scale * float(value - low), 1)

        mark = '<g class="rp-at"><path d="M{} {}V{}"/><circle cx="{}" cy="{}" r="3.5"/></g>'
        marks = Markup("").join(
            Markup(mark).format(at, y(end[0]), y(end[1]), at, y(value))
            for at, value, end in zip(x, middle, ends, strict=True)
            if np.isfinite(value)
        )
        told, line = (
            f"{one.cell} from {self.values[0]} to {self.values[-1]}",
            Markup(""),
        )
        if np.isfinite(one.mark):
            told += f"; dashed: {self.dashed}"
            dashed = Markup('<path class="rp-dashed" d="M{} {}H{}"/>')
            line = dashed.format(LEFT, y(one.mark), WIDE - MARGIN)
        text = Markup('<text x="{}" y="{}" text-anchor="{}">{}</text>').format
        ends_of = (
            (LEFT - 4, y(end), "end", between(end, high - low or 1))
            for end in (low, high)
        )
        axes = Markup("").join(text(*end) for end in ends_of)
        axes += text(LEFT, HIGH - 3, "start", self.values[0])
        axes += text(WIDE, HIGH - 3, "end", self.values[-1])
        return Markup(
            '<figure><svg viewBox="0 0 {} {}" role="img" aria-label="{}">{}{}{}</svg>'
            "<figcaption>{}</figcaption></figure>"
        ).format(
            WIDE,
            HIGH,
            told,
            line,
            marks,
            axes,
            one.cell + f" ({one.unit})" * bool(one.unit),
        )


def swept(
    key: str,
    moved: str | Sequence[str],
    values: Sequence[str | float | Sequence[str | float]],
    compute: Callable[[Change], Iterable[Point]],
    dashed: str = "printed",
) -> Sweep:
    """Compute a table for each value of an input.

    Raises
    ------
    ValueError
        If there is no value, or not one for each input.
    """
    if isinstance(values, str) or not values:
        raise ValueError(
            f"expected a list of values, at least one value; got {values!r}"
        )
    names = (moved,) if isinstance(moved, str) else tuple(moved)
    steps = []
    for one in values:
        step = (one,) if isinstance(one, str | int | float) else tuple(one)
        if len(step) != len(names):
            got = ", ".join(map(str, step))
            raise ValueError(
                f"expected {len(names)} values for {', '.join(names)}, got {got}"
            )
        steps.append(dict(zip(names, step, strict=True)))
    columns = list(zip(*map(compute, steps), strict=True))
    label = ", ".join(find(name)[0].label for name in names)
    return Sweep(key, names, label, steps, columns, dashed)


def _as_printed(address: str, value: str | float) -> bool:
    return isclose(si_value(find(address)[0], value), find(address)[0].si)


def of_cells(rerun: Rerun, names: Sequence[str]) -> Iterator[Point]:
    """Yield the numbers of an item under a change: those of some cells, all of them where none."""
    for one in rerun.cells:
        if one.cell.is_number and (not names or one.cell.name in names):
            number, unit = one.cell.number, symbol(one.cell.unit)
            text = _digits(one, one.value) or "none"
            if one.interval:
                text += f" ({' to '.join(_digits(one, end) for end in one.interval)})"
            text = verdicts.quantity(text, unit if one.value is not None else "")
            place = (one.cell.name, unit, one.value, one.interval)
            yield Point(*place, text, float(number.value), number.interval())


def of_study(
    study: Study,
    frames: Sequence[pd.DataFrame],
    names: Sequence[str],
    wanted: Mapping[str, Any],
) -> Iterator[Point]:
    """Yield the numbers of a table of our own: `frames` are as it is and under a change.

    `names` are the columns to show, and `wanted` says of columns which entry, or entries, the rows
    to show have.

    Raises
    ------
    ValueError
        If there is no such column, it holds no numbers, or no row has such an entry.
    """
    known = {column.name: column for column in study.columns}
    if strays := [name for name in (*wanted, *names) if name not in known]:
        raise ValueError(
            f"{study.key}: no column {strays[0]!r}; it has {', '.join(known)}"
        )
    if words := [name for name in names if not known[name].form]:
        raise ValueError(
            f"{study.key}: {words[0]!r} holds words, which no slider can move over"
        )
    before, after = (_chosen(frame, wanted) for frame in frames)
    if not before or len(before) != len(after):
        raise ValueError(
            f"{study.key}: expected the same rows at every value, got none or others"
        )
    behind = {column.error for column in study.columns}
    shown = names or [
        c.name for c in study.columns[1:] if c.form and c.name not in behind
    ]
    for old, new in zip(before, after, strict=True):
        for name in shown:
            value, mark = float(new[name]), float(old[name])
            span = (mark - _NOTICED * abs(mark), mark + _NOTICED * abs(mark))
            text = entry(new[name], known[name])
            yield Point(
                _called(study, name, old, before), "", value, None, text, mark, span
            )


def _chosen(frame: pd.DataFrame, wanted: Mapping[str, Any]) -> list[dict[Any, Any]]:
    for name, entries in wanted.items():
        frame = frame[
            frame[name].isin([entries] if np.isscalar(entries) else list(entries))
        ]
    return frame.to_dict(orient="records")


def _called(
    study: Study, name: str, row: Mapping[Any, Any], rows: Sequence[Mapping[Any, Any]]
) -> str:
    """Return a column's name after as many words of its row as tell it from the others."""
    told = []
    for at in [c.name for c in study.columns if not c.form] or [study.columns[0].name]:
        if len(rows) > 1:
            told.append(f"{row[at]}" if isinstance(row[at], str) else f"{at} {row[at]}")
            rows = [other for other in rows if other[at] == row[at]]
    return f"{', '.join(told)}: {name}" if told else name
