"""One input moved over several values: a small table, and on a page a slider over it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isclose
from typing import TYPE_CHECKING, Any

import numpy as np
from markupsafe import Markup

from reproduce.judge.rerun import ChangedCell, Rerun, in_si
from reproduce.papers.declare import Column, Study
from reproduce.printed.cells import library
from reproduce.printed.number import Interval
from reproduce.printed.units import symbol
from reproduce.views.writing.blocks import Block, Grid, Html
from reproduce.views.writing.display import Display
from reproduce.views.writing.numbers import entry, minus

if TYPE_CHECKING:
    import pandas as pd

WIDE, HIGH, MARGIN = 220, 96, 8  # of one picture, in CSS pixels
# A number of our own that moves by a smaller share than this does not fill the height of a picture.
NOTICED = 0.05


@dataclass(frozen=True)
class Moved:
    """The input that is moved, or several that move together.

    Parameters
    ----------
    names : tuple of str
        Addresses of printed cells, or one setting of a study.
    label : str
        What they are, in words.
    steps : tuple of tuples
        What they are moved to: as in the print, or numbers.
    """

    names: tuple[str, ...]
    label: str
    steps: tuple[tuple[str | float, ...], ...]

    @classmethod
    def checked(
        cls,
        names: str | Sequence[str],
        values: Sequence[str | float | Sequence[str | float]],
        settings: Mapping[str, str],
    ) -> Moved:
        """Return what a reader asked for; `settings` are those that stand beside printed cells.

        Raises
        ------
        ValueError
            If there is no value, or not one for each input.
        """
        if isinstance(values, str):
            raise ValueError(f"expected a list of values to move the cell to, got {values!r} alone")
        if not values:
            raise ValueError("expected at least one value to move the cell to, got none")
        moved = (names,) if isinstance(names, str) else tuple(names)
        steps = [(v,) if isinstance(v, str | int | float) else tuple(v) for v in values]
        if wrong := [one for one in steps if len(one) != len(moved)]:
            got = ", ".join(map(str, wrong[0]))
            raise ValueError(f"expected {len(moved)} values for {', '.join(moved)}, got {got}")
        cells = (name.partition("#") for name in moved if name not in settings)
        labels = [library()[key][name].label for key, _, name in cells if key in library()]
        labels += [f"{name} ({settings[name]})" for name in moved if name in settings]
        return cls(moved, ", ".join(labels), tuple(steps))

    @property
    def changes(self) -> list[dict[str, str | float]]:
        """Name to value, for each step."""
        return [dict(zip(self.names, step, strict=True)) for step in self.steps]

    @property
    def printed(self) -> list[bool]:
        """Whether a step is what the paper prints."""
        return [all(_as_printed(*one) for one in change.items()) for change in self.changes]


def _as_printed(address: str, value: str | float) -> bool:
    key, _, name = address.partition("#")
    if key not in library():
        return False
    cell = library()[key][name]
    return isclose(in_si(cell, value), cell.si)


@dataclass(frozen=True)
class Quantity:
    """One number over the steps.

    Parameters
    ----------
    name, cell, reading : str
        What it is called in a head; the name of its cell; for a cell that depends on how the text
        is read, which reading this is.
    unit : str
        Of its values.
    values, intervals : tuples
        Its value at each step, none where nothing is computed, and the ends of its central 99 %.
    texts : tuple of str
        The same as a reader sees it.
    mark : float
        Where the dashed line lies.
    span : tuple of float
        What a picture shows at least: rounding noise is not to look like a difference.
    """

    name: str
    cell: str
    reading: str
    unit: str
    values: tuple[float | None, ...]
    intervals: tuple[Interval | None, ...]
    texts: tuple[str, ...]
    mark: float
    span: tuple[float, float]


@dataclass(frozen=True, repr=False)
class Sweep(Display):
    """A table computed again for several values of an input.

    Parameters
    ----------
    key : str
        The table.
    moved : Moved
        The input, and its values.
    quantities : tuple of Quantity
        What becomes of each number.
    dashed : str
        What the dashed lines of the pictures are.
    """

    key: str
    moved: Moved
    quantities: tuple[Quantity, ...]
    dashed: str

    @property
    def values(self) -> list[str]:
        """The settings of all inputs, in one string for each step."""
        return [", ".join(map(str, step)) for step in self.moved.steps]

    def frame(self) -> pd.DataFrame:
        """Return one row per value and cell: the value, the ends of its central 99 %, the unit."""
        import pandas as pd

        rows = [
            {
                "setting": value,
                "cell": one.cell,
                "reading": one.reading,
                "computed": one.values[number],
                "low": (one.intervals[number] or (None, None))[0],
                "high": (one.intervals[number] or (None, None))[1],
                "unit": one.unit,
            }
            for one in self.quantities
            for number, value in enumerate(self.values)
        ]
        frame = pd.DataFrame(rows).set_index(["setting", "cell"])
        return frame if frame["reading"].any() else frame.drop(columns="reading")

    @property
    def grid(self) -> Grid:
        """The table of values and what becomes of each number."""
        head = [self.moved.label, *(one.name for one in self.quantities)]
        settings = zip(self.values, self.moved.printed, strict=True)
        rows = [
            [value + " (printed)" * printed, *(one.texts[number] for one in self.quantities)]
            for number, (value, printed) in enumerate(settings)
        ]
        moved = " and ".join(self.moved.names)
        caption = f"{self.key} for {len(rows)} values of {moved}, all computed"
        predicted = any(any(one.intervals) for one in self.quantities)
        caption += "; in brackets the central 99 % of the prediction." if predicted else "."
        return Grid(caption, head, rows, whole=range(len(head)))

    def blocks(self) -> Iterator[Block]:
        """Yield the table, and on a page a slider over it with a picture of each number."""
        printed = self.moved.printed
        at = printed.index(True) if any(printed) else 0
        dial = Markup(
            '<div class="rp-sweep">\n<p class="rp-dial" hidden><label>{}: '
            '<input type="range" min="0" max="{}" step="1" value="{}"></label> '
            "<output></output></p>"
        )
        yield Html(dial.format(self.moved.label, len(self.values) - 1, at))
        yield self.grid
        pictures = Markup("\n").join(
            _picture(one, self.values, self.dashed) for one in self.quantities
        )
        yield Html(Markup('<div class="rp-sweep-pictures">{}</div></div>').format(pictures))


def of_cells(moved: Moved, reruns: Sequence[Rerun], names: Sequence[str]) -> Sweep:
    """Return a sweep over an item: `names` are the cells to show, all of them where none is."""
    chosen = [
        [one for one in rerun.cells if one.cell.is_number and (not names or one.cell.name in names)]
        for rerun in reruns
    ]
    quantities = tuple(_of_cell(column) for column in zip(*chosen, strict=True))
    return Sweep(reruns[0].key, moved, quantities, "printed")


def _of_cell(column: Sequence[ChangedCell]) -> Quantity:
    one, printed = column[0], column[0].cell.number
    return Quantity(
        name=f"{one.cell.name} if {one.reading}" if one.reading else one.cell.name,
        cell=one.cell.name,
        reading=one.reading,
        unit=symbol(one.cell.unit),
        values=tuple(each.value for each in column),
        intervals=tuple(each.interval for each in column),
        texts=tuple(map(_written, column)),
        mark=float(printed.value),
        span=printed.interval(),
    )


def _written(one: ChangedCell) -> str:
    if one.value is None:
        return "none"
    number = one.cell.number
    text = number.format(one.value, extra=1)
    if one.interval is not None:
        text += f" ({' to '.join(number.format(end, extra=1) for end in one.interval)})"
    unit = symbol(one.cell.unit) if one.cell.unit else ""
    return minus(f"{text} {unit}".strip())


def of_study(
    moved: Moved,
    study: Study,
    frames: Sequence[pd.DataFrame],
    names: Sequence[str],
    rows: Mapping[str, Any],
) -> Sweep:
    """Return a sweep over a table of our own.

    `frames` are the unchanged table and one for each step, `names` the columns to show, and `rows`
    says of columns which entry, or entries, the rows to show have.

    Raises
    ------
    ValueError
        If there is no such column, it holds no numbers, or no row has such an entry.
    """
    known = {column.name: column for column in study.columns}
    if strays := [name for name in (*rows, *names) if name not in known]:
        raise ValueError(f"{study.key}: no column {strays[0]!r}; it has {', '.join(known)}")
    if words := [name for name in names if not known[name].form]:
        raise ValueError(f"{study.key}: {words[0]!r} holds words, which no slider can move over")
    wanted = {name: [v] if isinstance(v, str | int | float) else v for name, v in rows.items()}
    chosen = [
        [
            row
            for row in frame.to_dict(orient="records")
            if all(row[name] in entries for name, entries in wanted.items())
        ]
        for frame in frames
    ]
    if not chosen[0] or len({len(one) for one in chosen}) > 1:
        raise ValueError(f"{study.key}: expected the same rows at every value, got none or others")
    behind = {column.error for column in study.columns}
    shown = names or [c.name for c in study.columns[1:] if c.form and c.name not in behind]
    quantities = tuple(
        _of_column(known[name], each, _called(study, name, each[0], chosen[0]))
        for each in zip(*chosen, strict=True)
        for name in shown
    )
    return Sweep(study.key, moved, quantities, "with what is printed")


def _called(
    study: Study, name: str, row: Mapping[Any, Any], rows: Sequence[Mapping[Any, Any]]
) -> str:
    """Return a column's name after as many words of its row as tell it from the others."""
    words = [column.name for column in study.columns if not column.form]
    if not words and len(rows) > 1:
        at = study.columns[0].name
        return f"{at} {row[at]}: {name}"
    told = []
    while words and len(rows) > 1:
        at = words.pop(0)
        told.append(str(row[at]))
        rows = [other for other in rows if other[at] == row[at]]
    return f"{', '.join(told)}: {name}" if told else name


