"""How a posterior declares which printed numbers reach its model, and the list of all of them."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.random import Generator

from reproduce.inference.model import Model
from reproduce.inference.repeats import Published
from reproduce.locate import papers
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given


@dataclass(frozen=True)
class Declared:
    """A model of this book, with the printed cells that it reads.

    Parameters
    ----------
    name : str
        The model's name on the command line and in the book.
    paper : str
        Whose numbers it takes.
    given : tuple of str
        Every printed cell (or group) that reaches the model, as data, setting or prior.
    build : callable
        Makes the model from the door.
    simulated : bool
        Whether the data are simulated from printed settings (the raw data are not published).
    rivals : tuple of callables
        Rivals for model choice: each makes a model of the same data.
    published : callable, optional
        What the paper prints of the experiment, of the door and the model; none where the paper
        prints no estimate.
    compared : tuple of str
        The printed cells that are compared with the posterior only: they do not reach the model.
    truth : callable, optional
        The parameters with which the data were simulated, by name, of the door; SI units or px.
    """

    name: str
    paper: str
    given: tuple[str, ...]
    build: Callable[[Given], Model]
    simulated: bool
    rivals: tuple[Callable[[Given], Model], ...] = ()
    published: Callable[[Given, Model], Published] | None = None
    compared: tuple[str, ...] = ()
    truth: Callable[[Given], dict[str, float]] | None = None

    def model(self) -> Model:
        """Return the model with its data."""
        return self.build(given(self.given))

    def true_values(self) -> dict[str, float]:
        """Return the parameters with which the data were simulated; none where they were not."""
        return {} if self.truth is None else self.truth(given(self.given))

    def rival_models(self) -> list[Model]:
        """Return the models that model choice compares this one with."""
        return [rival(given(self.given)) for rival in self.rivals]

    def printed(self, model: Model) -> Published | None:
        """Return what the paper prints of the experiment, with how to repeat it."""
        if self.published is None:
            return None
        return self.published(given((*self.given, *self.compared)), model)


# What a comparison of a model with its own data can show.
OWN_DATA = (
    "These numbers are the data of the model: where a repeat would not print them the model is in "
    "doubt; where it would, that proves nothing."
)


def published_cells(
    given: Given,
    addresses: Sequence[str],
    repeat: Callable[[FloatArray, Generator], FloatArray],
    parameters: Sequence[str] = (),
    whole: Callable[[FloatArray], FloatArray] | None = None,
    note: str = "",
) -> Published:
    """Return printed cells as the outcome of an experiment.

    Parameters
    ----------
    given : Given
        Holds the cells.
    addresses : sequence of str
        Of the cells.
    repeat, whole, note
        As for `Published`, in the order of the addresses and in SI units or px.
    parameters : sequence of str
        The parameter that each cell estimates; empty if none does.

    Returns
    -------
    Published
        With names and units of the print.
    """
    cells = [given.cells[address] for address in addresses]
    half = np.array([given.half_unit(address) for address in addresses])
    return Published(
        tuple(cell.label for cell in cells),
        tuple(cell.unit for cell in cells),
        tuple(cell.text for cell in cells),
        np.array([given[address] for address in addresses]),
        half,
        np.array([cell.number.half_unit for cell in cells]) / half,
        repeat,
        tuple(parameters) or ("",) * len(cells),
        whole,
        note,
    )


def simulated(model: Model, parameters: FloatArray, generator: Generator) -> FloatArray:
    """Return data of repeats, for models whose data are one array; shape (n, ...)."""
    return np.stack([model.repeat(one, generator) for one in parameters])


@cache
def posteriors() -> dict[str, Declared]:
    """Return all posteriors of all papers by name, in the order of the book.

    Returns
    -------
    dict
        Name to what each paper's module ``posteriors``, if it has one, lists as ``POSTERIORS``.

    Examples
    --------
    >>> list(posteriors())[0]
    'registration'
    """
    names = [f"reproduce.papers.{paper}.posteriors" for paper in papers()]
    found = [importlib.import_module(name) for name in names if importlib.util.find_spec(name)]
    return {declared.name: declared for module in found for declared in module.POSTERIORS}
