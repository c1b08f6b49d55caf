"""A figure in the project's one style: drawn, written to files, inline in a page, run again."""

from __future__ import annotations

import io
import json
import re
import textwrap
import zlib
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from functools import cached_property
from html import escape
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias
from xml.etree import ElementTree

import numpy as np
import pandas as pd
from markupsafe import Markup

from reproduce.judge.rerun import refuse_strays
from reproduce.papers.catalogue import catalogue, drawings
from reproduce.papers.charts import NARROW
from reproduce.papers.declare import Drawing, Schematic, item_text
from reproduce.printed.cells import anchor, find, library
from reproduce.store.files import FIGURES, check_target, replacing, write_text
from reproduce.views import computed, keys, numbers
from reproduce.views.base import Change, Item, Rerunnable, ResultView, text_of
from reproduce.views.blocks import Block, Html
from reproduce.views.computed import cached
from reproduce.views.export import citation, export_frame, provenance_of, toolbar
from reproduce.views.verdicts import filled

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

    from reproduce.printed.inputs import Inputs

_STYLE = Path(__file__).parent / "figures.mplstyle"
_XML = '<?xml version="1.0" encoding="utf-8" standalone="no"?>\n'
# On a narrow page text has little room, and must not be under eight points.
_SMALL = {"font.size": 8.5, "axes.titlesize": 9.0}
_FONTS = re.compile(r"(font-family: 'DejaVu Sans')[^;\"]*")
_LINK = re.compile(r'(xlink:href="#|url\(#)([\w-]+)')
_NAMED = re.compile(r' id="([^"]+)"')
Paint = Callable[["MatplotlibFigure"], None]
# A matplotlib figure, or the SVG of a schematic.
Drawn: TypeAlias = "MatplotlibFigure | str"
_SCHEMATIC = (".svg",)
_Provenance = Mapping[str, str] | None


class Vectors(NamedTuple):
    """A figure as SVG, as a wide page shows it and, where it is drawn so, a narrow one."""

    wide: str
    narrow: str = ""


def drawable() -> list[str]:
    """Return the keys of the items with a figure, in printed order."""
    return [key for key, item in catalogue().items() if item.draw is not None]


def _declared_drawing(key: str) -> Drawing | Schematic:
    """Return the drawing of a key: of an item, or a supplementary one."""
    if key in drawings():
        return drawings()[key]
    if found := catalogue()[keys.check_key(key)].draw:
        return found
    known = ", ".join((*drawable(), *drawings()))
    raise ValueError(f"{key} has no figure; these have one: {known}")


def styled_figure(paint: Paint, *, narrow: bool = False) -> MatplotlibFigure:
    """Return a figure in the project's style, for a wide page or for a narrow one."""
    from matplotlib import style
    from matplotlib.figure import Figure as MatplotlibFigure

    with style.context([_STYLE, _SMALL] if narrow else _STYLE):
        figure = MatplotlibFigure(
            figsize=(NARROW, 3.2) if narrow else None, layout="constrained"
        )
        paint(figure)
    return figure


def draw(key: str, inputs: Inputs | None = None, *, narrow: bool = False) -> Drawn:
    """Draw an item or a supplementary drawing, with its printed values."""
    drawing = _declared_drawing(key)
    if isinstance(drawing, Schematic):
        style, end, body = drawing.text.partition("</style>")
        return style + end + filled(body, {})
    patterns = [*([key] if key in library() else []), *drawing.marks]
    marked = (cell for pattern in patterns for cell in find(pattern))
    printed = {cell.address: cell.si for cell in marked if cell.is_number}
    return styled_figure(lambda figure: drawing(figure, printed, inputs), narrow=narrow)


