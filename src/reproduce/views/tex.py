"""Text in LaTeX: escaped signs, and signs of numbers and of units."""

import unicodedata

from reproduce.views.numbers import minus, powers

_ESCAPED: dict[int, str] = str.maketrans(
    {sign: f"\\{sign}" for sign in "&%$_{}"}
    | {sign: f"${sign}$" for sign in "<>"}
    | {
        "^": r"\textasciicircum{}",
        "~": r"\textasciitilde{}",
        "\\": "/",
        "/": r"/\allowbreak{}",
        "#": r"\#\allowbreak{}",
    }
)
_SIGNS: dict[int, str] = str.maketrans(
    {
        "−": "$-$",
        "×": r"$\times$",
        "\u202f": r"\,",
        "\u00a0": "~",
        "″": "$''$",
        "µ": r"\textmu{}",
        "–": "--",
        "°": r"\textdegree{}",
        "σ": r"$\sigma$",
        "χ": r"$\chi$",
        "Δ": r"$\Delta$",
        "θ": r"$\theta$",
        "≈": r"$\approx$",
        "≥": r"$\geq$",
        "±": r"$\pm$",
        "⁻": "$^{-}$",
        **{
            sign: rf"$^\mathrm{{{unicodedata.normalize('NFKC', sign)}}}$"
            for sign in "⁰¹²³⁴⁵⁶⁷⁸⁹ᵉᶜᵈᵃᵘ"
        },
    }
)


def escaped(text: object) -> str:
    """Escape the signs that LaTeX reads as commands."""
    return str(text).translate(_ESCAPED)


def in_tex(text: str) -> str:
    """Write signs of numbers and of units as LaTeX does.

    Examples
    --------
    >>> print(in_tex("-5e-5 µm"))
    $-$5\\,$\\times$\\,10$^{-}$$^\\mathrm{5}$ \\textmu{}m
    """
    return powers(minus(text)).translate(_SIGNS)
