"""Figures in one style: drawn, written to files, inline in a page, computed again."""

from __future__ import annotations

import io
import json
import re
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import deepcopy
from functools import cached_property
from html import escape
from pathlib import Path
from threading import RLock
from typing import TYPE_CHECKING, Any, TypeAlias
from xml.etree import ElementTree

import numpy as np
import pandas as pd
from markupsafe import Markup

from reproduce.judge import rerun
from reproduce.locate import data_folder
from reproduce.papers.catalogue import catalogue
from reproduce.papers.charts import NARROW
from reproduce.papers.declare import Drawing, Schematic, drawing, item_text, panels
from reproduce.printed.cells import anchor, library
from reproduce.printed.inputs import load_inputs
from reproduce.printed.number import powers
from reproduce.store.files import FIGURES, FilePath, check_target, replacing
from reproduce.views import _computed as computed
from reproduce.views import _keys as keys
from reproduce.views._base import NO_CHANGE, Change, Rerunnable, ResultView
from reproduce.views._blocks import Block, Html, rendered
from reproduce.views._verdicts import filled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as MatplotlibFigure

_STYLE = Path(__file__).parent / "figures.mplstyle"
# The style of matplotlib is common to all threads.
_LOCK = RLock()
_XML = '<?xml version="1.0" encoding="utf-8" standalone="no"?>\n'
# Names of the provenance and of dates in the metadata of each format.
_METADATA = {
    "svg": ("Description", "Date"),
    "pdf": ("Subject", "CreationDate"),
    "png": ("Description",),
}
# Sizes on a narrow page, in points. Text is not smaller than 8 points.
_SMALL = {"font.size": 8.5, "axes.titlesize": 9.0}
_FONTS = re.compile(r"(font-family: 'DejaVu Sans')[^;\"]*")
_Paint = Callable[["MatplotlibFigure"], None]
# A matplotlib figure, or the SVG of a schematic.
_Drawn: TypeAlias = "MatplotlibFigure | str"


def drawable() -> list[str]:
    """Return the keys of the figures in printed order, and of the supplementary drawings."""
    return [key for key in (*catalogue(), *catalogue("drawings")) if drawing(key)]


def _styled_figure(paint: _Paint, *, narrow: bool) -> MatplotlibFigure:
    """Return a figure in the project's style, for a wide page or for a narrow one."""
    from matplotlib import style
    from matplotlib.figure import Figure as MatplotlibFigure

    # The style of the user, such as that of a notebook, must not change a figure.
    with (
        _LOCK,
        style.context([_STYLE, _SMALL] if narrow else _STYLE, after_reset=True),
    ):
        figure = MatplotlibFigure(
            figsize=(NARROW, 3.2) if narrow else None, layout="constrained"
        )
        paint(figure)
    return figure


def _curves(axes: Axes) -> Iterator[tuple[str, Any]]:
    """Yield the names and the points of the lines, areas, marks and labels of a panel."""
    from matplotlib.collections import PathCollection, QuadMesh

    # A line across the panel has one coordinate that is a fraction of the panel, whose limits
    # matplotlib sets when it draws.
    axes.autoscale_view()
    found: list[Any] = [
        (
            line.get_label(),
            (line.get_transform() - axes.transData).transform(line.get_xydata()),
        )
        for line in axes.lines
    ]
    for one in axes.collections:
        points: Any = [
            point for path in one.get_paths() for point in np.asarray(path.vertices)
        ]
        if isinstance(one, PathCollection):
            points = one.get_offsets()
        if not isinstance(one, QuadMesh):  # an image has no points
            found.append((one.get_label(), points))
    # A label is next to its point.
    found += [(t.get_text(), getattr(t, "xy", t.get_position())) for t in axes.texts]
    for number, (name, points) in enumerate(found, start=1):
        yield f"curve {number}" if name.startswith("_") else name, points


def _content(figure: _Drawn, form: str, note: str = "") -> bytes:
    """Return the file of a figure, without a date, so that builds are equal."""
    from matplotlib import style

    if isinstance(figure, str):
        title = f"<metadata>{escape(note)}</metadata>\n  <title>"
        return (_XML + figure.replace("<title>", title, 1)).encode()
    subject, *dates = _METADATA[form]
    buffer = io.BytesIO()
    with _LOCK, style.context(_STYLE, after_reset=True):
        metadata = {subject: note, **dict.fromkeys(dates)}
        # The layout of a drawn figure would move the next one by some pixels.
        deepcopy(figure).savefig(buffer, format=form, metadata=metadata)
    if form != "svg":
        return buffer.getvalue()
    # Pages contain many figures: no space between tags, and none at the ends of lines.
    svg = re.sub(r">\s*\n\s*<", "><", buffer.getvalue().decode())
    svg = re.sub(r"\s*\n\s*", " ", svg[svg.index("<svg") :])
    return (_XML + _FONTS.sub(r"\1, sans-serif", svg)).encode()


