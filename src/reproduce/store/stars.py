"""Matched stars of two images, with errors, weights and brightness."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.store.points import (
    STARS,
    Table,
    TableFileError,
    is_table,
    read_table,
    table_of,
)

SIGMAS = ("sigma", "sigma_x", "sigma_y")
BRIGHTNESS = ("flux", "mag")

FloatArray = NDArray[np.float64]


def matched_stars(
    source: Any, target: ArrayLike | None, settings: dict[str, Any]
) -> tuple[Table, dict[str, Any]]:
    """Read both images, and turn columns of sigma and weight into settings of the fit."""
    sep = settings.pop("sep", None)
    if is_table(source) and target is None:
        table = read_table(source, STARS, (*SIGMAS, "weight", *BRIGHTNESS), sep)
        return table, settings | _known(table, settings)
    if isinstance(source, str | Path):
        raise ValueError(
            "target: expected nothing beside a file, which holds both images"
        )
    if target is None:
        raise ValueError(
            "target: expected the stars of the other image, or a file of both"
        )
    both = {
        name: _places(name, one, sep)
        for name, one in (("source", source), ("target", target))
    }
    table = table_of(STARS, *both.items())
    if table.notes:  # what is given of each star goes with it
        sizes = {"weights": 1, "source_covariance": 3, "target_covariance": 3}
        for name, axes in sizes.items():
            value = settings.get(name)
            if value is not None and np.ndim(value) == axes:
                settings = settings | {name: np.asarray(value)[table.rows]}
    return table, settings


def brightness(columns: Mapping[str, FloatArray]) -> FloatArray | None:
    """Return a number that increases with the flux of each star, or None if none is known."""
    return (
        columns["flux"]
        if "flux" in columns
        else -columns["mag"]
        if "mag" in columns
        else None
    )


def _places(name: str, source: Any, sep: str | None) -> Any:
    """Return an array, or the columns x and y of a table without a mask."""
    if not is_table(source):
        return source
    table = read_table(source, ("x", "y"), sep=sep, name=name)
    if table.notes:
        raise TableFileError(
            f"{table.path}, column mask: expected no masked rows in two tables. Put the stars of "
            f"both into one table with the columns {', '.join(STARS)}"
        )
    return table.values


def _known(table: Table, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return weights and the covariance of the target that the columns of a table give."""
    found: dict[str, Any] = {}
    given = table.optional
    if "weight" in given:
        found["weights"] = given["weight"]
    if {*SIGMAS} & {*given}:
        found["target_covariance"] = deviations(table)[..., None] ** 2 * np.eye(2)
    for name in found:
        if settings.get(name) is not None:
            raise ValueError(
                f"{name}: expected none beside a column of the table; leave one out"
            )
    return found


def deviations(table: Table) -> FloatArray:
    """Return the standard deviations along x and y that the columns of a table give, (n, 2)."""
    given = table.optional
    axes = [
        next((one for one in (f"sigma_{axis}", "sigma") if one in given), "")
        for axis in "xy"
    ]
    if not all(axes):
        raise TableFileError(
            f"{table.path}: expected sigma, or both sigma_x and sigma_y"
        )
    for name in axes:
        for row in np.flatnonzero(given[name] <= 0)[:1].tolist():
            raise table.wrong(row, name, "expected a standard deviation above zero")
    return np.stack([given[name] for name in axes], axis=-1)
