"""What the pages of the posteriors call: each call shows one artefact of one model.

The artefacts are those of the six steps of the Bayesian analysis reporting guidelines (Kruschke,
2021). `reporting` links them. No call depends on another one, so cells run in any order; a test
holds that every page shows all six.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from reproduce.inference.calibration import banded, least_of_all
from reproduce.inference.checks import placed, predictive_checks
from reproduce.inference.evidence import Compared
from reproduce.inference.models.radial import WIDTHS
from reproduce.inference.sensitivity import CROWDED, NEAR, NOTABLE, sensitivities
from reproduce.papers import calibrations
from reproduce.papers.chen2023.posteriors import (
    FLOORS,
    summed_columns,
    table_reads,
    table_shares,
)
from reproduce.papers.niu2024.posteriors import transforms
from reproduce.papers.posteriors import posteriors
from reproduce.views.objects.posterior import (
    Posterior,
    book_posterior,
    coverage_rows,
    entries,
    named,
)
from reproduce.views.writing import posterior_figures as figures
from reproduce.views.writing.display import Grid, Html
from reproduce.views.writing.numbers import digits, plain, ranged, shared, signed

__all__ = [
    *("STEPS", "calibrations_of_all", "columns_of_table_4", "columns_of_table_5", "computation"),
    *("decision", "file_formats", "model", "reporting", "reproducing", "results"),
    *("sensitivity", "transform_choice"),
]

STEPS = {
    "model": "1. The model and its data are explained",
    "computation": "2. The computation is reported and has converged",
    "results": "3. The posterior is described",
    "decision": "4. Models are compared and estimates placed",
    "sensitivity": "5. The sensitivity to the priors is shown",
    "reproducing": "6. Everything can be redone",
}
# Three decimals at most, however small the Monte Carlo error.
LEAST_ERROR = 5e-4


def _table(head: Sequence[str], rows: Sequence[Sequence[str]], caption: str) -> str:
    return str(Grid(caption, head, rows).html) if rows else ""


def _step(step: str, name: str, *parts: str) -> Html:
    return Html(f'<div id="posterior-{name}-{step}">{"".join(parts)}</div>')


def model(name: str) -> Html:
    """Show a model: parameters, units, priors with their reasons, and what reaches it."""
    declared = posteriors()[name]
    kind = "simulated from the printed settings" if declared.simulated else "as printed"
    caption = f"{declared.title}. Data {kind}; printed cells read: {', '.join(declared.given)}."
    rows = list(Posterior(name).priors.itertuples(name=None))
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
    drawn = figures.traces(found, f"Trace of every parameter of {name}, one colour per ensemble")
    return _step("computation", name, _table(head, rows, caption), drawn)


def results(name: str) -> Html:
    """Show the posterior: summaries, consequences, predictive checks and a corner plot."""
    found = book_posterior(name)
    head = ("Quantity", "mean", "sd", "95 % from", "to", "MCSE", "R-hat", "bulk ESS", "tail ESS")
    rows = [(_named(r), *entries(r)) for r in found.summaries()]
    summary = _table(head, rows, "Posterior, with no more digits than its error allows.")
    checks = [
        (c.name, f"{c.observed:.4g}", ranged(c.prior), ranged(c.posterior), shared(c.tail))
        for c in predictive_checks(found)
    ]
    compared = ("Number", "in the data", "prior predicts", "posterior predicts", "tail probability")
    caption = "Predictive checks: central 95 % of simulated data, and where the data lie."
    drawn = figures.corner(found, f"Corner plot of the posterior of {name}")
    return _step("results", name, summary, _table(compared, checks, caption), drawn)


def _named(row: Any) -> str:
    return f"{row.name} ({row.unit})"


def decision(name: str) -> Html:
    """Show the estimates and the published numbers in the posterior, and the rivals' evidence."""
    return _step("decision", name, estimates(name), bounds(name), repeats(name), rivals(name))


def estimates(name: str) -> str:
    """Return the nominal or least-squares estimates, placed in the posterior."""
    rows = [
        (_named(one), f"{one.estimate:.6g}", signed(digits(one.off, one.error)), shared(one.tail))
        for one in placed(book_posterior(name))
    ]
    head = ("Parameter", "estimate", "posterior sd from the mean", "tail probability")
    caption = "The nominal or least-squares estimate, placed in the posterior."
    return _table(head, rows, caption)