def _vectors_of(*figures: _Drawn) -> list[str]:
    """Return figures as SVG without provenance."""
    return [_content(one, "svg").decode() for one in figures]


def _inline(
    vectors: Sequence[str], name: str, alternative: str, caption: str, bar: str = ""
) -> Markup:
    """Return a figure as HTML whose black parts have the text colour of the page.

    `vectors` contains the SVG for a wide page, and for a narrow page if there is one. Without the
    style sheet of the book, as in a notebook, only the wide figure is visible. `bar` is the HTML
    below the caption, which has room for the number of the figure.
    """
    # An element without a colour is black; the colour of the root applies to it.
    head = f'<svg role="img" aria-label="{escape(alternative)}" fill="currentColor" '
    drawn = {}
    for svg, kind in zip(vectors, ("wide", "narrow"), strict=False):
        svg = re.sub(r"<metadata>.*?</metadata>", "", svg, flags=re.DOTALL)
        svg = re.sub(r"#000000\b", "currentColor", svg)
        # Identifiers are different in each figure of a page.
        mark = f"v{zlib.crc32(f'{name}-{kind}'.encode()):x}-"
        svg = re.sub(r'( id="|xlink:href="#|url\(#)', rf"\g<1>{mark}", svg)
        drawn[kind] = Markup(svg.removeprefix(_XML).replace("<svg ", head, 1))
    return rendered("figure", name=name, drawn=drawn, caption=caption, bar=bar)


def figure_block(name: str, paint: _Paint, alternative: str, caption: str) -> Html:
    """Return a figure that is not among the files of the book."""
    drawn = (_styled_figure(paint, narrow=narrow) for narrow in (False, True))
    return Html(_inline(_vectors_of(*drawn), name, alternative, caption))


class Figure(Rerunnable):
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

    @property
    def _declared(self) -> Drawing:
        if self.key not in catalogue("drawings"):
            keys.check_key(self.key)
        if found := drawing(self.key):
            return found
        raise ValueError(
            f"key: expected a figure, got {self.key}. Use table({self.key!r})"
        )

    def compute(self, *, narrow: bool = False) -> _Drawn:
        """Draw the figure with its printed values, for a wide page or for a narrow one."""
        declared = self._declared
        if isinstance(declared, Schematic):
            file = data_folder() / "schematics/style.svg"
            _, *style, _ = file.read_text(encoding="utf-8").splitlines()
            return filled(declared.svg).replace(">", "\n".join((">", *style)), 1)
        own = [self.key] if self.key in library() else []
        printed = load_inputs([*own, *declared.marks])
        return _styled_figure(
            lambda figure: declared.function(figure, printed, self._inputs),
            narrow=narrow,
        )

    @property
    def drawn(self) -> _Drawn:
        """The matplotlib figure, or the SVG of a schematic."""
        figure: _Drawn = self._made
        return figure

    @property
    def _endings(self) -> tuple[str, ...]:
        """The endings of its files."""
        return (".svg",) if isinstance(self._declared, Schematic) else FIGURES

    @property
    def files(self) -> list[str]:
        """Its files below the root of the book, the data last."""
        return [
            f"figures/{anchor(self.key)}{ending}" for ending in (*self._endings, ".csv")
        ]

    def vectors(self) -> list[str]:
        """Return it as SVG for a wide page; in a build also for a narrow page, drawn once."""
        if self.changes or not computed.kept():
            return _vectors_of(self.drawn)
        return computed.cached(
            f"figure-{anchor(self.key)}.json",
            # A schematic is the same on both pages.
            lambda: _vectors_of(
                *dict.fromkeys([self.drawn, self.compute(narrow=True)])
            ),
            json.dumps,
            json.loads,
        )

    def frame(self) -> pd.DataFrame:
        """Return the lines, points and labels in the units of the axes, or of a view box."""
        figure = self.drawn
        if isinstance(figure, str):
            labels = ElementTree.fromstring(figure).iter(
                "{http://www.w3.org/2000/svg}text"
            )
            places = [
                (1, "".join(one.itertext()), *(float(one.get(a, 0)) for a in "xy"))
                for one in labels
            ]
        else:
            places = [
                (panel, curve, x, y)
                for panel, axes in enumerate(figure.axes, start=1)
                for curve, points in _curves(axes)
                for x, y in np.reshape(points, (-1, 2)).tolist()
            ]
        return pd.DataFrame(places, columns=["panel", "curve", "x", "y"])

    def save(self, path: FilePath) -> Path:
        """Write the figure as SVG, PDF or PNG, by the ending of `path`; a schematic as SVG."""
        path = check_target(path, self._endings)
        form = path.suffix[1:].lower()
        note = "\n".join(self.provenance.values())
        with replacing(path) as part:
            part.write_bytes(_content(self.drawn, form, note))
        return path

    @cached_property
    def caption(self) -> str:
        """Caption; of a figure with changes, the changes."""
        if self.changes:
            remark = "your setting; marks of printed values do not change"
            return f"{self.title}. {self._setting(remark)}"
        return powers(filled(item_text(self.key).caption))

    @cached_property
    def alternative(self) -> str:
        """Alternative text."""
        if self.changes:
            return self.caption
        return powers(filled(item_text(self.key).alternative))

    def blocks(self) -> Iterator[Block]:
        """Yield the figure with its caption; a terminal shows the command that draws it."""
        name = f"figure-{anchor(self.key)}"
        text = (
            f"{self.key}: {self.title}\n{self.place}; lines and points in .data\n"
            f"{self.caption}\n"
            f"Draw it with `reproduce figure {self.key} --out FILE.svg` and the same options."
        )
        bar = "" if self.changes else self._toolbar(name)
        name += "-changed" * bool(self.changes)
        page = _inline(self.vectors(), name, self.alternative, self.caption, bar)
        yield Html(page, text)


