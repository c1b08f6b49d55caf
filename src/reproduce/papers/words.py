"""Texts of tables, figures and options, which are no code: ``data/words/PAPER.toml``.

A table of the file has a key's last part as its name, and what `Words` says.
"""

from __future__ import annotations

import tomllib
from dataclasses import field
from functools import cache
from pathlib import Path

from pydantic import ConfigDict, TypeAdapter
from pydantic.dataclasses import dataclass

from reproduce.locate import words_files

_EXACT = ConfigDict(extra="forbid")


@dataclass(frozen=True, config=_EXACT)
class Column:
    """A column of a study, and how its numbers are written.

    Parameters
    ----------
    name : str
        Its head, with the unit in brackets.
    form : str
        A format specification for numbers, such as ``.2f``; empty for words; ``±`` for two digits
        of the error; ``chance`` for a probability, with the digits that its draws can tell.
    zero : float
        Numbers smaller than this are what rounding leaves of zero, and are shown as 0;
        probabilities smaller than this are shown as a bound.
    infinite : str
        The word for a number without limit.
    error : str
        The name of the column that holds its standard error, shown behind ± in that column's form
        or with one digit; that column is not shown on its own.
    missing : str
        What stands where there is no number.
    draws : int
        How many draws a probability is counted from; without them it is a power of ten.
    bold : float
        Numbers below this are bold.
    """

    name: str
    form: str = ""
    zero: float = 0.0
    infinite: str = "any"
    error: str = ""
    missing: str = ""
    draws: int = 0
    bold: float = 0.0


@dataclass(frozen=True, config=_EXACT)
class Way:
    """One way to read what a text leaves open, as `reproduce.papers.declare.Reading` has it."""

    name: str
    place: str
    added: str
    choices: dict[str, str]


@dataclass(frozen=True, config=_EXACT)
class Pictured:
    """What a figure shows, for a reader who does not see it, and its caption."""

    alternative: str
    caption: str


@dataclass(frozen=True, config=_EXACT)
class Words:
    """The texts of one key.

    - `caption`, `columns`, `folded`, `settings`: of a study, as `papers.declare.Study` has them.
    - `options`: what the text of a paper leaves open: option to its alternatives, each with what
      it stands for.
    - `readings`: every way tried to read it, the literal one first, by what they give.
    - `missing`: what the text would have to say, by the same names.
    - `figure`: of what is drawn; ``{name}`` stands for a fact that the drawing names, and
      ``{ADDRESS printed}`` or another side for a printed cell.
    """

    caption: str = ""
    columns: tuple[Column, ...] = ()
    folded: str = ""
    settings: dict[str, str] = field(default_factory=dict)
    options: dict[str, dict[str, str]] = field(default_factory=dict)
    readings: dict[str, tuple[Way, ...]] = field(default_factory=dict)
    missing: dict[str, str] = field(default_factory=dict)
    figure: Pictured = Pictured("", "")


_FILE = TypeAdapter(dict[str, Words])


def words(key: str) -> Words:
    """Return the texts of a key; empty ones where its paper's file has none."""
    paper, _, name = key.partition("/")
    return _of_paper(paper).get(name, Words())


@cache
def _of_paper(paper: str) -> dict[str, Words]:
    found: dict[str, Words] = {}
    for path in words_files(paper):
        found |= parsed(path.read_text(encoding="utf-8"), path)
    return found


def parsed(text: str, path: Path) -> dict[str, Words]:
    """Return the words of a file by name; raises ValueError with the place of every fault."""
    try:
        return _FILE.validate_python(tomllib.loads(text))
    except ValueError as error:  # pydantic's own and that of TOML are such
        raise ValueError(f"{path}: {error}") from error
