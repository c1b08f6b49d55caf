"""What the book shows of the approximations of niu2024: their errors and biases as tables."""

from __future__ import annotations

import functools

from reproduce.papers.niu2024 import costs
from reproduce.papers.niu2024.figures_costs import TITLES
from reproduce.printed.given import given
from reproduce.views.pages import Html
from reproduce.views.study_pages import plain_table


@functools.cache
def _all() -> tuple[costs.Cost, ...]:
    return tuple(costs.costs(given(costs.READS)))


def errors() -> Html:
    """Show how large each error is over the detector, and what a fit leaves of it."""
    rows = [
        [_label(cost), *(_length(value) for value in (cost.peak, cost.rms, cost.left))]
        for cost in _all()
    ]
    heads = ["Left out", "Largest (px)", "RMS (px)", "RMS after a fit (px)"]
    return plain_table("Errors of the approximations over the detector.", heads, rows)


def biases() -> Html:
    """Show what each approximation adds to the parameters, analytic and simulated."""
    rows = []
    for cost in _all():
        row = [_label(cost)]
        for i, least in enumerate((1e-12, 1e-12, 1e-9, 1e-9)):
            pair = (cost.analytic[i], cost.simulated[i])
            row += [_number(float(value), least) for value in pair]
        rows.append(row)
    heads = ["Left out"]
    for name in ("k", "θ (rad)", "Δx (px)", "Δy (px)"):
        heads += [f"{name}, analytic", "simulated"]
    caption = "Biases that the approximations put on the parameters."
    return plain_table(caption, heads, rows)


def _label(cost: costs.Cost) -> str:
    return f"{TITLES[cost.effect]}; {cost.table}, {cost.channel}"


def _length(value: float) -> str:
    """Write a length in px; below a billionth it is what rounding leaves of zero."""
    return "0" if value < 1e-9 else f"{value:.2g}"


def _number(value: float, least: float) -> str:
    """Write a bias; below `least` it is what rounding leaves of zero."""
    return "0" if abs(value) < least else f"{value:.2e}".replace("-", "−")


def sayings() -> dict[str, str]:
    """Return what sentences may say of the approximations.

    Label to text: ``EFFECT-TABLE-CHANNEL-rms``, ``-left`` and ``-peak``, in px.
    """
    said = {}
    for cost in _all():
        name = "-".join((cost.effect, cost.table, cost.channel)).lower().replace(" ", "-")
        for what, value in (("rms", cost.rms), ("left", cost.left), ("peak", cost.peak)):
            said[f"{name}-{what}"] = f"{_length(value)}\u202fpx"
    return said
