"""What tables and sentences say of a posterior."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers import calibrations
from reproduce.papers.posteriors import posteriors
from reproduce.views.numbers import digits, percent

if TYPE_CHECKING:
    from reproduce.inference.calibration import Ranks
    from reproduce.inference.posterior import Sampled, Summary
    from reproduce.papers.declare_posterior import Aside

__all__ = ["coverage_rows", "entries", "posterior_facts"]


def spread(row: Summary) -> tuple[str, str, str, str]:
    """Write the mean of a summary, its standard deviation and the ends of its 95 %."""
    return (
        digits(row.mean, row.mcse),
        f"{row.deviation:.2g}",
        digits(row.low, row.mcse_end),
        digits(row.high, row.mcse_end),
    )


def entries(row: Summary) -> tuple[str, ...]:
    """Write the numbers of a summary: those of `spread`, MCSE, R-hat, bulk and tail ESS."""
    precision = (f"{row.mcse:.1g}", f"{row.rhat:.3f}", f"{row.bulk:.0f}", f"{row.tail:.0f}")
    return (*spread(row), *precision)


def coverage_rows(stored: Ranks) -> list[tuple[str, ...]]:
    """Write evenness and coverage of every quantity, with binomial standard errors."""
    return [
        (
            row.name,
            digits(row.chance.value, row.chance.error),
            percent(row.half),
            percent(row.wide),
            "none" if row.published is None else percent(row.published),
        )
        for row in stored.coverages()
    ]


def posterior_facts(name: str, found: Sampled) -> dict[str, str]:
    """Return the numbers of a posterior that sentences may say, by name.

    ``shift-x-mean`` (-sd, -low, -high) of each parameter and consequence, the asides of the
    declaration, and ``sbc-...`` of the stored calibration.
    """
    texts: dict[str, str] = {}
    for row in found.summaries():
        label, gap = row.name.replace(" ", "-").replace(",", ""), _gap(row.unit)
        for what, text in zip(("mean", "sd", "low", "high"), spread(row), strict=True):
            texts[f"{label}-{what}"] = f"{text.replace('-', '−')}{gap}"
    asides = posteriors()[name].asides
    for key, aside in ({} if asides is None else asides(found.model)).items():
        texts |= _of_aside(key, aside)
    return texts | dict(_of_calibration(name)) | dict(_of_repeats(name, found))


def _gap(unit: str) -> str:
    return "" if unit == "1" else f"\u202f{unit}"


def _of_aside(key: str, aside: Aside) -> dict[str, str]:
    value, gap = f"{aside.value:.2g}", _gap(aside.unit)
    errors = {}
    if aside.error:
        decimals = max(0, 1 - int(np.floor(np.log10(aside.error))))
        value = f"{aside.value:z.{decimals}f}"
        errors = {f"{key}-error": f"{aside.error:.{decimals}f}{gap}"}
    return {key: f"{value.replace('-', '−')}{gap}"} | errors


def _of_calibration(name: str) -> Iterator[tuple[str, str]]:
    if not calibrations.stored(name):
        return
    stored = calibrations.load(name)
    rows = stored.coverages()
    yield "sbc-replicates", f"{stored.replicates:,}"
    yield "sbc-failed", str(int(stored.failed.sum()))
    yield "sbc-least-p", f"{min(row.chance.value for row in rows):.2g}"
    yield "sbc-quantities", str(len(rows))
    for row in rows:
        if row.published is not None:
            yield f"sbc-{row.name}-published", f"{100 * row.published.value:.0f}\u202f%"


def _of_repeats(name: str, found: Sampled) -> Iterator[tuple[str, str]]:
    """Yield how many printed numbers lie outside what repeats print."""
    compared = posteriors()[name].repeats(found)
    if compared is not None:
        rows = compared[0]
        yield "outside", str(sum(row.tail.value < 0.05 / len(rows) for row in rows))
        yield "printed-count", str(len(rows))
