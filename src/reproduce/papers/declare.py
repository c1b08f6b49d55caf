"""Declarations: functions with the cells that they compute, draw or tabulate, and their inputs."""

from __future__ import annotations

import fnmatch
import inspect
import zlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, lru_cache
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from reproduce.papers.texts import Alternative as Alternative
from reproduce.papers.texts import Column as Column
from reproduce.papers.texts import Options as Options
from reproduce.papers.texts import item_text as item_text
from reproduce.papers.texts import parsed as parsed
from reproduce.papers.texts import unpublished as unpublished
from reproduce.printed.inputs import Inputs, load_inputs

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

# Root seed of the project; every computation adds its own name to it (see `seed_of`).
ROOT_SEED = 20_240_102


@dataclass(frozen=True)
class Prediction:
    """Predicted distribution of a random or measured number.

    Parameters
    ----------
    draws : ndarray, shape (replicates,)
        Replicates of the number in SI units. The same index is the same replicate in every cell
        of a table, so that the cells keep their correlation.
    """

    draws: NDArray[np.float64]


Result = float | Prediction
Results = Mapping[str, Result]


@dataclass(frozen=True)
class Computation:
    """A function with the cells that it makes, its inputs and its equations.

    Parameters
    ----------
    key : str
        The table, figure or group of quoted numbers.
    function : callable
        Takes the inputs (and, if stochastic, seed and number of replicates) and returns results
        by cell name, in SI units.
    cells : tuple of str
        Patterns of the names of its cells.
    given : tuple of str
        Addresses of all printed inputs.
    equations : tuple of str
        Equation numbers of the paper.
    replicates : int
        Number of replicates of a stochastic computation; 0 for a deterministic one.
    options : mapping of str to mapping
        Option to its alternatives, the literal one first. Each option is a keyword argument of
        the function.
    """

    key: str
    function: Callable[..., Results]
    cells: tuple[str, ...]
    inputs: tuple[str, ...]
    equations: tuple[str, ...]
    replicates: int
    options: Options = field(default_factory=dict, hash=False)

    @cached_property
    def readings(self) -> list[dict[str, str]]:
        """All readings, the literal one first: every combination of the alternatives."""
        choices = product(*self.options.values())
        return [dict(zip(self.options, one, strict=True)) for one in choices]

    @property
    def literal(self) -> dict[str, str]:
        """The literal reading: the first alternative of each option."""
        return self.readings[0]

    @property
    def name(self) -> str:
        """Full name of the function, as the ledger and the pages cite it."""
        return f"{self.function.__module__}.{self.function.__qualname__}"

    @property
    def line(self) -> str:
        """File of the function, from its package on, and its first line."""
        code = inspect.unwrap(self.function).__code__
        file = self.function.__module__.replace(".", "/")
        return f"{file}.py:{code.co_firstlineno}"

    @property
    def entropy(self) -> tuple[int, ...]:
        """Root seed and the computation's own number; empty if deterministic."""
        return (ROOT_SEED, *self._seed(None).spawn_key) if self.replicates else ()

    def _seed(self, root: int | None) -> SeedSequence:
        return seed_of(f"{self.key}:{self.function.__name__}", root)

    def makes(self, name: str) -> bool:
        """Return whether the computation makes the cell `name`."""
        return any(fnmatch.fnmatchcase(name, pattern) for pattern in self.cells)

    def with_options(self, choices: Mapping[str, str]) -> Computation:
        """Return the computation with one alternative of each option.

        Options without a choice keep their literal alternative.
        """
        chosen = {}
        for name, ways in self.options.items():
            way = choices.get(name, "")
            way = way if way in ways else next(iter(ways))
            chosen[name] = {way: ways[way]}
        return replace(self, options=chosen)

    def __call__(self, inputs: Inputs, replicates: int | None = None) -> Results:
        """Return the numbers of the literal reading, with the seed of the computation.

        Results from unchanged printed numbers are cached, because the ledger, supplementary
        tables and reruns share them.
        """
        changed = bool(inputs.values or inputs.shifts)
        return dict((_run if changed else _cached)(self, inputs, replicates))


def _run(computation: Computation, inputs: Inputs, replicates: int | None) -> Results:
    random: tuple[Any, ...] = ()
    if computation.replicates:
        random = computation._seed(inputs.root), replicates or computation.replicates
    return computation.function(inputs, *random, **computation.literal)


_cached = lru_cache(maxsize=64)(_run)


@cache
def seed_of(name: str, root: int | None) -> SeedSequence:
    """Return the seed of the one generator of a computation, drawing or table.

    Parameters
    ----------
    name : str
        Its key, such as ``chen2023/fig-8``.
    root : int, optional
        Root seed of the inputs. Default: the root seed of the project.

    Returns
    -------
    numpy.random.SeedSequence
        Different for every name. The same object for the same arguments, so that results can
        be cached by it.

    Examples
    --------
    >>> seed_of("chen2023/fig-7", None).spawn_key == seed_of("chen2023/fig-8", None).spawn_key
    False
    """
    number = zlib.crc32(name.encode())
    return SeedSequence(ROOT_SEED if root is None else root, spawn_key=(number,))


