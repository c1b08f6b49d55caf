"""Distances between printed and computed numbers, in units of the largest that agrees."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
import pandas as pd

from reproduce.papers.charts import Figure, set_size
from reproduce.views._blocks import Html
from reproduce.views._computed import whole_ledger
from reproduce.views.figure import figure_block


def distances(papers: Collection[str]) -> pd.DataFrame:
    """Return the computed numbers of papers that agree or differ, those that differ first.

    The distance is the middle of the printed interval minus the middle of the interval of the
    computed number, over the sum of their half widths. It is at most one if both overlap.
    """
    rows = []
    for record in whole_ledger().records:
        judged = record.agrees or record.verdict == "differs"
        if record.paper in papers and judged:
            ends = np.array([record.stands_for, record.interval], float)
            low, high, lower, upper = ends.flat  # NaN for the open end of a limit
            if (width := high - low + upper - lower) > 0:
                number = (
                    f"{record.place.partition(',')[0]}: {record.printed_cell.label}"
                )
                distance = (low + high - lower - upper) / width
                rows.append(
                    (record.cell, record.paper, number, record.agrees, distance)
                )
    columns = ["name", "paper", "number", "agrees", "distance"]
    return pd.DataFrame(rows, columns=columns).sort_values("agrees", kind="stable")


def differences_block(found: pd.DataFrame) -> Html:
    """Return the strip plot of the distances, one row per number that differs."""
    numbers = found["number"].mask(found["agrees"], "numbers that agree")
    lines = found["paper"] + ", " + numbers
    count = lines.nunique()

    def paint(figure: Figure) -> None:
        narrow = set_size(figure, 0.34 * count + 1.0, 0.42 * count + 1.0)
        names = lines.str.replace(", ", ",\n", n=1) if narrow else lines
        axes = figure.add_subplot()
        axes.axvspan(-1, 1, fc=("C6", 0.2), ec="C6")
        for agrees, look in ((False, "C1D"), (True, "C0|")):
            shown = found["agrees"] == agrees
            axes.plot(found["distance"][shown], names[shown], look)
        axes.set_xscale("symlog", linthresh=2)
        axes.set_xticks([-5, -1, 0, 1, 5, 20], ["−5", "−1", "0", "1", "5", "20"])
        axes.set(xlabel="distance (largest that agrees)", xlim=(-6, 30))
        axes.invert_yaxis()

    agree = int(found["agrees"].sum())
    return figure_block(
        "figure-differences",
        paint,
        f"Strip plot with one row for each of {len(found) - agree} numbers that differ, and a row "
        f"of each paper for its numbers that agree, {agree} in all. The agreeing numbers are short "
        "lines between minus one and one, in a shaded band. The others are diamonds outside of "
        "the band: most are a few units away, one is much farther.",
        f"{len(found) - agree} printed numbers are farther from the computed number than the "
        "largest distance that agrees, which is the unit of the axis. Diamonds: numbers that "
        "differ; lines: numbers that agree; band: agreement. The unit contains the rounding of "
        "the printed number, and the range of the computed number by rounded inputs or by chance.",
    )
