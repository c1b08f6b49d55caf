"""What the pages of the posteriors call beside the front door.

What all posteriors say, in one table and three pictures; and the appendix of diagnostics, which
shows for each posterior the artefacts of the six steps of the Bayesian analysis reporting
guidelines (Kruschke, 2021). A test holds that none is missing.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from markupsafe import Markup

from reproduce.inference.calibration import banded, least_of_all, power
from reproduce.inference.checks import placed, predictive_checks
from reproduce.inference.posterior import Summary
from reproduce.papers import calibrations
from reproduce.papers.niu2024.posteriors import decisions
from reproduce.papers.niu2024.posteriors.new_stars import pixel_angle
from reproduce.papers.posteriors import posteriors
from reproduce.printed.cells import anchor, find
from reproduce.printed.given import given
from reproduce.printed.units import UNITS, symbol
from reproduce.views.computed import item_ledger
from reproduce.views.objects.base import text_of
from reproduce.views.objects.figure import pictured
from reproduce.views.objects.posterior import (
    Posterior,
    book_posterior,
    book_repeats,
    coverage_rows,
    entries,
    interval,
    named,
)
from reproduce.views.objects.posterior import file_formats as formats
from reproduce.views.writing import posterior_figures as figures
from reproduce.views.writing.display import Entry, Grid, Html, folded
from reproduce.views.writing.numbers import (
    digits,
    minus,
    percent,
    ranged,
    shared,
    signed,
)

__all__ = [
    *(
        "PRINTED",
        "SIMULATED",
        "STEPS",
        "calibrations_of_all",
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

STEPS = {
    "model": "The model and its data",
    "computation": "The computation",
    "results": "The posterior",
    "decision": "Estimates",
    "reproducing": "Calibration, and how to redo everything",
}
# Shares by which a standard deviation may be too small, of which the power is told.
NARROW = (0.1, 0.05)
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


def said() -> Html:
    """Show what every posterior says, beside the print and its verdict."""
    rows = [summarised(one) for one in (*PRINTED, *SIMULATED)]
    head = ("Quantity", "Data", "Printed", "Posterior, mean ± sd", "95 % interval",
            "Truth of our simulation", "Verdict of the print")  # fmt: skip
    caption = (
        "What the posteriors say. Data: as printed, or simulated by us with printed settings "
        "where the paper's own are not published. Verdict: that of the printed cell; no posterior "
        "decides one."
    )
    return Html(Grid(caption, head, rows, "posteriors").html)


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


def diagnostics(paper: str) -> Html:
    """Show everything that speaks for or against the posteriors of a paper, each in a fold."""
    steps = (model, computation, results, decision, reproducing)
    folds = []
    for name, declared in posteriors().items():
        if declared.paper != paper:
            continue
        parts = [Markup(reporting(name).text), *(Markup(step(name).text) for step in steps)]
        summary = Markup("<strong>{}</strong>: {}. {}").format(name, declared.title, _gates(name))
        fold = folded(summary, Markup("").join(parts))
        folds.append(Markup('<div id="diagnostics-{}">{}</div>').format(name, fold))
    return Html(Markup("").join(folds))


def _gates(name: str) -> str:
    found = book_posterior(name).diagnoses
    return (
        f"R-hat up to {max(one.rhat for one in found):.3f}, effective sample size from "
        f"{min(min(one.bulk, one.tail) for one in found):,.0f}"
    )


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], caption: str) -> str:
    return str(Grid(caption, head, rows).html) if rows else ""


def _step(step: str, name: str, *parts: str) -> Html:
    title = f'<p class="rp-step"><strong>{STEPS[step]}</strong></p>'
    return Html(f'<div id="posterior-{name}-{step}">{title}{"".join(parts)}</div>')


def model(name: str) -> Html:
    """Show a model: parameters, units, priors with their reasons, and what reaches it."""
    ours = Posterior(name)
    caption = f"Data {ours.told}. Printed cells read: {', '.join(ours.reads)}."
    rows = [(name, unit, prior.replace(" -", " −"), why)
            for name, unit, prior, why in ours.priors.itertuples(name=None)]  # fmt: skip
    return _step("model", name, _table(("Parameter", "Unit", "Prior", "Why"), rows, caption))


def computation(name: str) -> Html:
    """Show that the chains have converged: R-hat, autocorrelation times, sizes, traces."""
    found = book_posterior(name)
    rows = [
        (d.name, f"{d.rhat:.4f}", f"{d.time:.1f}", f"{d.times:.0f}", f"{d.bulk:.0f}",
         f"{d.tail:.0f}")
        for d in found.diagnoses
    ]  # fmt: skip
    ensembles, steps, walkers = found.chain.shape[:3]
    caption = (
        f"{ensembles} independent ensembles of {walkers} walkers, {steps} steps each, acceptance "
        f"{min(found.acceptance):.2f} to {max(found.acceptance):.2f}."
    )
    head = ("Parameter", "R-hat", "τ (steps)", "steps / τ", "bulk ESS", "tail ESS")
    alternative = (
        f"One panel for each parameter of {name}, with the median of the walkers of each ensemble "
        "against the step. All ensembles wander about one level, without a trend."
    )
    below = f"Traces of {name}: the median of the walkers, a line for each ensemble."
    drawn = pictured(figures.traces(found), alternative, below, text_of(figures.traces))
    return _step("computation", name, _table(head, rows, caption), drawn.text)


def results(name: str) -> Html:
    """Show the posterior: summaries, consequences, predictive checks and a corner plot."""
    found = book_posterior(name)
    head = ("Quantity", "mean", "sd", "95 % from", "to", "MCSE", "R-hat", "bulk ESS", "tail ESS")
    rows = [(named(r), *map(minus, entries(r)))
            for r in found.summaries()]  # fmt: skip
    summary = _table(
        head, rows, "Posterior, to the digits that its Monte Carlo error (MCSE) allows."
    )
    checks = [
        (
            c.name,
            minus(f"{c.observed:.4g}"),
            ranged(c.prior) if c.prior else "",
            ranged(c.posterior),
            shared(c.tail),
        )
        for c in predictive_checks(found)
    ]
    compared = ("Number", "in the data", "prior predicts", "posterior predicts", "tail probability")
    caption = "Predictive checks: central 95 % of simulated data, and where the data lie."
    return _step("results", name, summary, _table(compared, checks, caption), correlations(name))


def correlations(name: str) -> str:
    """Return the correlation of every pair of parameters, for those that no corner plot shows."""
    found = book_posterior(name)
    if found.model.dimension == 1:
        return ""
    related = np.atleast_2d(np.corrcoef(found.draws.T))
    rows = [
        (name, *(minus(f"{value:z.2f}") for value in row[: i + 1]), *[""] * (len(row) - i - 1))
        for i, (name, row) in enumerate(zip(found.model.names, related, strict=True))
    ]
    return _table(("Parameter", *found.model.names), rows, "Correlations of the parameters.")


def decision(name: str) -> Html:
    """Show the estimates and the published numbers in the posterior."""
    return _step("decision", name, estimates(name), bounds(name), repeats(name))


def estimates(name: str) -> str:
    """Return the nominal or least-squares estimates, placed in the posterior."""
    rows = [
        (
            named(one),
            minus(f"{one.estimate:.6g}"),
            signed(digits(one.off, one.error)),
            shared(one.tail),
        )
        for one in placed(book_posterior(name))
    ]
    head = ("Parameter", "estimate", "posterior sd from the mean", "tail probability")
    caption = "The nominal or least-squares estimate, placed in the posterior."
    return _table(head, rows, caption)


def bounds(name: str) -> str:
    """Return the Cramér-Rao bound beside the width of the posterior, where it is simple."""
    rows = [
        (named(one), digits(one.width, one.error), f"{one.bound:.4g}",
         digits(one.ratio, one.ratio_error))
        for one in posteriors()[name].bounds(book_posterior(name))
    ]  # fmt: skip
    head = ("Parameter", "posterior sd", "Cramér-Rao bound", "ratio")
    caption = (
        "The width of the posterior, and the least that any unbiased estimate can have; a prior "
        "may make the posterior narrower."
    )
    return _table(head, rows, caption)


def repeats(name: str) -> str:
    """Return the published numbers, and those of repeats of the experiment."""
    found = book_repeats(name)
    if found is None:
        return ""
    printed, together, note = found
    rows = [
        (
            named(row),
            row.printed,
            ranged(row.range),
            shared(row.tail),
            shared(row.same),
            "estimates none" if row.estimated is None else shared(row.estimated),
        )
        for row in printed
    ]
    head = ("Printed number", "in print", "95 % of repeats", "tail probability among repeats",
            "a repeat prints the same digits", "tail probability in the posterior")  # fmt: skip
    caption = (
        "The published numbers, and those of repeats of the experiment simulated under the "
        "posterior, computed as the paper does and rounded as in print; probabilities with their "
        f"Monte Carlo standard errors. All digits alike at once: {shared(together)}. {note}"
    )
    return _table(head, rows, caption)


def file_formats() -> Html:
    """Show which columns a user's own file has, for every model that takes one."""
    rows = [(keys, names or "none", text) for keys, names, text in formats()]
    return Html(_table(("Model", "Columns", "What they hold"), rows, "Files for --data"))


