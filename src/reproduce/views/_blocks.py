"""Blocks of output: sentences, a `Grid`, and `Html`, such as a `fold` around other blocks.

A template writes each block as HTML for a page, and rich writes it for a terminal.
"""

from __future__ import annotations

import io
import json
import re
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jinja2 import (
    ChoiceLoader,
    Environment,
    FileSystemLoader,
    PackageLoader,
    StrictUndefined,
    select_autoescape,
)
from markupsafe import Markup, escape
from rich import box
from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderResult
from rich.padding import Padding
from rich.table import Table
from rich.text import Text

from reproduce import version
from reproduce.locate import data_folder
from reproduce.printed.number import minus, powers
from reproduce.views._tex import escaped, in_tex

if TYPE_CHECKING:
    import pandas as pd

Entry = str | Markup
_WIDTH_COLUMNS, _MIN_COLUMNS, _MAX_COLUMNS = 80, 20, 1000  # of a terminal
# Longest name or number with a unit; longer entries are sentences.
_NAME_CHARACTERS = 24
_CONTROL = re.compile(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]")
_NUMBER = re.compile(r"[−<(≈]?\s?[\d.](?!.*[a-z]{5})|·?$")  # or no entry
# Code, a tag, or text of HTML.
_PIECES = re.compile(r"<(code|pre|script|style)\b.*?</\1>|<[^>]*>|[^<]+", re.DOTALL)
# Meaning, short head, sign, style and shape of each verdict.
LOOKS: dict[str, dict[str, str]] = tomllib.loads(
    Path(__file__).with_name("verdicts.toml").read_text(encoding="utf-8")
)


@cache
def _templates() -> Environment:
    # A fit of stars needs no printed number.
    from reproduce.printed.cells import anchor, library

    folders = [
        PackageLoader("reproduce.views"),
        FileSystemLoader(data_folder() / "reports"),
    ]
    made = Environment(
        loader=ChoiceLoader(folders),
        undefined=StrictUndefined,
        autoescape=select_autoescape(),
        trim_blocks=True,
        lstrip_blocks=True,
    )
    made.globals |= {
        "anchor": anchor,
        "looks": LOOKS,
        "library": library,
        "version": version,
    }
    made.filters |= {
        "escaped": escaped,
        "tex": lambda text: in_tex(escaped(text)),
        # A text in double quotes, as YAML and TriG read it.
        "quoted": lambda text: json.dumps(text, ensure_ascii=False),
    }
    return made


def written(template: str, **context: Any) -> str:
    """Return the text of a template of the folder ``templates`` or of ``data/reports``."""
    return _templates().get_template(template).render(context)


def rendered(template: str, **context: Any) -> Markup:
    """Return the HTML of a template of the folder ``templates``."""
    return Markup(written(f"{template}.html", **context))


def _powers_in_html(html: str) -> str:
    """Return HTML whose exponents are powers of ten, except in code.

    Examples
    --------
    >>> _powers_in_html('<b id="x-2e-05">2e-05</b> <code>2e-05</code>')
    '<b id="x-2e-05">2\u202f×\u202f10⁻⁵</b> <code>2e-05</code>'
    """
    return _PIECES.sub(
        lambda match: match[0] if match[0][0] == "<" else powers(match[0]), html
    )


class Display:
    """An object that shows its blocks in a notebook and in a terminal."""

    def blocks(self) -> Iterable[Block]:
        """Return the blocks; a part such as `Grid` is its own block."""
        return [self]

    @property
    def _views(self) -> Iterator[Display]:
        """The blocks; a sentence is a paragraph of a page."""
        paragraph = Markup('<p class="rp-joint">{}</p>')
        for block in self.blocks():
            if isinstance(block, str):
                block = Html(paragraph.format(block), block)
            yield block

    @property
    def markup(self) -> Markup:
        """HTML of the blocks."""
        return Markup("\n").join(block.markup for block in self._views)

    def __rich_console__(self, _: Console, __: ConsoleOptions) -> RenderResult:
        yield from self._views

    def _repr_html_(self) -> str:
        return _powers_in_html(self.markup)

    def print(self) -> None:
        """Write the object on the terminal."""
        width = Console().width or _WIDTH_COLUMNS
        Console(width=min(max(width, _MIN_COLUMNS), _MAX_COLUMNS)).print(self)

    def __repr__(self) -> str:
        """Return the object as text without colour."""
        file = io.StringIO()
        console = Console(
            file=file, width=_WIDTH_COLUMNS, no_color=True, force_jupyter=False
        )
        console.print(self)
        return "\n".join(line.rstrip() for line in file.getvalue().splitlines())


@dataclass(frozen=True, repr=False)
class Blocks(Display):
    """Some blocks as one object."""

    shown: tuple[Block, ...]

    def blocks(self) -> tuple[Block, ...]:
        """Return the blocks."""
        return self.shown


@dataclass(frozen=True, repr=False)
class Html(Display):
    """Part of a page, or a function that returns it. A terminal shows `words` instead."""

    text: str | Callable[[], str]
    words: Entry | Display = ""

    @property
    def markup(self) -> Markup:
        """HTML of the part."""
        return Markup(self.text if isinstance(self.text, str) else self.text())

    def __rich_console__(self, _: Console, __: ConsoleOptions) -> RenderResult:
        if words := self.words:
            yield Text(plain(words)) if isinstance(words, str) else words


