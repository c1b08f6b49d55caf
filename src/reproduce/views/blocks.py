"""What is shown, described once as blocks: sentences, a `Grid`, a `Fold` around others, `Html`.

One writer makes them HTML for a page or a notebook, another text for a terminal's columns; a
`Display` shows itself so.
"""

from __future__ import annotations

import codecs
import io
import re
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from typing import Any, NamedTuple

from markupsafe import Markup, escape
from rich import box
from rich.cells import cell_len
from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from reproduce.views.numbers import powers_in_html

Entry = str | Markup
_WIDTH = 80
# Columns of a terminal, at least and at most.
_NARROWEST, _WIDEST = 20, 1000
_TOWER = 14  # columns that a wrapped sentence takes at least
_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]")
# How a terminal shows the badge of a verdict.
_COLOURS = {"exact": "green", "consistent": "green", "differs": "bold red"}
_COLOURS |= {"ambiguous": "yellow", "unpublished": "cyan", "input": "dim"}
_SMALL = re.compile("<br><small>(.*?)</small>")
PLAIN = "reproduce-plain"  # how streams write what they cannot encode
# What stands in for a sign that a stream cannot encode.
_SIGNS = {
    "−": "-",
    "×": "x",
    "″": '"',
    "′": "'",
    "°": " deg",
    "±": "+/-",
    "µ": "u",
    "μ": "u",
}
_SIGNS |= {"→": "->", "↔": "<->", "≈": "~", "∞": "inf", "√": "sqrt", "∆": "Delta"}
_SIGNS |= {
    "≤": "<=",
    "≥": ">=",
    "·": ".",
    "–": "-",
    "—": "-",
    "…": "...",
    "’": "'",
    "─": "-",
}
_SIGNS |= {
    "⁻": "-",
    "σ": "sigma",
    "τ": "tau",
    "χ": "chi",
    "κ": "kappa",
    "θ": "theta",
    "Δ": "Delta",
}


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
    shown = {
        head: column
        for head, column in zip(columns, written, strict=True)
        if any(column)
    }
    return Grid(caption, list(shown), [*zip(*shown.values(), strict=True)], **looks)


def badge(word: str, text: str = "") -> Markup:
    """Return a verdict, or a text in its look, as a badge."""
    return Markup('<span class="rp-badge rp-badge-{}">{}</span>').format(
        word, text or word
    )


def link(place: str, text: Entry) -> Markup:
    """Return a text that leads to an anchor, on whatever page it is."""
    return Markup('<a href="#{}">{}</a>').format(place, text)


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


def _write(blocks: Iterable[Block], console: Console) -> None:
    """Write blocks on a terminal."""
    for part in _terminal(blocks, console.width):
        console.print(Text(part) if isinstance(part, str) else part)


def _terminal(blocks: Iterable[Block], width: int) -> Iterator[RenderableType]:
    """Write blocks as aligned text for a terminal of this many columns."""
    for block in blocks:
        if isinstance(block, Grid):
            yield from _grid_lines(block, width)
        elif isinstance(block, Fold):
            yield f"\n{_plain(block.summary)}"
            yield from () if block.page else _terminal(block.blocks, width)
        elif isinstance(block, Html):
            yield from [block.words] * bool(block.words)
        else:
            yield _plain(block)


def _grid_lines(grid: Grid, width: int) -> Iterator[RenderableType]:
    """Yield a table and its caption; where it is too wide, a few lines for each row."""
    head, rows, whole = list(grid.head), [list(row) for row in grid.rows], grid.whole
    if grid.stacked:
        boxes = [
            one for row in rows for one in row if isinstance(one, Box) and one.name
        ]
        head, rows = (
            ["cell", *grid.stacked],
            [[one.name, *one.content] for one in boxes],
        )
        whole = range(1, len(head))
    elif grid.names:
        rows = [[name, *row[1:]] for name, row in zip(grid.names, rows, strict=True)]
    texts = [list(map(_text, row)) for row in rows]
    lined = [
        [_plain(name) for name in head],
        *([one.plain for one in row] for row in texts),
    ]
    columns = enumerate(zip_longest(*lined, fillvalue=""))
    least = sum(_least(i in whole, column) + 1 for i, column in columns) - 1
    wide = least > width
    gap = int(
        least + len(head) - 1 <= width
    )  # a second blank between columns, if there is room
    table = _columns(map(_plain, head), texts, whole=whole, words=grid.words, gap=gap)
    if wide and grid.spare:
        return
    yield from [f"\n{_plain(grid.caption)}"] * bool(grid.caption)
    yield from _row_by_row(head, texts) if wide else [table]


