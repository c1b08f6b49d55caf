"""The one way to show a table: HTML in a page, aligned columns in a terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from markupsafe import Markup, escape
from rich.console import RenderableType
from rich.table import Table

from reproduce.views.numbers import powers_in_html
from reproduce.views.shown import Shown

__all__ = ["Box", "Entry", "Grid", "folded"]

Entry = str | Markup


class Box(NamedTuple):
    """An entry with an anchor and a class of its own."""

    content: Entry
    identifier: str = ""
    kind: str = ""


@dataclass(frozen=True)
class Grid(Shown):
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
    """

    caption: Entry
    head: Sequence[Entry]
    rows: Sequence[Sequence[Entry | Box]]
    identifier: str = ""
    kind: str = ""
    anchors: Sequence[str] = ()

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
        table = Table(box=None, pad_edge=False, padding=(0, 1, 0, 0))
        for i, name in enumerate(self.head):
            table.add_column(_text(name), justify="right" if i else "left", overflow="fold")
        for row in self.rows:
            table.add_row(*map(_text, row))
        yield table
        yield _text(self.caption)


def folded(summary: str, content: Entry, *, opened: bool = False) -> Markup:
    """Return HTML that shows its content when it is asked to."""
    fold = '<details class="rp-details"{}>\n<summary>{}</summary>\n{}\n</details>'
    return Markup(fold).format(Markup(" open" if opened else ""), summary, content)


def _td(entry: Entry | Box) -> str:
    box = entry if isinstance(entry, Box) else Box(entry)
    named = (("id", box.identifier), ("class", box.kind))
    marks = "".join(f' {name}="{escape(value)}"' for name, value in named if value)
    return f"<td{marks}>{escape(box.content)}</td>"


def _text(entry: Entry | Box) -> str:
    if isinstance(entry, Box):
        return _text(entry.content)
    return entry.striptags() if isinstance(entry, Markup) else entry