class Panels(ResultView, list[Figure]):
    """Panels of a figure, such as ``chen2023/fig-11``: a list that shows every panel."""

    def __init__(self, panels: Iterable[Figure]) -> None:
        super().__init__(panels)
        self.key = self[0].key[:-1]
        settings = dict.fromkeys(panel._changed for panel in self if panel.changes)
        self._changed = "; ".join(settings)

    def blocks(self) -> Panels:
        """Return the panels."""
        return self

    def frame(self) -> pd.DataFrame:
        """Return the lines and points of all panels, with the key of each."""
        return pd.concat([panel.frame().assign(figure=panel.key) for panel in self])

    def save(self, path: FilePath) -> list[Path]:
        """Write each panel to the path with its letter: ``fig-11a.pdf`` for ``fig-11.pdf``.

        Parameters
        ----------
        path : path
            File with the ending of a picture, as in `Figure.save`.

        Returns
        -------
        list of pathlib.Path
            The written files.
        """
        path = check_target(path, FIGURES)
        return [panel.save(path.with_stem(path.stem + panel.key[-1])) for panel in self]

    def rerun(
        self, changes: Change = NO_CHANGE, *, seed: int | None = None, **others: Any
    ) -> Panels:
        """Return the panels with changed inputs or another seed.

        Parameters
        ----------
        changes : mapping, optional
            Address of an input of any panel to a value as printed.
        seed : int, optional
            Seed of the panels that draw random numbers.
        **others
            Not accepted.

        Returns
        -------
        Panels
            Panels that do not depend on a change are as printed.

        Raises
        ------
        TypeError
            If the changes are no mapping of addresses, or the seed is not a whole number.
        ValueError
            If no panel has the input, or no panel draws random numbers.
        """
        rerun.checked_values(self.key, changes)
        fixed = any(panel.random for panel in self)
        return Panels(
            panel.rerun(
                {name: changes[name] for name in changes if name in panel.inputs},
                seed=None if fixed and not panel.random else seed,
                **others,
            )
            for panel in self
        )


def figure(key: str) -> Figure | Panels:
    """Return a figure.

    Parameters
    ----------
    key : str
        Key of a figure or of a panel, such as ``chen2023/fig-11a``. The key of a figure with
        panels, ``chen2023/fig-11``, returns a list of all panels.

    Returns
    -------
    Figure or Panels
        The figure, which is drawn on first use.

    Raises
    ------
    TypeError
        If the key is not text.
    KeyError
        If there is no such figure.
    ValueError
        If it is a table without a figure.

    Examples
    --------
    >>> figure("chen2023/fig-11a").place
    'Figure 11a'
    """
    parts = panels(key)
    return Panels(map(Figure, parts)) if parts else Figure(key)