def reproduces(
    key: str,
    *,
    inputs: Sequence[str] = (),
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
        Every printed cell or group that the function reads. It has access to no other.
    cells : sequence of str
        Patterns of the names of the cells it makes, where a table needs several functions.
    equations : sequence of str
        Numbers of the paper's equations that the function rests on.
    replicates : int
        How many replicates to draw; the function then takes ``(inputs, seed, replicates)``.
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

    known = item_text(key).options if options is None else options

    def declared(function: Callable[..., Results]) -> Computation:
        taken = inspect.signature(function).parameters.values()
        own = {p.name: known[p.name] for p in taken if p.kind is p.KEYWORD_ONLY}
        return Computation(
            key,
            function,
            tuple(cells),
            tuple(inputs),
            tuple(equations),
            replicates,
            own,
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
class DeclarationMap:
    """A function that draws or tabulates.

    Parameters
    ----------
    key : str
        Such as ``chen2023/heat``.
    function : callable
        Draws the figure, or returns the table.
    given : tuple of str
        Addresses of all printed inputs.
    random : bool
        Whether it draws random numbers, with seeds from the root of the inputs.
    """

    key: str
    function: Callable[..., Any]
    inputs: tuple[str, ...] = ()
    random: bool = False
    named: Callable[..., Mapping[str, Fact]] | None = None

    @property
    def title(self) -> str:
        """First line of the function's docstring, without its full stop."""
        return (self.function.__doc__ or "").strip().split("\n")[0].rstrip(".")


@dataclass(frozen=True)
class Drawing(DeclarationMap):
    """A function that fills a matplotlib figure.

    Its parameters are the figure, `printed` (address of each marked cell to its value in SI
    units) and the inputs; the last two only if it needs them.

    Parameters
    ----------
    marks : tuple of str
        Addresses of cells of other items that the drawing marks, such as a printed optimum. All
        cells of the item itself are marked.
    """

    marks: tuple[str, ...] = ()

    def __call__(
        self,
        figure: Figure,
        printed: Mapping[str, float],
        inputs: Inputs | None = None,
    ) -> None:
        """Draw on an empty figure, from the printed or from changed inputs."""
        _, *names = inspect.signature(self.function).parameters
        values: dict[str, Any] = {"printed": printed}
        for name in names:
            if name != "printed":
                values[name] = load_inputs(self.inputs) if inputs is None else inputs
        self.function(figure, **{name: values[name] for name in names})


@dataclass(frozen=True)
class Schematic:
    """A drawing by hand: an SVG file, whose ``{ADDRESS printed}`` stand for printed cells."""

    key: str
    files: tuple[Path, ...]
    inputs: ClassVar[tuple[str, ...]] = ()
    random: ClassVar[bool] = False
    named: ClassVar[None] = None

    @cached_property
    def text(self) -> str:
        """SVG with the style that all schematics share."""
        shared, drawn = (path.read_text(encoding="utf-8") for path in self.files)
        style = shared[shared.index("<style") : shared.index("</svg>")]
        return drawn.replace(">", f">\n  {style.rstrip()}", 1)

    @property
    def title(self) -> str:
        """Title of the file."""
        return self.text.partition("<title>")[2].partition("</title>")[0]


def draws(
    key: str,
    *,
    inputs: Sequence[str] = (),
    marks: Sequence[str] = (),
    random: bool = False,
) -> Callable[[Callable[..., None]], Drawing]:
    """Declare that a function draws `key`; the arguments are those of `Drawing`."""
    return lambda function: Drawing(
        key, function, tuple(inputs), random, marks=tuple(marks)
    )


@dataclass(frozen=True)
class Study(DeclarationMap):
    """A supplementary table, which no paper prints.

    The function takes the inputs, if any, and returns the rows, or a DataFrame whose ``attrs``
    fill the blanks of the caption.

    Parameters
    ----------
    named : callable, optional
        Returns the facts that sentences quote, by name, from the same inputs.
    columns : tuple of Column
        One for each entry of a row; the first names the row.
    caption : str
        One or two sentences.
    folded : str
        Name of a column by whose values a long table is shown in parts.
    """

    columns: tuple[Column, ...] = ()
    caption: str = ""
    folded: str = ""

    def _inputs(self, inputs: Inputs | None) -> list[Inputs]:
        if not self.inputs:
            return []
        return [load_inputs(self.inputs) if inputs is None else inputs]

    def __call__(self, inputs: Inputs | None = None) -> pd.DataFrame:
        """Compute the table, from the printed or from changed inputs."""
        import pandas as pd

        found = self.function(*self._inputs(inputs))
        frame = found if isinstance(found, pd.DataFrame) else self.frame(found)
        frame.attrs["caption"] = self.caption.format_map(frame.attrs)
        return frame

    def facts(self) -> Mapping[str, Fact]:
        """Compute the facts that sentences quote, by name."""
        return self.named(*self._inputs(None)) if self.named else {}

    def frame(self, rows: Iterable[Sequence[Any]], **blanks: Any) -> pd.DataFrame:
        """Return rows under the declared heads, with the blanks of the caption in ``attrs``."""
        import pandas as pd

        heads = [column.name for column in self.columns]
        frame = pd.DataFrame(list(rows), columns=heads)
        frame.attrs.update(blanks)
        return frame


def studied(
    key: str,
    *,
    inputs: Sequence[str] = (),
    named: Callable[..., Mapping[str, Fact]] | None = None,
    random: bool = False,
    **shown: Any,
) -> Callable[[Callable[..., Any]], Study]:
    """Declare that a function computes the supplementary table `key`, as in `Study`.

    Columns, caption and folded are the texts of the key, unless they are given.
    """
    text = item_text(key)
    texts = {name: getattr(text, name) for name in ("columns", "caption", "folded")}
    return lambda function: Study(
        key, function, tuple(inputs), random, named, **texts | shown
    )


@dataclass(frozen=True)
class Item:
    """Functions that compute and draw a table, a figure or a group of quoted numbers."""

    computations: tuple[Computation, ...] = ()
    draw: Drawing | Schematic | None = None
