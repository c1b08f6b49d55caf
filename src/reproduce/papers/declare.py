"""How computations, drawings and tables of our own are declared: what they make and read.

Their texts, which are no code, stand in ``data/words/PAPER.toml``: a table of the file has a key's
last part as its name, and what `Words` says.
"""

from __future__ import annotations

import fnmatch
import inspect
import tomllib
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ConfigDict, TypeAdapter
from pydantic import dataclasses as checked

from reproduce.locate import words_files
from reproduce.printed.given import Given, given

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

_EXACT = ConfigDict(extra="forbid")


@checked.dataclass(frozen=True, config=_EXACT)
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
    error: str = ""
    missing: str = ""
    draws: int = 0
    bold: float = 0.0


@checked.dataclass(frozen=True, config=_EXACT)
class Way:
    """One way to read what a text leaves open, as `Reading` has it."""

    name: str
    place: str
    added: str
    choices: dict[str, str]


@checked.dataclass(frozen=True, config=_EXACT)
class _Pictured:
    """What a figure shows, for a reader who does not see it, and its caption."""

    alternative: str
    caption: str


@checked.dataclass(frozen=True, config=_EXACT)
class Words:
    """The texts of one key.

    - `caption`, `columns`, `folded`, `settings`: of a study, as `Study` has them.
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
    figure: _Pictured = _Pictured("", "")


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


# One root for the whole project; every computation adds its own name to it (see seed_of).
ROOT_SEED = 20_240_102
# Draws that must lie beyond a value before their count says how likely it is.
LEAST_DRAWS = 20
_NOTHING: Mapping[str, float] = {}


@dataclass(frozen=True)
class Prediction:
    """What a reproduction of a random or measured number predicts.

    Parameters
    ----------
    draws : ndarray, shape (replicates,)
        Replicates of the number in SI units; the same index is the same replicate in every cell
        of a table, so that the cells keep their correlation.
    """

    draws: NDArray[np.float64]


@dataclass(frozen=True)
class Reading:
    """What a number would be under one way to read what the paper leaves open.

    Parameters
    ----------
    name : str
        The reading in a few words, the same for every cell that it belongs to.
    place : str
        Where the text leaves room for it.
    result : float or Prediction
        The number in SI units, or its prediction.
    choices : mapping of str to str
        What it chooses of the options of its computation.
    added : str
        The day on which it came into the history of this project, such as ``2026-11-22``.
    """

    name: str
    place: str
    result: float | Prediction
    choices: Mapping[str, str] = field(default_factory=dict)
    added: str = ""


def read(way: Way, result: float | Prediction) -> Reading:
    """Return what a number would be under one way to read the text."""
    return Reading(way.name, way.place, result, way.choices, way.added)


@dataclass(frozen=True)
class Blocked:
    """A number that needs something unpublished, or that may depend on how the text is read.

    Parameters
    ----------
    missing : str
        What would be needed.
    stand_in : float, optional
        Our value in its place, in SI units, shown without a verdict.
    readings : tuple of Reading
        Every way tried to read the text, the literal one first. Where all of them agree with the
        print, or none does, the number is not blocked: the literal one judges it.
    """

    missing: str
    stand_in: float | None = None
    readings: tuple[Reading, ...] = ()


def blocked(
    text: Words, name: str, results: Iterable[float | Prediction], stand_in: float | None = None
) -> Blocked:
    """Return a number that depends on how the text is read, from what every way gives."""
    return Blocked(text.missing[name], stand_in, tuple(map(read, text.readings[name], results)))


def options_of(text: Words, name: str) -> dict[str, dict[str, str]]:
    """Return what the readings of a number choose among: option to alternatives, as in `Words`."""
    chosen = {choice for way in text.readings[name] for choice in way.choices.items()}
    taken = {
        option: {way: told for way, told in ways.items() if (option, way) in chosen}
        for option, ways in text.options.items()
    }
    return {option: ways for option, ways in taken.items() if ways}


Result = float | Prediction | Blocked
Results = Mapping[str, Result]
_Options = Mapping[str, Mapping[str, str]]


@dataclass(frozen=True)
class Computation:
    """A function with what it makes, what it reads and the equations it rests on.

    Parameters
    ----------
    key : str
        The table, figure or group of quoted numbers.
    function : callable
        Takes the door (and, if stochastic, the seed) and returns results by cell name, in SI.
    cells : tuple of str
        Patterns of the cell names that it makes.
    given : tuple of str
        Addresses of all printed cells that it reads.
    equations : tuple of str
        Equation numbers of the paper.
    replicates : int
        How many replicates a stochastic computation draws; 0 for a deterministic one.
    options : mapping of str to mapping
        What the text leaves open: option to its alternatives, each with what it stands for. An
        option that the function takes is handed to it by name; any other chooses among the
        readings that the function returns.
    chosen : mapping of str to str
        Option to the alternative that is chosen; empty where all stay open.
    """

    key: str
    function: Callable[..., Results]
    cells: tuple[str, ...]
    given: tuple[str, ...]
    equations: tuple[str, ...]
    replicates: int
    options: _Options = field(default_factory=dict, hash=False)
    chosen: Mapping[str, str] = field(default_factory=dict, hash=False)

    @property
    def name(self) -> str:
        """The function's full name, as the ledger and the pages cite it."""
        return f"{self.function.__module__}.{self.function.__qualname__}"

    @property
    def line(self) -> str:
        """The function's file, from its package on, and the line where it begins."""
        function = inspect.unwrap(self.function)
        file = function.__module__.replace(".", "/")
        return f"{file}.py:{function.__code__.co_firstlineno}"

    @property
    def entropy(self) -> tuple[int, ...]:
        """The seed: the project's root and this computation's own number; () if deterministic."""
        if not self.replicates:
            return ()
        return ROOT_SEED, *seed_of(self._stream, None).spawn_key

    @property
    def _stream(self) -> str:
        return f"{self.key}:{self.function.__name__}"

    def makes(self, name: str) -> bool:
        """Tell whether the cell called `name` is one that this computation makes."""
        return any(fnmatch.fnmatchcase(name, pattern) for pattern in self.cells)

    def __call__(self, given: Given, replicates: int | None = None) -> Results:
        """Run the function through the door, with its own seed if it draws random numbers.

        What follows from the print as it stands is kept: the ledger, our own tables and a rerun,
        which compares with it, ask for the same.
        """
        if given.values or given.shifts:
            return self._run(given, replicates)
        return dict(_kept(self, given, replicates))

    def _run(self, given: Given, replicates: int | None) -> Results:
        taken = inspect.signature(self.function).parameters
        every = any(one.kind is one.VAR_KEYWORD for one in taken.values())
        handed = {name: way for name, way in self.chosen.items() if every or name in taken}
        if not self.replicates:
            results = self.function(given, **handed)
        else:
            seed = seed_of(self._stream, given.root)
            results = self.function(given, seed, replicates or self.replicates, **handed)
        return {name: self._left(name, one) for name, one in results.items()}

    def under(self, chosen: Mapping[str, str]) -> Computation:
        """Return the same computation with some of its options chosen; it leaves out others."""
        own = {n: way for n, way in chosen.items() if way in self.options.get(n, ())}
        return replace(self, chosen=own)

    def _left(self, name: str, result: Result) -> Result:
        """Return a result with the readings that what is chosen leaves open; one alone decides."""
        if not self.chosen or not isinstance(result, Blocked) or not result.readings:
            return result
        left = tuple(reading for reading in result.readings if agree(reading.choices, self.chosen))
        if not left:
            ways = (", ".join(f"{n}={w}" for n, w in r.choices.items()) for r in result.readings)
            raise ValueError(
                f"{self.key}#{name}: no reading has all that is chosen; these are computed: "
                f"{'; '.join(dict.fromkeys(ways))}"
            )
        return left[0].result if len(left) == 1 else replace(result, readings=left)


