"""Estimates placed in their posteriors, repeats of the experiments, and models compared."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from reproduce.inference.checks import Share, tail_share
from reproduce.inference.closed_form import cramer_rao_bound, registration_log_evidence
from reproduce.inference.diagnostics import mcse_deviation
from reproduce.inference.evidence import Evidence, log_evidence, small_log_evidence
from reproduce.inference.posterior import Posterior, digits
from reproduce.inference.radial import (
    affine_model,
    linear_log_evidence,
    radial_model,
    similarity_model,
)
from reproduce.inference.repeats import Published, repeats
from reproduce.inference.small_angle import small_angle_posterior
from reproduce.inference.stage_table import StageTableLikelihood
from reproduce.inference.table_readings import Read, read
from reproduce.papers.chen2023.posteriors import readings
from reproduce.papers.posteriors import posteriors
from reproduce.views import posterior as running
from reproduce.views.markup import html_table

if TYPE_CHECKING:
    from collections.abc import Callable

# Below this a probability is written with its power of ten.
SMALL = 1e-3


def probability(share: Share) -> str:
    """Write a probability with its Monte Carlo standard error, or the bound that none seen sets.

    Examples
    --------
    >>> probability(Share(0.03775, 0.003, 4000)), probability(Share(0.0, 0.00025, 4000))
    ('0.04 ± 0.003', '< 0.0008')
    >>> probability(Share(0.002, 0.0009, 4000))
    '0.002 ± 0.0009'
    """
    if share.value == 0:
        return f"< {3 / share.count:.1g}"
    if share.value >= SMALL:
        text = digits(share.value, share.error)
        # Nearly all error: one digit still says more than a zero.
        text = text if float(text) else f"{share.value:.1g}"
        return f"{text} ± {share.error:.1g}"
    kept = int(np.floor(np.log10(share.value)) - np.ceil(np.log10(2 * share.error)))
    return f"{share.value:.{max(kept, 0)}e} ± {share.error:.0e}"


def placed(found: Posterior) -> str:
    """Return the nominal or least-squares estimates, placed in the posterior."""
    rows = []
    for i, parameter in enumerate(found.model.parameters):
        if parameter.name not in found.model.estimate:
            continue
        estimate, draws = found.model.estimate[parameter.name], found.draws[:, i]
        shown = (estimate - parameter.offset) * parameter.shown
        rows.append((f"{parameter.name} ({parameter.unit})", f"{shown:.6g}",
                     f"{(estimate - draws.mean()) / draws.std():+.2f}",
                     probability(tail_share(draws, estimate))))  # fmt: skip
    head = ("Parameter", "estimate", "posterior sd from the mean", "tail probability")
    caption = "The nominal or least-squares estimate, placed in the posterior."
    return html_table(head, rows, caption) if rows else ""


def bounded(found: Posterior) -> str:
    """Return the Cramér-Rao bound beside the width of the posterior, where it is simple."""
    try:
        bounds = cramer_rao_bound(found.model)
    except TypeError:
        return ""
    rows = []
    for i, (parameter, bound) in enumerate(zip(found.model.parameters, bounds, strict=True)):
        chain = found.chain[..., i]
        error = mcse_deviation(chain) / bound
        name = f"{parameter.name} ({parameter.unit})"
        width, least = chain.std() * parameter.shown, bound * parameter.shown
        rows.append((name, f"{width:.3g}", f"{least:.3g}", digits(width / least, error)))
    head = ("Parameter", "posterior sd", "Cramér-Rao bound", "ratio")
    caption = "The width of the posterior, and the least that any unbiased estimate can have."
    return html_table(head, rows, caption)


def repeated(found: Posterior, published: Published) -> str:
    """Return the published numbers, and those of repeats of the experiment."""
    rows, together = repeats(found, published)
    shown = [
        (
            row.name if row.unit == "1" else f"{row.name} ({row.unit})",
            row.printed,
            f"{row.low:.5g} to {row.high:.5g}",
            probability(row.tail),
            probability(row.same),
            "estimates none" if row.estimated is None else probability(row.estimated),
        )
        for row in rows
    ]
    head = ("Printed number", "in print", "95 % of repeats", "tail probability among repeats",
            "a repeat prints the same digits", "tail probability in the posterior")  # fmt: skip
    caption = (
        "The published numbers, and those of repeats of the experiment simulated under the "
        "posterior, computed as the paper does and rounded as in print; probabilities with their "
        f"Monte Carlo standard errors. All digits alike at once: {probability(together)}."
    )
    return html_table(head, shown, caption)


def compared(name: str) -> str:
    """Return the evidence of a model and its rivals, with the exact one where there is one."""
    chain = (running.book_posterior(name), *running.rival_posteriors(name))
    sampled = [log_evidence(one, one.seed) for one in chain]
    rows = [
        (found.name, digits(found.value, found.error), f"{found.error:.1g}",
         _ratio(found, sampled[0]), f"{found.shape:.2f}", exact_evidence(one))
        for one, found in zip(chain, sampled, strict=True)
    ]  # fmt: skip
    head = ("Model", "log evidence", "MCSE", "less the first one's", "Pareto k",
            "closed form or quadrature")  # fmt: skip
    caption = "Evidence (natural logarithm) under the priors above; differences decide."
    return html_table(head, rows, caption)


def _ratio(one: Evidence, first: Evidence) -> str:
    if one is first:
        return "0"
    error = float(np.hypot(one.error, first.error))
    return f"{digits(one.value - first.value, error)} ± {error:.1g}"


def exact_evidence(one: Posterior) -> str:
    """Return the log evidence without sampling, where there is a way, or say that there is none."""
    ways: tuple[Callable[[Posterior], float], ...] = (
        lambda found: linear_log_evidence(found.model),
        lambda found: registration_log_evidence(found.model),
        lambda found: small_angle_posterior(found.model).log_evidence,
        small_log_evidence,
        _table_evidence,
    )
    for way in ways:
        try:
            return f"{way(one):.3f}"
        except TypeError:
            continue
    return "none"


def _table_evidence(one: Posterior) -> float:
    """Log evidence of the stage table by quadrature: of one hypothesis, or of both with halves."""
    if not isinstance(one.model.likelihood, StageTableLikelihood):
        raise TypeError(f"{one.model.name}: expected the stage table")
    as_printed, crossed = table_reads()[:2]
    hypothesis = one.model.likelihood.hypothesis
    if hypothesis is not None:
        return (as_printed, crossed)[hypothesis].log_evidence
    return float(np.logaddexp(as_printed.log_evidence, crossed.log_evidence) - np.log(2))


@cache
def table_reads() -> tuple[Read, ...]:
    """Return what every reading of Table V comes to, summed once in a process."""
    model = posteriors()["table-5"].model()
    return tuple(read(model, reading) for reading in readings())


def columns_of_table_5() -> str:
    """Return every reading of Table V: evidence, probability and moments, by quadrature."""
    model = posteriors()["table-5"].model()
    found = table_reads()
    logs = np.array([one.log_evidence for one in found])
    shares = np.exp(logs - np.logaddexp.reduce(logs))
    focal, noise = model.parameters[:2]
    rows = [
        (one.name, f"{one.log_evidence:.3f}", f"{share:.2g}",
         _moments(one, 0, focal.shown, focal.unit), _moments(one, 1, noise.shown, noise.unit),
         _moments(one, 2, noise.shown, noise.unit), _moments(one, 3, noise.shown, noise.unit))
        for one, share in zip(found, shares, strict=True)
    ]  # fmt: skip
    head = ("Reading", "log evidence", "probability", "focal length", "noise",
            "bias, angles printed about X", "about Y")  # fmt: skip
    caption = (
        "What each reading of the table comes to, all equally probable beforehand; mean ± standard "
        "deviation. No sampling: the sums are exact to the digits shown."
    )
    return html_table(head, rows, caption)


def _moments(one: Read, i: int, factor: float, unit: str) -> str:
    mean, deviation = one.means[i] * factor, one.deviations[i] * factor
    decimals = max(0, 1 - int(np.floor(np.log10(deviation))))
    rounded = round(mean, decimals) + 0.0  # no minus before a zero
    return f"{rounded:.{decimals}f} ± {deviation:.{decimals}f} {unit}"


def transforms(name: str) -> str:
    """Return the evidence of similarity, radial term and affine transform, in closed form too."""
    base = posteriors()[name].model()
    rows = []
    for rival in (similarity_model(base), radial_model(base), affine_model(base)):
        one = running.run(rival, running.plan_for(name))
        sampled = log_evidence(one, one.seed)
        rows.append((rival.name, digits(sampled.value, sampled.error), f"{sampled.error:.1g}",
                     f"{sampled.shape:.2f}", exact_evidence(one)))  # fmt: skip
    head = ("Transform", "log evidence", "MCSE", "Pareto k", "closed form")
    caption = "Similarity against its rivals, with equal priors on displacements at the edge."
    return html_table(head, rows, caption)
