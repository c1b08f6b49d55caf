"""A user's spots of lights, from a file, a DataFrame or arrays: images in which a lost one is NaN.

In a table a row is a spot, in px: ``group`` (0 at the zero point, 1 at the present), ``laser``
(from 1), ``x``, ``y``, and ``frame`` (or ``image``), any number that the spots of an image share.
Without it every image must be whole.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reproduce.store.points import (
    LARGEST,
    NAMED,
    Table,
    TableFileError,
    is_table,
    measured,
    read_table,
)

COLUMNS = ("group", "laser", "x", "y")
FRAMES = ("frame", "image")
# What arrays of both groups are called.
NAMES = ("zero", "spots")

FloatArray = NDArray[np.float64]
Images = tuple[FloatArray, FloatArray]


def read_images(spots: Any, zero: Any, count: int) -> tuple[Images, list[str]]:
    """Return the images at the zero point and at the present, and what a user should hear of it.

    Shape (frames, lights, 2), in px, of so many lights; spots may be a table of both groups.
    """
    if is_table(spots) and zero is None:
        table = read_table(spots, COLUMNS, FRAMES)
        pair, notes = images_of(table, count)
        return pair, [*table.notes, *notes]
    if isinstance(spots, str | Path):
        raise ValueError("zero: expected nothing beside a file, which holds both groups")
    if zero is None:
        raise ValueError("zero: expected the images at the zero point, or a file of both")
    arrays = measured(*zip(NAMES, (zero, spots), strict=True))
    before, now = (
        _lost(name, np.where(mask, np.nan, one), count)
        for name, (one, mask) in zip(NAMES, arrays, strict=True)
    )
    return (before, now), _notes((before, now))


def _lost(name: str, images: FloatArray, count: int) -> FloatArray:
    """Return an array of images with NaN for both coordinates of a spot that is lost."""
    if images.ndim != 3 or images.shape[1:] != (count, 2) or not len(images):
        raise ValueError(
            f"{name}: expected images of {count} lights, shape (frames, {count}, 2), got "
            f"{images.shape}; another instrument goes to platform"
        )
    if (np.abs(images) >= LARGEST).any():
        raise ValueError(f"{name}: expected numbers below {LARGEST:g}, or NaN for a lost spot")
    lost = np.isnan(images).any(axis=-1, keepdims=True)
    return np.where(lost, np.nan, images)


def images_of(table: Table, count: int) -> tuple[Images, list[str]]:
    """Return the images of a table, and what a user should hear of them."""
    for name, least, most in (("group", 0, 1), ("laser", 1, count)):
        values = table.column(name)
        wrong = (values != np.round(values)) | (values < least) | (values > most)
        for row in np.flatnonzero(wrong)[:1].tolist():
            raise table.wrong(row, name, f"expected a whole number from {least} to {most}")
    notes: list[str] = []
    named = next((one for one in FRAMES if one in table.optional), None)
    images = []
    for group in range(2):
        rows = np.flatnonzero(table.column("group") == group)
        if not len(rows):
            raise TableFileError(f"{table.path}: expected spots of the groups 0 (the zero point) "
                                 f"and 1 (the present), got none of group {group}")  # fmt: skip
        light = table.column("laser")[rows].astype(int) - 1
        if named is None:
            frame = _in_order(table, rows, light, count, notes.append)
        else:
            frame = np.unique(table.optional[named][rows], return_inverse=True)[1].reshape(-1)
        place = frame * count + light
        again = np.setdiff1d(np.arange(len(rows)), np.unique(place, return_index=True)[1])
        if len(again):
            raise table.wrong(int(rows[again[0]]), "laser", "expected each light once in an image")
        spots = np.full((int(frame.max()) + 1, count, 2), np.nan)
        spots[frame, light] = table.values[rows, 2:4]
        images.append(spots)
    pair = (images[0], images[1])
    return pair, [*dict.fromkeys(notes), *_notes(pair)]


def _in_order(
    table: Table, rows: NDArray[np.int64], light: NDArray[np.int64], count: int,
    note: Callable[[str], None],
) -> NDArray[np.int64]:  # fmt: skip
    """Return the image of each spot of a group, from the order of the rows."""
    lengths = np.bincount(light, minlength=count)
    shown = np.flatnonzero(lengths)
    images = light[: len(light) // len(shown) * len(shown)].reshape(-1, len(shown))
    whole = (np.sort(images, axis=1) == shown).all(axis=1)
    if images.size == light.size and whole.all():
        return np.arange(len(rows)) // len(shown)
    if len(set(lengths[shown].tolist())) == 1 and (np.diff(light) >= 0).all():
        note(
            f"no column {FRAMES[0]} says which {table.kind}s are of one image: spots of each light "
            "are paired in their order, so none may be lost"
        )
        return np.arange(len(rows)) - np.searchsorted(light, light)
    first = int(np.append(whole, False).argmin()) * len(shown)
    raise TableFileError(
        f"{table.at(int(rows[min(first, len(rows) - 1)]), 'laser')}: expected a spot of each light "
        "in every image, image after image, got none of one in the image that begins here; add a "
        f"column {FRAMES[0]}, a number for each image, where spots are lost or in another order"
    )


def _notes(pair: Images) -> list[str]:
    """Say how many spots are lost, of which light, and which images cannot tell an attitude."""
    gone = [np.isnan(one[..., 0]) for one in pair]
    of_light = sum(one.sum(axis=0) for one in gone)
    if not np.any(of_light):
        return []
    named = ", ".join(
        f"{lost} of light {number}" for number, lost in enumerate(of_light, start=1) if lost
    )
    dark = [f"image {image + 1} of group {group}" for group, one in enumerate(gone)
            for image in np.flatnonzero((~one).sum(axis=1) < 2)]  # fmt: skip
    size = sum(one.size for one in gone)
    notes = [f"{sum(of_light)} of {size} spots are lost ({named}): an image counts the less the "
             "fewer it shows"]  # fmt: skip
    if dark:
        more = ", ..." * (len(dark) > NAMED)
        notes.append(f"fewer than two lights are seen in {', '.join(dark[:NAMED])}{more}: no angle")
    return notes
