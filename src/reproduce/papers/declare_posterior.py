"""How a posterior is declared: once, beside the function that makes its model.

Command line, pages, calibrations and the formats of a user's files follow from the declaration.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator, SeedSequence
from numpy.typing import NDArray

from reproduce.inference import Model, Published, Repeat, Sampled, Share, repeats
from reproduce.inference.sampling import Plan
from reproduce.papers.declare import ROOT_SEED
from reproduce.physics.attitude import Platform
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.store.points import TableFileError, computing, read_table

if TYPE_CHECKING:
    import pandas as pd

Pivot = tuple[float, float] | None
# Kept steps of an ensemble: fifty autocorrelation times with room.
STEPS = 270
# Columns of which a fit makes use, but no posterior.
UNUSED = ("sigma", "sigma_x", "sigma_y", "weight")


@dataclass(frozen=True)
class File:
    """The format of a user's own data.

    - `columns`: of the CSV file, in any order.
    - `meaning`: what a line is, and what the columns hold.
    - `read`: makes the model of a table and of the pivot that the user gives.
    - `remarks`, optional: what a user should hear of the data.
    - `pivot`: whether the model turns about a point that the user may give.
    - `optional`: further columns that it uses where there are some.
    - `platform`: whether it takes an instrument of the user's, as ``design``.
    """

    columns: tuple[str, ...]
    meaning: str
    read: Callable[..., Model]
    remarks: Callable[..., list[str]] | None = None
    pivot: bool = False
    optional: tuple[str, ...] = ()
    platform: bool = False


@dataclass(frozen=True, eq=False)
class Supplied:
    """A user's file as a model, and what to say of it.

    - `model`: with priors on the scale of the data.
    - `lines`: the line of each row of data in the file.
    - `source`: what the data come from.
    - `sha256`: of the file.
    - `remarks`: what a user should hear of the data.
    """

    model: Model
    lines: NDArray[np.int64]
    source: str
    sha256: str
    remarks: tuple[str, ...]


@dataclass(frozen=True)
class Aside:
    """A number that a simple sum over the data of a model gives beside its posterior.

    - `value`: in the unit shown.
    - `error`: its standard error; zero where the number is a standard error itself.
    - `unit`: that unit.
    """

    value: float
    error: float
    unit: str


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
    - `published`, optional: what the paper prints of the experiment, of the door and the model;
      none where the paper prints no estimate.
    - `compared`: the printed cells that are compared with the posterior only: they do not reach the
      model.
    - `asides`, optional: what simple sums over the data of the model give beside it, by name.
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
    published: Callable[[Given, Model], Published] | None = None
    compared: tuple[str, ...] = ()
    asides: Callable[[Model], dict[str, Aside]] | None = None
    steps: int = STEPS
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
        self, path: str | Path | pd.DataFrame, pivot: Pivot = None, design: Platform | None = None
    ) -> Supplied:
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
        more = {"design": design} if file.platform else {}
        with computing("the DataFrame" if hasattr(path, "iloc") else path):
            table = read_table(path, file.columns, (*UNUSED, *file.optional))
            model = file.read(table, pivot, **more)
            remarks = file.remarks(table, pivot, **more) if file.remarks else []
        unused = [one for one in table.optional if one in UNUSED]
        remarks += [*table.notes, *(f"this model takes no column {one}" for one in unused)]
        return Supplied(model, table.lines, table.path, table.sha256, tuple(remarks))

    def printed(self, model: Model) -> Published | None:
        """Return what the paper prints of the experiment, with how to repeat it."""
        if self.published is None:
            return None
        return self.published(given((*self.given, *self.compared)), model)

    def repeats(self, found: Sampled) -> tuple[list[Repeat], Share, str] | None:
        """Return the printed numbers among those of repeats, all at once, and what to note of it.

        None where the paper prints no number of the experiment.
        """
        published = self.printed(found.model)
        return None if published is None else (*repeats(found, published), published.note)


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


def data_stream(given: Given, *key: int) -> SeedSequence:
    """Return the seed of some simulated data: the project's, or that of the door."""
    return SeedSequence(ROOT_SEED if given.root is None else given.root, spawn_key=key)


def simulated(model: Model, parameters: FloatArray, generator: Generator) -> FloatArray:
    """Return data of repeats, for models whose data are one array; shape (n, ...)."""
    return np.stack([model.repeat(one, generator) for one in parameters])
