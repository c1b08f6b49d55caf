"""A user's own measurements in place of ours: which columns, and which priors.

The priors of what is measured come from the scale of the data. The instrument of a misalignment and
the design of the lasers are settings, and are those of chen2023's ground platform, with the widths
of its specifications.
What is printed, rounded, is taken as rounded to the last digit that the file writes.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reproduce.inference.model import Model
from reproduce.papers.posteriors import posteriors
from reproduce.store.points import TableFileError, read_table


def formats() -> list[tuple[tuple[str, ...], tuple[str, ...], str]]:
    """Return the formats of all files: the posteriors that take one, its columns, their meaning."""
    found: dict[tuple[tuple[str, ...], str], list[str]] = {}
    for key, declared in posteriors().items():
        file = declared.file
        told = (("none",), file) if isinstance(file, str) else (file.columns, file.meaning)
        found.setdefault(told, []).append(key)
    return [(tuple(keys), columns, meaning) for (columns, meaning), keys in found.items()]


@dataclass(frozen=True, eq=False)
class Supplied:
    """A user's file as a model, and what to say of it.

    Parameters
    ----------
    model : Model
        With priors on the scale of the data.
    data : dict
        What the data are, for programs: kind, file, rows, pivot where there is one.
    words : str
        The same in one line.
    remarks : tuple of str
        What a user should hear of the data.
    """

    model: Model
    data: dict[str, Any]
    words: str
    remarks: tuple[str, ...]


def from_file(name: str, path: Path, pivot: tuple[float, float] | None = None) -> Model:
    """Return a model with a user's data; arguments and errors are those of `supplied`."""
    return supplied(name, path, pivot).model


def supplied(name: str, path: Path, pivot: tuple[float, float] | None = None) -> Supplied:
    """Return a model with a user's data, and what to say of them."""
    file = posteriors()[name].file
    if isinstance(file, str):
        raise TableFileError(f"{name} takes no file: {file}")
    if pivot is not None and file.pivots is None:
        raise TableFileError(f"{name} takes no --pivot: only registrations turn about one")
    try:
        # A number that overflows or divides by nothing is an error of the file, not a warning.
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            table = read_table(path, file.columns)
            model = file.read(table, pivot)
            remarks = file.remarks(table, pivot) if file.remarks else []
    except FloatingPointError as error:
        raise TableFileError(
            f"{path}: the numbers lead to an {error}; look for values that are huge, zero or alike"
        ) from error
    data: dict[str, Any] = {"kind": "file", "file": str(path), "rows": len(table.values)}
    words = f"your file {path}, {len(table.values)} lines"
    if file.pivots is not None:
        data["pivot"] = [point.tolist() for point in file.pivots(table, pivot)]
        places = dict.fromkeys("({:.6g}, {:.6g})".format(*one) for one in data["pivot"])
        words += f", pivot {' and '.join(places)} px"
        words += "" if pivot else ", the mean of the stars"
    return Supplied(model, data, words, tuple(remarks))