def reproducing(name: str) -> Html:
    """Show the calibration of the model and the commands that redo everything."""
    stored = calibrations.load(name)
    commands = (
        f"<pre>reproduce posterior {name}\nreproduce calibrate {name} "
        f"--replicates {stored.replicates}</pre>"
    )
    head = ("Quantity", "evenness of ranks, p", "50 % covers", "95 % covers",
            "published estimator, 95 % covers")  # fmt: skip
    caption = (
        f"Simulation-based calibration, {stored.replicates} replicates, of which "
        f"{int(stored.failed.sum())} missed the gate on autocorrelation times. The published "
        "estimator is least squares for stars and QUEST for laser spots, with its own standard "
        "errors, on the same data. These are drawn from the whole prior, so they may hold a drift "
        "or a distortion that it does not know."
    )
    table = _table(head, coverage_rows(stored), caption)
    alternative = (
        f"A curve for each quantity of {name} with ranks of its own: they are cumulated, less what "
        "even ranks give, against a shaded band about zero that holds a whole curve with the "
        "stated probability."
    )
    below = (
        f"Ranks of {name} in its calibration. The band holds one whole curve; of many curves one "
        "or another may leave it. Of quantities with the same ranks one is drawn."
    )
    drawn = pictured(figures.ranks(stored, name), alternative, below, text_of(figures.ranks))
    return _step("reproducing", name, table, drawn.text, commands)


