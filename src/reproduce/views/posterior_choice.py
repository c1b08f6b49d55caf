"""Models compared: sampled evidence, and the exact one where there is a way without sampling."""

from __future__ import annotations

import numpy as np

from reproduce.inference.evidence import Evidence, log_evidence
from reproduce.inference.model import Model, UnsuitableModelError
from reproduce.inference.models.radial import (
    WIDTHS,
    affine_model,
    linear_log_evidence,
    radial_model,
    similarity_model,
)
from reproduce.inference.models.table_readings import Read
from reproduce.inference.posterior import digits
from reproduce.papers.chen2023.posteriors import FLOORS, summed_columns, table_reads
from reproduce.papers.posteriors import posteriors
from reproduce.views import posterior as running
from reproduce.views.markup import html_table


def compared(name: str) -> str:
    """Return the evidence of a model and its rivals, with the exact one where there is one.

    The model has been sampled anyway; a rival is sampled only where there is no other way.
    """
    declared = posteriors()[name]
    rows: list[tuple[str, ...]] = []
    first, first_error = 0.0, 0.0
    for model in (running.book_posterior(name).model, *declared.rival_models()):
        exact, told = exact_evidence(name, model), ("not needed", "", "")
        value, error = exact or 0.0, 0.0
        if exact is None or not rows:
            found = _sampled(name, model, is_rival=bool(rows))
            told = (
                digits(found.value, found.error), f"{found.error:.1g}", f"{found.shape:.2f}",
            )  # fmt: skip
            value, error = (found.value, found.error) if exact is None else (exact, 0.0)
        if not rows:
            first, first_error = value, error
        less = _difference(value - first, float(np.hypot(error, first_error))) if rows else "0"
        rows.append((model.name, *told, "none" if exact is None else f"{exact:.3f}", less))
    head = ("Model", "log evidence, sampled", "MCSE", "Pareto k", "closed form or quadrature",
            "less the first one's")  # fmt: skip
    caption = "Evidence (natural logarithm) under the priors above; differences decide."
    if declared.simulated and len(rows) > 1:
        caption += (
            " The data are our own simulation: which model is preferred tests the method, and says "
            "nothing of the instrument."
        )
    return html_table(head, rows, caption)


def _sampled(name: str, model: Model, is_rival: bool) -> Evidence:
    found = running.run(model, running.plan_for(name)) if is_rival else running.book_posterior(name)
    return log_evidence(found, found.seed)


def _difference(value: float, error: float) -> str:
    if error == 0:
        return f"{value:.3f}".replace("-", "−")
    return f"{digits(value, error)} ± {error:.1g}".replace("-", "−")


def exact_evidence(name: str, model: Model) -> float | None:
    """Return the log evidence of a model or rival without sampling, where there is a way."""
    evidence = posteriors()[name].evidence
    try:
        return None if evidence is None else evidence(model)
    except UnsuitableModelError:
        return None


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
    rows = [
        (rival(base).name, *(f"{linear_log_evidence(rival(base, width)):.3f}" for width in WIDTHS))
        for rival in (similarity_model, radial_model, affine_model)
    ]
    head = ("Transform", *(f"log evidence, {width:g} px" for width in WIDTHS))
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


def columns_of_table_4() -> str:
    """Return white noise and floor of every column of Table IV, and the evidence of a floor."""
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
    return html_table(head, rows, caption)
