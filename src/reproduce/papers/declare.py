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
from functools import cache, cached_property, lru_cache
from itertools import product
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
        of the error; ``chance`` for a probability, small ones as a power of ten.
    zero : float
        Numbers smaller than this are what rounding leaves of zero, and are shown as 0;
        probabilities smaller than this are shown as a bound.
    error : str
        The name of the column that holds its standard error, shown behind ± in that column's form
        or with one digit; that column is not shown on its own.
    """

    name: str
    form: str = ""
    zero: float = 0.0
    error: str = ""


@checked.dataclass(frozen=True, config=_EXACT)
class Alternative:
    """One value of an option: what it means, and the passage of the paper that allows it."""

    text: str
    place: str


Options = Mapping[str, Mapping[str, Alternative]]


@checked.dataclass(frozen=True, config=_EXACT)
class _Pictured:
    """What a figure shows, for a reader who does not see it, and its caption."""

    alternative: str
    caption: str


@checked.dataclass(frozen=True, config=_EXACT)
class Words:
    """The texts of one key.

    - `caption`, `columns`, `folded`: of a study, as `Study` has them.
    - `options`: what the text of a paper leaves open: option to its alternatives, the literal one
      first.
    - `unpublished`: patterns of cell names to the data that the paper does not publish.
    - `figure`: of what is drawn; ``{name}`` stands for a fact that the drawing names, and
      ``{ADDRESS printed}`` or another side for a printed cell.
    """

    caption: str = ""
    columns: tuple[Column, ...] = ()
    folded: str = ""
    options: dict[str, dict[str, Alternative]] = field(default_factory=dict)
    unpublished: dict[str, str] = field(default_factory=dict)
    figure: _Pictured = _Pictured("", "")


_FILE = TypeAdapter(dict[str, Words])


def unpublished(key: str, name: str) -> str:
    """Return the unpublished data that a cell needs; empty if the paper publishes them."""
    missing = words(key).unpublished.items()
    return next(
        (data for pattern, data in missing if fnmatch.fnmatchcase(name, pattern)), ""
    )


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


Result = float | Prediction
Results = Mapping[str, Result]


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
        What the text leaves open: option to its alternatives, the literal one first. Each option
        is a keyword argument of the function.
    """

    key: str
    function: Callable[..., Results]
    cells: tuple[str, ...]
    given: tuple[str, ...]
    equations: tuple[str, ...]
    replicates: int
    options: Options = field(default_factory=dict, hash=False)

    @property
    def literal(self) -> dict[str, str]:
        """The literal reading: the first alternative of each option."""
        return {name: next(iter(ways)) for name, ways in self.options.items()}

    @cached_property
    def readings(self) -> list[dict[str, str]]:
        """All readings, the literal one first: every combination of the alternatives."""
        return [
            dict(zip(self.options, one, strict=True))
            for one in product(*self.options.values())
        ]

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

    def under(self, choices: Mapping[str, str]) -> Computation:
        """Return the computation with one alternative of each option.

        Options without a choice keep their literal alternative.
        """
        chosen = {n: w for n, w in choices.items() if w in self.options.get(n, ())}
        reading = self.literal | chosen
        return replace(
            self, options={n: {w: self.options[n][w]} for n, w in reading.items()}
        )

    def __call__(self, given: Given, replicates: int | None = None) -> Results:
        """Return the numbers of the literal reading, with the seed of the computation.

        Results from unchanged printed numbers are cached: the ledger, supplementary tables and
        reruns share them.
        """
        changed = bool(given.values or given.shifts)
        return dict((_run if changed else _cached)(self, given, replicates))


def _run(computation: Computation, given: Given, replicates: int | None) -> Results:
    if not computation.replicates:
        return computation.function(given, **computation.literal)
    seed = seed_of(computation._stream, given.root)
    count = replicates or computation.replicates
    return computation.function(given, seed, count, **computation.literal)


_cached = lru_cache(maxsize=64)(_run)


@cache
def seed_of(name: str, root: int | None) -> np.random.SeedSequence:
    """Return the random seed of something that draws random numbers.

    The same object for the same arguments, so that results can be cached by it.

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


def split_seed(
    seed: np.random.SeedSequence, count: int
) -> list[np.random.SeedSequence]:
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
    options: Options | None = None,
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
        Options of the text, of which the function takes those that are its keyword-only
        parameters. Default: the options in the data of `key`.

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

    known = words(key).options if options is None else options

    def declared(function: Callable[..., Results]) -> Computation:
        taken = inspect.signature(function).parameters.values()
        own = {p.name: known[p.name] for p in taken if p.kind is p.KEYWORD_ONLY}
        return Computation(
            key, function, tuple(cells), tuple(given), tuple(equations), replicates, own
        )

    return declared


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
        self,
        figure: Figure,
        printed: Mapping[str, float] = _NOTHING,
        door: Given | None = None,
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
    return lambda function: Drawing(
        key, function, tuple(given), named, random, tuple(marks)
    )


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
    """

    columns: tuple[Column, ...] = ()
    caption: str = ""
    folded: str = ""

    def __call__(self, door: Given | None = None) -> pd.DataFrame:
        """Compute the table, from the print or from what another door holds."""
        import pandas as pd

        found = self.function(*self._doors(door))
        frame = found if isinstance(found, pd.DataFrame) else self.frame(found)
        frame.attrs["caption"] = self.caption.format_map(frame.attrs)
        return frame

    def facts(self) -> Mapping[str, Fact]:
        """Compute what sentences quote of it, by name."""
        return self.named(*self._doors()) if self.named else {}

    def frame(self, rows: Iterable[Sequence[Any]], **blanks: Any) -> pd.DataFrame:
        """Return rows under the declared heads, with what fills the blanks of the caption."""
        import pandas as pd

        frame = pd.DataFrame(
            list(rows), columns=[column.name for column in self.columns]
        )
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

    Columns, caption and folded are the texts of the key in the paper's file of words, unless they
    are given.
    """
    text = words(key)
    of_words = {name: getattr(text, name) for name in ("columns", "caption", "folded")}
    return lambda function: Study(
        key, function, tuple(given), named, random, **of_words | shown
    )


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
