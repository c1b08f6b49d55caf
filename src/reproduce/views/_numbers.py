"""Texts of numbers in tables and sentences: errors, probabilities and intervals."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from reproduce.printed.number import minus

if TYPE_CHECKING:
    from reproduce.papers.declare import Column


def entry(value: float | str, style: Column) -> str:
    """Return a number in the format of a column.

    An infinite value is ``any``. A value below the zero of the style is 0, and a smaller value than
    the least one has a bound.

    Examples
    --------
    >>> from reproduce.papers.declare import Column
    >>> entry(1.0, Column(name="RMSE (px)", form=".3f")), entry(-2e-9, Column(name="x", form=".1g"))
    ('1.000', '−2e−09')
    >>> entry(3e-15, Column(name="p", form=".1g", least=1e-12))
    '<\u202f1e−12'
    """
    if value != value:  # NaN
        return ""
    if isinstance(value, str) or not style.form:
        return str(value)
    if abs(value) < style.least:
        return minus(f"<\u202f{style.least:g}")
    if abs(value) < style.zero:
        return "0"
    return "any" if math.isinf(value) else minus(f"{value:{style.form}}")


def digits(value: float, mcse: float) -> str:
    """Return a number with no more digits than its Monte Carlo standard error allows.

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
    if not math.isfinite(mcse) or mcse <= 0:
        return f"{value:z.6g}"
    decimals = -math.ceil(math.log10(2 * mcse))
    if abs(value) > mcse:
        decimals = max(decimals, -math.floor(math.log10(abs(value))))
    return f"{round(value, decimals):z.{min(max(decimals, 0), 12)}f}"


def percent(share: float, count: int) -> str:
    """Return a fraction of `count` simulations in percent, with its binomial error.

    Examples
    --------
    >>> percent(0.948, 1000)
    '94.8 ± 0.7 %'
    """
    error = math.sqrt(max(share * (1 - share), 1 / count) / count)
    return f"{100 * share:.1f} ± {100 * error:.1f} %"


def moments(mean: float, deviation: float) -> str:
    """Return mean ± standard deviation, to two digits of the latter.

    Examples
    --------
    >>> moments(-0.99756643, 1.1e-5)
    '−0.997566 ± 0.000011'
    """
    return f"{between(mean, deviation)} ± {between(deviation, deviation)}"


def between(end: float, deviation: float) -> str:
    """Return an end of an interval, to two digits of the standard deviation."""
    decimals = max(0, 1 - math.floor(math.log10(deviation)))
    return minus(f"{end:z.{decimals}f}")