def _data(figure: Drawn) -> pd.DataFrame:
    """Return the lines, points and labels of a figure."""
    if isinstance(figure, str):
        return _labels(figure)
    parts = [pd.DataFrame(columns=["panel", "curve", "x", "y"])]
    for panel, axes in enumerate(figure.axes, start=1):
        drawn = [(line.get_label(), line.get_xydata()) for line in axes.lines]
        drawn += [(one.get_label(), one.get_offsets()) for one in axes.collections]
        drawn += [(one.get_text(), [one.get_position()]) for one in axes.texts]
        for number, (label, points) in enumerate(drawn, start=1):
            part = pd.DataFrame(np.reshape(points, (-1, 2)), columns=["x", "y"])
            name = str(label)
            curve = f"curve {number}" if name.startswith("_") else name
            parts.append(part.assign(panel=panel, curve=curve))
    found = [part for part in parts if len(part)] or parts
    return pd.concat(found, ignore_index=True)[["panel", "curve", "x", "y"]]


def _labels(svg: str) -> pd.DataFrame:
    """Return the labels of a schematic with their places, in units of its view box."""
    rows = [
        (1, "".join(one.itertext()), float(one.get("x", 0)), float(one.get("y", 0)))
        for one in ElementTree.fromstring(svg).iter("{http://www.w3.org/2000/svg}text")
    ]
    return pd.DataFrame(rows, columns=["panel", "curve", "x", "y"])


def save(
    figure: Drawn, out: Path | io.StringIO, provenance: _Provenance = None
) -> None:
    """Write a figure with its metadata to a file, or as SVG to a stream."""
    from matplotlib import style

    if isinstance(figure, str):
        note = escape("\n".join((provenance or {}).values()))
        svg = figure.replace("<title>", f"<metadata>{note}</metadata>\n  <title>", 1)
        if isinstance(out, Path):
            write_text(check_target(out, _SCHEMATIC), _XML + svg)
        else:
            out.write(svg)
        return
    ending = out.suffix.lower() if isinstance(out, Path) else ".svg"
    # Dates and random ids would make every build differ from the last one.
    dates = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}
    name = "Subject" if ending == ".pdf" else "Description"
    metadata = {name: "\n".join((provenance or {}).values()), **dates.get(ending, {})}
    with ExitStack() as stack:
        stack.enter_context(style.context(_STYLE))
        if isinstance(out, Path):
            out = stack.enter_context(replacing(check_target(out, FIGURES)))
        figure.savefig(out, format=ending[1:], metadata=metadata)


def _figure_files(key: str) -> list[str]:
    """Return where the book carries the pictures and the data of a figure, below its root."""
    return [f"figures/{anchor(key)}{ending}" for ending in (*_endings(key), ".csv")]


def _endings(key: str) -> tuple[str, ...]:
    """Return the endings of the files as which a figure can be written."""
    is_schematic = isinstance(_declared_drawing(key), Schematic)
    return _SCHEMATIC if is_schematic else FIGURES


def vector_of(figure: Drawn, provenance: _Provenance = None) -> str:
    """Return a figure as SVG."""
    buffer = io.StringIO()
    save(figure, buffer, provenance)
    svg = buffer.getvalue()
    return _FONTS.sub(r"\1, sans-serif", svg[svg.index("<svg") :])


def write_figure(key: str, root: Path) -> None:
    """Write the pictures and the data of a figure below the root of the book, and keep its SVG."""
    figure, provenance = draw(key), provenance_of(citation(key, "text"))
    shown = _page_vectors(key, figure, provenance)
    (root / "figures").mkdir(parents=True, exist_ok=True)
    for path in (root / name for name in _figure_files(key)):
        if path.suffix == ".csv":
            write_text(path, export_frame(_data(figure), "csv", provenance))
        elif path.suffix == ".svg":
            write_text(path, f"{_XML}{shown.wide}")
        else:
            save(figure, path, provenance)
            if not isinstance(figure, str):
                figure.set_layout_engine(
                    "none"
                )  # a figure with a layout keeps its places


