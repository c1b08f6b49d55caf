"""Base classes of tables, figures and studies: inputs, export, citation, changes."""

from __future__ import annotations

import inspect
from abc import abstractmethod
from collections.abc import Callable, Iterable, Mapping
from contextlib import nullcontext
from functools import cached_property
from typing import Any, Self

import pandas as pd
from markupsafe import Markup

from reproduce.judge import rerun
from reproduce.papers.declare import (
    Drawing,
    Schematic,
    Study,
    changeable,
    declarations,
)
from reproduce.physics.validate import Text, checked
from reproduce.printed.inputs import Inputs
from reproduce.views import _keys as keys
from reproduce.views._blocks import Display, rendered
from reproduce.views._export import export_frame, provenance_of, table_files
from reproduce.views.citations import cite, cite_item

# Address of a printed cell to a value as printed.
Change = Mapping[str, str | float]
NO_CHANGE: Change = {}


class ResultView(Display):
    """An object with a key, printed cells as inputs, and numbers."""

    key: str
    _changed = ""  # its changes in one line

    @property
    def inputs(self) -> tuple[str, ...]:
        """Addresses of its inputs, direct or through other items."""
        return changeable(self.key)

    @property
    def source(self) -> str:
        """Source code of the functions that compute and draw it."""
        return "\n\n\n".join(
            text_of(made.function)
            for made in declarations(self.key)
            if not isinstance(made, Schematic)
        )

    @abstractmethod
    def frame(self) -> pd.DataFrame:
        """Return the numbers."""

    @property
    def data(self) -> pd.DataFrame:
        """The numbers, as in `frame`."""
        return self.frame()

    def export(self, form: str) -> str:
        """Return the numbers as csv, json, latex or markdown."""
        return export_frame(self.frame(), form, self.provenance)

    @property
    def provenance(self) -> dict[str, str]:
        """Provenance of its exports, with its changes."""
        return provenance_of(self.cite("text"), self._setting())

    def _setting(self) -> str:
        """Return the sentence on its changes in an export."""
        return self._changed

    def cite(self, form: str = "bibtex") -> str:
        """Return its citation, with its changes, and the citation of its paper.

        Parameters
        ----------
        form : {"bibtex", "ris", "csl", "text", "sentence"}
            Format, as in `reproduce.cite`.
        """
        if self._changed:
            return cite_item(form, self.key, self._changed)
        return cite(self.key, form)


class ItemView(ResultView):
    """A table or a figure, of a paper or supplementary."""

    @property
    def options(self) -> pd.DataFrame:
        """Alternatives of each option of the text, the literal one first."""
        rows = [
            (name, alternative, text.text, text.place)
            for name, alternatives in rerun.options(self.key).items()
            for alternative, text in alternatives.items()
        ]
        index = ["option", "alternative"]
        return _Texts(rows, columns=[*index, "meaning", "passage"]).set_index(index)

    @property
    def title(self) -> str:
        """Title of the item."""
        return keys.title(self.key)

    @property
    def place(self) -> str:
        """Place in the paper."""
        return keys.place(self.key)

    @property
    def files(self) -> Iterable[str]:
        """Its files below the root of the book."""
        return table_files(self.key)

    def _toolbar(self, name: str) -> Markup:
        """Return the toolbar below it on a page, where its anchor is `name`.

        Its links lead to its `files`, and each of its functions has an anchor.
        """
        return rendered("bar", item=self, name=name, cite=cite)


class Rerunnable(ItemView):
    """An object that can be computed again with other inputs or another seed.

    Parameters
    ----------
    key : str
        Key of the object.
    changes : mapping, optional
        Address of any cell in `inputs` to a value as printed.
    seed : int, optional
        Seed of the random number generator.

    Attributes
    ----------
    changes : dict of str to str
        Address or ``seed`` to the value as given.
    """

    @checked
    def __init__(
        self, key: Text, changes: Change = NO_CHANGE, seed: int | None = None
    ) -> None:
        self.key, self.seed = key, seed
        self._rerun = rerun.Rerun(key, changes, seed=seed, random=self.random)
        self.changes, self._changes = self._rerun.changes, changes
        self._changed = self._rerun.setting

    @property
    @abstractmethod
    def _declared(self) -> Drawing | Study:
        """The declaration of its key."""

    @abstractmethod
    def compute(self) -> Any:
        """Compute from the printed values, or from changed inputs."""

    @cached_property
    def _inputs(self) -> Inputs:
        """The inputs of the computation, with the changes and recomputed values."""
        return self._rerun.inputs(self._declared.inputs)

    @cached_property
    def _made(self) -> Any:
        # Only an error after a change is one of the user.
        with self._rerun.explained() if self.changes else nullcontext():
            return self.compute()

    @property
    def random(self) -> bool:
        """Whether it draws random numbers."""
        return self._declared.random

    def _setting(self, remark: str = "your setting") -> str:
        return (
            setting("With", self._changed, self.replaced, remark)
            if self.changes
            else ""
        )

    @property
    def replaced(self) -> dict[str, float]:
        """Printed inputs that recomputed values replaced, in the printed unit."""
        _ = self._made  # computes them
        return self._rerun.replaced

    def rerun(
        self, changes: Change = NO_CHANGE, *, seed: int | None = None, **others: Any
    ) -> Self:
        """Compute the object with other inputs or another seed.

        Parameters
        ----------
        changes : mapping
            Address of any cell in `inputs` to a value as printed. The marks of printed values in a
            figure do not change.
        seed : int, optional
            Seed of the random number generator.
        **others
            Not accepted.

        Returns
        -------
        Figure or StudyTable
            The object with its `changes`.

        Raises
        ------
        TypeError
            If the changes are no mapping of addresses, or the seed is not a whole number.
        ValueError
            If a cell is not an input, a value does not fit its cell, or there are no random
            numbers.
        """
        if others:
            raise ValueError(
                f"{next(iter(others))}: expected changes or a seed for {self.key}. Leave it out"
            )
        seed = self.seed if seed is None else seed
        rerun.checked_values(self.key, changes)
        return type(self)(self.key, {**self._changes, **changes}, seed)


def setting(
    subject: str, changed: str, replaced: Mapping[str, float], remark: str
) -> str:
    """Return a sentence on changes and on the recomputed values that replaced printed ones."""
    names = f" Recomputed values took the place of: {', '.join(replaced)}."
    return f"{subject} {changed or 'no change'}: {remark}.{names if replaced else ''}"


class _Texts(pd.DataFrame):
    """A DataFrame whose sentences a notebook does not shorten."""

    @property
    def _constructor(self) -> type[_Texts]:
        return _Texts

    def _repr_html_(self) -> str:
        with pd.option_context("display.max_colwidth", None):
            return self.to_html(notebook=True)


def text_of(function: Callable[..., Any]) -> str:
    """Return the source code of a function, or of the function of a `partial`."""
    function = getattr(function, "func", function)
    return inspect.getsource(function).rstrip()
