"""How a number is written, wherever it is shown: minus signs, powers of ten, errors, chances."""

from __future__ import annotations

import math
import re
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from reproduce.papers.declare import Column, Fact

_EXPONENT = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)[eE]([−+-]?)0*(\d+)(?!\w|\.\d)")
_SUPERSCRIPTS = str.maketrans("−-0123456789", "⁻⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
# A hyphen that is the sign of a number or of its exponent, not one within a word or a range.
_HYPHEN = re.compile(r"(?<![\w.)])-(?=\.?\d|inf)|(?<=\d[eE])-(?=\d)")
_TAGS = re.compile(r"(<[^>]*>)")


def minus(text: str) -> str:
    """Write the numbers of a text with a true minus sign, as every reader sees them.

    Examples
    --------
    >>> minus("from -0.3 to -.1 (-2e-11) in II-B, fig-4 and 2-1")
    'from −0.3 to −.1 (−2e−11) in II-B, fig-4 and 2-1'
    """
    return _HYPHEN.sub("−", text)


def _number(value: float, form: str, *, zero: float = 0.0) -> str:
    """Write a number by a format specification, with a true minus sign.

    What is smaller than `zero` is the rounding of nothing; what has no limit is named.

    Examples
    --------
    >>> _number(-0.25, ".1f"), _number(3e-16, ".2e", zero=1e-12), _number(float("inf"), ".1f")
    ('−0.2', '0', 'any')
    """
    if math.isinf(value):
        return "any"
    if abs(value) < zero:
        return "0"
    return minus(f"{value:{form}}")


def entry(
    value: float | str, column: Column, error: tuple[float, str] | None = None
) -> str:
    """Write an entry of a column, with its error and the form of that if it has one.

    Examples
    --------
    >>> from reproduce.papers.declare import Column
    >>> entry(1.0, Column("RMSE (px)", "±"), (0.0423, "")), entry(2e-9, Column("p", "chance"))
    ('1.000 ± 0.042', '10⁻⁹')
    """
    if isinstance(value, float) and math.isnan(value):
        return ""
    if not column.form or isinstance(value, str):
        return str(value)
    if column.form == "chance":
        return _power(value, column.zero)
    if column.form == "±" and error:
        return moments(value, error[0])
    text = _number(value, column.form, zero=column.zero)
    return f"{text} ± {_number(error[0], error[1] or '.1g')}" if error else text


def fact(quoted: Fact) -> str:
    """Write a fact with its unit.

    Examples
    --------
    >>> from reproduce.papers.declare import Fact
    >>> fact(Fact(0.0432, ".2f", "px")), fact(Fact("Table 2"))
    ('0.04\u202fpx', 'Table 2')
    """
    from reproduce.papers.declare import (
        Column,
    )  # only now: a user's own stars need no paper

    text = entry(quoted.value, Column("", quoted.form, quoted.zero))
    return f"{text}\u202f{quoted.unit}" if quoted.unit else text


def powers(text: str) -> str:
    """Write the exponents of a text as powers of ten.

    Examples
    --------
    >>> powers("from 1e−6 to −5.7e+12 px, not 2e-05.")
    'from 10⁻⁶ to −5.7\u202f×\u202f10¹² px, not 2\u202f×\u202f10⁻⁵.'
    """

    def write(found: re.Match[str]) -> str:
        digits, sign, size = found.groups()
        power = f"{'−' if sign in ('-', '−') else ''}{size}".translate(_SUPERSCRIPTS)
        return f"10{power}" if digits == "1" else f"{digits}\u202f×\u202f10{power}"

    return _EXPONENT.sub(write, text)


def powers_in_html(html: str) -> str:
    """Write exponents as powers of ten wherever HTML shows a sentence or a number.

    Examples
    --------
    >>> powers_in_html('<b id="x-2e-05">2e-05</b> <code>2e-05</code>')
    '<b id="x-2e-05">2\u202f×\u202f10⁻⁵</b> <code>2e-05</code>'
    """
    pieces, verbatim = _TAGS.split(html), 0
    for index, piece in enumerate(pieces):
        if re.match(r"</?(code|pre|script|style)\b", piece):
            verbatim += -1 if piece.startswith("</") else 1
        elif not piece.startswith("<") and not verbatim:
            pieces[index] = powers(piece)
    return "".join(pieces)


def chance(value: float, mcse: float) -> str:
    """Write a probability with no more digits than its Monte Carlo error allows.

    Examples
    --------
    >>> chance(0.4321, 0.01)
    '0.43'
    """
    if value < mcse:
        return f"<\u00a0{2 * mcse:.1g}"
    decimals = 1
    while decimals < 6 and 10.0**-decimals > 2 * mcse:
        decimals += 1
    return f"{value:.{decimals}f}"


def _power(probability: float, least: float) -> str:
    """Write a probability, a small one as a power of ten."""
    if probability >= 1e-3:
        return f"{probability:.1g}"
    bound = round(math.log10(least or 1e-300))
    power = round(math.log10(max(probability, 1e-300)))
    text = f"10{str(max(power, bound)).translate(_SUPERSCRIPTS)}"
    return text if power >= bound else f"<\u202f{text}"


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
    if not math.isfinite(mcse) or mcse <= 0:
        return f"{value:z.6g}"
    decimals = -math.ceil(math.log10(2 * mcse))
    if abs(value) > mcse:
        decimals = max(decimals, -math.floor(math.log10(abs(value))))
    if decimals >= 0:
        return f"{value:z.{min(decimals, 12)}f}"
    return f"{round(value, decimals):z.0f}"


def percent(share: float, count: int) -> str:
    """Write a share of so many simulations with its binomial error.

    Examples
    --------
    >>> percent(0.948, 1000)
    '94.8 ± 0.7 %'
    """
    error = math.sqrt(max(share * (1 - share), 1 / count) / count)
    return f"{100 * share:.1f} ± {100 * error:.1f} %"


def moments(mean: float, deviation: float) -> str:
    """Write mean ± standard deviation, to two digits of the latter.

    Examples
    --------
    >>> moments(-0.99756643, 1.1e-5)
    '−0.997566 ± 0.000011'
    """
    return f"{between(mean, deviation)} ± {between(deviation, deviation)}"


def between(end: float, deviation: float) -> str:
    """Write an end of an interval, to two digits of the standard deviation."""
    decimals = max(0, 1 - math.floor(math.log10(deviation)))
    return minus(f"{end:z.{decimals}f}")
