"""What is shown, described once as blocks: sentences, a `Grid`, a `Fold` around others, `Html`.

Here they become HTML, in `display` text for a terminal.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from markupsafe import Markup, escape

from reproduce.views.numbers import powers_in_html

Entry = str | Markup


@dataclass(frozen=True)
class Html:
    """A piece of a page, or what writes it; a terminal shows `words` in its place."""

    text: str | Callable[[], str]
    words: str = ""

    @property
    def markup(self) -> Markup:
        """The piece itself."""
        return Markup(self.text if isinstance(self.text, str) else self.text())

    def _repr_html_(self) -> str:
        return powers_in_html(self.markup)

    def __repr__(self) -> str:
        """Return the words, where it has some: the HTML is what counts."""
        return self.words or "<HTML>"


class Box(NamedTuple):
    """An entry with an anchor, a class and a name of its own; it may hold several, stacked."""

    content: Entry | tuple[Entry, ...]
    identifier: str = ""
    kind: str = ""
    name: str = ""


class Fold(NamedTuple):
    """Blocks that a page shows when it is asked to; of some a terminal says the summary alone."""

    summary: Entry
    blocks: tuple[Block, ...]
    opened: bool = False
    page: bool = False


@dataclass(frozen=True)
class Grid:
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
    names : sequence of str
        What a terminal calls each row in place of its first entry.
    whole : collection of int
        Columns that a terminal does not wrap.
    stacked : sequence of str
        What the stacked entries of a box are; a terminal shows a row for each box.
    words : int
        So many columns are words, which a terminal aligns at the left.
    spare : bool
        Whether a terminal that is too narrow may leave it out.
    """

    caption: Entry
    head: Sequence[Entry]
    rows: Sequence[Sequence[Entry | Box]]
    identifier: str = ""
    kind: str = ""
    anchors: Sequence[str] = ()
    names: Sequence[str] = ()
    whole: Collection[int] = ()
    stacked: Sequence[str] = ()
    words: int = 1
    spare: bool = False


Block = str | Markup | Html | Grid | Fold


def grid(
    caption: Entry,
    columns: Mapping[Any, Callable[[Any], Entry | Box]],
    rows: Collection[Any],
    **looks: Any,
) -> Grid:
    """Return a table from what writes the entries of each column, by its head, and the rows.

    Columns without any entry are left out.
    """
    written = [[write(row) for row in rows] for write in columns.values()]
    shown = {head: column for head, column in zip(columns, written, strict=True) if any(column)}
    return Grid(caption, list(shown), [*zip(*shown.values(), strict=True)], **looks)


def badge(word: str, text: str = "") -> Markup:
    """Return a verdict, or a text in its look, as a badge."""
    mark = Markup('<span class="rp-badge rp-badge-{}">{}</span>')
    return mark.format(word, text or word)


def html(blocks: Iterable[Block]) -> str:
    """Write blocks as HTML."""
    return powers_in_html(_joined(blocks))


def _joined(blocks: Iterable[Block]) -> Markup:
    return Markup("\n").join(map(_block_html, blocks))


def _block_html(block: Block) -> Markup:
    if isinstance(block, Html):
        return block.markup
    if isinstance(block, Grid):
        return _table_html(block)
    if isinstance(block, Fold):
        fold = '<details class="rp-details"{}>\n<summary>{}</summary>\n{}\n</details>'
        opened = Markup(" open" if block.opened else "")
        return Markup(fold).format(opened, block.summary, _joined(block.blocks))
    return Markup('<p class="rp-joint">{}</p>').format(block)


def _table_html(grid: Grid) -> Markup:
    th = '<th scope="{}">{}</th>'.format
    head = "".join(th("col", escape(name)) for name in grid.head)
    marks = [f' id="{escape(name)}"' for name in grid.anchors] or [""] * len(grid.rows)
    rows = "\n".join(
        f"<tr{mark}>{th('row', escape(row[0]))}{''.join(map(_td, row[1:]))}</tr>"
        for mark, row in zip(marks, grid.rows, strict=True)
    )
    anchor = f' id="{escape(grid.identifier)}"' if grid.identifier else ""
    label = escape(Markup(escape(grid.caption)).striptags())
    return Markup(
        f'<div class="rp-scroll"{anchor} tabindex="0" role="region" aria-label="{label}">'
        f'\n<table class="{f"rp-table {grid.kind}".strip()}">'
        f"<caption>{escape(grid.caption)}</caption>"
        f"<thead><tr>{head}</tr></thead>\n<tbody>\n{rows}\n</tbody></table></div>"
    )


def _td(entry: Entry | Box) -> str:
    one = entry if isinstance(entry, Box) else Box(entry)
    named = (("id", one.identifier), ("class", one.kind))
    marks = "".join(f' {name}="{escape(value)}"' for name, value in named if value)
    lines = one.content if isinstance(one.content, tuple) else (one.content,)
    return f"<td{marks}>{Markup('<br>').join(line for line in lines if line)}</td>"