def _row_by_row(
    head: Sequence[Entry], rows: Sequence[Sequence[Text]]
) -> Iterator[RenderableType]:
    """Yield a few lines for each row; what heads say in small print is said once, before."""
    names = [_plain(type(name)(_SMALL.sub("", name))) for name in head]
    small = [(n, _SMALL.findall(text)) for n, text in zip(names, head, strict=True)]
    yield from (f"{name}: {_plain(Markup(found[0]))}" for name, found in small if found)
    yield from [names[1]] * (len(names) == 2)
    for row in rows:
        yield row[0]
        named = [
            (n, text) for n, text in zip(names[1:], row[1:], strict=False) if text.plain
        ]
        if len(names) == 2:  # the head of a single column need not be said at every row
            yield from (Padding(text, (0, 0, 0, 2)) for _, text in named)
            continue
        yield Padding(
            _columns(("", ""), named, words=2, show_header=False), (0, 0, 0, 2)
        )


def _columns(
    heads: Iterable[str],
    rows: Iterable[Iterable[str | Text]],
    *,
    words: int = 1,
    whole: Collection[int] = (),
    show_header: bool = True,
    gap: int = 1,
) -> Table:
    """Return a table for a terminal: numbers to the right, after so many columns of words.

    Columns that are to stay `whole` are not wrapped.
    """
    table = Table(
        pad_edge=False,
        box=box.SIMPLE_HEAD if show_header else None,
        padding=(0, gap, 0, 0),
        show_header=show_header,
        show_edge=False,
    )
    for i, name in enumerate(heads):
        table.add_column(name, no_wrap=i in whole, overflow="fold")
        table.columns[i].justify = "left" if i < words else "right"
    for row in rows:
        table.add_row(*row)
    return table


def _least(whole: bool, texts: Sequence[str]) -> int:
    """Return how narrow a column may be: no word is broken, and no sentence is a tower."""
    longest = max(map(cell_len, texts))
    words = [cell_len(word) for text in texts for word in text.split(" ")]
    return longest if whole else max(*words, min(longest, _TOWER))


def _plain(entry: Entry) -> str:
    """Return an entry without its marks."""
    if isinstance(entry, Markup):
        # Markup would escape what stands in for a break.
        text = str(entry).replace("<br><small>", " ").replace("<br>", "; ")
        entry = Markup(text).striptags()
    return printable(entry)


def printable(text: str) -> str:
    """Return a text with escape sequences for control characters, such as those of a file name.

    Examples
    --------
    >>> printable("red" + chr(27) + "[31m.fits")
    'red\\\\x1b[31m.fits'
    """
    return _CONTROL.sub(lambda found: repr(found[0])[1:-1], text)


def plain(entry: Entry | Box) -> str:
    """Return the text of an entry, without marks."""
    content = entry.content if isinstance(entry, Box) else entry
    lines = content if isinstance(content, tuple) else (content,)
    return ", ".join(_plain(line) for line in lines if line)


def _text(entry: Entry | Box) -> Text:
    text = plain(entry)
    return Text(text, style=_COLOURS.get(text.partition(" ")[0], ""))


class Display(ABC):
    """What shows itself by its blocks, in a notebook and in a terminal."""

    @abstractmethod
    def blocks(self) -> Iterable[Block]:
        """Return what is shown."""

    def _repr_html_(self) -> str:
        return html(self.blocks())

    def print(self) -> None:
        """Write the blocks on the terminal."""
        console = Console()
        console.width = min(max(console.width or _WIDTH, _NARROWEST), _WIDEST)
        _write(self.blocks(), console)

    def __repr__(self) -> str:
        """Return the blocks as text, without colour."""
        shown = io.StringIO()
        console = Console(file=shown, width=_WIDTH, no_color=True, force_jupyter=False)
        _write(self.blocks(), console)
        return "\n".join(line.rstrip() for line in shown.getvalue().splitlines())


@dataclass(frozen=True, repr=False)
class Blocks(Display):
    """Some blocks as one object."""

    shown: tuple[Block, ...]

    def blocks(self) -> tuple[Block, ...]:
        """Return them."""
        return self.shown


def _encodable(error: UnicodeError) -> tuple[str, int]:
    """Write what a stream cannot encode in plain signs."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    signs = error.object[error.start : error.end]
    raised = unicodedata.decomposition(signs[0]).startswith("<super>")
    return "^" * raised + "".join(map(_plain_sign, signs)), error.end


def _plain_sign(sign: str) -> str:
    letters = unicodedata.normalize("NFKD", sign).encode("ascii", "ignore").decode()
    return _SIGNS.get(sign) or letters or "?"


codecs.register_error(PLAIN, _encodable)
