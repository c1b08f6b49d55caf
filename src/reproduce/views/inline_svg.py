"""Figures as inline SVG that take the page's own text colour."""

from __future__ import annotations

import io
import re
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# What the style file paints in black is what should follow the page.
_FOREGROUND = re.compile(r"#000000\b")


def inline(figure: Figure, name: str, alternative: str) -> str:
    """Return a figure as an HTML fragment whose black parts follow the page's text colour.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        The figure.
    name : str
        Its id on the page; ids inside the SVG get it as a prefix, so that two figures on one
        page cannot share a clip path by accident.
    alternative : str
        What the figure shows, for readers who cannot see it.

    Returns
    -------
    str
        A ``figure`` element.
    """
    from matplotlib import style

    from reproduce.views.figures import STYLE

    buffer = io.StringIO()
    with style.context(STYLE):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = _FOREGROUND.sub("currentColor", svg)
    svg = _uncoloured_text(svg)
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    svg = re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{name}-", svg)
    label = escape(alternative, quote=True)
    svg = svg.replace("<svg ", f'<svg role="img" aria-label="{label}" ', 1)
    return f'<figure class="rp-figure" id="{name}">{svg}</figure>'


def _uncoloured_text(svg: str) -> str:
    """Give text without a colour of its own the page's colour: SVG's default is black."""
    # Formulas, such as powers of ten on an axis, are written as <text> without any attribute.
    return re.sub(r"<text(?=[ >])", '<text fill="currentColor"', svg)