def _page_vectors(
    key: str, figure: Drawn | None = None, provenance: _Provenance = None
) -> Vectors:
    """Return a figure for a page of the book; in a build it is drawn once."""

    def make() -> Vectors:
        wide = draw(key) if figure is None else figure
        vectors = Vectors(vector_of(wide, provenance))
        if isinstance(wide, str):  # a schematic fits wide and narrow pages
            return vectors
        return vectors._replace(narrow=vector_of(draw(key, narrow=True)))

    def load(content: bytes) -> Vectors:
        return Vectors(*json.loads(content))

    shown: Vectors = cached(f"figure-{anchor(key)}.json", make, json.dumps, load)
    return shown


def inline(shown: Vectors, name: str, alternative: str, below: str = "") -> str:
    """Return a figure as an HTML fragment whose black parts follow the page's text colour.

    `below` is HTML: the caption and what else belongs to the figure.
    """
    parts = [f'<div class="rp-wide">{_followed(shown.wide, name, alternative)}</div>']
    if shown.narrow:
        # Without the book's style sheet, as in a notebook, only the wide figure is visible.
        svg = _followed(shown.narrow, f"{name}-narrow", alternative)
        parts.append(f'<div class="rp-narrow" hidden>{svg}</div>')
    return f'<figure class="rp-figure" id="{name}">{"".join(parts)}{below}</figure>'


def _followed(svg: str, name: str, alternative: str) -> str:
    # What the style file paints in black is what should follow the page. Where black fills
    # something, matplotlib writes nothing, since SVG fills in black by itself: the root says
    # otherwise.
    svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
    svg = re.sub(r"#000000\b", "currentColor", svg)
    # Short names, of what is named at all, and each its own in a page: points repeat them.
    mark = f"v{zlib.crc32(name.encode()):x}-"
    named = dict.fromkeys(old for _, old in _LINK.findall(svg))
    short = {old: f"{mark}{n}" for n, old in enumerate(named)}
    svg = _NAMED.sub(
        lambda own: f' id="{short[own[1]]}"' if own[1] in short else "", svg
    )
    svg = _LINK.sub(lambda link: link[1] + short[link[2]], svg)
    label = escape(alternative, quote=True)
    return svg.replace(
        "<svg ", f'<svg role="img" aria-label="{label}" fill="currentColor" ', 1
    )


def _captioned(caption: str) -> Markup:
    """Return a caption with the place into which the book writes the figure's number."""
    return Markup('<figcaption><span class="rp-number"></span>{}</figcaption>').format(
        caption
    )


def figure_block(name: str, paint: Paint, alternative: str, caption: str) -> Html:
    """Show a picture that no file of the book holds."""
    shown = Vectors(
        vector_of(styled_figure(paint)), vector_of(styled_figure(paint, narrow=True))
    )
    return Html(inline(shown, name, alternative, _captioned(caption)))


