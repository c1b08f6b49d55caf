"""Declarations of the posteriors: model, data, sampling, and the format of your data."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cache, partial
from hashlib import sha256
from importlib.util import find_spec
from typing import Any

from reproduce.inference import Model
from reproduce.inference.sampling import Plan
from reproduce.locate import papers
from reproduce.physics.validate import whole_number
from reproduce.printed.inputs import ROOT_SEED, Inputs, load_inputs
from reproduce.store.points import DataTable, computing, is_table

# Your data, their model, and remarks on them.
Supplied = tuple[DataTable | None, Model, list[str]]
# Numbers of a sampling run, with the seed of the book.
book_plan = partial(Plan, ROOT_SEED)


@cache
def posteriors() -> dict[str, Declaration]:
    """Return the declaration of every posterior by its key, in the order of the book.

    Examples
    --------
    >>> list(posteriors())[0]
    'camera-red'
    """
    names = (f"reproduce.papers.{paper}.posteriors" for paper in papers())
    modules = [importlib.import_module(name) for name in names if find_spec(name)]
    return {
        declared.key: declared for module in modules for declared in module.POSTERIORS
    }


@dataclass(frozen=True)
class Declaration:
    """A posterior of the book.

    - `key`: its name on the command line, in the book, and of its stored calibration.
    - `title`: its subject, in one line.
    - `paper`: the paper whose numbers it uses.
    - `inputs`: addresses of the printed cells of the model: data, settings and priors.
    - `build`: returns the model with its data.
    - `meaning`: the meaning of a row of your data, or the reason why it accepts none.
    - `columns`: columns of your data, in any order.
    - `read`: function of your file or table and keyword arguments. It raises `ValueError` for
      unusable data.
    - `accepts`: names of these arguments of `reproduce.posterior`, in addition to ``sep``.
    - `plan`: its sampling plan.
    - `summary`: names of quantities for the table of all posteriors, each with the address of its
      printed cell or with a label.
    """

    key: str
    title: str
    paper: str
    inputs: tuple[str, ...]
    build: Callable[[Inputs], Model]
    meaning: str
    columns: tuple[str, ...] = ()
    read: Callable[..., Supplied] | None = None
    accepts: tuple[str, ...] = ()
    plan: Plan = field(default_factory=book_plan)
    summary: Mapping[str, str] = field(default_factory=dict)

    def model(self, data_seed: int | None = None) -> Model:
        """Return the model with its data, which may be simulated with another seed."""
        if data_seed is not None:
            whole_number("data_seed", data_seed, least=0)
        model = self.build(load_inputs(self.inputs, data_seed))
        if data_seed is not None and not model.truth:
            raise ValueError(
                f"data_seed: expected none, because the data of {self.key} are printed. Leave it "
                "out"
            )
        return model

    def sha256(self) -> str:
        """Return the hash of the printed cells of the model, which determine the data."""
        cells = sorted(load_inputs(self.inputs).cells.items())
        texts = "".join(f"{address} {cell.text}\n" for address, cell in cells)
        return sha256(texts.encode()).hexdigest()

    def supplied(self, data: Any, settings: dict[str, Any]) -> Supplied:
        """Return your data, their model and remarks, or the model with the data of the book.

        The priors of your measured quantities are far wider than their errors. An instrument or a
        design that the data do not determine is by default the one of the paper. Unusable data are
        a `ValueError`.
        """
        if data is None:
            data_seed = settings.pop("data_seed", None)
            if settings:
                raise ValueError(f"{min(settings)}: expected data with it, got none")
            return None, self.model(data_seed), []
        if not is_table(data):
            raise TypeError(
                "data: expected a file or a table with named columns, got "
                f"{type(data).__name__}. Use DataFrame(array, columns=[...])"
            )
        if self.read is None:
            raise ValueError(f"{self.key} takes no file: {self.meaning}")
        if unknown := settings.keys() - {*self.accepts, "sep"}:
            raise ValueError(
                f"{min(unknown)}: expected none for {self.key}. Leave it out"
            )
        with computing("data"):
            return self.read(data, **settings)
