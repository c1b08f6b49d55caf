"""Declarations: functions with the cells that they compute, draw or tabulate, and their inputs.

A module with declarations is imported on first use of one of its keys.
"""

from __future__ import annotations

import fnmatch
import importlib
import inspect
import re
import zlib
from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, cached_property, lru_cache
from itertools import chain, product
from typing import TYPE_CHECKING, Any, Self

from numpy.random import SeedSequence

from reproduce.locate import data_files
from reproduce.papers._texts import Alternative as Alternative
from reproduce.papers._texts import Column as Column
from reproduce.papers._texts import ItemText
from reproduce.papers._texts import Options as Options
from reproduce.papers._texts import item_text as item_text
from reproduce.papers.catalogue import KINDS, catalogue
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import ROOT_SEED, Inputs, load_inputs

if TYPE_CHECKING:
    import pandas as pd

# A float, or draws as an array of shape (replicates,), in SI units; a fact has its displayed unit.
# The same index is the same replicate in every cell of a table, so that the cells keep their
# correlation.
Result = float | FloatArray
Results = Mapping[str, Result]
# Rows of a supplementary table.
Rows = Iterator[tuple[Any, ...]]


def by_cell(form: str, values: FloatArray, *labels: Iterable[Any]) -> dict[str, Result]:
    """Return the results of an array by cell name.

    Parameters
    ----------
    form : str
        Name of a cell with a blank for each label, such as ``{}.motion-{}``.
    values : ndarray
        Numbers, or their draws along a leading axis.
    *labels : iterable
        Labels along each of the other axes.

    Returns
    -------
    dict
        Numbers or draws by name.

    Examples
    --------
    >>> import numpy as np
    >>> shifts = by_cell("shift-{}.{}", np.array([[1.0, 2.0]]), "x", ("red", "blue"))
    >>> list(shifts), float(shifts["shift-x.blue"])
    (['shift-x.red', 'shift-x.blue'], 2.0)
    """
    names = [form.format(*parts) for parts in product(*labels)]
    columns = values.reshape(*values.shape[: -len(labels)], len(names))
    return dict(zip(names, columns.T, strict=True))


@dataclass(frozen=True)
class PaperFunction:
    """A function of printed inputs.

    Parameters
    ----------
    key : str
        Key of the item, supplementary table or drawing, such as ``chen2023/heat``.
    function : callable
        Function of the `Inputs`, and of more arguments that depend on the kind.
    inputs : tuple of str
        Addresses of all printed inputs.
    """

    key: str
    function: Callable[..., Any]
    inputs: tuple[str, ...]

    @classmethod
    def declare(
        cls, key: str, *, inputs: Sequence[str] = (), **others: Any
    ) -> Callable[[Callable[..., Any]], Self]:
        """Return a decorator that declares a function.

        Parameters
        ----------
        key : str
            Its key.
        inputs : sequence of str
            Addresses of all cells and groups that the function uses. It has access to no other
            cell.
        **others
            Other parameters of the class.

        Examples
        --------
        >>> @reproduces("niu2024/text-context")
        ... def nothing(inputs):
        ...     return {}
        >>> nothing.key
        'niu2024/text-context'
        """
        return lambda function: cls(key, function, tuple(inputs), **others)

    @property
    def text(self) -> ItemText:
        """Texts of its key."""
        return item_text(self.key)

    @property
    def title(self) -> str:
        """Title of the table or figure."""
        return self.text.title