@lru_cache(maxsize=64)
def _kept(computation: Computation, given: Given, replicates: int | None) -> Results:
    return computation._run(given, replicates)


def agree(choices: Mapping[str, str], chosen: Mapping[str, str]) -> bool:
    """Tell whether a reading has all that is chosen, as far as it decides it."""
    return all(chosen.get(name, way) == way for name, way in choices.items())


def seed_of(name: str, root: int | None) -> np.random.SeedSequence:
    """Return the random seed of something that draws random numbers.

    Parameters
    ----------
    name : str
        Its key, such as ``chen2023/fig-8``.
    root : int, optional
        That of the door; none for the project's.

    Returns
    -------
    numpy.random.SeedSequence
        Another one for every name.

    Examples
    --------
    >>> seed_of("chen2023/fig-7", None).spawn_key == seed_of("chen2023/fig-8", None).spawn_key
    False
    """
    own = zlib.crc32(name.encode())
    return np.random.SeedSequence(ROOT_SEED if root is None else root, spawn_key=(own,))


def split_seed(seed: np.random.SeedSequence, count: int) -> list[np.random.SeedSequence]:
    """Return independent seeds for the parts of a computation."""
    # spawn() would count up inside `seed`, and a second call would draw other numbers.
    keys = ((*seed.spawn_key, part) for part in range(count))
    return [np.random.SeedSequence(seed.entropy, spawn_key=key) for key in keys]


