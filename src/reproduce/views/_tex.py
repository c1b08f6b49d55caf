"""Text in LaTeX: escaped signs, and signs of numbers and of units, from ``tex.toml``."""

import tomllib
from pathlib import Path

from reproduce.printed.number import minus, powers

_SIGNS = {
    name: str.maketrans(signs)
    for name, signs in tomllib.loads(
        Path(__file__).with_name("tex.toml").read_text(encoding="utf-8")
    ).items()
}


def escaped(text: object) -> str:
    """Escape the signs that LaTeX reads as commands."""
    return str(text).translate(_SIGNS["escaped"])


def in_tex(text: str) -> str:
    """Write signs of numbers and of units as LaTeX does.

    Examples
    --------
    >>> print(in_tex("-5e-5 µm"))
    $-$5\\,$\\times$\\,10$^{-}$$^\\mathrm{5}$ \\textmu{}m
    """
    return powers(minus(text)).translate(_SIGNS["signs"])