@dataclass(frozen=True)
class Computation(PaperFunction):
    """A function that computes printed cells.

    The function takes the inputs and returns numbers by cell name, in SI units. A stochastic one
    also takes the seed and the number of replicates, and returns draws.

    Parameters
    ----------
    cells : sequence of str
        Patterns of the names of its cells. Default: all cells.
    replicates : int
        Number of replicates of a stochastic computation; 0 for a deterministic one.
    options : mapping of str to mapping
        Option to its alternatives, the literal one first. The computation keeps the options that
        are keyword arguments of the function. Default: the options in the texts of its key.
    """

    cells: Sequence[str] = ("*",)
    replicates: int = 0
    options: Options = field(default_factory=dict)

    def __post_init__(self) -> None:
        taken = inspect.signature(self.function).parameters
        known = (self.options or self.text.options).items()
        options = {name: ways for name, ways in known if name in taken}
        object.__setattr__(self, "options", options)

    def __hash__(self) -> int:
        """Return equal numbers for all readings of a function, whose options have no hash."""
        return hash(self.function)

    @cached_property
    def readings(self) -> list[dict[str, str]]:
        """All readings, the literal one first: every combination of the alternatives."""
        return [
            dict(zip(self.options, names, strict=True))
            for names in product(*self.options.values())
        ]

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
    def equations(self) -> tuple[str, ...]:
        """Equation numbers of the paper in the docstring, as in ``Implements: niu2024 (17).``."""
        _, _, claim = (self.function.__doc__ or "").partition("Implements:")
        return tuple(re.findall(r"\((\d+)\)", claim))

    @property
    def entropy(self) -> tuple[int, ...]:
        """Root seed and the number of the computation; empty if deterministic."""
        return (ROOT_SEED, *self._seed(0).spawn_key) if self.replicates else ()

    def _seed(self, root: int) -> SeedSequence:
        return seed_of(f"{self.key}:{self.function.__name__}", root)

    def makes(self, name: str) -> bool:
        """Return whether the computation makes the cell `name`."""
        return any(fnmatch.fnmatchcase(name, pattern) for pattern in self.cells)

    def with_options(self, choices: Mapping[str, str]) -> Computation:
        """Return the computation with one alternative of each option.

        Options without a choice keep their literal alternative.
        """
        options = {}
        for option, ways in self.options.items():
            name = choices.get(option, "")
            if name not in ways:
                name = next(iter(ways))
            options[option] = {name: ways[name]}
        return replace(self, options=options)

    def __call__(self, inputs: Inputs, replicates: int | None = None) -> dict[str, Any]:
        """Return the numbers of the literal reading, with the seed of the computation.

        They are floats, or draws if the computation has replicates.

        Results from unchanged printed numbers are cached, because the ledger, supplementary
        tables and reruns share them.
        """
        run = _run if inputs.values else _cached
        return dict(run(self, inputs, replicates))


def _run(computation: Computation, inputs: Inputs, replicates: int | None) -> Results:
    random: tuple[Any, ...] = ()
    if computation.replicates:
        random = computation._seed(inputs.root), replicates or computation.replicates
    results: Results = computation.function(inputs, *random, **computation.literal)
    return results


_cached = lru_cache(maxsize=64)(_run)


@cache
def seed_of(name: str, root: int) -> SeedSequence:
    """Return the seed of the one generator of a computation, drawing or table.

    Parameters
    ----------
    name : str
        Its key, such as ``chen2023/fig-8``.
    root : int
        Root seed of the inputs.

    Returns
    -------
    numpy.random.SeedSequence
        Different for every name. The same object for the same arguments, so that results can
        be cached by it.

    Examples
    --------
    >>> seed_of("chen2023/fig-7", 1).spawn_key == seed_of("chen2023/fig-8", 1).spawn_key
    False
    """
    return SeedSequence(root, spawn_key=(zlib.crc32(name.encode()),))


@dataclass(frozen=True)
class Drawing(PaperFunction):
    """A function that draws on an empty matplotlib figure.

    Its arguments are the figure, the marked printed cells, and the inputs.

    Parameters
    ----------
    random : bool
        Whether it draws random numbers, with seeds from the root of the inputs.
    marks : sequence of str
        Addresses of cells of other items that the drawing marks, such as a printed optimum. All
        cells of the item itself are marked.
    """

    random: bool = False
    marks: Sequence[str] = ()


class Schematic(Drawing):
    """A drawing by hand, whose function reads an SVG file.

    Texts ``{ADDRESS printed}`` in it stand for printed cells.
    """

    @cached_property
    def svg(self) -> str:
        """SVG, without the style that all schematics share."""
        return str(self.function(encoding="utf-8"))

    @property
    def title(self) -> str:
        """Title of the file."""
        return self.svg.partition("<title>")[2].partition("</title>")[0]


