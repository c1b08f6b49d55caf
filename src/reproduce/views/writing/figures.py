"""A figure in the project's one style: drawn, written to a file, or inline in a page."""

from __future__ import annotations

import io
import re
import zlib
from collections.abc import Callable
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from reproduce.papers.catalogue import catalogue, drawings
from reproduce.papers.declare import Drawing, Marks
from reproduce.papers.sketch import NARROW
from reproduce.printed.cells import anchor, find, library
from reproduce.views.computed import once

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from reproduce.printed.given import Given

STYLE = Path(__file__).parent / "figures.mplstyle"
ENDINGS = (".svg", ".pdf", ".png")
XML = '<?xml version="1.0" encoding="utf-8" standalone="no"?>\n'
# On a narrow page text has little room, and must not be under eight points.
SMALL = {"font.size": 8.5, "axes.titlesize": 9.0}
FONTS = re.compile(r"(font-family: 'DejaVu Sans')[^;\"]*")
LINK = re.compile(r'(xlink:href="#|url\(#)([\w-]+)')
NAMED = re.compile(r' id="([^"]+)"')
_Paint = Callable[["Figure"], None]


class Picture(NamedTuple):
    """What is drawn: its key, what paints it, and the numbers behind it, else what is drawn."""

    key: str
    paint: _Paint
    numbers: pd.DataFrame | None = None


class Vectors(NamedTuple):
    """A figure as SVG, as a wide page shows it and, where it is drawn so, a narrow one."""

    wide: str
    narrow: str = ""


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


def drawn(paint: _Paint, *, narrow: bool = False) -> Figure:
    """Draw in the project's style, for a wide page or for a narrow one."""
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context([STYLE, SMALL] if narrow else STYLE):
        figure = Figure(figsize=(NARROW, 3.2) if narrow else None, layout="constrained")
        paint(figure)
    return figure


def _picture(key: str, door: Given | None = None) -> Picture:
    """Return an item that draws, or one of our own drawings, with what it marks as printed."""
    drawing, table = declared(key), library().get(key)
    marked = [*(table.cells if table else ()), *(c for mark in drawing.marks for c in find(mark))]
    numbers = [cell for cell in marked if cell.is_number]
    printed = Marks({c.address: c.si for c in numbers}, {c.address: c.si_interval for c in numbers})
    return Picture(anchor(key), lambda figure: drawing(figure, printed, door))


def draw(key: str, door: Given | None = None, *, narrow: bool = False) -> Figure:
    """Draw an item, or one of our own drawings."""
    return drawn(_picture(key, door).paint, narrow=narrow)


def data(figure: Figure) -> pd.DataFrame:
    """Return the lines, points and labels of a figure."""
    import numpy as np
    import pandas as pd

    parts = []
    for panel, axes in enumerate(figure.axes, start=1):
        drawn = [(line.get_label(), line.get_xydata()) for line in axes.lines]
        drawn += [(one.get_label(), one.get_offsets()) for one in axes.collections]
        drawn += [(one.get_text(), [one.get_position()]) for one in axes.texts]
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


def vector_of(figure: Figure) -> str:
    """Return a figure as SVG for a page."""
    buffer = io.StringIO()
    _write(figure, buffer, ".svg")
    svg = re.sub(r"<metadata>.*?</metadata>", "", buffer.getvalue(), flags=re.DOTALL)
    return FONTS.sub(r"\1, sans-serif", svg[svg.index("<svg") :])


def vectors(picture: Picture, root: Path | None = None) -> Vectors:
    """Draw a picture for wide pages and narrow ones; write its files below the root of a book."""
    figure = drawn(picture.paint)
    shown = Vectors(vector_of(figure), vector_of(drawn(picture.paint, narrow=True)))
    if root is not None:
        numbers = data(figure) if picture.numbers is None else picture.numbers
        _write_files(figure, picture.key, root, numbers, shown.wide)
    return shown


def in_build(key: str) -> Vectors:
    """Draw an item or one of our own drawings for a page; once in a build."""
    return once(f"figure-{anchor(key)}", Vectors, lambda: vectors(_picture(key)))


def write_figure(key: str, root: Path) -> None:
    """Write the pictures and the data of a figure below the root of the book, and keep its SVG."""
    shown = vectors(_picture(key), root)
    once(f"figure-{anchor(key)}", Vectors, lambda: shown)


def _write_files(figure: Figure, key: str, root: Path, numbers: pd.DataFrame, svg: str) -> None:
    (root / "figures").mkdir(parents=True, exist_ok=True)
    for path in figure_files(key):
        if path.endswith(".csv"):
            numbers.to_csv(root / path, index=False)
        elif path.endswith(".svg"):
            (root / path).write_text(f"{XML}{svg}", encoding="utf-8")
        else:
            save(figure, root / path)
            figure.set_layout_engine("none")  # what is laid out keeps its places


def inline(shown: Vectors, name: str, alternative: str, below: str = "") -> str:
    """Return a figure as an HTML fragment whose black parts follow the page's text colour.

    `below` is HTML: the caption and what else belongs to the figure.
    """
    parts = [f'<div class="rp-wide">{_followed(shown.wide, name, alternative)}</div>']
    if shown.narrow:
        # Without the book's style sheet, as in a notebook, the wide one alone is seen.
        svg = _followed(shown.narrow, f"{name}-narrow", alternative)
        parts.append(f'<div class="rp-narrow" hidden>{svg}</div>')
    return f'<figure class="rp-figure" id="{name}">{"".join(parts)}{below}</figure>'


def _followed(svg: str, name: str, alternative: str) -> str:
    # What the style file paints in black is what should follow the page. Where black fills
    # something, matplotlib writes nothing, since SVG fills in black by itself: the root says
    # otherwise.
    svg = re.sub(r"#000000\b", "currentColor", svg)
    # Short names, of what is named at all, and each its own in a page: points repeat them.
    mark = f"v{zlib.crc32(name.encode()):x}-"
    short = {
        old: f"{mark}{n}"
        for n, old in enumerate(dict.fromkeys(old for _, old in LINK.findall(svg)))
    }
    svg = NAMED.sub(lambda own: f' id="{short[own[1]]}"' if own[1] in short else "", svg)
    svg = LINK.sub(lambda link: link[1] + short[link[2]], svg)
    label = escape(alternative, quote=True)
    return svg.replace("<svg ", f'<svg role="img" aria-label="{label}" fill="currentColor" ', 1)
