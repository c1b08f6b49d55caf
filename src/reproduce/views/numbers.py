"""How a number is written, wherever it is shown: minus signs, powers of ten, errors, chances."""

from __future__ import annotations

import math
import re

from reproduce.papers.study import LEAST_DRAWS, Column, Fact

_EXPONENT = re.compile(r"(?<![\w.])(\d+(?:\.\d+)?)[eE]([−+-]?)0*(\d+)(?!\w|\.\d)")
_SUPERSCRIPTS = str.maketrans("−-0123456789", "⁻⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_TAGS = re.compile(r"(<[^>]*>)")


def number(value: float, form: str, *, zero: float = 0.0, infinite: str = "any") -> str:
    """Write a number by a format specification, with a true minus sign.

    What is smaller than `zero` is the rounding of nothing; what has no limit is named.

    Examples
    --------
    >>> number(-0.25, ".1f"), number(3e-16, ".2e", zero=1e-12), number(float("inf"), ".1f")
    ('−0.2', '0', 'any')
    """
    if math.isinf(value):
        return infinite
    if abs(value) < zero:
        return "0"
    return f"{value:{form}}".replace("-", "−")


def entry(value: float | str, column: Column, error: float | None = None, form: str = "") -> str:
    """Write an entry of a column, with its error if it has one, that in a form of its own.

    Examples
    --------
    >>> entry(1.0, Column("RMSE (px)", "±"), 0.0423), entry(2e-9, Column("p", "chance"))
    ('1.000 ± 0.042', '10⁻⁹')
    """
    if not column.form or isinstance(value, str):
        return column.missing if value != value else str(value)
    if math.isnan(value):
        return column.missing
    if column.form == "chance":
        return _counted(value, column.draws, column.zero)
    if column.form == "±":
        decimals = max(0, 1 - math.floor(math.log10(error or 1.0)))
        return f"{number(value, f'.{decimals}f')} ± {number(error or 0.0, f'.{decimals}f')}"
    text = number(value, column.form, zero=column.zero, infinite=column.infinite)
    return text if error is None else f"{text} ± {number(error, form or '.1g')}"


def fact(quoted: Fact) -> str:
    """Write a fact with its unit.

    Examples
    --------
    >>> fact(Fact(0.0432, ".2f", "px")), fact(Fact("Table 2"))
    ('0.04\u202fpx', 'Table 2')
    """
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


def _counted(probability: float, draws: int, least: float) -> str:
    """Write a probability by its count where the draws can tell, else as a power of ten."""
    if probability * draws >= LEAST_DRAWS:
        return chance(probability, math.sqrt(probability * max(2 - probability, 0) / draws))
    if probability >= 1e-3:
        return f"{probability:.1g}"
    bound = round(math.log10(least or 1e-300))
    power = round(math.log10(max(probability, 1e-300)))
    text = f"10{str(max(power, bound)).translate(_SUPERSCRIPTS)}"
    return text if power >= bound else f"<\u202f{text}"
