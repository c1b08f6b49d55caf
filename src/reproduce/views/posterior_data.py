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
from reproduce.store.points import TableFileError, read_table
from reproduce.views import posterior_data_printed as printed
from reproduce.views import posterior_data_spots as spots
from reproduce.views import posterior_data_stars as stars
from reproduce.views.posterior_data_stars import Reader

# Model to the columns of its file and what makes a model of them.
READERS: dict[str, tuple[tuple[str, ...], Reader]] = {
    "registration": (stars.COLUMNS, stars.plain),
    "registration-blue": (stars.COLUMNS, stars.plain),
    "registration-joint": (stars.JOINT_COLUMNS, stars.joint),
    "registration-student": (stars.COLUMNS, stars.student),
    "registration-field-noise": (stars.COLUMNS, stars.field_noise),
    "registration-distortion": (stars.COLUMNS, stars.distortion),
    "registration-principal-point": (stars.COLUMNS, stars.principal_point),
    "misalignment": (spots.COLUMNS, spots.constant),
    "misalignment-directions": (spots.COLUMNS, spots.directions),
    "misalignment-drift": (spots.COLUMNS, spots.drift),
    "misalignment-states": (spots.STATE_COLUMNS, spots.states),
    "table-5": (printed.STAGE_COLUMNS, printed.stage_table),
    "geometry": (printed.GEOMETRY_COLUMNS, printed.geometry),
    **{
        f"frame-averaging{column}": (printed.AVERAGE_COLUMNS, printed.averaging)
        for column in ("", "-transform-y", "-misalignment-x", "-misalignment-y")
    },
}
# What the columns hold, by the module that reads them, in the order of `READERS`.
FORMATS = (
    ("registration, registration-blue and the variants of one channel", stars.COLUMNS,
     "one star per line, in px: its place in the channel and in the reference channel"),
    ("registration-joint", stars.JOINT_COLUMNS,
     "one star per line, in px: its places in the three channels"),
    ("misalignment, misalignment-directions, misalignment-drift", spots.COLUMNS,
     "one spot per line, in px: group 0 at the zero point, 1 at the present; lasers from 1 in the "
     "order of the platform; the images of a group in the order of time"),
    ("misalignment-states", spots.STATE_COLUMNS,
     "one spot per line, in px: states from 0; how far the stage has moved since state 0"),
    ("frame-averaging and its other columns", printed.AVERAGE_COLUMNS,
     "one average per line: its frames, the standard deviation of such averages, and the frames of "
     "the whole series, the same in every line; the last digit written is the rounding"),
    ("table-5", printed.STAGE_COLUMNS,
     "one state per line, the zero state first, with angles zero; the last digit written is the "
     "rounding"),
    ("geometry", printed.GEOMETRY_COLUMNS,
     "block 0: spots, x and y in px; block 1: positions of the stage, X and Y in micrometres, the "
     "zero state first; block 2: reference angles about Y and about X, in arcsec; items from 1"),
)  # fmt: skip
# Models that no file fits, and why.
NONE = {
    "centroid-noise": "its likelihood is the response of one calibration, that of Table 3, to the "
    "noise of its own simulated angles; for centroids of your own take registration, which "
    "estimates their noise",
}


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
    """Return a model with a user's data, and what to say of them.

    Parameters
    ----------
    name : str
        A model of the book.
    path : pathlib.Path
        A CSV file with the columns of `READERS`; what each holds is told where its reader is.
    pivot : tuple of float, optional
        For registrations: the channel's principal point; the mean of its stars by default.

    Returns
    -------
    Supplied
        With priors on the scale of the data.

    Raises
    ------
    TableFileError
        If the file is wrong, or the model takes none, or no pivot.
    """
    if name not in READERS:
        raise TableFileError(f"{name} takes no file: {NONE[name]}")
    columns, reader = READERS[name]
    starry = columns in (stars.COLUMNS, stars.JOINT_COLUMNS)
    if pivot is not None and not starry:
        raise TableFileError(f"{name} takes no --pivot: only registrations turn about one")
    try:
        # A number that overflows or divides by nothing is an error of the file, not a warning.
        with np.errstate(over="raise", divide="raise", invalid="raise"):
            table = read_table(path, columns)
            model = reader(name, table, pivot)
            remarks = stars.remarks(table, pivot) if starry else []
    except FloatingPointError as error:
        raise TableFileError(
            f"{path}: the numbers lead to an {error}; look for values that are huge, zero or alike"
        ) from error
    data: dict[str, Any] = {"kind": "file", "file": str(path), "rows": len(table.values)}
    words = f"your file {path}, {len(table.values)} lines"
    if starry:
        data["pivot"] = [point.tolist() for point in stars.pivots(table, pivot)]
        places = dict.fromkeys("({:.6g}, {:.6g})".format(*one) for one in data["pivot"])
        words += f", pivot {' and '.join(places)} px"
        words += "" if pivot else ", the mean of the stars"
    return Supplied(model, data, words, tuple(remarks))
