"""What the book shows of the distributions of niu2024's simulation: every reading, every number."""

from __future__ import annotations

import numpy as np

from reproduce.judge import readings as judged
from reproduce.papers.niu2024 import angles, simulation, study
from reproduce.printed.cells import find
from reproduce.printed.given import given
from reproduce.printed.units import si_factor
from reproduce.store import studies
from reproduce.views.pages import Html
from reproduce.views.studies import READINGS
from reproduce.views.study_pages import plain_table, templates

NAMES = ("k", "θ (rad)", "Δx (px)", "Δy (px)", "before, x", "y", "after, x", "y")
BOTH = ("before (px)", "after (px)")


def distributions() -> Html:
    """Show median and central 99 % of every number under every reading."""
    door, levels = given(study.READS), studies.read(READINGS).arrays["quantiles"]
    every, tables = study.readings(door), []
    heads = ["Reading", *(f"{c}: {n}" for c in simulation.REGISTERED for n in (*NAMES, *BOTH))]
    for place, found in enumerate(angles.candidates(door)):
        rows = []
        for number, one in enumerate(every):
            if one.arrangement == place:
                label = f"{one.shifts}; draws: {one.repeats}; {one.noisy}; {one.tests}"
                cells = levels[number].transpose(1, 2, 0).reshape(-1, levels.shape[1])
                rows.append([label, *(spread(cell) for cell in cells)])
        caption = f"Median and half of the central 99 %: {found.name}."
        tables.append((found.name, plain_table(caption, heads, rows).text))
    return Html(templates().get_template("folded.html").render(tables=tables))


def spread(levels: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> str:
    """Write a distribution as its median and half of its central 99 %.

    Examples
    --------
    >>> spread(np.array([0.9, 0.95, 1.0, 1.05, 1.1]))
    '1.00 ± 0.10'
    """
    half = float(levels[-1] - levels[0]) / 2
    decimals = max(0, 1 - int(np.floor(np.log10(half))))
    return f"{levels[2]:.{decimals}f} ± {half:.{decimals}f}".replace("-", "−")


def printed_values() -> list[float]:
    """Return the print, red before blue and cells as in `counting.CELLS`, in rad and px."""
    cells = [find(address)[0] for address in judged.ADDRESSES]
    return [cell.number.value * si_factor(cell.unit) for cell in cells]
