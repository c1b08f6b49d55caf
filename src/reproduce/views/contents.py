"""All items with their score, every number as a mark, and the verdicts against the frozen ones."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cached_property
from itertools import groupby
from math import ceil
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from reproduce.judge.ledger import Ledger, Record, build, surprises
from reproduce.judge.verdicts import VERDICTS
from reproduce.papers.catalogue import catalogue, studies
from reproduce.printed.cells import (
    PAPERS,
    PrintedTable,
    altered_files,
    anchor,
    library,
)
from reproduce.views import keys, verdicts
from reproduce.views.base import by_row
from reproduce.views.blocks import (
    Block,
    Blocks,
    Box,
    Display,
    Entry,
    Fold,
    Grid,
    Html,
    badge,
    grid,
)
from reproduce.views.computed import item_ledger
from reproduce.views.export import full_frame
from reproduce.views.table import EVERY

if TYPE_CHECKING:
    import pandas as pd

PITCH = 14  # from one mark to the next, in CSS pixels
DEEP = 6  # marks above each other; a longer table goes on beside itself
# Each verdict has a shape of its own, so that colour is not needed.
SHAPES = {
    "exact": "M-4.5-4.5h9v9h-9z",
    "consistent": "M-4.9 0a4.9 4.9 0 1 0 9.8 0a4.9 4.9 0 1 0-9.8 0z",
    "differs": "M0-6.5 6.5 0 0 6.5-6.5 0z",
    "ambiguous": "M0-5 5.5 4.5h-11z",
    "unpublished": "M-4.5-4.5 4.5 4.5M-4.5 4.5 4.5-4.5",
    "input": "M-2.1 0a2.1 2.1 0 1 0 4.2 0a2.1 2.1 0 1 0-4.2 0z",
}


class Contents(Display):
    """All items of a paper or of all, in order of print, with the verdicts of their cells.

    A terminal also names the tables of our own, which no paper prints.

    Parameters
    ----------
    paper : str, optional
        One paper; all by default.
    """

    def __init__(self, paper: str | None = None) -> None:
        self.papers = PAPERS if paper is None else (keys.check_paper(paper),)
        self.keys, self.own = (
            [
                key
                for key in found
                if paper is None or key.partition("/")[0] in self.papers
            ]
            for found in (catalogue(), studies())
        )

    @cached_property
    def _ledger(self) -> Ledger:
        return item_ledger(*self.keys)

    def entries(self) -> list[dict[str, Any]]:
        """Return what is known of each item and each table of our own, computing nothing."""
        return [
            {
                "key": key,
                "place": keys.place(key),
                "title": keys.title(key),
                "draws": key in catalogue() and catalogue()[key].draw is not None,
            }
            for key in (*self.keys, *self.own)
        ]

    def frame(self) -> pd.DataFrame:
        """Return one row per item: place, title and the number of cells by verdict."""
        named = {
            key: {"place": keys.place(key), "title": keys.title(key)}
            for key in self.keys
        }
        tallies = {key: verdicts.tally(self._ledger.of(key)) for key in self.keys}
        return by_row(named).join(by_row(tallies))

    def cells(self) -> pd.DataFrame:
        """Return one row per cell, with every field of the ledger."""
        return full_frame(self._ledger.records)

    @property
    def numbers(self) -> Blocks:
        """Every printed number; a page lets a reader sort and filter them."""
        what, kind = (
            f"The {len(self._ledger.records)} printed numbers",
            "rp-small rp-sortable",
        )
        return Blocks(
            (grid(what, EVERY, self._ledger.records, kind=kind, words=len(EVERY)),)
        )

    @property
    def listed(self) -> Blocks:
        """The items and the tables of our own, without the score."""
        rows = [(one["key"], one["place"], one["title"]) for one in self.entries()]
        caption, head = (
            "Items in order of print, then our own tables.",
            ("key", "place", "what"),
        )
        return Blocks((Grid(caption, head, rows, words=3, whole=(0,)),))

    @property
    def index(self) -> Blocks:
        """Every item in order of print, with its cells by verdict; each leads to its place."""
        return Blocks((_score(self.keys, self._ledger),))

    def blocks(self) -> Iterator[Block]:
        """Yield every number as a mark, and the same as lists: items, tables of our own, score."""
        records, part = (
            self._ledger.records,
            Markup('<div><p class="rp-wall-paper">{}</p>{}</div>'),
        )
        papers = groupby(records, key=lambda record: record.key.partition("/")[0])
        walls = Markup("\n").join(
            part.format(paper, wall(own)) for paper, own in papers
        )
        yield Html(
            Markup('<div class="rp-walls">\n{}\n</div>\n{}').format(
                walls, legend(records)
            )
        )
        yield Fold("The same in words", (*self.listed.shown, *self.index.shown))


class Check(Display):
    """The verdicts against the frozen ones. True if they and the printed files are the same.

    Parameters
    ----------
    wanted : tuple of str
        The items, or papers with all of theirs; all by default.
    progress : callable, optional
        Called with the number of items done and of all.
    """

    def __init__(
        self,
        wanted: tuple[str, ...] = (),
        progress: Callable[[int, int], None] | None = None,
    ) -> None:
        whole = {paper: Contents(paper).keys for paper in PAPERS}
        listed = [
            one for key in wanted for one in whole.get(key) or [keys.check_key(key)]
        ]
        found = build(listed or None, progress)
        self.ledger = found.model_copy(update={"altered": altered_files()})
        self.surprises = surprises(self.ledger)

    def __bool__(self) -> bool:
        """Tell whether verdicts are as frozen, and files as summed."""
        return not (self.surprises or self.ledger.altered)

    def frame(self) -> pd.DataFrame:
        """Return the cells whose verdict is not the frozen one."""
        import pandas as pd

        return pd.DataFrame(
            map(vars, self.surprises), columns=["cell", "expected", "found"]
        )

    def faults(self) -> list[str]:
        """Return what is not as frozen, and what to do about it."""
        lines = [
            f"{s.cell}: expected {s.expected}, found {s.found}" for s in self.surprises
        ]
        if lines:
            lines.append(
                f"Not as in data/verdicts.toml: {len(lines)} of {len(self.ledger.records)}; find "
                "the cause, or change that file with the reason"
            )
        return lines + [
            f"data/printed/{name}: not the file of its checksum in data/printed/SHA256SUMS; "
            "restore the printed digits, or enter them twice and renew the checksum"
            for name in self.ledger.altered
        ]

    def blocks(self) -> Iterator[Block]:
        """Yield the score, and what is not as frozen."""
        records = self.ledger.records
        yield _score(list(dict.fromkeys(record.key for record in records)), self.ledger)
        yield from self.faults() or [f"All {len(records)} verdicts are as frozen."]


def _score(listed: Sequence[str], ledger: Ledger) -> Grid:
    """Return the number of cells by verdict, item by item; each item leads to its place."""
    rows: list[list[Entry | Box]] = []
    names: list[str] = []
    entry = Markup('<a href="#{}">{}</a><br><small>{}</small><br><code>{}</code>')
    for key in listed:
        paper, _, name = key.partition("/")
        if not names or paper not in names:
            rows.append(
                [
                    paper,
                    *_counts([r for r in ledger.records if r.key.startswith(paper)]),
                ]
            )
            names.append(paper)
        names.append(f" {name}")
        place, what = keys.place(key).partition(",")[0], keys.title(key)
        target = anchor(key) if key in library() else f"figure-{anchor(key)}"
        counts = _counts(ledger.of(key)) if key in library() else []
        rows.append([entry.format(target, place, what, key), *counts])
    if len({key.partition("/")[0] for key in listed}) > 1:
        rows.append(["all", *_counts(ledger.records)])
        names.append("all")
    head = ["", *map(badge, VERDICTS), "weak"]
    caption = "Cells by verdict, in the order of the papers."
    return Grid(
        caption,
        head,
        rows,
        kind="rp-score rp-index",
        names=names,
        whole=range(len(head)),
    )


def _counts(records: Sequence[Record]) -> list[Box]:
    counts = [*verdicts.tally(records).values(), verdicts.weak(records)]
    return [Box(str(count)) if count else Box("·", kind="rp-zero") for count in counts]


def wall(records: Iterable[Record]) -> Markup:
    """Draw every record as a mark that leads to its cell, one small picture for each item."""
    items = groupby(records, key=lambda record: record.key)
    blocks = Markup("\n").join(_block(library()[key], tuple(own)) for key, own in items)
    return Markup('<div class="rp-wall">\n{}\n</div>').format(blocks)


def legend(records: Sequence[Record]) -> Markup:
    """Say what each mark means, and how many there are."""
    entry = Markup(
        '<li tabindex="0"><svg viewBox="-7 -7 14 14" width="14" height="14" aria-hidden="true">'
        '<path class="rp-mark-{}" d="{}"/></svg> <strong>{}</strong>: {}</li>'
    ).format
    entries = [
        entry(
            verdict, SHAPES[verdict], f"{count} {verdict}", verdicts.MEANINGS[verdict]
        )
        for verdict, count in verdicts.tally(records).items()
    ]
    hollow = f"{verdicts.weak(records)} of these weak"
    weak = (
        "agrees, but in a way that says little: a copy, a difference, a wide interval"
    )
    entries.insert(2, entry("exact rp-mark-weak", SHAPES["exact"], hollow, weak))
    return Markup('<ul class="rp-wall-legend">\n{}\n</ul>').format(
        Markup("\n").join(entries)
    )


def _block(table: PrintedTable, records: Sequence[Record]) -> Markup:
    """Draw one item: its name, and its cells in the shape of the print, as high as all others."""
    across, rows = max(1, len(table.columns)), len(table.rows)
    deep = ceil(rows / ceil(rows / DEEP))
    wide, high = PITCH * across * ceil(rows / deep), PITCH * DEEP
    marks = Markup("")
    for at, record in enumerate(records):
        row, column = divmod(at, across)
        marks += _mark(record, row // deep * across + column, row % deep)
    name = table.place.partition(",")[0]
    name = table.key.partition("/")[2].removeprefix("text-") if name == "Text" else name
    tally = verdicts.tally(records).items()
    told = ", ".join(f"{count} {verdict}" for verdict, count in tally if count)
    return Markup(
        '<div class="rp-wall-item"><a href="#{}" title="{}: {}">{}</a>\n'
        '<svg viewBox="0 0 {} {}" width="{}" height="{}" role="group" aria-label="{}: {}">{}</svg>'
        "</div>"
    ).format(
        anchor(table.key),
        table.title,
        told,
        name,
        wide,
        high,
        wide,
        high,
        name,
        told,
        marks,
    )


def _mark(record: Record, across: int, down: int) -> Markup:
    cell, value = verdicts.cell_of(record), verdicts.computed(record)
    told = f"{cell.label}: {cell.shown} printed"
    told += f", {value} computed" if value and record.role == "result" else ""
    weak = " rp-mark-weak" if verdicts.weak_agreement(record) else ""
    x, y = (PITCH * place + PITCH // 2 for place in (across, down))
    # The name of the item leads a keyboard to its table; 300 stops on the way would not help it.
    return Markup(
        '<a href="#{}" tabindex="-1"><title>{}, {}</title>'
        '<g transform="translate({} {})"><path class="rp-hit" d="M-7-7h14v14h-14z"/>'
        '<path class="rp-mark-{}{}" d="{}"/></g></a>'
    ).format(
        cell.anchor,
        told,
        verdicts.qualified(record),
        x,
        y,
        record.verdict,
        weak,
        SHAPES[record.verdict],
    )