def reproduces(
    key: str,
    *,
    given: Sequence[str] = (),
    cells: Sequence[str] = ("*",),
    equations: Sequence[str] = (),
    replicates: int = 0,
    options: _Options | None = None,
) -> Callable[[Callable[..., Results]], Computation]:
    """Declare that a function makes printed cells of `key`.

    Parameters
    ----------
    key : str
        The table, figure or group of quoted numbers, such as ``niu2024/table-3``.
    given : sequence of str
        Every printed cell or group that the function reads; the door hands out nothing else.
    cells : sequence of str
        Patterns of the names of the cells it makes, where a table needs several functions.
    equations : sequence of str
        Numbers of the paper's equations that the function rests on.
    replicates : int
        How many replicates to draw; the function then takes ``(given, seed, replicates)``.
    options : mapping, optional
        What the text leaves open, as in `Computation`.

    Returns
    -------
    callable
        A decorator that turns the function into a `Computation`.

    Examples
    --------
    >>> @reproduces("niu2024/text-context")
    ... def nothing(given):
    ...     return {}
    >>> nothing.key
    'niu2024/text-context'
    """

    declared = (tuple(cells), tuple(given), tuple(equations), replicates, options or {})
    return lambda function: Computation(key, function, *declared)


@dataclass(frozen=True)
class Fact:
    """A number or a word that sentences quote; `form` and `zero` as in `Column`."""

    value: float | str
    form: str = ""
    unit: str = ""
    zero: float = 0.0


@dataclass(frozen=True)
class Own:
    """What drawings and tables of our own declare.

    Parameters
    ----------
    key : str
        Such as ``chen2023/heat``.
    function : callable
        What makes it.
    given : tuple of str
        Addresses of all printed cells that it reads.
    named : callable, optional
        Returns the facts that sentences quote, by name.
    random : bool
        Whether it draws random numbers, with seeds from the door's root.
    """

    key: str
    function: Callable[..., Any]
    given: tuple[str, ...] = ()
    named: Callable[..., Mapping[str, Fact]] | None = None
    random: bool = False

    @property
    def title(self) -> str:
        """What it shows: the first line of the function's docstring, without its full stop."""
        return (self.function.__doc__ or "").strip().split("\n")[0].rstrip(".")

    def _doors(self, door: Given | None = None) -> list[Given]:
        return [given(self.given) if door is None else door] if self.given else []


