"""How a computation declares what it makes and what it reads."""

from __future__ import annotations

import fnmatch
import zlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reproduce.printed.given import Given

# One root for the whole project; every computation adds its own name to it (see seed_of).
ROOT_SEED = 20_240_102


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
    """

    name: str
    place: str
    result: float | Prediction


@dataclass(frozen=True)
class Blocked:
    """A number that needs something unpublished, or that depends on how the text is read.

    Parameters
    ----------
    missing : str
        What would be needed.
    stand_in : float, optional
        Our value in its place, in SI units, shown without a verdict.
    readings : tuple of Reading
        Every way tried to read the text, where the verdict depends on it: some agree with the
        print and some do not.
    """

    missing: str
    stand_in: float | None = None
    readings: tuple[Reading, ...] = ()


@dataclass(frozen=True)
class Pending:
    """A number whose computation is not written yet.

    Parameters
    ----------
    work : str
        The work that will compute it.
    """

    work: str


Result = float | Prediction | Blocked | Pending
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
    """

    key: str
    function: Callable[..., Results]
    cells: tuple[str, ...]
    given: tuple[str, ...]
    equations: tuple[str, ...]
    replicates: int

    @property
    def paper(self) -> str:
        """The paper's key."""
        return self.key.split("/")[0]

    @property
    def name(self) -> str:
        """The function's full name, as the ledger and the pages cite it."""
        return f"{self.function.__module__}.{self.function.__qualname__}"

    @property
    def summary(self) -> str:
        """What the function computes, in one sentence."""
        return (self.function.__doc__ or "").strip().split("\n")[0]

    @property
    def entropy(self) -> tuple[int, ...]:
        """The seed: the project's root and this computation's own number; () if deterministic."""
        if not self.replicates:
            return ()
        return _entropy(f"{self.key}:{self.function.__name__}")

    def makes(self, name: str) -> bool:
        """Tell whether the cell called `name` is one that this computation makes."""
        return any(fnmatch.fnmatchcase(name, pattern) for pattern in self.cells)

    def __call__(
        self, given: Given, replicates: int | None = None, root: int | None = None
    ) -> Results:
        """Run the function through the door, with its own seed if it draws random numbers.

        A root seed other than the project's gives other random numbers.
        """
        if not self.replicates:
            return self.function(given)
        project, own = self.entropy
        seed = np.random.SeedSequence(project if root is None else root, spawn_key=(own,))
        return self.function(given, seed, replicates or self.replicates)


def seed_of(name: str) -> np.random.SeedSequence:
    """Return the random seed of something that is drawn or studied but judges no cell.

    Parameters
    ----------
    name : str
        Its key, such as ``chen2023/fig-8``.

    Returns
    -------
    numpy.random.SeedSequence
        Another one for every name.

    Examples
    --------
    >>> seed_of("chen2023/fig-8").spawn_key == seed_of("chen2023/fig-9").spawn_key
    False
    """
    root, key = _entropy(name)
    return np.random.SeedSequence(root, spawn_key=(key,))


def _entropy(name: str) -> tuple[int, int]:
    return ROOT_SEED, zlib.crc32(name.encode())


def reproduces(
    key: str,
    *,
    given: Sequence[str] = (),
    cells: Sequence[str] = ("*",),
    equations: Sequence[str] = (),
    replicates: int = 0,
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

    def declare(function: Callable[..., Results]) -> Computation:
        return Computation(key, function, tuple(cells), tuple(given), tuple(equations), replicates)

    return declare


@dataclass(frozen=True)
class Item:
    """A table, figure or group of quoted numbers, with the computations that make it.

    Parameters
    ----------
    key : str
        Its only name.
    computations : tuple of Computation
        The functions that compute its cells; none for a group that is only quoted.
    draw : callable, optional
        ``draw(figure, printed)`` draws the item on a matplotlib figure; ``printed`` maps the
        addresses of the cells to be marked to their values, and comes from the caller.
    marks : tuple of str
        Addresses of cells of other items that the drawing marks, such as a figure's optimum that
        is quoted in the text; an item's own cells need no mention.
    """

    key: str
    computations: tuple[Computation, ...] = ()
    draw: Callable[..., None] | None = None
    marks: tuple[str, ...] = ()

    @property
    def paper(self) -> str:
        """The paper's key."""
        return self.key.split("/")[0]
