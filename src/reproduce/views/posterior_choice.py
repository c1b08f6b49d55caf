"""Models compared: sampled evidence, and the exact one where there is a way without sampling."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from reproduce.inference.closed_form import registration_log_evidence
from reproduce.inference.evidence import Evidence, log_evidence, small_log_evidence
from reproduce.inference.model import UnsuitableModelError
from reproduce.inference.posterior import Posterior, digits
from reproduce.inference.priors import HalfNormal
from reproduce.inference.radial import (
    WIDTH,
    WIDTHS,
    affine_model,
    linear_log_evidence,
    radial_model,
    similarity_model,
)
from reproduce.inference.small_angle import small_angle_posterior
from reproduce.inference.stage_table import StageTableLikelihood
from reproduce.inference.table_readings import Read, read
from reproduce.papers.chen2023.posteriors import readings
from reproduce.papers.posteriors import posteriors
from reproduce.views import posterior as running
from reproduce.views.markup import html_table

if TYPE_CHECKING:
    from collections.abc import Callable

# Scales of the floor's prior, over ours.
FLOORS = (0.25, 1, 4)


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
    if posteriors()[name].simulated and len(chain) > 1:
        caption += (
            " The data are our own simulation: which model is preferred tests the method, and says "
            "nothing of the instrument."
        )
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
        except UnsuitableModelError:
            continue
    return "none"


def _table_evidence(one: Posterior) -> float:
    """Log evidence of the stage table by quadrature: of one hypothesis, or of both with halves."""
    if not isinstance(one.model.likelihood, StageTableLikelihood):
        raise UnsuitableModelError(f"{one.model.name}: expected the stage table")
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
    """Return the evidence of similarity, radial term and affine transform, under several priors."""
    base = posteriors()[name].model()
    rows = []
    for rival in (similarity_model, radial_model, affine_model):
        one = running.run(rival(base), running.plan_for(name))
        sampled = log_evidence(one, one.seed)
        exact = [f"{linear_log_evidence(rival(base, width)):.3f}" for width in WIDTHS]
        rows.append((one.model.name, digits(sampled.value, sampled.error), f"{sampled.error:.1g}",
                     f"{sampled.shape:.2f}", *exact))  # fmt: skip
    head = ("Transform", f"log evidence, sampled, {WIDTH:g} px", "MCSE", "Pareto k",
            *(f"without sampling, {width:g} px" for width in WIDTHS))  # fmt: skip
    caption = (
        "Similarity against its rivals. Displacements at the edge of the field have equal priors; "
        "those that a rival adds to the similarity are Gaussian about nothing with the standard "
        "deviation at the head of the column, on which the evidence of a rival hangs: a prior "
        "wider than the estimate is sharp costs it the logarithm of their ratio, per term."
    )
    if posteriors()[name].simulated:
        caption += (
            " The data are our own simulation with the printed settings, from cameras whose "
            "distortions differ from channel to channel: the choice tests the method, and says "
            "nothing of the paper's centroids."
        )
    return html_table(head, rows, caption)


def floors(*names: str) -> str:
    """Return how much more evident the white noise is with a floor, under several priors of it.

    Parameters
    ----------
    *names : str
        Columns of Table IV.

    Returns
    -------
    str
        An HTML table.
    """
    rows = []
    for name in names:
        found = running.book_posterior(name)
        (without,) = running.rival_posteriors(name)
        plain, floor = small_log_evidence(without), found.model.parameters[1]
        if not isinstance(floor.prior, HalfNormal):
            raise TypeError(f"{name}: expected a half-normal floor, got {floor.prior}")
        told = []
        for factor in FLOORS:
            prior = HalfNormal(factor * floor.prior.sigma, floor.prior.reason)
            parameters = (found.model.parameters[0], replace(floor, prior=prior))
            model = replace(found.model, parameters=parameters)
            told.append(f"{small_log_evidence(replace(found, model=model)) - plain:+.2f}")
        rows.append((name, f"{floor.prior.sigma * floor.shown:.3g} {floor.unit}", *told))
    head = ("Column", "scale of the prior", *(f"times {factor:g}" for factor in FLOORS))
    caption = (
        "Log evidence of a floor less that of none, for priors of the floor narrower and wider "
        "than ours: what changes its sign is decided by the prior."
    )
    return html_table(head, [[cell.replace("-", "−") if i > 1 else cell
                              for i, cell in enumerate(row)] for row in rows], caption)  # fmt: skip
