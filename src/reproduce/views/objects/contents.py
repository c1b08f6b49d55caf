"""All items in order of print, with the number of their cells by verdict."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from reproduce.judge.ledger import Ledger, Record
from reproduce.judge.studies import studies
from reproduce.judge.verdicts import VERDICTS
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import PAPERS, anchor, library
from reproduce.views import keys
from reproduce.views.computed import item_ledger
from reproduce.views.objects.base import by_row
from reproduce.views.objects.wall import legend, wall
from reproduce.views.writing import verdicts
from reproduce.views.writing.blocks import Block, Entry, Fold, Grid, Html, badge
from reproduce.views.writing.display import Blocks, Display

if TYPE_CHECKING:
    import pandas as pd


class Contents(Display):
    """All items of a paper or of all, in order of print, with the verdicts of their cells.

    A terminal also names the tables of our own, which no paper prints.

    Parameters
    ----------
    paper : str, optional
        One paper; all by default.
    """

    def __init__(self, paper: str | None = None) -> None:
        self.paper = paper if paper is None else keys.check_paper(paper)
        self.keys = [key for key in catalogue() if paper in {None, key.partition("/")[0]}]
        self.own = [key for key in studies() if paper in {None, key.partition("/")[0]}]

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
                "functions": [one.name for one in catalogue()[key].computations],
                "draws": catalogue()[key].draw is not None,
            }
            for key in self.keys
        ] + [
            {
                "key": key,
                "place": "a table of our own",
                "title": studies()[key].title,
                "functions": [f"{made.__module__}.{made.__qualname__}"],
                "draws": False,
            }
            for key in self.own
            for made in (studies()[key].function,)
        ]

    def frame(self) -> pd.DataFrame:
        """Return one row per item: place, title and the number of cells by verdict."""
        named = {key: {"place": keys.place(key), "title": keys.title(key)} for key in self.keys}
        return by_row(
            {key: row | verdicts.tally(self._ledger.of(key)) for key, row in named.items()}
        )

    def listed(self) -> Iterator[Grid]:
        """Yield the items and the tables of our own, without the score."""
        rows = [(key, keys.place(key), keys.title(key)) for key in self.keys]
        yield Grid("", ("key", "in the paper", "what"), rows, words=3, whole=(0,))
        if self.own:
            own = [(key, studies()[key].title) for key in self.own]
            yield Grid("", ("our own tables", "what"), own, words=2, whole=(0,))

    @property
    def index(self) -> Blocks:
        """Every item in order of print, with its cells by verdict; each leads to its place."""
        rows: list[list[Entry]] = []
        for key in self.keys:
            held = key in library()
            tally = verdicts.tally(self._ledger.of(key)) if held else {}
            counts = [_named(tally[name], name) if held else "" for name in VERDICTS]
            target = anchor(key) if held else f"figure-{anchor(key)}"
            link = Markup('<a href="#{}">{}</a>').format(target, _short(keys.place(key)))
            what = Markup("{}<br><code>{}</code>").format(keys.title(key), key)
            rows.append([link, what, *counts])
        caption = "Tables, figures and quoted numbers, in order of print."
        grid = Grid(caption, ["", "", *map(badge, VERDICTS)], rows, kind="rp-score rp-index")
        return Blocks((grid,))

    def blocks(self) -> Iterator[Block]:
        """Yield every number as a mark, and the same as lists: items, tables of our own, score."""
        parts, records = [], self._ledger.records
        for paper in (self.paper,) if self.paper else PAPERS:
            own = [record for record in records if record.key.startswith(f"{paper}/")]
            parts += [Markup('<p class="rp-wall-paper">{}</p>').format(paper), wall(own)]
        yield Html(Markup("\n").join([*parts, legend(records)]))
        yield Fold("The same in words", (*self.listed(), score_table(self._ledger)))


def score_table(ledger: Ledger) -> Grid:
    """Return the number of cells by verdict, item by item."""
    items = dict.fromkeys(record.key for record in ledger.records)
    rows = [[key, *_counts(ledger.of(key))] for key in items]
    rows.append(["all", *_counts(ledger.records)])
    heads = ["item", *VERDICTS, "(weak)"]
    return Grid("Cells by verdict", heads, rows, whole=range(len(heads)))


def _counts(records: tuple[Record, ...]) -> list[str]:
    tally = verdicts.tally(records)
    weak = tally["exact"] + tally["consistent"] - verdicts.strong(records)
    return [*map(_counted, tally.values()), _counted(weak)]


def _counted(count: int) -> str:
    return str(count) if count else "·"


def _named(count: int, verdict: str) -> Markup:
    """Return a count with the word that stands beside it where the page is narrow."""
    if not count:
        return Markup('<span class="rp-zero">·</span>')
    return Markup('{}<span class="rp-named"> {}</span>').format(count, verdict)


def _short(place: str) -> str:
    return place.partition(",")[0]
