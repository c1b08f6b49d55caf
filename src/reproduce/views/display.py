"""What shows itself by its blocks: as HTML in a notebook, aligned within a terminal's columns."""

from __future__ import annotations

import codecs
import io
import re
import unicodedata
from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass
from itertools import zip_longest

from markupsafe import Markup
from rich import box
from rich.cells import cell_len
from rich.console import Console, RenderableType
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from reproduce.views.blocks import Block, Box, Entry, Fold, Grid, Html, html

_WIDTH = 80
_TOWER = 14  # columns that a wrapped sentence takes at least
# How a terminal shows the badge of a verdict.
_COLOURS = {"exact": "green", "consistent": "green", "differs": "bold red", "blocked": "yellow"}
_COLOURS |= {"input": "dim"}
_SMALL = re.compile("<br><small>(.*?)</small>")
PLAIN = "reproduce-plain"  # how streams write what they cannot encode
# What stands in for a sign that a stream cannot encode.
_SIGNS = {"−": "-", "×": "x", "″": '"', "′": "'", "°": " deg", "±": "+/-", "µ": "u", "μ": "u"}
_SIGNS |= {"→": "->", "↔": "<->", "≈": "~", "∞": "inf", "√": "sqrt", "∆": "Delta"}
_SIGNS |= {"≤": "<=", "≥": ">=", "·": ".", "–": "-", "—": "-", "…": "...", "’": "'", "─": "-"}
_SIGNS |= {"σ": "sigma", "τ": "tau", "χ": "chi", "κ": "kappa", "θ": "theta", "Δ": "Delta"}
_RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹⁻"


def _as_text(blocks: Iterable[Block]) -> str:
    """Return blocks as text, without colour."""
    shown = io.StringIO()
    _write(blocks, Console(file=shown, width=_WIDTH, no_color=True, force_jupyter=False))
    return "\n".join(line.rstrip() for line in shown.getvalue().splitlines())


def _write(blocks: Iterable[Block], console: Console | None = None) -> None:
    """Write blocks on a terminal, by default this one."""
    console = console or Console()
    for part in _terminal(blocks, console.width):
        if isinstance(part, str):
            console.print(part, markup=False, highlight=False)
        else:
            console.print(part)


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
        boxes = [one for row in rows for one in row if isinstance(one, Box) and one.name]
        head, rows = ["cell", *grid.stacked], [[one.name, *one.content] for one in boxes]
        whole = range(1, len(head))
    elif grid.names:
        rows = [[name, *row[1:]] for name, row in zip(grid.names, rows, strict=True)]
    texts = [list(map(_text, row)) for row in rows]
    table = _columns(map(_plain, head), texts, whole=whole, words=grid.words)
    lined = [[_plain(name) for name in head], *([one.plain for one in row] for row in texts)]
    wide = sum(_least(i in whole, column) + 1 for i, column in enumerate(_turned(lined))) > width
    if wide and grid.spare:
        return
    yield from [f"\n{_plain(grid.caption)}"] * bool(grid.caption)
    yield from _row_by_row(head, texts) if wide else [table]


def _row_by_row(head: Sequence[Entry], rows: Sequence[Sequence[Text]]) -> Iterator[RenderableType]:
    """Yield a few lines for each row; what heads say in small print is said once, before."""
    names = [_plain(type(name)(_SMALL.sub("", name))) for name in head]
    small = [(n, _SMALL.findall(text)) for n, text in zip(names, head, strict=True)]
    yield from (f"{name}: {_plain(Markup(found[0]))}" for name, found in small if found)
    yield from [names[1]] * (len(names) == 2)
    for row in rows:
        yield row[0]
        named = [(n, text) for n, text in zip(names[1:], row[1:], strict=False) if text.plain]
        if len(names) == 2:  # the head of a single column need not be said at every row
            yield from (Padding(text, (0, 0, 0, 2)) for _, text in named)
            continue
        yield Padding(_columns(("", ""), named, words=2, show_header=False), (0, 0, 0, 2))


def _columns(
    heads: Iterable[str],
    rows: Iterable[Iterable[str | Text]],
    *,
    words: int = 1,
    whole: Collection[int] = (),
    show_header: bool = True,
) -> Table:
    """Return a table for a terminal: numbers to the right, after so many columns of words.

    Columns that are to stay `whole` are not wrapped.
    """
    table = Table(
        pad_edge=False, box=box.SIMPLE_HEAD if show_header else None, padding=(0, 1, 0, 0),
        show_header=show_header, show_edge=False,
    )  # fmt: skip
    for i, name in enumerate(heads):
        table.add_column(name, no_wrap=i in whole, overflow="fold")
        table.columns[i].justify = "left" if i < words else "right"
    for row in rows:
        table.add_row(*row)
    return table


def _turned(rows: Sequence[Sequence[str]]) -> Iterator[tuple[str, ...]]:
    yield from zip_longest(*rows, fillvalue="")


def _least(whole: bool, texts: Sequence[str]) -> int:
    """Return how narrow a column may be: no word is broken, and no sentence is a tower."""
    longest = max(map(cell_len, texts))
    words = [cell_len(word) for text in texts for word in text.split(" ")]
    return longest if whole else max(*words, min(longest, _TOWER))


def _plain(entry: Entry) -> str:
    """Return an entry without its marks."""
    if not isinstance(entry, Markup):
        return entry
    # Markup would escape what stands in for a break.
    text = str(entry).replace("<br><small>", " ").replace("<br>", "; ")
    return Markup(text).striptags()


def _text(entry: Entry | Box) -> Text:
    content = entry.content if isinstance(entry, Box) else entry
    lines = content if isinstance(content, tuple) else (content,)
    text = ", ".join(_plain(line) for line in lines if line)
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
        _write(self.blocks())

    def __repr__(self) -> str:
        """Return the blocks as text, without colour."""
        return _as_text(self.blocks())


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
    return "".join(map(_plain_sign, error.object[error.start : error.end])), error.end


def _plain_sign(sign: str) -> str:
    if sign in _RAISED:
        return "0123456789-"[_RAISED.index(sign)]
    letters = unicodedata.normalize("NFKD", sign)
    return _SIGNS.get(sign) or letters.encode("ascii", "ignore").decode() or "?"


codecs.register_error(PLAIN, _encodable)
