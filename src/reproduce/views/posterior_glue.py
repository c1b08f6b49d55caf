"""The numbers of posteriors in the sentences of the book's pages."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers.posteriors import posteriors
from reproduce.printed.cells import find
from reproduce.views import posterior as running
from reproduce.views import posterior_calibration as calibrations
from reproduce.views import posterior_decision as deciding

if TYPE_CHECKING:
    from collections.abc import Callable


def glue(*names: str) -> None:
    """Make the numbers of posteriors available to the sentences of a page."""
    from myst_nb import glue as glue_one

    for name in names:
        for row in running.all_rows(running.book_posterior(name)):
            label = f"{name}-{row.name}".replace(" ", "-").replace(",", "")
            mean, deviation, low, high = running.numbers(row)[:4]
            gap = "" if row.unit == "1" else f"\u202f{row.unit}"
            for what, text in (("mean", mean), ("sd", deviation), ("low", low), ("high", high)):
                glue_one(f"{label}-{what}", f"{text.replace('-', '−')}{gap}", display=False)
        _glue_asides(glue_one, name)
        _glue_calibration(glue_one, name)


def _glue_asides(glue_one: Callable[..., None], name: str) -> None:
    asides = posteriors()[name].asides
    if asides is None:
        return
    for key, one in asides(running.book_posterior(name).model).items():
        gap = "" if one.unit == "1" else f"\u202f{one.unit}"
        text = f"{one.value:.2g}"
        if one.error:
            decimals = max(0, 1 - int(np.floor(np.log10(one.error))))
            text = f"{one.value:z.{decimals}f}"
            glue_one(f"{name}-{key}-error", f"{one.error:.{decimals}f}{gap}", display=False)
        glue_one(f"{name}-{key}", f"{text.replace('-', '−')}{gap}", display=False)


def _glue_calibration(glue_one: Callable[..., None], name: str) -> None:
    stored = calibrations.load(name)
    text = {
        "replicates": f"{stored.replicates:,}",
        "failed": str(int(stored.failed.sum())),
        "least-p": f"{float(stored.probabilities().min()):.2g}",
        "quantities": str(len(stored.names)),
    }
    covered = stored.estimator_coverage(0.95)
    for parameter, share in zip(stored.names, covered, strict=False):
        if share >= 0:  # NaN where the published estimator gives none
            text[f"{parameter}-published"] = f"{100 * share:.0f}\u202f%"
    for what, value in text.items():
        glue_one(f"{name}-sbc-{what}", value, display=False)


def glue_outside(name: str) -> None:
    """Make available how many printed numbers lie outside what repeats print."""
    from myst_nb import glue as glue_one

    rows, _ = deciding.repeats_of(name)
    outside = sum(row.tail.value < 0.05 / len(rows) for row in rows)
    glue_one(f"{name}-outside", str(outside), display=False)
    glue_one(f"{name}-printed-count", str(len(rows)), display=False)


def glue_printed(*addresses: str) -> None:
    """Make printed cells available to the sentences of a page, as ``ANCHOR-printed``."""
    from myst_nb import glue as glue_one

    for address in addresses:
        for cell in find(address):
            glue_one(f"{cell.anchor}-printed", cell.shown, display=False)
