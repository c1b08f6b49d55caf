"""A user's own measurements in place of ours: which columns, and which priors.

Nothing of the papers enters the priors: they come from the scale of the data. The instrument of a
misalignment is a setting, and is that of chen2023's ground platform.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reproduce.inference.lasers import SpotStatistics
from reproduce.inference.misalignment import misalignment_model
from reproduce.inference.model import Model
from reproduce.inference.priors import Normal, Prior
from reproduce.inference.registration import registration_model
from reproduce.papers.chen2023.posteriors import READS, platform
from reproduce.printed.given import given
from reproduce.store.points import TableFileError, read_columns

FloatArray = NDArray[np.float64]

# Model to the columns of its file.
COLUMNS = {
    "registration": ("x", "y", "x_reference", "y_reference"),
    "misalignment": ("group", "laser", "x", "y"),
}
# A prior this many times as wide as what the data show is hardly felt, yet proper.
GENEROUS = 20.0


def from_file(name: str, path: Path, pivot: tuple[float, float] | None = None) -> Model:
    """Return a model with a user's data.

    Parameters
    ----------
    name : str
        A model of `COLUMNS`.
    path : pathlib.Path
        A CSV file: for `registration` one star per line, its place in the channel and in the
        reference channel; for `misalignment` one spot per line, group 0 at the zero point and
        group 1 at the present, lasers numbered from 1 in the order of the platform. All in px.
    pivot : tuple of float, optional
        For `registration`: the channel's principal point; the mean of its stars by default.

    Returns
    -------
    Model
        With priors on the scale of the data.

    Raises
    ------
    TableFileError
        If the file is wrong, or the model takes none.
    """
    if name not in COLUMNS:
        raise TableFileError(f"{name} takes no file; these models do: {', '.join(COLUMNS)}")
    table = read_columns(path, COLUMNS[name])
    if name == "registration":
        centre = table[:, :2].mean(axis=0) if pivot is None else np.array(pivot)
        return registration_model(table[:, :2], table[:, 2:], centre)
    return _misalignment(path, table)


def _misalignment(path: Path, table: FloatArray) -> Model:
    instrument = platform(given(READS))
    count = len(instrument.lasers)
    images = []
    for group in (0, 1):
        spots = table[table[:, 0] == group]
        lasers = [spots[spots[:, 1] == laser, 2:] for laser in range(1, count + 1)]
        lengths = {len(one) for one in lasers}
        if len(lengths) != 1 or sum(map(len, lasers)) != len(spots) or not len(spots):
            raise TableFileError(
                f"{path}: expected as many lines for each laser from 1 to {count} in group "
                f"{group}, got {[len(one) for one in lasers]}; repair columns group and laser"
            )
        images.append(np.stack(lasers, axis=1))
    if not set(table[:, 0]) <= {0.0, 1.0}:
        raise TableFileError(f"{path}: expected groups 0 (zero point) and 1, got others")
    instrument = replace(instrument, spots=images[0].mean(axis=0))
    return misalignment_model(
        instrument, SpotStatistics.of(images, (False, False)), priors=_priors(images)
    )


def _priors(images: list[FloatArray]) -> dict[str, Prior]:
    """Angles as wide as the pattern's motion against its own size allows, many times over."""
    means = [one.mean(axis=0) for one in images]
    size = float(np.ptp(means[0], axis=0).max())
    motion = float(np.abs(means[1] - means[0]).max() + images[0].std(axis=0).max())
    instrument = platform(given(READS))
    pixel = instrument.pixel_pitch / instrument.tracker_focal_length
    reason = "twenty times what the spots moved"
    across = Normal(0.0, GENEROUS * motion * pixel, reason)
    roll = Normal(0.0, GENEROUS * motion / size, reason + ", as a roll of the pattern")
    return {"angle-x": across, "angle-y": across, "angle-z": roll}