@dataclass(frozen=True)
class Drawing(Own):
    """A function that draws an item, or a picture of our own, with what it marks.

    The function takes the figure and, as far as it has room for them: ``printed``, which maps the
    addresses of the cells to be marked to their values and comes from the caller; the door. What
    `named` returns is quoted by the alternative text.

    Parameters
    ----------
    marks : tuple of str
        Addresses of cells of other items that the drawing marks, such as a figure's optimum that
        is quoted in the text; an item's own cells need no mention.
    """

    marks: tuple[str, ...] = ()

    def __call__(
        self, figure: Figure, printed: Mapping[str, float] = _NOTHING, door: Given | None = None
    ) -> None:
        """Draw on an empty figure, from the print or from what another door holds."""
        taken = inspect.signature(self.function).parameters
        self.function(*[figure, printed, *self._doors(door)][: len(taken)])


def draws(
    key: str,
    *,
    given: Sequence[str] = (),
    marks: Sequence[str] = (),
    named: Callable[[], Mapping[str, Fact]] | None = None,
    random: bool = False,
) -> Callable[[Callable[..., None]], Drawing]:
    """Declare that a function draws `key`; the arguments are those of `Drawing`."""
    return lambda function: Drawing(key, function, tuple(given), named, random, tuple(marks))


@dataclass(frozen=True)
class Study(Own):
    """A table that no paper prints.

    The function takes the door, if anything is given, and returns the rows, or a DataFrame whose
    ``attrs`` fill the blanks of the caption; `named` takes what it takes.

    Parameters
    ----------
    columns : tuple of Column
        As many as a row has entries; the first names the row.
    caption : str
        What it shows, in one or two sentences.
    folded : str
        The name of a column by whose values a long table is shown in parts.
    settings : mapping
        Arguments of `function` that a reader may give, each with what it is; all are numbers.
    """

    columns: tuple[Column, ...] = ()
    caption: str = ""
    folded: str = ""
    settings: Mapping[str, str] = field(default_factory=dict)

    def __call__(self, door: Given | None = None, **settings: float) -> pd.DataFrame:
        """Compute the table, from the print or from what another door holds."""
        import pandas as pd

        found = self.function(*self._doors(door), **settings)
        frame = found if isinstance(found, pd.DataFrame) else self.frame(found)
        frame.attrs["caption"] = self.caption.format_map(frame.attrs)
        return frame

    def facts(self) -> Mapping[str, Fact]:
        """Compute what sentences quote of it, by name."""
        return self.named(*self._doors()) if self.named else {}

    def frame(self, rows: Iterable[Sequence[Any]], **blanks: Any) -> pd.DataFrame:
        """Return rows under the declared heads, with what fills the blanks of the caption."""
        import pandas as pd

        frame = pd.DataFrame(list(rows), columns=[column.name for column in self.columns])
        frame.attrs.update(blanks)
        return frame


def studied(
    key: str,
    *,
    given: Sequence[str] = (),
    named: Callable[..., Mapping[str, Fact]] | None = None,
    random: bool = False,
    **shown: Any,
) -> Callable[[Callable[..., Any]], Study]:
    """Declare that a function computes the study `key`; the arguments are those of `Study`.

    Columns, caption, folded and settings are the texts of the key in the paper's file of words,
    unless they are given.
    """
    text = words(key)
    of_words = {name: getattr(text, name) for name in ("columns", "caption", "folded", "settings")}
    return lambda function: Study(key, function, tuple(given), named, random, **of_words | shown)


@dataclass(frozen=True)
class Item:
    """A table, figure or group of quoted numbers, with what makes it.

    Parameters
    ----------
    key : str
        Its only name.
    computations : tuple of Computation
        The functions that compute its cells; none for a group that is only quoted.
    draw : Drawing, optional
        The function that draws it.
    """

    key: str
    computations: tuple[Computation, ...] = ()
    draw: Drawing | None = None
