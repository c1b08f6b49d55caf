"""Result of a rerun, and of several values of one input, on a page with a slider."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isclose
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from jinja2 import Environment
from markupsafe import Markup

from reproduce.judge.rerun import ChangedCell, Rerun
from reproduce.papers.declare import Study
from reproduce.printed.cells import find
from reproduce.printed.number import Interval, symbol
from reproduce.printed.quantity import si_value
from reproduce.views import verdicts
from reproduce.views.base import Change, setting
from reproduce.views.blocks import Block, Display, Grid, Html
from reproduce.views.numbers import between, entry, minus

if TYPE_CHECKING:
    import pandas as pd

# Size of a picture, its margin, and the space of its axes, in CSS pixels.
_WIDTH_PX, _HEIGHT_PX, _MARGIN_PX = 220, 110, 8
_LEFT_PX, _FOOT_PX = 56, 16
# Relative change of a number of a supplementary table that fills the height of a picture.
_MIN_CHANGE_RATIO = 0.05
_OWN = "a reader's own setting, without a verdict"
_READING = (
    "one reading of the text; the verdict of a cell takes all readings into account"
)
_ENVIRONMENT = Environment(autoescape=True)
_SLIDER = _ENVIRONMENT.from_string(
    """<div class="rp-sweep">
<p class="rp-dial" hidden><label>{{ label }}: \
<input type="range" min="0" max="{{ count - 1 }}" step="1" value="{{ at }}"></label> \
<output></output>; all {{ count }} settings were computed beforehand</p>"""
)
_PICTURE = _ENVIRONMENT.from_string(
    """<figure><svg viewBox="0 0 {{ width }} {{ height }}" role="img" \
aria-label="{{ label }}">\
{% if dashed is not none %}\
<path class="rp-dashed" d="M{{ left }} {{ dashed }}H{{ right }}"/>{% endif %}\
{% for x, low, high, y in marks %}<g class="rp-at"><path d="M{{ x }} {{ low }}V{{ high }}"/>\
<circle cx="{{ x }}" cy="{{ y }}" r="3.5"/></g>{% endfor %}\
{% for x, y, anchor, text in texts %}\
<text x="{{ x }}" y="{{ y }}" text-anchor="{{ anchor }}">{{ text }}</text>{% endfor %}\
</svg><figcaption>{{ caption }}</figcaption></figure>"""
)


class Point(NamedTuple):
    """One number at one value of the input.

    `interval` is its central 99 %, `text` the text for readers, `mark` the height of the dashed
    line of its picture, and `span` the smallest range of the picture: rounding noise is no
    difference.
    """

    cell: str
    unit: str
    value: float | None
    interval: Interval | None
    text: str
    mark: float
    span: Interval


class Changed(Display):
    """A table or cell recomputed with changed inputs, without a verdict.

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
        self.changes, self.options = result.changes, result.options
        self.replaced = result.replaced
        self._cells = [one for one in result.cells if name in {"", one.cell.name}]

    def frame(self) -> pd.DataFrame:
        """Return the printed, computed and changed values, and their difference.

        Returns
        -------
        pandas.DataFrame
            One row per computed cell, in the printed unit, with the central 99 % where it is a
            prediction; a reading of the text has the ``verdict`` of each cell.
        """
        import pandas as pd

        rows = []
        for one in self._cells:
            low, high = one.interval or (None, None)
            row = {
                "cell": one.cell.name,
                "printed": one.cell.text,
                "unchanged": one.unchanged,
                "changed": one.value,
                "changed - printed": None,
                "low": low,
                "high": high,
                "unit": one.cell.unit and symbol(one.cell.unit),
            }
            if one.value is not None and one.cell.is_number:
                row["changed - printed"] = one.value - one.cell.number.value
            rows.append(row | ({"verdict": one.verdict} if one.verdict else {}))
        return pd.DataFrame(rows).set_index("cell")

    @property
    def grid(self) -> Grid:
        """The cells and the changes, as a reader sees them; without empty columns."""
        reading = self.result.is_reading
        remark = _READING if reading else _OWN
        changed = self.changes | self.options
        caption = setting(f"{self.result.key} with", changed, self.replaced, remark)
        if any(one.interval for one in self._cells):
            caption += " From and to: the central 99 % of the prediction."
        if self.result.joint:
            caption += f" {verdicts.joint_sentence(self.result.joint)}"
        columns: dict[str, Callable[[ChangedCell], str]] = {
            "cell": lambda one: one.cell.name,
            "printed": lambda one: minus(one.cell.text),
            "from the print": lambda one: _digits(
                one, None if reading else one.unchanged
            ),
            "computed" if reading else "changed": lambda one: _digits(one, one.value),
            "from": lambda one: _digits(one, one.interval and one.interval[0]),
            "to": lambda one: _digits(one, one.interval and one.interval[1]),
            "verdict": lambda one: one.verdict,
            "unit": lambda one: symbol(one.cell.unit),
        }
        rows = [one for one in self._cells if one.cell.is_number]
        texts = [{name: write(row) for name, write in columns.items()} for row in rows]
        return Grid.of(caption, columns, texts)

    def blocks(self) -> Iterator[Block]:
        """Yield the cells and the changes."""
        yield self.grid


