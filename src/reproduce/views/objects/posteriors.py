"""What the pages of the posteriors call beside the front door.

What all posteriors say, in one table and three pictures; and how far they can be trusted, in one
table for each paper.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from markupsafe import Markup

from reproduce.inference import Gates, Share, Summary
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
from reproduce.views.objects.posterior import (
    Posterior,
    book_posterior,
    interval,
)
from reproduce.views.objects.posterior import file_formats as formats
from reproduce.views.writing import posterior_figures as figures
from reproduce.views.writing.blocks import Entry, Grid, Html
from reproduce.views.writing.display import Blocks
from reproduce.views.writing.numbers import (
    digits,
    minus,
    percent,
)

__all__ = [
    *(
        "PRINTED",
        "SIMULATED",
    ),
    *(
        "diagnostics",
        "file_formats",
        "intervals",
        "noise_of_table_3",
        "said",
        "stars",
        "summarised",
    ),
]

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


def _frames(count: int) -> str:
    return f"{count} frame{'s' if count > 1 else ''}"


_STATED_NOISE = "niu2024/text-simulation#noise"
PRINTED = (
    Said(
        "Centroid noise, if one made all errors of Table 3",
        "centroid-noise",
        "noise",
        _STATED_NOISE,
    ),
    *(
        Said(f"Misalignment about {axis.upper()}, {_frames(count)}, 3σ",
             "frame-averaging", f"misalignment-{axis}, error of {_frames(count)}",
             f"chen2023/table-4#{count}.misalignment-{axis}")
        for count in (1, 100) for axis in "xy"
    ),
    Said("Floor that averaging leaves, about X, 1σ", "frame-averaging", "misalignment-x-floor"),
    Said("Floor that averaging leaves, about Y, 1σ", "frame-averaging", "misalignment-y-floor"),
    Said("Focal length behind Table V", "table-5", "focal-length",
         "chen2023/table-2#telescope-focal-length.value"),
    Said("Noise of a monitored angle", "table-5", "noise"),
    Said("Bias about X", "table-5", "bias-x"),
    Said("Bias about Y", "table-5", "bias-y"),
    Said("Error of a monitored state, both axes", "table-5", "pointing error"),
    Said("The same on the ground", "table-5", "position error"),
)  # fmt: skip
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


def said() -> Blocks:
    """Show what every posterior says, beside the print and its verdict."""
    rows = [summarised(one) for one in (*PRINTED, *SIMULATED)]
    head = ("Quantity", "Data", "Printed", "Posterior, mean ± sd", "95 % interval",
            "Truth of our simulation", "Verdict of the print")  # fmt: skip
    caption = (
        "What the posteriors say. Data: as printed, or simulated by us with printed settings "
        "where the paper's own are not published. Verdict: that of the printed cell; no posterior "
        "decides one."
    )
    return Blocks((Grid(caption, head, rows, "posteriors"),))


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


def intervals() -> Html:
    """Draw the interval of every quantity of `said` that is printed or was simulated by us."""
    rows = []
    for one in (*PRINTED, *SIMULATED):
        row, truth = _summary(one), Posterior(one.posterior).truth.get(one.name)
        cell = find(one.cell)[0] if one.cell else None
        if truth is None and cell is None:
            continue
        printed = None if cell is None else float(cell.number.value)
        half = 0.0 if cell is None else float(cell.number.half_unit)
        rows.append(figures.Bar(one.label, row.low, row.mean, row.high, truth, printed, half))
    alternative = (
        "A bar of the same width for each quantity. Diamonds, the truth of our simulations, lie in "
        "or near their bars. Of the circles, the print, those of Table IV lie in their bars or "
        "at an end; the scales, the translations, the noise against Table 3 and the nominal focal "
        "length lie outside, most of them far."
    )
    caption = (
        "Every quantity that is printed or whose truth is known. Bars: the central 95 % of the "
        "posterior, all scaled to one width. An arrow at the edge says how many half-widths away "
        "the print lies. Our simulation stands on the principal points of Table 1, the printed "
        "translations on Table 2: that is why they differ. The truth of a scale leaves out the "
        "distortion of the channels, which a similarity takes for scale."
    )
    return pictured(figures.bars(rows), alternative, caption, text_of(figures.bars))


def noise_of_table_3() -> Html:
    """Draw the noise that would make all errors of Table 3, beside the stated one."""
    found = book_posterior("centroid-noise")
    alternative = (
        "Histogram of the centroid noise with one peak and a long tail to the right. A dashed line "
        "marks the noise that the text states, far left of the whole histogram."
    )
    caption = (
        "Centroid noise, if one noise made all errors of Table 3, which none fits well. Data as "
        "printed in niu2024. Orange: the noise that the text states."
    )
    mark = float(found.model.estimate["noise"])
    picture = figures.density(found, "noise", mark)
    return pictured(picture, alternative, caption, text_of(figures.density))


def stars() -> Html:
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
    alternative = (
        "Two falling lines with bands, both axes logarithmic: the error at the edge of the field "
        "against the number of stars. The line with the distortions free begins above that of the "
        "similarity and falls straight; that of the similarity levels off, and they cross. At the "
        "printed number of stars a mark with a bar lies on each line."
    )
    caption = (
        "How far a calibration misplaces the outermost star. Lines: the median of calibrations; "
        "bands: the central 95 %. Both follow from the printed design and noise without sampling. "
        "Marks with bars: the same from the posteriors that emcee sampled, with the printed number "
        "of stars, simulated by us. A similarity also errs by what it leaves out of Table 1."
    )
    count = door[decisions.COUNT]
    picture = figures.edge_errors(counts, curves, count, marks, pixel_angle(door))
    return pictured(picture, alternative, caption, text_of(figures.edge_errors))


def diagnostics(paper: str) -> Blocks:
    """Show how far the posteriors of a paper can be trusted, a line each: chains, calibration."""
    names = [name for name, one in posteriors().items() if one.paper == paper]
    stored = studies.table("calibrations")
    trials = stored.attrs["trials"]
    stored = stored[stored["posterior"].isin(names)]
    rows = [_trusted(name, one, trials) for name, one in stored.groupby("posterior", sort=False)]
    least, count = stored["even"].min(), len(stored)
    outside = (stored["even"] < OUTSIDE).sum()
    found_out = (f"sd {share} % too small leaves its band" for share in NARROW)
    head = ("Model", "R-hat, largest", "steps / τ, fewest", "ESS, smallest", "acceptance",
            "replicates", "failed", "quantities", "least even, p", "95 % covers",
            *found_out)  # fmt: skip
    gates = Gates()
    caption = (
        f"Posteriors of {paper}: the chains, then the simulation-based calibration. The gates: "
        f"R-hat at most {gates.rhat:g}, at least {gates.times:g} autocorrelation times τ, "
        f"effective sample sizes (bulk and tail) from {gates.size:g}, acceptance from "
        f"{gates.acceptance:g}. "
        f"Of {count} quantities {outside} leave their own band of {100 * (1 - OUTSIDE):g} %, where "
        f"chance alone makes {count * OUTSIDE:.2g}; the least even has p = {least:.2g}, and "
        f"{count * least:.2g} are expected to be as small."
    )
    return Blocks((Grid(caption, head, rows),))


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
        *(percent(Share.counted(least[column], trials)) for column in NARROW.values()),
    )  # fmt: skip


def file_formats() -> Blocks:
    """Show which columns a user's own file has, for every model that takes one."""
    rows = [(keys, names or "none", text) for keys, names, text in formats()]
    return Blocks((Grid("Files for --data", ("Model", "Columns", "What they hold"), rows),))
