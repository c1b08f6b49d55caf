"""All items with their verdicts, every number as a mark, and the frozen verdicts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Any

from reproduce.judge.ledger import Ledger, build
from reproduce.judge.verdicts import VERDICTS
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import PAPERS, altered_files
from reproduce.views import _keys as keys
from reproduce.views import _verdicts as verdicts
from reproduce.views._blocks import (
    LOOKS,
    Block,
    Display,
    Grid,
    Html,
    fold,
    link,
    rendered,
)
from reproduce.views._computed import whole_ledger
from reproduce.views._export import full_frame

if TYPE_CHECKING:
    import pandas as pd


class Contents(Display):
    """The items of a paper, or of all papers, in printed order, with their verdicts.

    Parameters
    ----------
    paper : str, optional
        Name such as ``niu2024``. Default: all papers.

    Raises
    ------
    ValueError
        If the paper is unknown.

    Examples
    --------
    >>> Contents("niu2024").frame().loc["niu2024/table-1", "input"]
    np.int64(12)
    """

    def __init__(self, paper: str | None = None) -> None:
        self.papers = keys.chosen_papers(paper)
        self.keys, self.supplementary = (
            [key for key in ledger if key.partition("/")[0] in self.papers]
            for ledger in (catalogue(), catalogue("studies"))
        )

    @cached_property
    def _ledger(self) -> Ledger:
        return whole_ledger() if self.papers == PAPERS else build(self.keys)

    def entries(self) -> list[dict[str, Any]]:
        """Return a record for each item and supplementary table, without computing it."""
        return list(map(_entry, (*self.keys, *self.supplementary)))

    def frame(self) -> pd.DataFrame:
        """Return one row per item: place, title and the number of cells by verdict."""
        import pandas as pd

        rows = [_entry(key) | verdicts.tally(self._ledger.of(key)) for key in self.keys]
        columns = ["key", "place", "title", *VERDICTS]
        return pd.DataFrame(rows, columns=columns).set_index("key")

    def cells(self) -> pd.DataFrame:
        """Return one row per cell, with every field of the ledger."""
        return full_frame(self._ledger.records)

    @property
    def numbers(self) -> Grid:
        """Every printed number, in a table that a page can sort and filter."""
        records = self._ledger.records
        rows = [
            verdicts.texts(record)
            | {
                "number": link(record.printed_cell.anchor, record.printed_cell.label),
                "place": f"{record.paper}, {record.place}",
            }
            for record in records
        ]
        return Grid.of(
            f"The {len(rows)} printed cells",
            ("number", "place", "printed", "computed", "verdict", "why"),
            rows,
            kind="rp-small rp-sortable",
        )

    @property
    def listed(self) -> Grid:
        """The items and the supplementary tables, without verdicts."""
        return Grid.of(
            "Items in printed order, then supplementary tables.",
            ("key", "place", "title"),
            self.entries(),
        )

    @property
    def index(self) -> Html:
        """Links to the items in printed order, with the number of cells by verdict."""
        return _index(self.keys, self._ledger)

    def blocks(self) -> tuple[Block, ...]:
        """Return a mark for every number, and the same as lists."""
        wall = rendered(
            "wall",
            contents=self,
            records=self._ledger.records,
            verdicts=verdicts,
        )
        return Html(wall), fold(
            "The items, and their cells by verdict", self.listed, self.index
        )


class Check(Display):
    """Judgement of recomputed items, and comparison of the verdicts with the frozen ones.

    True if the verdicts and the files of printed numbers are unchanged.

    Parameters
    ----------
    *items : str
        Keys of items or names of papers. Default: all items.

    Raises
    ------
    KeyError
        If a key is unknown.

    Examples
    --------
    >>> bool(Check("niu2024/table-2"))
    True
    """

    def __init__(self, *items: str) -> None:
        listed: list[str] = []
        for key in items:
            listed += Contents(key).keys if key in PAPERS else [keys.check_key(key)]
        self.ledger = build(listed).model_copy(update={"altered": altered_files()})
        self.changed_verdicts = self.ledger.changed_verdicts()

    def __bool__(self) -> bool:
        """Return whether verdicts and files are unchanged."""
        return not (self.changed_verdicts or self.ledger.altered)

    def frame(self) -> pd.DataFrame:
        """Return the cells whose verdict is not the frozen one."""
        import pandas as pd

        return pd.DataFrame(
            self.changed_verdicts, columns=["cell", "expected", "found"]
        )

    def faults(self) -> list[str]:
        """Return a sentence for each change and its remedy."""
        lines = [
            f"{cell}: expected {expected}, found {found}"
            for cell, expected, found in self.changed_verdicts
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

    def blocks(self) -> list[Block]:
        """Return the number of cells by verdict, and the changes."""
        records = self.ledger.records
        listed = list(dict.fromkeys(record.key for record in records))
        unchanged = [f"All {len(records)} verdicts are as frozen."]
        return [_index(listed, self.ledger), *(self.faults() or unchanged)]


def _entry(key: str) -> dict[str, Any]:
    return {
        "key": key,
        "paper": key.partition("/")[0],
        "place": keys.place(key),
        "title": keys.title(key),
    }


def _index(listed: Sequence[str], ledger: Ledger) -> Html:
    """Return the number of cells by verdict, for a page also by paper."""
    rows = [_entry(key) | verdicts.tally(ledger.of(key)) for key in listed]
    columns = *VERDICTS, "weak"
    page = rendered("index", rows=rows, columns=columns)
    lines = [
        (row["key"], *(str(row[name] or "·") for name in columns))
        for row in (*rows, {"key": "all", **verdicts.tally(ledger.records)})
    ]
    heads = ("key", *(LOOKS[name]["head"] for name in VERDICTS), "weak")
    return Html(page, Grid("Cells by verdict.", heads, lines))


# Names of the public API.
contents, check = Contents, Check