def bounds(name: str) -> str:
    """Return the Cramér-Rao bound beside the width of the posterior, where it is simple."""
    rows = [
        (_named(one), digits(one.width, one.error), f"{one.bound:.4g}",
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
    found = posteriors()[name].repeats(book_posterior(name))
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


def rivals(name: str) -> str:
    """Return the evidence of a model and its rivals, with the exact one where there is one.

    The model has been sampled anyway; a rival is sampled only where there is no other way.
    """
    declared = posteriors()[name]
    found = declared.choice(book_posterior(name))
    rows = [_weighed(one, "0" if i == 0 else _difference(one)) for i, one in enumerate(found)]
    head = ("Model", "log evidence, sampled", "MCSE", "Pareto k", "closed form or quadrature",
            "less the first one's")  # fmt: skip
    caption = "Evidence (natural logarithm) under the priors above; differences decide."
    if declared.simulated and len(rows) > 1:
        caption += (
            " The data are our own simulation: which model is preferred tests the method, and says "
            "nothing of the instrument."
        )
    return _table(head, rows, caption)


def _weighed(one: Compared, less: str) -> tuple[str, ...]:
    sampled = ("not needed", "", "")
    if one.sampled is not None:
        value, error = one.sampled.value, one.sampled.error
        sampled = (digits(value, error), f"{error:.1g}", f"{one.sampled.shape:.2f}")
    return one.name, *sampled, "none" if one.exact is None else f"{one.exact:.3f}", less


def _difference(one: Compared) -> str:
    if one.error == 0:
        return f"{one.less:.3f}".replace("-", "−")
    return f"{digits(one.less, one.error)} ± {one.error:.1g}".replace("-", "−")


def transform_choice() -> Html:
    """Show the evidence of similarity, radial term and affine transform, under several priors."""
    rows = [(name, *(f"{log:.3f}" for log in logs)) for name, logs in transforms().items()]
    head = ("Transform", *(f"log evidence, {width:g} px" for width in WIDTHS))
    caption = (
        "Similarity against its rivals. Displacements at the edge of the field have equal priors; "
        "those that a rival adds to the similarity are Gaussian about nothing with the standard "
        "deviation at the head of the column, on which the evidence of a rival hangs: a prior "
        "wider than the estimate is sharp costs it the logarithm of their ratio, per term."
        " The data are our own simulation with the printed settings, from cameras whose "
        "distortions differ from channel to channel: the choice tests the method, and says "
        "nothing of the paper's centroids."
    )
    return Html(_table(head, rows, caption))


def columns_of_table_5() -> Html:
    """Show what every reading of Table V comes to: which columns stand where, which digit holds."""
    focal, noise = posteriors()["table-5"].model().parameters[:2]
    shown = (focal, noise, noise, noise)
    rows = []
    for one, share in zip(table_reads(), table_shares(), strict=True):
        pairs = zip(one.means, one.deviations, shown, strict=True)
        moments = (_moments(m * p.shown, d * p.shown, p.unit) for m, d, p in pairs)
        rows.append((one.name, f"{one.log_evidence:.3f}", f"{share:.2g}", *moments))
    head = ("Reading", "log evidence", "probability", "focal length", "noise",
            "bias, angles printed about X", "about Y")  # fmt: skip
    caption = (
        "What each reading of the table comes to, all equally probable beforehand; mean ± standard "
        "deviation. No sampling: the sums are exact to the digits shown."
    )
    return Html(_table(head, rows, caption))


def _moments(mean: float, deviation: float, unit: str) -> str:
    decimals = max(0, 1 - int(np.floor(np.log10(deviation))))
    return f"{mean:z.{decimals}f} ± {deviation:.{decimals}f} {unit}"


def columns_of_table_4() -> Html:
    """Show white noise and floor of every column of Table IV, and what speaks for a floor."""
    rows = []
    for one in summed_columns():
        decimals = 1 - int(np.floor(np.log10(one.white_error)))
        rows.append((
            one.column.replace("-", ", "),
            f"{one.white:.{decimals}f} ± {one.white_error:.2g} arcsec",
            f"{one.floor:#.2g} arcsec", f"{one.prior:.3g} arcsec",
            *(f"{gain:+.2f}".replace("-", "−") for gain in one.gains),
        ))  # fmt: skip
    head = ("Column", "white noise of one frame", "floor, 97.5 % below", "scale of its prior",
            *(f"evidence of a floor, scale times {factor:g}" for factor in FLOORS))  # fmt: skip
    caption = (
        "Every column by itself, one sigma, summed over nodes without sampling; and the log "
        "evidence of a floor less that of none, for priors of the floor narrower and wider than "
        "ours: what changes its sign is decided by the prior."
    )
    return Html(_table(head, rows, caption))


def file_formats() -> Html:
    """Show which columns a user's own file has, for every model that takes one."""
    formats: dict[tuple[str, str], list[str]] = {}
    for key, declared in posteriors().items():
        file = declared.file
        told = ("none", file) if isinstance(file, str) else (", ".join(file.columns), file.meaning)
        formats.setdefault(told, []).append(key)
    rows = [(", ".join(keys), *told) for told, keys in formats.items()]
    return Html(_table(("Model", "Columns", "What they hold"), rows, "Files for --data"))


def sensitivity(name: str) -> Html:
    """Show how the posterior answers when prior or likelihood is scaled."""
    rows = []
    for one in sensitivities(book_posterior(name)):
        answers = (one.prior, one.likelihood, one.shift)
        told = (
            plain(digits(answer, max(error, LEAST_ERROR)))
            for answer, error in zip(answers, one.errors, strict=True)
        )
        rows.append((one.name, *told, f"{one.shape:.2f}", one.held_by))
    head = ("Parameter", "to prior", "to likelihood", "mean shift (sd)", "Pareto k", "reading")
    caption = (
        "Change of the posterior per doubling of the power of prior or likelihood (root of the "
        f"cumulative Jensen-Shannon divergence; from {NOTABLE} on it is worth a word), with no "
        "more digits than the errors allow that leaving out one ensemble after the other tells "
        f"of. An end holds a posterior with more than {100 * CROWDED:g} % of its draws within "
        f"{100 * NEAR:g} % of the width of a flat prior from it."
    )
    return _step("sensitivity", name, _table(head, rows, caption))


def reproducing(name: str) -> Html:
    """Show the calibration of the model and the commands that redo everything."""
    commands = (
        f"<pre>reproduce posterior {name}\nreproduce calibrate {name} "
        f"--replicates {calibrations.REPLICATES}</pre>"
    )
    stored = calibrations.load(name)
    head = ("Quantity", "evenness of ranks, p", "50 % covers", "95 % covers",
            "published estimator, 95 % covers")  # fmt: skip
    caption = (
        f"Simulation-based calibration, {stored.replicates} replicates, "
        f"{int(stored.failed.sum())} of which missed the gate on autocorrelation times. The band "
        "below holds a whole curve, but each by itself: of many curves one or the other leaves it. "
        "The published estimator is least squares on stars and QUEST on laser spots, with its own "
        "standard errors; it is tried on the same data, drawn from the whole prior, which it may "
        "take for something simpler."
    )
    table = _table(head, coverage_rows(stored), caption)
    drawn = figures.ranks(stored, name, f"Ranks of {name} against their simultaneous band")
    return _step("reproducing", name, table, drawn, commands)


def calibrations_of_all() -> Html:
    """Show the stored calibrations of all models, a line each, and how even all ranks are."""
    found = calibrations.of_all()
    rows = []
    for name, one in found.items():
        least, wide = banded(float(one.probabilities().min())), 100 * one.coverage(0.95)
        rows.append((name, f"{one.replicates:,}", str(int(one.failed.sum())), str(len(one.names)),
                     digits(least.value, least.error),
                     f"{wide.min():.1f} to {wide.max():.1f} %"))  # fmt: skip
    least_one, count, expected = least_of_all(list(found.values()))
    head = ("Model", "replicates", "failed", "quantities", "least even, p", "95 % covers")
    caption = (
        f"Calibrations of all models. The least even of all {count} quantities has p = "
        f"{least_one:.2g}; of so many {expected:.2g} are expected to be as small by chance alone, "
        "however they depend on each other."
    )
    return Html(_table(head, rows, caption))


def reporting(name: str) -> Html:
    """Link the six steps of the reporting guidelines to their artefacts on this page."""
    link = '<li><a href="#posterior-{}-{}">{}</a></li>'
    links = (link.format(name, step, text) for step, text in STEPS.items())
    return Html(f"<ul>{''.join(links)}</ul>")