class Figure(Rerunnable, Item):
    """A figure of a paper, drawn from its caption and the text, or a supplementary drawing.

    Parameters
    ----------
    key : str
        Such as ``chen2023/fig-11a``, or ``niu2024/drawing-fusion-star``.
    changes : mapping, optional
        Address of any cell in `inputs` to a value in the printed format.
    seed : int, optional
        Seed of the random number generator. Default: the seed of the project.
    """

    kind = "a figure"

    @property
    def _declared(self) -> Drawing | Schematic:
        return _declared_drawing(self.key)

    def _compute(self, inputs: Inputs | None) -> Drawn:
        return draw(self.key, inputs)

    @property
    def drawn(self) -> Drawn:
        """The matplotlib figure, or the SVG of a schematic."""
        figure: Drawn = self._made[0]
        return figure

    def frame(self) -> pd.DataFrame:
        """Return the lines and points that are drawn, in the units of the axes."""
        return _data(self.drawn)

    def save(self, path: str | Path) -> Path:
        """Write the figure as SVG, PDF or PNG, by the ending of `path`; a schematic as SVG."""
        path = check_target(path, _endings(self.key))
        save(self.drawn, path, self.provenance)
        return path

    @cached_property
    def caption(self) -> str:
        """Caption; of a figure with changes, the changes."""
        if self.changes:
            remark = "a reader's own setting; what is marked as printed stays the print"
            return f"{self.title}. {self._setting(remark)}"
        return self._filled(item_text(self.key).figure.caption)

    @cached_property
    def alternative(self) -> str:
        """Alternative text."""
        alternative = self._filled(item_text(self.key).figure.alternative)
        return self.caption if self.changes else alternative

    def _filled(self, text: str) -> str:
        return numbers.powers(filled(text, {}))

    def blocks(self) -> Iterator[Block]:
        """Yield the figure with its caption; a terminal shows the command that draws it."""
        name = f"figure-{anchor(self.key)}"
        if self.key in drawings():
            name = f"drawing-{anchor(self.key.replace('/drawing-', '/'))}"
        options = [f' --set {one}="{text}"' for one, text in self._changes.items()]
        if self.seed is not None:
            options.append(f" --seed {self.seed}")
        text = (
            f"{self.key}: {self.title}\n{self.place}; lines and points in .data\n"
            f"{textwrap.fill(self.caption, 79)}\n"
            f"Draw it with `reproduce figure {self.key} --out FILE.svg{''.join(options)}`."
        )
        below = _captioned(self.caption)
        if self.changes:
            name = f"{name}-changed"
        else:
            declared = self._declared
            source = text_of(declared.function) if isinstance(declared, Drawing) else ""
            below += toolbar(self.key, name, _figure_files(self.key), source)
        # A page of the book also has a narrow drawing; a notebook of a reader does not.
        if computed.kept() and not self.changes:
            shown = _page_vectors(self.key)
        else:
            shown = Vectors(vector_of(self.drawn))
        yield Html(inline(shown, name, self.alternative, below), text)


class Panels(ResultView):
    """A figure of several panels, such as ``chen2023/fig-11``, each drawn on its own.

    Parameters
    ----------
    key : str
        The key of the panels without their letters.
    panels : tuple of Figure
        One or more.
    """

    def __init__(self, key: str, panels: tuple[Figure, ...]) -> None:
        self.key, self.panels = key, panels

    @property
    def inputs(self) -> tuple[str, ...]:
        """Addresses of all printed cells that any panel reads."""
        return tuple(dict.fromkeys(chain.from_iterable(p.inputs for p in self.panels)))

    @property
    def source(self) -> str:
        """The text of the functions that compute and draw the panels."""
        return "\n\n".join(one.source for one in self.panels)

    def _setting(self) -> str:
        return " ".join(one._setting() for one in self.panels).strip()

    def frame(self) -> pd.DataFrame:
        """Return the lines and points of all panels, with the key of each."""
        return pd.concat([one.frame().assign(figure=one.key) for one in self.panels])

    def rerun(
        self, changes: Change | None = None, seed: int | None = None, **others: Any
    ) -> Panels:
        """Return the panels with changed inputs, and with a seed if they draw random numbers."""
        changes = changes or {}
        refuse_strays(self.key, changes, self.inputs)
        random = [one for one in self.panels if one.random] or self.panels
        again = [
            one.rerun(
                {a: value for a, value in changes.items() if a in one.inputs},
                seed=seed if one in random else None,
                **others,
            )
            for one in self.panels
        ]
        return Panels(self.key, tuple(again))

    def cite(self, form: str = "bibtex") -> str:
        """Return how to cite the panels and their paper."""
        return "\n\n".join(one.cite(form) for one in self.panels)

    def save(self, path: str | Path) -> list[Path]:
        """Write a file for each panel, its letter behind the name: fig.svg becomes fig-a.svg."""
        path = check_target(path, FIGURES)
        stems = {one: f"{path.stem}-{one.key[-1]}" for one in self.panels}
        return [one.save(path.with_stem(stem)) for one, stem in stems.items()]

    def blocks(self) -> Iterator[Block]:
        """Yield each panel."""
        return chain.from_iterable(one.blocks() for one in self.panels)
