"""All posteriors of the book at once: what they say, how far to trust them, files they take."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from markupsafe import Markup

from reproduce.inference import Gates, Summary
from reproduce.papers.declare import words
from reproduce.papers.niu2024 import decisions
from reproduce.papers.niu2024.posteriors import pixel_angle
from reproduce.papers.posteriors import posteriors
from reproduce.printed.cells import anchor, find
from reproduce.printed.given import given
from reproduce.printed.units import UNITS, symbol
from reproduce.store import studies
from reproduce.views.computed import item_ledger
from reproduce.views.objects.base import text_of
from reproduce.views.objects.figure import pictured
from reproduce.views.objects.posterior import Posterior, book_posterior, interval
from reproduce.views.writing import posterior_figures as figures
from reproduce.views.writing.blocks import Block, Entry, Grid, Html
from reproduce.views.writing.display import Blocks, Display
from reproduce.views.writing.numbers import digits, minus, percent

# Standard deviations too small by a share in %: columns of the calibrations that tell their power.
NARROW = {"10": "narrow_10", "5": "narrow_5"}
# The share of right curves that leave their own band.
OUTSIDE = 0.05


class Said(NamedTuple):
    """A quantity of `said`: a label, a posterior, its name there, the cell that prints it."""

    label: str
    posterior: str
    name: str
    cell: str = ""


def _channel(channel: str) -> list[Said]:
    rows = (
        ("Scale factor", "scale", "scale"),
        ("Rotation", "rotation", "rotation"),
        ("Translation x", "shift-x", "translation-x"),
        ("Translation y", "shift-y", "translation-y"),
    )
    return [
        Said(f"{label}, {channel}", "registration-joint", f"{channel}-{name}",
             f"niu2024/table-3#{row}.{channel}")
        for label, name, row in rows
    ]  # fmt: skip


_STATED_NOISE = "niu2024/text-simulation#noise"
SIMULATED = (
    *_channel("red"),
    *_channel("blue"),
    Said("Centroid noise", "registration-joint", "noise", _STATED_NOISE),
    *(Said(f"Misalignment about {axis.upper()}", "misalignment", f"angle-{axis}")
      for axis in "xyz"),
    *(Said(f"Drift about {axis.upper()}", "misalignment-drift", f"drift-{axis}")
      for axis in "xyz"),
    Said("Position on the ground, corrected", "misalignment", "position error"),
)  # fmt: skip


class Posteriors(Display):
    """Every posterior of the book: what all say, beside the print and the verdict of the print."""

    def blocks(self) -> Iterator[Block]:
        """Yield one table of all."""
        rows = [summarised(one) for one in SIMULATED]
        head = ("Quantity", "Data", "Printed", "Posterior, mean ± sd", "95 % interval",
                "Truth of our simulation", "Verdict of the print")  # fmt: skip
        yield Grid(words("posteriors/all").caption, head, rows, "posteriors")

    @property
    def models(self) -> Blocks:
        """What each is about, and the columns of a file of one's own that it takes."""
        about = [(name, one.paper, one.title) for name, one in posteriors().items()]
        heads = ("Models", "Columns", "What they hold")
        return Blocks((
            Grid("The models.", ("Model", "Paper", "About"), about, words=3, whole=(0, 1)),
            Grid(words("posteriors/models").caption, heads, _files(), words=3),
        ))  # fmt: skip

    def intervals(self) -> Html:
        """Draw the interval of every quantity that is printed or was simulated by us."""
        rows = [bar for one in SIMULATED if (bar := _bar(one))]
        text = words("posteriors/intervals").figure
        source = text_of(figures.bars)
        return pictured(figures.bars(rows), text.alternative, text.caption, source)

    def stars(self) -> Html:
        """Draw what a calibration leaves at the edge against its stars, with what emcee finds."""
        door = given(decisions.READS)
        counts = np.geomspace(10, 1000, 30)
        curves = decisions.edge_errors(door, counts)
        left = decisions.left_out(door)
        off = dict(zip(decisions.MODELS, (left, 0 * left), strict=True))
        marks = {
            name: decisions.sampled_edge(book_posterior(key), off[name])
            for name, key in decisions.MODELS.items()
        }
        count, text = door[decisions.COUNT], words("posteriors/stars").figure
        picture = figures.edge_errors(counts, curves, count, marks, pixel_angle(door))
        return pictured(picture, text.alternative, text.caption, text_of(figures.edge_errors))

    def diagnostics(self, paper: str) -> Blocks:
        """Show how far the posteriors of a paper can be trusted: chains and calibration of each."""
        names = [name for name, one in posteriors().items() if one.paper == paper]
        stored = studies.table("calibrations")
        trials = stored.attrs["trials"]
        stored = stored[stored["posterior"].isin(names)]
        rows = [
            _trusted(name, one, trials) for name, one in stored.groupby("posterior", sort=False)
        ]
        least, count = stored["even"].min(), len(stored)
        outside = (stored["even"] < OUTSIDE).sum()
        found_out = (f"sd {share} % too small leaves its band" for share in NARROW)
        head = ("Model", "R-hat, largest", "steps / τ, fewest", "ESS, smallest", "acceptance",
                "replicates", "failed", "quantities", "smallest p (even)", "95 % covers",
                *found_out)  # fmt: skip
        gates = Gates()
        caption = words("posteriors/diagnostics").caption.format(
            paper=paper, rhat=gates.rhat, times=gates.times, size=gates.size,
            acceptance=gates.acceptance, count=count, outside=outside, band=100 * (1 - OUTSIDE),
            chance=count * OUTSIDE, least=least, as_small=count * least,
        )  # fmt: skip
        return Blocks((Grid(caption, head, rows),))


