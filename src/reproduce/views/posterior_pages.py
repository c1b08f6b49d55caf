"""What the pages of the posteriors call: each call shows one artefact of one model.

The artefacts are those of the six steps of the Bayesian analysis reporting guidelines (Kruschke,
2021). `reporting` links them. No call depends on another one, so cells run in any order; a test
holds that every page shows all six.
"""

from __future__ import annotations

from reproduce.inference.checks import predictive_checks
from reproduce.inference.posterior import digits
from reproduce.inference.priors import in_unit
from reproduce.inference.sensitivity import CROWDED, NEAR, NOTABLE, sensitivities
from reproduce.papers.posteriors import posteriors
from reproduce.views import posterior as running
from reproduce.views import posterior_calibration as calibrations
from reproduce.views import posterior_choice as choosing
from reproduce.views import posterior_data as formats
from reproduce.views import posterior_decision as deciding
from reproduce.views import posterior_figures as figures
from reproduce.views.markup import html_table
from reproduce.views.pages import Html

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


def _boxed(body: str) -> Html:
    return Html(f'<div class="rp-table">{body}</div>')


def _artefact(step: str, name: str, body: str) -> Html:
    return Html(f'<div class="rp-table" id="posterior-{name}-{step}">{body}</div>')


def model(name: str) -> Html:
    """Show a model: parameters, units, priors with their reasons, and what reaches it."""
    declared = posteriors()[name]
    built = running.book_posterior(name).model
    rows = []
    for one in built.parameters:
        prior = in_unit(one.prior, one.shown)
        rows.append((one.name, one.unit, str(prior), one.prior.reason))
    kind = "simulated from the printed settings" if declared.simulated else "as printed"
    caption = f"{declared.title}. Data {kind}; printed cells read: {', '.join(declared.given)}."
    table = html_table(("Parameter", "Unit", "Prior", "Why"), rows, caption)
    return _artefact("model", name, table)


def computation(name: str) -> Html:
    """Show that the chains have converged: R-hat, autocorrelation times, sizes, traces."""
    found = running.book_posterior(name)
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
    return _artefact("computation", name, html_table(head, rows, caption) + drawn)


def results(name: str) -> Html:
    """Show the posterior: summaries, consequences, predictive checks and a corner plot."""
    found = running.book_posterior(name)
    head = ("Quantity", "mean", "sd", "95 % from", "to", "MCSE", "R-hat", "bulk ESS", "tail ESS")
    rows = [(f"{r.name} ({r.unit})", *running.numbers(r)) for r in running.all_rows(found)]
    summary = html_table(head, rows, "Posterior, with no more digits than its error allows.")
    checks = [
        (c.name, f"{c.observed:.4g}", deciding.ranged(c.prior), deciding.ranged(c.posterior),
         deciding.probability(c.tail))
        for c in predictive_checks(found)
    ]  # fmt: skip
    compared = ("Number", "in the data", "prior predicts", "posterior predicts", "tail probability")
    caption = "Predictive checks: central 95 % of simulated data, and where the data lie."
    drawn = figures.corner(found, f"Corner plot of the posterior of {name}")
    return _artefact("results", name, summary + html_table(compared, checks, caption) + drawn)


def decision(name: str) -> Html:
    """Show the estimates and the published numbers in the posterior, and the rivals' evidence."""
    found = running.book_posterior(name)
    parts = [
        deciding.placed(found),
        deciding.bounded(name),
        deciding.repeated(name),
        choosing.compared(name),
    ]
    return _artefact("decision", name, "".join(parts))


def similarity_choice(name: str) -> Html:
    """Show the evidence of similarity, radial term and affine transform, in closed form too."""
    return _boxed(choosing.transforms(name))


def columns_of_table_5() -> Html:
    """Show what every reading of Table V comes to: which columns stand where, which digit holds."""
    return _boxed(choosing.columns_of_table_5())


def columns_of_table_4() -> Html:
    """Show white noise and floor of every column of Table IV, and what speaks for a floor."""
    return _boxed(choosing.columns_of_table_4())


def file_formats() -> Html:
    """Show which columns a user's own file has, for every model that takes one."""
    rows = [
        (", ".join(names), ", ".join(columns), told) for names, columns, told in formats.formats()
    ]
    return _boxed(html_table(("Model", "Columns", "What they hold"), rows, "Files for --data"))


def sensitivity(name: str) -> Html:
    """Show how the posterior answers when prior or likelihood is scaled."""
    rows = []
    for one in sensitivities(running.book_posterior(name)):
        held = "as it should be"
        if one.held_by_end:
            held = "an end of the flat prior holds it"
        elif one.prior >= NOTABLE:
            held = "prior and data" if one.likelihood >= NOTABLE else "the prior holds it"
        answers = (one.prior, one.likelihood, one.shift)
        told = (
            deciding.plain(digits(answer, max(error, LEAST_ERROR)))
            for answer, error in zip(answers, one.errors, strict=True)
        )
        rows.append((one.name, *told, f"{one.shape:.2f}", held))
    head = ("Parameter", "to prior", "to likelihood", "mean shift (sd)", "Pareto k", "reading")
    caption = (
        "Change of the posterior per doubling of the power of prior or likelihood (root of the "
        f"cumulative Jensen-Shannon divergence; from {NOTABLE} on it is worth a word), with no "
        "more digits than the errors allow that leaving out one ensemble after the other tells "
        f"of. An end holds a posterior with more than {100 * CROWDED:g} % of its draws within "
        f"{100 * NEAR:g} % of the width of a flat prior from it."
    )
    return _artefact("sensitivity", name, html_table(head, rows, caption))


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
    table = html_table(head, calibrations.coverage_rows(stored), caption)
    drawn = figures.ranks(stored, name, f"Ranks of {name} against their simultaneous band")
    return _artefact("reproducing", name, table + drawn + commands)


def calibrations_of_all() -> Html:
    """Show the stored calibrations of all models, a line each, and how even all ranks are."""
    found = calibrations.studies_of_all()
    least, count, expected = calibrations.least_of_all(found)
    head = ("Model", "replicates", "failed", "quantities", "least even, p", "95 % covers")
    caption = (
        f"Calibrations of all models. The least even of all {count} quantities has p = "
        f"{least:.2g}; of so many {expected:.2g} are expected to be as small by chance alone, "
        "however they depend on each other."
    )
    return _boxed(html_table(head, calibrations.overview_rows(found), caption))


def reporting(name: str) -> Html:
    """Link the six steps of the reporting guidelines to their artefacts on this page."""
    links = "".join(
        f'<li><a href="#posterior-{name}-{step}">{text}</a></li>' for step, text in STEPS.items()
    )
    return Html(f"<ul>{links}</ul>")
