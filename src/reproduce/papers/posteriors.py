"""How a posterior declares which printed numbers reach its model, and the list of all of them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from reproduce.inference.model import Model
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
    evidence : tuple of callables
        Rivals for model choice: each makes a model of the same data.
    """

    name: str
    paper: str
    given: tuple[str, ...]
    build: Callable[[Given], Model]
    simulated: bool
    rivals: tuple[Callable[[Given], Model], ...] = ()

    def model(self) -> Model:
        """Return the model with its data."""
        return self.build(given(self.given))

    def rival_models(self) -> list[Model]:
        """Return the models that model choice compares this one with."""
        return [rival(given(self.given)) for rival in self.rivals]


def posteriors() -> dict[str, Declared]:
    """Return all posteriors of both papers by name, in the order of the book.

    Examples
    --------
    >>> list(posteriors())[0]
    'registration'
    """
    from reproduce.papers.chen2023.posteriors import POSTERIORS as CHEN
    from reproduce.papers.niu2024.posteriors import POSTERIORS as NIU

    return {declared.name: declared for declared in (*NIU, *CHEN)}
