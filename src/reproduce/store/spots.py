"""Spots of fiducial lights as images at the zero point and at the present.

Images have shape (frames, lights, 2), in px. A lost spot is NaN: its coordinates are NaN, masked or
larger than 1e30. A row of a table is a spot with the columns ``group`` (0 at the zero point, 1 at
the present), ``laser`` (from 1), ``x`` and ``y`` in px, and ``frame`` or ``time``, the number of
its image. Without this number, the images are complete and in order.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from reproduce.physics.validate import FloatArray, finite_array, number_array
from reproduce.store.points import (
    _LARGEST_NUMBER,
    DataTable,
    TableFileError,
    is_table,
    read_table,
)

SPOTS = ("group", "laser", "x", "y")
# Columns that number the images.
IMAGES = ("frame", "time")

Images = tuple[FloatArray, FloatArray]


def read_images(
    count: int, spots: Any, zero: Any = None, times: Any = None, sep: str | None = None
) -> tuple[Images, FloatArray | None, list[str]]:
    """Return the images of both groups, times of those at the present, and remarks.

    Shape (frames, count, 2), in px; `spots` may be a table of both groups.
    """
    if is_table(spots):
        if zero is not None or times is not None:
            raise ValueError(
                "zero, times: expected no arguments with a table, which contains both groups, got "
                "one. Leave them out"
            )
        table = read_table(spots, SPOTS, IMAGES, sep)
        pair, when = _by_image(table, count)
        return pair, when, [*table.notes, *lost_spots(pair)]
    if zero is None:
        raise ValueError(
            "zero: expected the images at the zero point, got no argument. Pass them, or a table "
            "of both groups"
        )
    pair = _array("zero", zero, count), _array("spots", spots, count)
    when = None
    if times is not None:
        when = finite_array("times", times, shape=pair[1].shape[:1])
    return pair, when, lost_spots(pair)


def _array(name: str, images: Any, count: int) -> FloatArray:
    """Return the images of an array, with NaN for both coordinates of a lost spot."""
    unmasked = images.filled(np.nan) if np.ma.isMaskedArray(images) else images
    array = number_array(name, unmasked, shape=(None, count, 2))
    if array.ndim != 3:
        raise ValueError(
            f"{name}: expected shape (frames, {count}, 2), got {array.shape}. Pass one array"
        )
    seen = (np.abs(array) < _LARGEST_NUMBER).all(axis=-1, keepdims=True)
    return np.where(seen, array, np.nan)


def images_of(table: DataTable, count: int) -> Images:
    """Return the images of a table of spots of `count` lights, of both groups."""
    return _by_image(table, count)[0]


def _by_image(table: DataTable, count: int) -> tuple[Images, FloatArray | None]:
    """Return the images of both groups, and the mean times of those at the present."""
    import pandas as pd

    for name, least, greatest in (("group", 0, 1), ("laser", 1, count)):
        allowed = np.isin(table.numbers[name], range(least, greatest + 1))
        table.check(name, allowed, f"a whole number from {least} to {greatest}")
    frame = pd.DataFrame(dict(table.numbers), index=table.rows)
    label = next((column for column in IMAGES if column in frame), None)
    images, times = [], None
    for group in range(2):
        part = frame[frame["group"] == group]
        lights = part["laser"].to_numpy()
        count_seen = max(len(np.unique(lights)), 1)
        image = np.arange(len(part)) // count_seen if label is None else part[label]
        if not len(part):
            raise TableFileError(
                f"{table.path}, column group: expected 0 (the zero point) and 1 (the present), got "
                f"no {group}. Add its spots"
            )
        swapped = np.resize(lights[:count_seen], len(part)) != lights
        if label is None and swapped.any():
            raise TableFileError(
                f"{table.path}, row {part.index[swapped.argmax()]}: expected images one after the "
                "other, each with all lights in one order, got another light. Add a column frame, "
                "a number for each image"
            )
        columns = pd.MultiIndex.from_product([["x", "y"], range(1, count + 1)])
        part = part.assign(image=image)
        try:
            spots = part.pivot(index="image", columns="laser", values=["x", "y"])
        except ValueError as error:
            raise TableFileError(
                f"{table.path}, column laser: expected each light once in an image ({error}). "
                "Remove a spot"
            ) from error
        wide = spots.reindex(columns=columns).to_numpy()
        images.append(wide.reshape(-1, 2, count).swapaxes(1, 2))
        if "time" in part:
            times = part.groupby("image")["time"].mean().to_numpy()
    return (images[0], images[1]), times


def lost_spots(pair: Images) -> list[str]:
    """Return the remark on lost spots."""
    lost = np.concatenate([np.isnan(group[..., 0]).ravel() for group in pair])
    text = f"{lost.sum()} of {lost.size} spots are lost: an image with fewer spots has less weight"
    return [text] if lost.any() else []