def _digits(one: ChangedCell, value: float | None) -> str:
    return "" if value is None else minus(one.cell.number.format(value, extra=1))


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
        return [all(_is_printed(*one) for one in step.items()) for step in self.steps]

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
        return Grid(caption, head, rows)

    def blocks(self) -> Iterator[Block]:
        """Yield the table, and on a page a slider over it with a picture of each number."""
        at = self._printed.index(True) if any(self._printed) else 0
        slider = _SLIDER.render(label=self.label, count=len(self.steps), at=at)
        yield Html(Markup(slider))
        yield self.grid
        pictures = Markup("\n").join(map(self._picture, self.quantities))
        yield Html(
            Markup('<div class="rp-sweep-pictures">{}</div></div>').format(pictures)
        )

    def _picture(self, points: Sequence[Point]) -> Markup:
        """Draw a number over the values: median, central 99 %, and a dashed line."""
        first = points[0]
        middle = np.array([point.value for point in points], dtype=float)
        ends = np.array([p.interval or (p.value, p.value) for p in points], dtype=float)
        seen = np.concatenate([ends.ravel(), first.span])
        seen = seen[np.isfinite(seen)]
        low, high = (seen.min(), seen.max()) if len(seen) else (0.0, 0.0)
        range_px = _HEIGHT_PX - _FOOT_PX - 2 * _MARGIN_PX
        x = np.linspace(
            _LEFT_PX + 2 * _MARGIN_PX, _WIDTH_PX - 2 * _MARGIN_PX, len(middle)
        )

        def y(value: Any) -> Any:
            height = range_px * (value - low) / (high - low or 1)
            return np.round(_HEIGHT_PX - _FOOT_PX - _MARGIN_PX - height, 1)

        marks = np.column_stack([x.round(1), y(ends), y(middle)])
        texts = [
            (_LEFT_PX - 4, y(end), "end", between(end, high - low or 1))
            for end in (low, high)
        ]
        texts.append((_LEFT_PX, _HEIGHT_PX - 3, "start", self.values[0]))
        texts.append((_WIDTH_PX, _HEIGHT_PX - 3, "end", self.values[-1]))
        label, dashed = f"{first.cell} from {self.values[0]} to {self.values[-1]}", None
        if np.isfinite(first.mark):
            label, dashed = f"{label}; dashed: {self.dashed}", y(first.mark)
        return Markup(
            _PICTURE.render(
                width=_WIDTH_PX,
                height=_HEIGHT_PX,
                left=_LEFT_PX,
                right=_WIDTH_PX - _MARGIN_PX,
                label=label,
                dashed=dashed,
                marks=marks[np.isfinite(middle)].tolist(),
                texts=texts,
                caption=f"{first.cell} ({first.unit})" if first.unit else first.cell,
            )
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
    names = (moved,) if isinstance(moved, str) else tuple(moved)
    steps = []
    for value in () if isinstance(values, str) else values:
        step = [value] if isinstance(value, str | int | float) else list(value)
        if len(step) != len(names):
            raise ValueError(
                f"values: expected {len(names)} for {', '.join(names)}, got {step}"
            )
        steps.append(dict(zip(names, step, strict=True)))
    if not steps:
        raise ValueError(
            f"values: expected a list of at least one value, got {values!r}"
        )
    columns = list(zip(*map(compute, steps), strict=True))
    label = ", ".join(find(name)[0].label for name in names)
    return Sweep(key, names, label, steps, columns, dashed)


def _is_printed(address: str, value: str | float) -> bool:
    cell = find(address)[0]
    return isclose(si_value(cell, value), cell.si)


def of_cells(rerun: Rerun, names: Sequence[str]) -> Iterator[Point]:
    """Yield the numbers of an item under a change: of the named cells; by default of all cells."""
    for one in rerun.cells:
        if one.cell.is_number and (not names or one.cell.name in names):
            number, unit = one.cell.number, symbol(one.cell.unit)
            text = "none"
            if one.value is not None:
                ends = " to ".join(_digits(one, end) for end in one.interval or ())
                text = _digits(one, one.value) + (ends and f" ({ends})")
                text = verdicts.quantity(text, unit)
            yield Point(
                cell=one.cell.name,
                unit=unit,
                value=one.value,
                interval=one.interval,
                text=text,
                mark=number.value,
                span=number.interval(),
            )


def of_study(
    study: Study,
    frames: Sequence[pd.DataFrame],
    names: Sequence[str],
    wanted: Mapping[str, Any],
) -> Iterator[Point]:
    """Yield the numbers of a supplementary table; `frames` are without and with a change.

    `names` are the columns to show. `wanted` maps columns to the entry, or entries, of the rows to
    show.

    Raises
    ------
    ValueError
        If there is no such column, it contains no numbers, or no row has such an entry.
    """
    known = {column.name: column for column in study.columns}
    errors = {column.error for column in study.columns}
    numbers = [c.name for c in study.columns if c.form and c.name not in errors]
    for name in (*wanted, *names):
        if name not in known or (name in names and not known[name].form):
            raise ValueError(
                f"{name}: expected a column of {study.key}, {', '.join(known)}; columns to "
                "show contain numbers"
            )
    before, after = (_rows(frame, wanted) for frame in frames)
    if not before or len(before) != len(after):
        raise ValueError(f"{study.key}: expected the same rows at every value")
    first = study.columns[0].name
    labels = [c.name for c in study.columns if not c.form] or [first]
    for old, new in zip(before, after, strict=True):
        for name in names or [name for name in numbers if name != first]:
            mark = float(old[name])
            room = _MIN_CHANGE_RATIO * abs(mark)
            yield Point(
                cell=": ".join([*_distinguished(old, before, labels), name]),
                unit="",
                value=float(new[name]),
                interval=None,
                text=entry(new[name], known[name]),
                mark=mark,
                span=(mark - room, mark + room),
            )


def _rows(frame: pd.DataFrame, wanted: Mapping[str, Any]) -> list[dict[Any, Any]]:
    """Return the rows with the wanted entries."""
    for name, entries in wanted.items():
        frame = frame[frame[name].isin(np.atleast_1d(entries))]
    return frame.to_dict(orient="records")


def _distinguished(
    row: Mapping[Any, Any], rows: Sequence[Mapping[Any, Any]], labels: Sequence[str]
) -> list[str]:
    """Return the labels that distinguish a row from the other rows, in one text; or nothing."""
    texts = []
    for name in labels:
        if len(rows) > 1:
            value = row[name]
            texts.append(value if isinstance(value, str) else f"{name} {value}")
            rows = [other for other in rows if other[name] == value]
    return [", ".join(texts)] if texts else []
