"""Texts of items in ``data/captions/PAPER.toml``: captions, columns, options, facts.

A table of the file has the last part of a key as its name and the fields of `ItemText`.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any

from pydantic import BaseModel, ConfigDict

from reproduce.locate import data_files, read_toml


class _Text(BaseModel):
    """Base of the texts."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class Column(_Text):
    """A column of a supplementary table and the format of its numbers.

    Parameters
    ----------
    name : str
        Head, with the unit in brackets.
    form : str
        Format specification for numbers, such as ``.2f``; empty for words.
    zero : float
        Smaller numbers are rounding noise and shown as 0.
    least : float
        Smaller numbers, such as probabilities far in a tail, are shown as a bound.
    """

    name: str
    form: str = ""
    zero: float = 0.0
    least: float = 0.0


class Fact(_Text):
    """A number or a word that sentences quote; `form` as in `Column`.

    A number in a supplementary table has its `column`. `rows` contains values of other columns. Of
    several numbers, `take` is the smallest, ``min``, or the largest, ``max``.
    """

    form: str = ""
    unit: str = ""
    column: str = ""
    rows: dict[str, Any] = {}
    take: str = "min"


class Alternative(_Text):
    """An alternative of an option: its meaning, and the passage of the paper that allows it."""

    text: str
    place: str


Options = Mapping[str, Mapping[str, Alternative]]


class ItemText(_Text):
    """The texts of one key.

    - `title`: of a supplementary table or of a figure.
    - `alternative`: of a figure, the text for readers who do not see it.
    - `caption`: of a supplementary table or of a figure. Facts fill the blanks of the caption of a
      table, and printed cells those in the texts of a figure, ``{ADDRESS printed}``.
    - `columns`: of a supplementary table.
    - `facts`: formats of the numbers that sentences quote.
    - `options`: option to its alternatives, the literal one first.
    """

    title: str = ""
    alternative: str = ""
    caption: str = ""
    columns: tuple[Column, ...] = ()
    facts: dict[str, Fact] = {}
    options: Options = {}


def item_text(key: str) -> ItemText:
    """Return the texts of a key; empty texts if the file of its paper has no such table."""
    paper, _, name = key.partition("/")
    return _of_paper(paper).get(name, ItemText())


@cache
def _of_paper(paper: str) -> dict[str, ItemText]:
    return {
        name: text
        for path in data_files(f"captions/{paper}.toml")
        for name, text in read_toml(path, dict[str, ItemText]).items()
    }
