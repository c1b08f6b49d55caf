"""Table 3 of niu2024, printed against predicted."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.declare import Blocked, Marks, Prediction, draws
from reproduce.papers.niu2024 import simulation
from reproduce.papers.sketch import INK, sized
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import given

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

__all__ = ["Row", "table_3"]

TABLE_3 = "niu2024/table-3"
# Half-widths of the prediction shown to either side; what lies further out is an arrow at the edge.
REACH = 12.0
PREDICTED = "#2E8BC0"


@dataclass(frozen=True)
class Row:
    """What is predicted of one cell of Table 3, under one reading where there are two."""

    address: str
    label: str
    low: float  # ends of the central 99 %
    middle: float  # median
    high: float

    def scaled(self, values: object) -> FloatArray:
        """Return values as distances from the middle of the prediction, in its half-widths."""
        centre, half = (self.low + self.high) / 2, (self.high - self.low) / 2
        return (np.asarray(values, dtype=np.float64) - centre) / half


def table_3() -> list[Row]:
    """Return the predictions of Table 3 in order of print; a translation has one by each table."""
    results: dict[str, object] = {}
    for computation in (simulation.calibrated_parameters, simulation.calibrated_translations):
        results |= computation(given(computation.given))
    titles = {"scale": "scale", "rotation": "rotation"}
    titles |= {f"translation-{axis}": f"shift {axis}" for axis in "xy"}
    rows = []
    for quantity, title in titles.items():
        for channel in simulation.REGISTERED:
            result, label = results[f"{quantity}.{channel}"], f"{title}, {channel}"
            address = f"{TABLE_3}#{quantity}.{channel}"
            if isinstance(result, Prediction):
                rows.append(_row(address, label, result))
            elif isinstance(result, Blocked):
                for reading in result.readings:
                    if isinstance(reading.result, Prediction):
                        table = reading.choices["translations"].replace("table-", "Table ")
                        rows.append(_row(address, f"{label}: {table}", reading.result))
    return rows


def _row(address: str, label: str, prediction: Prediction) -> Row:
    low, middle, high = np.quantile(prediction.draws, (0.005, 0.5, 0.995))
    return Row(address, label, float(low), float(middle), float(high))


@draws("niu2024-table-3", marks=[TABLE_3])
def draw_table_3(figure: Figure, printed: Marks) -> None:
    """Table 3 printed against predicted: each prediction scaled to the same width."""
    rows = table_3()
    narrow = sized(figure, 4.9, 4.9, 5.2)
    axes = figure.add_subplot()
    for height, row in enumerate(rows):
        _predicted(axes, height, row)
        _printed(axes, height, row, printed)
    axes.set_yticks(range(len(rows)), [row.label for row in rows], fontsize=9)
    axes.set_ylim(len(rows) - 0.4, -0.6)
    axes.set_xlim(-REACH, REACH)
    axes.axvline(0, color=INK, linewidth=0.6, alpha=0.5, zorder=0)
    axes.grid(visible=False, axis="y")
    gap = "\n" if narrow else " "
    axes.set_xlabel(f"distance from the median{gap}(half-widths)", fontsize=9)
    axes.tick_params(axis="x", labelsize=9)
    _legend(figure, 1 if narrow else 2)


def _predicted(axes: Axes, height: int, row: Row) -> None:
    axes.plot([-1, 1], [height, height], color=PREDICTED, linewidth=8, solid_capstyle="butt")
    axes.plot(row.scaled(row.middle), height, "|", color=INK, markersize=13, markeredgewidth=1.2)


def _printed(axes: Axes, height: int, row: Row, printed: Marks) -> None:
    place = float(row.scaled(printed[row.address]))
    if abs(place) < REACH:
        low, high = row.scaled(printed.intervals[row.address])
        axes.plot([low, high], [height, height], color=INK, linewidth=1.3)
        axes.plot([low, high], [height, height], "|", color=INK, markersize=7)
        axes.plot(place, height, "D", color=INK, markersize=4.5)
        return
    side = float(np.sign(place))
    axes.plot(0.97 * side * REACH, height, "<" if side < 0 else ">", color=INK, markersize=7)
    text = f"{abs(place):.0f} away"
    where = "left" if side < 0 else "right"
    axes.text(0.86 * side * REACH, height, text, ha=where, va="center", fontsize=9)


def _legend(figure: Figure, columns: int) -> None:
    from matplotlib.lines import Line2D

    bar = Line2D([], [], color=PREDICTED, linewidth=8)
    median = Line2D([], [], color=INK, marker="|", markersize=13, linewidth=0)
    mark = Line2D([], [], color=INK, marker="D", markersize=4.5, linewidth=1.3)
    figure.legend(
        [bar, median, mark],
        ["predicted, central 99 %", "median", "printed, with its rounding"],
        loc="outside lower center",
        ncols=columns,
        fontsize=9,
    )
