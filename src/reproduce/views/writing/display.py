"""How something shows itself: HTML in a page, aligned columns in a terminal."""

from __future__ import annotations

import io
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from markupsafe import Markup, escape
from rich import box
from rich.console import Console, RenderableType
from rich.table import Table
from rich.text import Text

from reproduce.views.writing.numbers import powers_in_html

__all__ = ["Box", "Display", "Entry", "Grid", "Html", "columns", "fits", "folded"]

WIDTH = 80
Entry = str | Markup


class Display(ABC):
    """What shows itself in a terminal by its parts, without colour in a notebook's text."""

    @abstractmethod
    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield what a terminal of this many columns shows."""

    def print(self, console: Console) -> None:
        """Write the parts on a terminal."""
        for part in self.parts(console.width):
            if isinstance(part, str):
                console.print(part, markup=False, highlight=False)
            else:
                console.print(part)

    def __repr__(self) -> str:
        """Return the parts as text."""
        text = io.StringIO()
        self.print(Console(file=text, width=WIDTH, no_color=True, force_jupyter=False))
        return "\n".join(line.rstrip() for line in text.getvalue().splitlines())


@dataclass(frozen=True)
class Html:
    """A piece of a page; notebooks show it as HTML."""

    text: str

    def _repr_html_(self) -> str:
        return powers_in_html(self.text)

    def __repr__(self) -> str:
        """Return nothing to read: the HTML is what counts."""
        return "<HTML>"


class Box(NamedTuple):
    """An entry with an anchor and a class of its own."""

    content: Entry
    identifier: str = ""
    kind: str = ""


@dataclass(frozen=True, repr=False)
class Grid(Display):
    """A table of texts; the first entry of each row names it.

    Parameters
    ----------
    caption : str
        What it shows; also its name for a reader who cannot see it.
    head : sequence of str
        Names of the columns.
    rows : sequence of sequences of str
        Entries; those that are `markupsafe.Markup` are HTML already.
    identifier : str
        The anchor of the table on a page.
    kind : str
        A further class of its HTML.
    anchors : sequence of str
        The anchor of each row, where rows have one.
    whole : collection of int
        Columns that a terminal does not wrap.
    """

    caption: Entry
    head: Sequence[Entry]
    rows: Sequence[Sequence[Entry | Box]]
    identifier: str = ""
    kind: str = ""
    anchors: Sequence[str] = ()
    whole: Collection[int] = ()

    @property
    def html(self) -> Markup:
        """The table as HTML that scrolls by itself where a page is narrow."""
        th = '<th scope="{}">{}</th>'.format
        head = "".join(th("col", escape(name)) for name in self.head)
        marks = [f' id="{escape(name)}"' for name in self.anchors] or [""] * len(self.rows)
        rows = "\n".join(
            f"<tr{mark}>{th('row', escape(row[0]))}{''.join(map(_td, row[1:]))}</tr>"
            for mark, row in zip(marks, self.rows, strict=True)
        )
        anchor = f' id="{escape(self.identifier)}"' if self.identifier else ""
        label = escape(Markup(escape(self.caption)).striptags())
        return Markup(
            powers_in_html(
                f'<div class="rp-scroll"{anchor} tabindex="0" role="region" aria-label="{label}">'
                f'\n<table class="{f"rp-table {self.kind}".strip()}">'
                f"<caption>{escape(self.caption)}</caption>"
                f"<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}\n</tbody></table></div>"
            )
        )

    def _repr_html_(self) -> str:
        return str(self.html)

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the table and its caption."""
        rows = (map(_text, row) for row in self.rows)
        yield columns(map(_text, self.head), rows, whole=self.whole)
        yield _text(self.caption)


def columns(
    heads: Iterable[str],
    rows: Iterable[Iterable[str | Text]],
    *,
    ruled: bool = False,
    words: int = 1,
    whole: Collection[int] = (),
    **settings: Any,
) -> Table:
    """Return a table for a terminal: numbers to the right, after so many columns of words.

    Columns that are to stay `whole` are not wrapped; without rules a table fits 80 columns.
    """
    look: dict[str, Any] = {"box": None, "padding": (0, 1, 0, 0)}
    look = {"box": box.SIMPLE_HEAD} if ruled else look
    table = Table(pad_edge=False, **look, **settings)
    for i, name in enumerate(heads):
        table.add_column(name, no_wrap=i in whole, overflow="fold")
        table.columns[i].justify = "left" if i < words else "right"
    for row in rows:
        table.add_row(*row)
    return table


def fits(table: Table, width: int) -> bool:
    """Tell whether a terminal of this many columns shows a table without wrapping an entry."""
    return Console(width=10_000).measure(table).maximum <= width


def folded(summary: str, content: Entry, *, opened: bool = False) -> Markup:
    """Return HTML that shows its content when it is asked to."""
    fold = '<details class="rp-details"{}>\n<summary>{}</summary>\n{}\n</details>'
    return Markup(fold).format(Markup(" open" if opened else ""), summary, content)


def _td(entry: Entry | Box) -> str:
    one = entry if isinstance(entry, Box) else Box(entry)
    named = (("id", one.identifier), ("class", one.kind))
    marks = "".join(f' {name}="{escape(value)}"' for name, value in named if value)
    return f"<td{marks}>{escape(one.content)}</td>"


def _text(entry: Entry | Box) -> str:
    if isinstance(entry, Box):
        return _text(entry.content)
    return entry.striptags() if isinstance(entry, Markup) else entry