def fold(summary: Entry, *blocks: Block) -> Html:
    """Return blocks that a page shows on demand."""
    content = Blocks(blocks)
    return Html(
        lambda: rendered("fold", summary=summary, content=content),
        Blocks((f"\n{plain(summary)}", content)),
    )


@dataclass(frozen=True, repr=False)
class Grid(Display):
    """A table of texts; the first entry of each row is its name.

    Parameters
    ----------
    caption : str
        Caption, also the label for screen readers.
    head : sequence of str
        Names of the columns.
    rows : sequence of sequences of str
        Entries; an entry that is `markupsafe.Markup` is HTML.
    identifier : str
        Anchor of the table.
    kind : str
        Further classes of its HTML.
    """

    caption: Entry
    head: Sequence[Entry]
    rows: Sequence[Sequence[Entry]]
    identifier: str = ""
    kind: str = ""

    @classmethod
    def of(
        cls,
        caption: Entry,
        columns: Iterable[Any],
        rows: Sequence[Mapping[Any, Any]],
        digits: int = 6,
        **looks: Any,
    ) -> Grid:
        """Return some columns of records, without empty columns."""
        shown = {
            name: texts
            for name in columns
            if any(texts := [entry_text(row.get(name, ""), digits) for row in rows])
        }
        lines = [*zip(*shown.values(), strict=True)]
        return cls(caption, [*shown], lines, **looks)

    @classmethod
    def of_frame(cls, caption: Entry, frame: pd.DataFrame, **looks: Any) -> Grid:
        """Return a DataFrame, whose index contains the names of the rows."""
        rows = frame.reset_index()
        return cls.of(caption, rows, rows.to_dict("records"), **looks)

    @property
    def markup(self) -> Markup:
        """HTML of the table."""
        return rendered("grid", grid=self, caption=escape(self.caption))

    def __rich_console__(self, console: Console, size: ConsoleOptions) -> RenderResult:
        """Yield the caption and the table; if it is too wide, the entries of each row as lines."""
        if self.caption:
            yield Text(f"\n{plain(self.caption)}")
        heads = [*map(plain, self.head)]
        rows = [[*map(plain, row)] for row in self.rows]
        if table := _table(heads, rows, size.max_width):
            yield table
            return
        for name, *texts in rows:
            pairs = zip(heads[1:], texts, strict=True)
            lines = (": ".join(pair) for pair in pairs if pair[1])
            yield Text(name)
            yield Padding(Text("\n".join(lines)), (0, 0, 0, 2))


def entry_text(value: object, digits: int) -> Entry:
    """Return an entry as text; a float has some digits."""
    if isinstance(value, str):
        return value
    if isinstance(value, float):
        return minus(f"{value:z.{digits}g}")
    if isinstance(value, dict):
        return ", ".join(map(": ".join, value.items()))
    return str(value)


def _table(
    heads: Sequence[str], rows: Sequence[Sequence[str]], width: int
) -> Table | None:
    """Return a table for a terminal, with numbers at the right; None if a word does not fit."""
    columns = [*zip(heads, *rows, strict=True)]
    widths = [max(map(cell_len, " ".join(texts).split())) for texts in columns]
    lengths = [max(map(cell_len, texts[1:]), default=0) for texts in columns]
    # Two blanks are between columns.
    spare = width - sum(widths) - 2 * len(columns) + 1
    if spare < 0:
        return None
    # Names and numbers are widened first, then sentences, the longest first, then heads.
    needs = [(min(size, _NAME_CHARACTERS), i) for i, size in enumerate(lengths)]
    needs += sorted(((size, i) for i, size in enumerate(lengths)), reverse=True)
    needs += [(cell_len(texts[0]), i) for i, texts in enumerate(columns)]
    for size, i in needs:
        more = max(0, min(size - widths[i], spare))
        widths[i], spare = widths[i] + more, spare - more
    table = Table(
        pad_edge=False, box=box.SIMPLE_HEAD, padding=(0, 1, 0, 0), show_edge=False
    )
    for (name, *texts), size in zip(columns, widths, strict=True):
        numeric = all(map(_NUMBER.match, texts))
        table.add_column(name, justify="right" if numeric else "left", width=size)
    for row in rows:
        looks = (LOOKS.get(text.partition(" ")[0], {}) for text in row)
        table.add_row(*map(Text, row, (look.get("style", "") for look in looks)))
    return table


Block = Entry | Display


def badge(word: str, text: str = "") -> Markup:
    """Return a verdict, or a text in the style of a verdict, as a badge."""
    return Markup('<span class="rp-badge rp-badge-{}">{}</span>').format(
        word, text or word
    )


def code(text: str) -> Markup:
    """Return a text as code."""
    return Markup("<code>{}</code>").format(text)


def link(place: str, text: Entry) -> Markup:
    """Return a text with a link to an anchor of any page."""
    return Markup('<a href="#{}">{}</a>').format(place, text)


def printable(text: str) -> str:
    """Return a text with escape sequences for control characters.

    Examples
    --------
    >>> printable("red" + chr(27) + "[31m.fits")
    'red\\\\x1b[31m.fits'
    """
    return _CONTROL.sub(lambda match: repr(match[0])[1:-1], text)


def plain(entry: Entry) -> str:
    """Return the text of an entry, without HTML."""
    if isinstance(entry, Markup):
        entry = entry.striptags()
    return printable(entry)
