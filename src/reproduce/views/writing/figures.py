"""A figure in the project's one style: drawn, written to a file, or inline in a page."""

from __future__ import annotations

import io
import math
import re
from collections.abc import Iterator
from contextlib import contextmanager
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from reproduce.papers.catalogue import catalogue, drawings
from reproduce.papers.declare import Drawing, Marks
from reproduce.printed.cells import anchor, find, library
from reproduce.views.computed import once

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from reproduce.printed.given import Given

__all__ = [
    *("SMALLEST", "Vector", "check_ending", "data", "declared", "draw", "drawable"),
    *("figure_files", "inline", "save", "styled", "vector", "vector_of", "write_figure"),
]

STYLE = Path(__file__).parent / "figures.mplstyle"
ENDINGS = (".svg", ".pdf", ".png")
# Text smaller than this many CSS pixels is hard to read; a narrow screen scrolls instead.
SMALLEST = 9.0
POINTS, PIXELS = 72.0, 96.0  # per inch


class Vector(NamedTuple):
    """A figure as SVG, and the width in CSS pixels from which its text is readable."""

    svg: str
    least: int


def drawable() -> list[str]:
    """Return the keys of the items that draw, in order of print."""
    return [key for key, item in catalogue().items() if item.draw is not None]


def declared(key: str) -> Drawing:
    """Return what draws a key: an item, or a drawing of our own."""
    if key in drawings():
        return drawings()[key]
    found = catalogue()[key].draw if key in catalogue() else None
    if found is None:
        known = ", ".join((*drawable(), *drawings()))
        raise ValueError(f"{key} has no figure; these have one: {known}")
    return found


@contextmanager
def styled(size: tuple[float, float] | None = None, constrained: bool = True) -> Iterator[Figure]:
    """Yield an empty figure to be drawn in the project's style."""
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE):
        yield Figure(figsize=size, layout="constrained" if constrained else None)


def draw(key: str, door: Given | None = None) -> Figure:
    """Draw an item, or one of our own drawings."""
    drawing = declared(key)
    table = library().get(key)
    marked = [*(table.cells if table else ()), *(c for mark in drawing.marks for c in find(mark))]
    numbers = [cell for cell in marked if cell.is_number]
    printed = Marks({c.address: c.si for c in numbers}, {c.address: c.si_interval for c in numbers})
    with styled() as figure:
        drawing(figure, printed, door)
    return figure


def data(figure: Figure) -> pd.DataFrame:
    """Return the lines and points of a figure."""
    import numpy as np
    import pandas as pd

    parts = []
    for panel, axes in enumerate(figure.axes, start=1):
        drawn = [(line.get_label(), line.get_xydata()) for line in axes.lines]
        drawn += [(one.get_label(), one.get_offsets()) for one in axes.collections]
        for number, (label, points) in enumerate(drawn, start=1):
            x, y = np.asarray(points, dtype=float).reshape(-1, 2).T
            named = str(label)
            curve = f"curve {number}" if named.startswith("_") else named
            parts.append(pd.DataFrame({"panel": panel, "curve": curve, "x": x, "y": y}))
    empty = pd.DataFrame(columns=["panel", "curve", "x", "y"])
    return pd.concat(parts, ignore_index=True) if parts else empty


def check_ending(out: Path) -> str:
    """Return the ending of a file to write, or raise ValueError if no figure has it."""
    if out.suffix.lower() not in ENDINGS:
        raise ValueError(f"unknown ending {out.suffix!r}: expected one of {', '.join(ENDINGS)}")
    return out.suffix.lower()


def save(figure: Figure, out: Path) -> None:
    """Write a drawn figure."""
    _write(figure, out, check_ending(out))


def _write(figure: Figure, out: Path | io.StringIO, ending: str) -> None:
    from matplotlib import style

    # Dates and random ids would make every build differ from the last one.
    undated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(ending, {})
    with style.context(STYLE):
        figure.savefig(out, format=ending[1:], metadata=undated)


def figure_files(key: str) -> list[str]:
    """Return where the book carries the pictures and the data of a figure, below its root."""
    return [f"figures/{anchor(key)}{ending}" for ending in (*ENDINGS, ".csv")]


def vector(key: str) -> Vector:
    """Draw an item or one of our own drawings for a page; once in a build."""
    return once(f"figure-{anchor(key)}", lambda: vector_of(draw(key)))


def vector_of(figure: Figure) -> Vector:
    """Return a figure as SVG for a page."""
    buffer = io.StringIO()
    _write(figure, buffer, ".svg")
    return Vector(buffer.getvalue(), _least_width(figure))


def write_figure(key: str, root: Path) -> None:
    """Write the pictures and the data of a figure below the root of the book, and keep its SVG."""
    figure = draw(key)
    (root / "figures").mkdir(parents=True, exist_ok=True)
    drawn = once(f"figure-{anchor(key)}", lambda: vector_of(figure))
    for path in figure_files(key):
        if path.endswith(".csv"):
            data(figure).to_csv(root / path, index=False)
        elif path.endswith(".svg"):
            (root / path).write_text(drawn.svg, encoding="utf-8")
        else:
            save(figure, root / path)


def inline(drawn: Vector, name: str, alternative: str, below: str = "") -> str:
    """Return a figure as an HTML fragment whose black parts follow the page's text colour.

    `below` is HTML: the caption and what else belongs to the figure.
    """
    svg = drawn.svg
    svg = svg[svg.index("<svg") :]
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    # What the style file paints in black is what should follow the page. Where black fills
    # something, matplotlib writes nothing, since SVG fills in black by itself: the root says
    # otherwise.
    svg = re.sub(r"#000000\b", "currentColor", svg)
    svg = re.sub(r'\bid="', f'id="{name}-', svg)
    svg = re.sub(r'(xlink:href="#|url\(#)', rf"\g<1>{name}-", svg)
    label = escape(alternative, quote=True)
    least = f"min-width:{drawn.least}px"
    svg = svg.replace(
        "<svg ", f'<svg role="img" aria-label="{label}" fill="currentColor" style="{least}" ', 1
    )
    # What scrolls on a narrow screen is within a keyboard's reach.
    return f'<figure class="rp-figure" id="{name}" tabindex="0">{svg}{below}</figure>'


def _least_width(figure: Figure) -> int:
    """Return the width in CSS pixels at which the smallest text of a figure is still readable."""
    from matplotlib.text import Text

    texts = [found for found in figure.findobj() if isinstance(found, Text)]
    sizes = [float(t.get_fontsize()) for t in texts if t.get_text().strip()]
    smallest = min(sizes, default=POINTS)
    width = figure.get_figwidth()
    return math.ceil(width * PIXELS * min(1.0, SMALLEST / (smallest * PIXELS / POINTS)))
