"""Figures as inline SVG that take the page's own text colour."""

from __future__ import annotations

import io
import math
import re
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["SMALLEST", "inline"]

# Text smaller than this many CSS pixels is hard to read; a narrow screen scrolls instead.
SMALLEST = 9.0
POINTS, PIXELS = 72.0, 96.0  # per inch
# What the style file paints in black is what should follow the page. Where black fills something,
# matplotlib writes nothing, since SVG fills in black by itself: the root says otherwise.
_FOREGROUND = re.compile(r"#000000\b")


def inline(figure: Figure, name: str, alternative: str, caption: str = "") -> str:
    """Return a figure as an HTML fragment whose black parts follow the page's text colour."""
    from matplotlib import style

    from reproduce.views.figures import STYLE

    buffer = io.StringIO()
    with style.context(STYLE):
        figure.savefig(buffer, format="svg", metadata={"Date": None})
    svg = buffer.getvalue()
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = _FOREGROUND.sub("currentColor", svg)
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    svg = re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{name}-", svg)
    label = escape(alternative, quote=True)
    least = f"min-width:{_least_width(figure)}px"
    svg = svg.replace(
        "<svg ", f'<svg role="img" aria-label="{label}" fill="currentColor" style="{least}" ', 1
    )
    below = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    return f'<figure class="rp-figure" id="{name}">{svg}{below}</figure>'


def _least_width(figure: Figure) -> int:
    """Return the width in CSS pixels at which the smallest text of a figure is still readable."""
    from matplotlib.text import Text

    texts = [found for found in figure.findobj() if isinstance(found, Text)]
    sizes = [float(t.get_fontsize()) for t in texts if t.get_text().strip()]
    smallest = min(sizes, default=POINTS)
    width = figure.get_figwidth()
    return math.ceil(width * PIXELS * min(1.0, SMALLEST / (smallest * PIXELS / POINTS)))
