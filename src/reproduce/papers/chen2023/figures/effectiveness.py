"""Which focal length Table V asks for: as it is printed, and with columns interchanged."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.chen2023.effectiveness import focal_lengths
from reproduce.papers.chen2023.platform import TELESCOPE
from reproduce.papers.declare import draws
from reproduce.papers.sketch import INK, Look, sized

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PRINTED = Look("columns as printed", "#0072B2", "none", "o")
INTERCHANGED = Look("columns interchanged", "#D55E00", "none", "D")


@draws("chen2023-focal-lengths", marks=(TELESCOPE,), named=focal_lengths.facts)
def draw_focal_lengths(figure: Figure, printed: Mapping[str, float]) -> None:
    """Focal length that each reference angle of Table V implies, under both readings."""
    frame = focal_lengths()
    frame = frame[frame["Angle"].str.startswith("reference")]
    # Row by row: the two angles of a state stand together, the first state on top.
    names = frame["Angle"].str.removeprefix("reference ").str.split(", ")
    order = sorted(range(len(frame)), key=lambda i: (names.iloc[i][1], names.iloc[i][0]))
    labels = [", ".join(reversed(names.iloc[i])) for i in order]
    own, own_half, other, other_half = (frame.iloc[order, i].to_numpy() for i in (1, 2, 4, 5))

    narrow = sized(figure, 5.2, 3.7, 4.6)
    left, right = figure.subplots(1, 2, sharey=True, width_ratios=(5, 3))
    rows = np.arange(len(order))
    left.hlines(rows, own, other, color="#777777", lw=0.8)
    _points(left, PRINTED, rows, own, own_half)
    for axes in (left, right):
        ends = (other - other_half).max(), (other + other_half).min()
        colour = INTERCHANGED.colour
        axes.axvspan(*ends, facecolor=(colour, 0.2), edgecolor=colour, linestyle=":", linewidth=0.8)
        _points(axes, INTERCHANGED, rows, other, other_half)
        axes.set_xlabel("focal length (mm)")
    nominal = printed[TELESCOPE] * 1e3
    left.locator_params(axis="x", nbins=3 if narrow else 5)
    left.axvline(nominal, color=INK, ls="--", lw=1, label="nominal")
    left.set(yticks=rows, yticklabels=labels, ylim=(len(rows) - 0.5, -0.5))
    right.set_title("enlarged" if narrow else "the same, enlarged", size=10)
    right.set_xlim((other - other_half).min() - 0.5, (other + other_half).max() + 0.5)
    entries = left.get_legend_handles_labels()
    columns = 1 if narrow else 3
    figure.legend(*entries, loc="outside lower center", ncols=columns, columnspacing=1.0)


def _points(
    axes: Axes, look: Look, rows: np.ndarray, lengths: np.ndarray, halves: np.ndarray
) -> None:
    """Mark lengths with bars as wide as the rounding of the print allows."""
    filled = look is INTERCHANGED
    axes.errorbar(
        lengths,
        rows,
        xerr=halves,
        fmt=look.marker,
        color=look.colour,
        markerfacecolor=look.colour if filled else "none",
        label=look.name,
        capsize=2,
        zorder=2 if filled else 3,
    )