def _summary(one: Said) -> Summary:
    return next(row for row in book_posterior(one.posterior).summaries() if row.name == one.name)


def summarised(one: Said) -> tuple[Entry, ...]:
    """Return the row of a quantity: label, data, print, mean ± sd, interval, truth, verdict."""
    row, ours = _summary(one), Posterior(one.posterior)
    gap = _gap(row.unit)
    label = Markup('<a href="#posterior-{}">{}</a>').format(one.posterior, one.label)
    printed, verdict = _of_print(one.cell)
    mean, ends = interval(row)
    truth = f"{ours.truth[one.name]:.6g}{gap}" if one.name in ours.truth else ""
    data = "simulated" if ours.declared.simulated else "printed"
    return label, data, printed, f"{mean}{gap}", f"{ends}{gap}", minus(truth), verdict


def _gap(unit: str) -> str:
    """Return a unit as a page shows it behind a number, with its space."""
    if unit not in UNITS:
        return f"\u202f{unit}"
    return symbol(unit) if symbol(unit) in {"", "°", "″"} else f"\u202f{symbol(unit)}"


def _of_print(address: str) -> tuple[Entry, Entry]:
    """Return a printed cell, linked, and the badge of its verdict."""
    if not address:
        return "", ""
    (cell,) = find(address)
    record = item_ledger(address.partition("#")[0]).cell(address)
    link = Markup('<a href="#{}">{}</a>').format(anchor(address), cell.shown)
    return link, Markup('<span class="rp-badge rp-badge-{0}">{0}</span>').format(record.verdict)


def _bar(one: Said) -> figures.Bar | None:
    """Return the bar of a quantity; none where it is neither printed nor simulated."""
    row, truth = _summary(one), Posterior(one.posterior).truth.get(one.name)
    cell = find(one.cell)[0] if one.cell else None
    if truth is None and cell is None:
        return None
    printed = None if cell is None else float(cell.number.value)
    half = 0.0 if cell is None else float(cell.number.half_unit)
    return figures.Bar(one.label, row.low, row.mean, row.high, truth, printed, half)


def _trusted(name: Any, stored: pd.DataFrame, trials: int) -> tuple[str, ...]:
    """Return the line of a posterior: its chains, then its calibration."""
    found = book_posterior(name)
    least, wide = stored.sort_values("even").iloc[0], 100 * stored["covers_95"]
    return (
        name, f"{max(one.rhat for one in found.diagnoses):.4f}",
        f"{min(one.times for one in found.diagnoses):.0f}",
        f"{min(min(one.bulk, one.tail) for one in found.diagnoses):,.0f}",
        f"{min(found.acceptance):.2f} to {max(found.acceptance):.2f}",
        f"{least['replicates']:,}", str(least["failed"]), str(len(stored)),
        digits(least["even"], least["even_error"]), f"{wide.min():.1f} to {wide.max():.1f} %",
        *(percent(least[column], trials) for column in NARROW.values()),
    )  # fmt: skip


def _files() -> list[tuple[str, str, str]]:
    """Say for a user's own files: models, their columns, what these hold, or why there are none."""
    found: dict[tuple[str, str], list[str]] = {}
    for key, declared in posteriors().items():
        file = declared.file
        known = ("none", file) if isinstance(file, str) else (", ".join(file.columns), file.meaning)
        found.setdefault(known, []).append(key)
    return [(", ".join(keys), *known) for known, keys in found.items()]
