"""Spots of fiducial lights as images at the zero point and at the present.

Images have shape (frames, lights, 2), in px. A lost spot is NaN: its coordinates are NaN, masked or
larger than 1e30. A row of a table is a spot with the columns ``group`` (0 at the zero point, 1 at
the present), ``laser`` (from 1), ``x`` and ``y`` in px, and ``frame`` or ``time``, the number of
its image. Without this number, no spot is lost and the images are in order. With both, ``frame`` is
the number and ``time`` the label of an image.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from reproduce.physics.validate import FloatArray, Images, number_array
from reproduce.store.points import (
    _LARGEST_NUMBER,
    DataTable,
    is_table,
    read_table,
)

SPOTS = ("group", "laser", "x", "y")
# Columns that number the images.
IMAGES = ("frame", "time")


def read_images(
    count: int, spots: Any, zero: Any, sep: str | None
) -> tuple[Images, Any]:
    """Return the images of both groups, and labels of those at the present.

    Shape (frames, count, 2), in px; `spots` may be a table of both groups, whose labels are a
    pandas index.
    """
    if is_table(spots):
        if zero is not None:
            raise ValueError(
                "zero: expected no argument with a table, which contains both groups, got one. "
                "Leave it out"
            )
        return images_of(read_table(spots, SPOTS, IMAGES, sep), count)
    present = _array("spots", spots, count)
    if zero is None:
        raise ValueError(
            "zero: expected the images at the zero point, got no argument. Pass them, or a table "
            "of both groups"
        )
    return (_array("zero", zero, count), present), None


def _array(name: str, images: Any, count: int) -> FloatArray:
    """Return the images of an array, with NaN for both coordinates of a lost spot."""
    array = number_array(name, images, shape=("frames", count, 2), exact=True)
    seen = (np.abs(array) < _LARGEST_NUMBER).all(axis=-1, keepdims=True)
    return np.where(seen, array, np.nan)


def images_of(table: DataTable, count: int) -> tuple[Images, Any]:
    """Return the images of a table of spots of `count` lights, and labels of those at the present.

    Without a number of the image, the spots of each light are in the order of the images.
    """
    import pandas as pd

    for name, least, greatest in (("group", 0, 1), ("laser", 1, count)):
        allowed = np.isin(table.numbers[name], range(least, greatest + 1))
        table.check(name, allowed, f"a whole number from {least} to {greatest}")
    frame = pd.DataFrame(dict(table.numbers))
    label = next((column for column in IMAGES if column in frame), "image")
    if label == "image":
        series = frame.groupby(["group", "laser"])["x"]
        frame[label] = series.cumcount() + 1
        if series.size().groupby("group").nunique().max() > 1:
            raise ValueError(
                f"{table.path}, column laser: expected equally many spots of each light, got "
                "others. Add a column frame, a number for each image"
            )
    repeats = frame.duplicated(["group", "laser", label])
    table.check("laser", ~repeats.to_numpy(), "each light once in an image")
    shown = "time" if "time" in frame else label
    groups = []
    for group in range(2):
        rows = frame[frame["group"] == group]
        labels = rows.groupby(label)[shown].first()
        images = labels.index.searchsorted(rows[label])
        spots = np.full((len(labels), count, 2), np.nan)
        spots[images, rows["laser"].astype(int) - 1] = rows[["x", "y"]]
        groups.append(spots)
    if not all(map(len, groups)):
        raise ValueError(
            f"{table.path}, column group: expected spots at the zero point (0) and at the present "
            "(1), got one group. Add the other"
        )
    return (groups[0], groups[1]), pd.Index(labels, name=shown)
