"""How a posterior is declared: once, beside the function that makes its model; and all of them.

Command line, pages, calibrations and the formats of a user's files follow from the declaration.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence
from numpy.typing import NDArray

from reproduce.inference import Model
from reproduce.inference.sampling import Plan
from reproduce.locate import papers
from reproduce.papers.declare import ROOT_SEED
from reproduce.physics.attitude import Platform
from reproduce.printed.given import Given, given
from reproduce.store.points import Table, TableFileError, computing, read_table

if TYPE_CHECKING:
    import pandas as pd

Pivot = tuple[float, float] | None
# Kept steps of an ensemble: fifty autocorrelation times with room.
_STEPS = 270
# Columns of which a fit makes use, but a posterior does not, unless its file says so.
_UNUSED = ("sigma", "sigma_x", "sigma_y", "weight")


@cache
def posteriors() -> dict[str, Declaration]:
    """Return the declaration of every posterior by its key, in the order of the book.

    What each paper's module ``posteriors``, if it has one, lists as ``POSTERIORS``.

    Examples
    --------
    >>> list(posteriors())[0]
    'registration'
    """
    names = [f"reproduce.papers.{paper}.posteriors" for paper in papers()]
    found = [importlib.import_module(name) for name in names if importlib.util.find_spec(name)]
    return {declared.key: declared for module in found for declared in module.POSTERIORS}


@dataclass(frozen=True)
class File:
    """The format of a user's own data.

    - `columns`: of the CSV file, in any order.
    - `meaning`: what a line is, and what the columns hold.
    - `read`: makes of a table, and of the pivot and the instrument that the user gives, the model
      and what the user should hear of the data.
    - `pivot`: whether the model turns about a point that the user may give.
    - `optional`: further columns that it uses where there are some.
    - `platform`: whether it takes an instrument of the user's.
    """

    columns: tuple[str, ...]
    meaning: str
    read: Callable[[Table, Pivot, Platform | None], tuple[Model, list[str]]]
    pivot: bool = False
    optional: tuple[str, ...] = ()
    platform: bool = False


@dataclass(frozen=True, eq=False)
class _Supplied:
    """A user's file as a model, and what to say of it.

    - `model`: with priors on the scale of the data.
    - `rows`: number of each row of data in the source.
    - `source`: what the data come from.
    - `sha256`: of the file.
    - `remarks`: what a user should hear of the data.
    """

    model: Model
    rows: NDArray[np.int64]
    source: str
    sha256: str
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class Declaration:
    """A posterior of the book.

    - `key`: its only name: on the command line, in the book, of its stored calibration.
    - `title`: what it is about, in one line.
    - `paper`: whose numbers it takes.
    - `given`: every printed cell (or group) that reaches the model, as data, setting or prior.
    - `build`: makes the model from the door.
    - `file`: the format of a user's own data, or why there is none.
    - `truth`, optional: the parameters with which the data were simulated, by name, of the door; SI
      units or px. None where the data are as printed.
    - `steps`, `walkers`: how it is sampled: kept steps and walkers of an ensemble, zero for the
      usual number.
    """

    key: str
    title: str
    paper: str
    given: tuple[str, ...]
    build: Callable[[Given], Model]
    file: File | str
    truth: Callable[[Given], dict[str, float]] | None = None
    steps: int = _STEPS
    walkers: int = 0

    @property
    def simulated(self) -> bool:
        """Whether the data are simulated from printed settings: the raw data are not published."""
        return self.truth is not None

    def model(self, data_seed: int | None = None) -> Model:
        """Return the model with its data, simulated ones with another seed where one is given."""
        return self.build(given(self.given, data_seed))

    def true_values(self) -> dict[str, float]:
        """Return the parameters with which the data were simulated; none where they were not."""
        return {} if self.truth is None else self.truth(given(self.given))

    def sha256(self) -> str:
        """Return the hash of the printed cells that reach the model; data follow from them."""
        cells = given(self.given).cells
        texts = (f"{address} {cells[address].text}\n" for address in sorted(cells))
        return sha256("".join(texts).encode()).hexdigest()

    def plan(
        self,
        steps: int | None = None,
        ensembles: int = 4,
        walkers: int | None = None,
        seed: int | None = None,
    ) -> Plan:
        """Return how it is sampled in the book, or otherwise where something is given."""
        steps = self.steps if steps is None else steps
        return Plan(
            ROOT_SEED if seed is None else seed,
            ensembles=ensembles,
            walkers=self.walkers if walkers is None else walkers,
            steps=steps,
            warmup=max(100, steps // 4),
        )

    def from_file(
        self,
        path: str | Path | pd.DataFrame,
        pivot: Pivot = None,
        design: Platform | None = None,
        sep: str | None = None,
    ) -> _Supplied:
        """Return the model with a user's data; raises `TableFileError` for a file it cannot take.

        The priors of what is measured come from the scale of the data. What the data do not
        measure, an instrument or a design, stays that of the paper unless one is given.
        """
        file = self.file
        if isinstance(file, str):
            raise TableFileError(f"{self.key} takes no file: {file}")
        if pivot is not None and not file.pivot:
            raise TableFileError(f"{self.key} takes no --pivot: only registrations turn about one")
        if design is not None and not file.platform:
            raise TableFileError(f"{self.key} takes no platform: only misalignments have one")
        with computing(path if isinstance(path, str | Path) else "the table"):
            table = read_table(path, file.columns, (*_UNUSED, *file.optional), sep)
            try:
                model, remarks = file.read(table, pivot, design)
            except TableFileError:
                raise
            except ValueError as error:
                raise TableFileError(f"{table.path}: {error}") from error
        strays = {*table.optional} & {*_UNUSED} - {*file.optional}
        unused = (f"this model takes no column {one}" for one in table.optional if one in strays)
        said = (*remarks, *table.notes, *unused)
        return _Supplied(model, table.rows, table.path, table.sha256, said)


def data_stream(given: Given, *key: int) -> SeedSequence:
    """Return the seed of some simulated data: the project's, or that of the door."""
    return SeedSequence(ROOT_SEED if given.root is None else given.root, spawn_key=key)