@dataclass(frozen=True)
class Study(PaperFunction):
    """A supplementary table, which is not in the paper.

    The function takes the inputs and returns the rows.

    Parameters
    ----------
    random : bool
        Whether it draws random numbers, with seeds from the root of the inputs.
    named : callable
        Function of the same inputs. It returns the numbers that sentences quote, by name.
    """

    random: bool = False
    named: Callable[[Inputs], Mapping[str, Any]] = lambda _: {}

    def __call__(self, inputs: Inputs) -> pd.DataFrame:
        """Compute the table, from the printed or from changed inputs."""
        import pandas as pd

        text = self.text
        heads = [column.name for column in text.columns]
        frame = pd.DataFrame(self.function(inputs), columns=heads)
        for column in text.columns:
            if column.zero:
                noise = frame[column.name].abs() < column.zero
                frame.loc[noise, column.name] = 0.0
        blanks = self.named(inputs) if "{" in text.caption else {}
        frame.attrs["caption"] = text.caption.format_map(blanks)
        return frame


# Decorators of functions that compute printed cells, draw a figure, or compute a supplementary
# table.
reproduces, draws, studied = Computation.declare, Drawing.declare, Study.declare


def panels(key: str) -> list[str]:
    """Return the keys of the panels of a figure; empty for any other key.

    Examples
    --------
    >>> panels("chen2023/fig-11")
    ['chen2023/fig-11a', 'chen2023/fig-11b']
    """
    return [item for item in catalogue() if item[:-1] == key and item[-1].isalpha()]


@cache
def declarations(key: str) -> Sequence[PaperFunction]:
    """Return the declarations of an item, a supplementary table or a drawing.

    They are in the module of the key. Without a module, its schematic is the declaration. A figure
    with panels has the declarations of its panels.
    """
    if parts := panels(key):
        return [*chain.from_iterable(map(declarations, parts))]
    module = ChainMap(*map(catalogue, KINDS))[key]
    if not module:
        files = data_files(f"schematics/{key}.svg")
        return [Schematic(key, path.read_text, ()) for path in files]
    declared = [
        value
        for value in vars(importlib.import_module(module)).values()
        if isinstance(value, PaperFunction) and value.key == key
    ]
    if not declared:
        raise ValueError(
            f"{key}: expected its declaration in {module}, got none. Add it, or correct the key "
            "in data/items/."
        )
    return declared


def computations(key: str) -> list[Computation]:
    """Return the computations of an item."""
    return [each for each in declarations(key) if isinstance(each, Computation)]


def drawing(key: str) -> Drawing | None:
    """Return the drawing of a figure or of a supplementary drawing; None for other keys."""
    drawn = (each for each in declarations(key) if isinstance(each, Drawing))
    return next(drawn, None)


def study(key: str) -> Study:
    """Return a supplementary table."""
    return next(each for each in declarations(key) if isinstance(each, Study))


def computation_for(address: str) -> Computation | None:
    """Return the computation of a printed cell; None for an input, words or a dash."""
    cell = load_inputs([address]).cells[address]
    made = (each for each in computations(cell.key) if each.makes(cell.name))
    return next(made, None) if cell.is_number else None


def changeable(key: str) -> tuple[str, ...]:
    """Return the inputs of an item, a cell or a study, direct or through other items.

    Parameters
    ----------
    key : str
        Key, or address of a cell.

    Returns
    -------
    tuple of str
        Addresses of the printed numbers, nearest first.

    Examples
    --------
    >>> "niu2024/text-simulation#noise" in changeable("niu2024/table-3")
    True
    """
    declared = [computation_for(key)] if "#" in key else declarations(key)
    return upstream(
        tuple(address for each in declared if each for address in each.inputs)
    )


@cache
def upstream(patterns: tuple[str, ...]) -> tuple[str, ...]:
    """Return the addresses of the numbers that match, and of all their inputs.

    A number that needs unpublished data stays as printed, so that its inputs are not among them.
    """
    addresses: dict[str, None] = {}
    waiting = list(patterns)
    for pattern in waiting:  # which grows
        for address, cell in load_inputs([pattern]).cells.items():
            if address not in addresses and cell.is_number:
                addresses[address] = None
                above = None if cell.unpublished else computation_for(address)
                waiting += above.inputs if above else ()
    return tuple(addresses)
