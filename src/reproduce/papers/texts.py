"""Texts of items in ``data/captions/PAPER.toml``: captions, columns, options, facts.

A table of the file has the last part of a key as its name and the fields of `ItemText`.
"""

from __future__ import annotations

import fnmatch
import tomllib
from collections.abc import Mapping
from dataclasses import field
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, TypeAdapter
from pydantic.dataclasses import dataclass

from reproduce.locate import caption_files

_STRICT = ConfigDict(extra="forbid")


@dataclass(frozen=True, config=_STRICT)
class Column:
    """A column of a supplementary table and the format of its numbers.

    Parameters
    ----------
    name : str
        Head, with the unit in brackets.
    form : str
        Format specification for numbers, such as ``.2f``; empty for words; ``±`` for two
        digits of the error; ``chance`` for a probability, small ones as a power of ten.
    zero : float
        Smaller numbers are rounding noise and shown as 0. Smaller probabilities are shown as
        a bound.
    error : str
        Name of the column with the standard error, which is shown after ± in this column's
        form or with one digit.
    """

    name: str
    form: str = ""
    zero: float = 0.0
    error: str = ""


@dataclass(frozen=True, config=_STRICT)
class Fact:
    """A number or a word that sentences quote; `form` and `zero` as in `Column`.

    A number in a supplementary table has its `column`. `rows` contains values of other columns. Of
    several numbers, `take` is the smallest, ``min``, or the largest, ``max``.
    """

    value: Any = ""
    form: str = ""
    unit: str = ""
    zero: float = 0.0
    column: str = ""
    rows: dict[str, Any] = field(default_factory=dict)
    take: str = "min"


@dataclass(frozen=True, config=_STRICT)
class Alternative:
    """An alternative of an option: its meaning, and the passage of the paper that allows it."""

    text: str
    place: str


Options = Mapping[str, Mapping[str, Alternative]]


@dataclass(frozen=True, config=_STRICT)
class _FigureText:
    """Alternative text and caption of a figure."""

    alternative: str
    caption: str


@dataclass(frozen=True, config=_STRICT)
class ItemText:
    """The texts of one key.

    - `title`: of a supplementary table or of a figure.
    - `caption`, `columns`: of a supplementary table. Facts fill the blanks of the caption.
    - `folded`: name of the column by whose values a long table is shown in parts.
    - `facts`: formats of the numbers that sentences quote.
    - `options`: option to its alternatives, the literal one first.
    - `unpublished`: pattern of cell names to the data that the paper does not publish.
    - `figure`: texts of a figure; ``{ADDRESS printed}`` is replaced by the printed cell.
    """

    title: str = ""
    caption: str = ""
    columns: tuple[Column, ...] = ()
    folded: str = ""
    facts: dict[str, Fact] = field(default_factory=dict)
    options: dict[str, dict[str, Alternative]] = field(default_factory=dict)
    unpublished: dict[str, str] = field(default_factory=dict)
    figure: _FigureText = _FigureText("", "")


def item_text(key: str) -> ItemText:
    """Return the texts of a key; empty texts if the file of its paper has no such table."""
    paper, _, name = key.partition("/")
    return _of_paper(paper).get(name, ItemText())


def unpublished(key: str, name: str) -> str:
    """Return the unpublished data that a cell needs; empty if the paper publishes them."""
    missing = item_text(key).unpublished.items()
    return next(
        (data for cells, data in missing if fnmatch.fnmatchcase(name, cells)), ""
    )


@cache
def _of_paper(paper: str) -> dict[str, ItemText]:
    texts: dict[str, ItemText] = {}
    for path in caption_files(paper):
        texts |= parse_texts(path.read_text(encoding="utf-8"), path)
    return texts


def parse_texts(text: str, path: Path) -> dict[str, ItemText]:
    """Return the texts of a file by name.

    Raises
    ------
    ValueError
        If the file is not valid. The message names the position of every fault.
    """
    try:
        return TypeAdapter(dict[str, ItemText]).validate_python(tomllib.loads(text))
    except ValueError as error:  # of pydantic or of TOML
        raise ValueError(f"{path}: {error}") from error
