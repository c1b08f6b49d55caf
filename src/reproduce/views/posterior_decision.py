"""Estimates placed in their posteriors, bounds of their widths, repeats of the experiments."""

from __future__ import annotations

from functools import cache

import numpy as np

from reproduce.inference.checks import Range, Repeat, Share, repeats, tail_share
from reproduce.inference.diagnostics import mcse_deviation, mcse_mean
from reproduce.inference.posterior import Posterior, digits
from reproduce.papers.posteriors import posteriors
from reproduce.views import posterior as running
from reproduce.views.markup import html_table

# Below this a probability is written with its power of ten.
SMALL = 1e-3
# Below this the end of a range is written with its power of ten.
TINY = 1e-5


def probability(share: Share) -> str:
    """Write a probability with its Monte Carlo standard error, or the bound that none seen sets.

    Examples
    --------
    >>> probability(Share(0.03775, 0.003, 4000)), probability(Share(0.0, 0.00025, 4000))
    ('0.04 ± 0.003', '< 0.0008')
    >>> probability(Share(0.0, 0.00025, 4000, sides=2))
    '< 0.002'
    >>> probability(Share(0.002, 0.0009, 4000))
    '0.002 ± 0.0009'
    """
    if share.value == 0:
        return f"< {share.bound:.1g}"
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
        estimate, chain = found.model.estimate[parameter.name], found.chain[..., i]
        shown = estimate * parameter.shown
        width = chain.std()
        off = (estimate - chain.mean()) / width
        error = np.hypot(mcse_mean(chain), off * mcse_deviation(chain)) / width
        rows.append((f"{parameter.name} ({parameter.unit})", f"{shown:.6g}",
                     signed(digits(off, float(error))),
                     probability(tail_share(found.draws[:, i], estimate))))  # fmt: skip
    head = ("Parameter", "estimate", "posterior sd from the mean", "tail probability")
    caption = "The nominal or least-squares estimate, placed in the posterior."
    return html_table(head, rows, caption) if rows else ""


def signed(text: str) -> str:
    """Write a number with its sign, plus too.

    Examples
    --------
    >>> signed("1.2"), signed("-0.3")
    ('+1.2', '−0.3')
    """
    return plain(text) if text.startswith("-") else f"+{text}"


def plain(text: str) -> str:
    """Write a number with a minus for a hyphen, and none before a zero.

    Examples
    --------
    >>> plain("-0.3"), plain("-0.00"), plain("-2e-11")
    ('−0.3', '0.00', '−2e-11')
    """
    return text if not text.startswith("-") else f"{'−' if float(text) else ''}{text[1:]}"


def ranged(found: Range) -> str:
    """Write the ends of a range, with no more digits than their errors allow.

    Examples
    --------
    >>> ranged(Range(0.123456, 2.5, (0.002, 0.04))), ranged(Range(-2.4e-11, 0.71, (0.0, 0.01)))
    ('0.12 to 2.5', '−2e-11 to 0.7')
    >>> ranged(Range(-4.052, -4.05, (0.0, 0.0)))
    '−4.052 to −4.050'
    """
    # An error of nothing: simulations that are alike there, not an end that is exact.
    least = (found.high - found.low) / 30 or abs(found.high) / 5000
    ends = zip((found.low, found.high), found.errors, strict=True)
    return " to ".join(plain(_end(end, error or least)) for end, error in ends)


def _end(end: float, error: float) -> str:
    return f"{end:.0e}" if 0 < abs(end) < TINY else digits(end, error)


def bounded(name: str) -> str:
    """Return the Cramér-Rao bound beside the width of the posterior, where it is simple."""
    bound = posteriors()[name].bound
    if bound is None:
        return ""
    found = running.book_posterior(name)
    bounds = bound(found.model)
    rows = []
    for i, (parameter, bound) in enumerate(zip(found.model.parameters, bounds, strict=True)):
        chain = found.chain[..., i]
        name, shown = f"{parameter.name} ({parameter.unit})", parameter.shown
        width, least, error = chain.std() * shown, bound * shown, mcse_deviation(chain) * shown
        ratio = digits(width / least, error / least)
        rows.append((name, digits(width, error), f"{least:.4g}", ratio))
    head = ("Parameter", "posterior sd", "Cramér-Rao bound", "ratio")
    caption = (
        "The width of the posterior, and the least that any unbiased estimate can have; a prior "
        "may make the posterior narrower."
    )
    return html_table(head, rows, caption)


@cache
def repeats_of(name: str) -> tuple[list[Repeat], Share]:
    """Return the printed numbers among those of repeats, simulated once in a process."""
    found = running.book_posterior(name)
    published = posteriors()[name].printed(found.model)
    if published is None:
        raise LookupError(f"{name}: expected printed numbers of this experiment, got none")
    return repeats(found, published)


def repeated(name: str) -> str:
    """Return the published numbers, and those of repeats of the experiment."""
    published = posteriors()[name].printed(running.book_posterior(name).model)
    if published is None:
        return ""
    rows, together = repeats_of(name)
    shown = [
        (
            row.name if row.unit == "1" else f"{row.name} ({row.unit})",
            row.printed,
            ranged(row.range),
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
        f"Monte Carlo standard errors. All digits alike at once: {probability(together)}. "
        f"{published.note}"
    )
    return html_table(head, shown, caption)