def calibrations_of_all() -> Html:
    """Show the stored calibrations of all models, a line each."""
    found = calibrations.of_all()
    rows = []
    for name, one in found.items():
        least, wide = banded(float(one.probabilities().min())), 100 * one.coverage(0.95)
        rows.append((name, f"{one.replicates:,}", str(int(one.failed.sum())), str(len(one.names)),
                     digits(least.value, least.error),
                     f"{wide.min():.1f} to {wide.max():.1f} %",
                     *(percent(power(one.replicates, 1 - share)) for share in NARROW)))  # fmt: skip
    least_one, count, expected = least_of_all(list(found.values()))
    outside = sum(int((one.probabilities() < OUTSIDE).sum()) for one in found.values())
    found_out = (f"sd {100 * share:g} % too small leaves its band" for share in NARROW)
    head = ("Model", "replicates", "failed", "quantities", "least even, p", "95 % covers",
            *found_out)  # fmt: skip
    caption = (
        f"Calibrations of all models. Of {count} quantities {outside} leave their own band of "
        f"{100 * (1 - OUTSIDE):g} %, where chance alone makes {count * OUTSIDE:.2g}; the least "
        f"even has p = {least_one:.2g}, and {expected:.2g} are expected to be as small."
    )
    return Html(_table(head, rows, caption))


def reporting(name: str) -> Html:
    """Link the six steps of the reporting guidelines to their artefacts."""
    link = '<li><a href="#posterior-{}-{}">{}</a></li>'
    links = (link.format(name, step, text) for step, text in STEPS.items())
    return Html(f"<ol>{''.join(links)}</ol>")