def _of_column(column: Column, rows: Sequence[Mapping[Any, Any]], name: str) -> Quantity:
    mark, *values = (row[column.name] for row in rows)
    return Quantity(
        name=name,
        cell=name,
        reading="",
        unit="",
        values=tuple(map(float, values)),
        intervals=(None,) * len(values),
        texts=tuple(entry(value, column) for value in values),
        mark=float(mark),
        span=(mark - NOTICED * abs(mark), mark + NOTICED * abs(mark)),
    )


def _picture(quantity: Quantity, values: list[str], dashed: str) -> Markup:
    """Draw a number over the values: median, central 99 %, and a dashed line."""
    middle = np.array([np.nan if value is None else value for value in quantity.values])
    pairs = zip(quantity.intervals, middle, strict=True)
    ends = np.array([interval or (value, value) for interval, value in pairs])
    seen = np.concatenate([ends.ravel(), quantity.span])
    seen = seen[np.isfinite(seen)]
    low, high = (seen.min(), seen.max()) if len(seen) else (0.0, 0.0)
    high = high if high > low else low + 1
    x = np.linspace(2 * MARGIN, WIDE - 2 * MARGIN, len(middle)).round(1)

    def y(value: float) -> float:
        return round(HIGH - MARGIN - (HIGH - 2 * MARGIN) * float((value - low) / (high - low)), 1)

    mark = '<g class="rp-at"><path d="M{} {}V{}"/><circle cx="{}" cy="{}" r="3.5"/></g>'
    marks = Markup("").join(
        Markup(mark).format(at, y(end[0]), y(end[1]), at, y(value))
        for at, value, end in zip(x, middle, ends, strict=True)
        if np.isfinite(value)
    )
    told, line = f"{quantity.name} from {values[0]} to {values[-1]}", Markup("")
    if np.isfinite(quantity.mark):
        told += f"; dashed: {dashed}"
        line = Markup('<path class="rp-dashed" d="M{} {}H{}"/>').format(
            MARGIN, y(quantity.mark), WIDE - MARGIN
        )
    return Markup(
        '<figure><svg viewBox="0 0 {} {}" role="img" aria-label="{}">{}{}</svg>'
        "<figcaption>{}</figcaption></figure>"
    ).format(WIDE, HIGH, told, line, marks, quantity.name)
