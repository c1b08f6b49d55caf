"""Numbers of posteriors as they are written: in tables, in the terminal, in sentences."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from reproduce.papers import calibrations
from reproduce.papers.posteriors import posteriors

if TYPE_CHECKING:
    from reproduce.inference.calibration import Ranks
    from reproduce.inference.checks import Range, Share
    from reproduce.inference.posterior import Sampled, Summary
    from reproduce.papers.declare_posterior import Aside

# Below this a probability is written with its power of ten.
SMALL = 1e-3
# Below this the end of a range is written with its power of ten.
TINY = 1e-5


def digits(value: float, mcse: float) -> str:
    """Write a number with no more digits than its Monte Carlo standard error allows.

    The last digit is the first that is larger than two standard errors, so that a second run
    changes it by one at most, nearly always; but a number that is larger than its error keeps its
    first digit, and a zero has no sign.

    Examples
    --------
    >>> digits(1.23456, 0.002), digits(1234.5, 3.0), digits(0.5, 0.0)
    ('1.23', '1230', '0.5')
    >>> digits(-0.23, 0.06), digits(7.0, 4.0), digits(-0.0003, 0.002)
    ('-0.2', '7', '0.00')
    """
    if not np.isfinite(mcse) or mcse <= 0:
        return f"{value:z.6g}"
    decimals = -int(np.ceil(np.log10(2 * mcse)))
    if abs(value) > mcse:
        decimals = max(decimals, -int(np.floor(np.log10(abs(value)))))
    if decimals >= 0:
        return f"{value:z.{min(decimals, 12)}f}"
    return f"{round(value, decimals):z.0f}"


def spread(row: Summary) -> tuple[str, str, str, str]:
    """Write the mean of a summary, its standard deviation and the ends of its 95 %."""
    return (
        digits(row.mean, row.mcse),
        f"{row.deviation:.2g}",
        digits(row.low, row.mcse_end),
        digits(row.high, row.mcse_end),
    )


def numbers(row: Summary) -> tuple[str, ...]:
    """Write the numbers of a summary: those of `spread`, MCSE, R-hat, bulk and tail ESS."""
    precision = (f"{row.mcse:.1g}", f"{row.rhat:.3f}", f"{row.bulk:.0f}", f"{row.tail:.0f}")
    return (*spread(row), *precision)


def percent(share: Share) -> str:
    """Write a share with its error.

    Examples
    --------
    >>> from reproduce.inference.checks import Share
    >>> percent(Share(0.948, 0.007, 1000))
    '94.8 ± 0.7 %'
    """
    return f"{100 * share.value:.1f} ± {100 * share.error:.1f} %"


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


def probability(share: Share) -> str:
    """Write a probability with its Monte Carlo standard error, or the bound that none seen sets.

    Examples
    --------
    >>> from reproduce.inference.checks import Share
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
    >>> from reproduce.inference.checks import Range
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


def sayings(name: str, found: Sampled) -> dict[str, str]:
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
