"""Data of real instruments that come with the project; their origin stands beside them."""

from __future__ import annotations

import datetime
import json
import tomllib
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np

from reproduce.locate import data_folder

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray


@cache
def mosaic(band: str) -> NDArray[np.float64]:
    """Return the image of 2MASS in one of its bands, ``j``, ``h`` or ``k``.

    Shape (720, 721), rows from the south, in the units of the file; not to be written to.

    Raises
    ------
    ImportError
        Without astropy, which the extra ``images`` installs.
    """
    image = np.asarray(_fits("2mass", f"2MASS_{band}.fits"), dtype=np.float64)
    image.flags.writeable = False
    return image


def _fits(*place: str) -> Any:
    """Return the first table or image of a file."""
    try:
        from astropy.io import fits
    except ImportError as error:
        raise ImportError(
            "expected astropy, got none; install reproduce-pointing[images]"
        ) from error
    return fits.getdata(data_folder().joinpath("instruments", *place))


@cache
def lenses() -> pd.DataFrame:
    """Return measured lateral colour, one row per lens and focal length; not to be written to.

    A point of the green image at r, in half heights of the image, lies in the red one at
    r (br r^2 + cr r + vr), in the blue one with bb, cb and vb.
    """
    import pandas as pd

    return pd.read_csv(data_folder() / "instruments" / "lensfun" / "tca.csv")


@dataclass(frozen=True, eq=False)
class Windows:
    """What Chandra's star tracker saw of one light or star; not to be written to."""

    times: NDArray[np.float64]  # (n,), in s
    corners: NDArray[np.float64]  # (n, 2), column and row of the first pixel
    images: NDArray[np.float64]  # (n, height, width), in DN, rows from the first upwards


# What the windows do when they track, and the frames at their end when the spacecraft turns away.
_TRACKING, _LAST = 1, 12


@cache
def windows(slot: int) -> Windows:
    """Return the frames in which a window of Chandra's star tracker tracks.

    Slots 0 to 2 are the fiducial lights, slot 7 is a star.

    Raises
    ------
    ImportError
        Without astropy, which the extra ``images`` installs.
    """
    table = _fits("chandra", f"acaf686111014N001_{slot}_img0.fits.gz")
    table = table[table["IMGFUNC1"] == _TRACKING][:-_LAST]
    corners = np.stack([table["IMGCOL0"], table["IMGROW0"]], axis=-1)
    columns = (table["TIME"], corners, table["IMGRAW"])
    found = Windows(*(np.array(one, dtype=np.float64) for one in columns))
    for one in vars(found).values():
        one.flags.writeable = False
    return found


def star_images() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return images of a star in Chandra's tracker, by place in the pixel, and the places.

    Shape (12, 12, 8, 8), unit light: down the first axis the row of the star grows, along the
    second its column; places, (12,), in px, of either.
    """
    import pandas as pd

    table = pd.read_csv(data_folder() / "instruments" / "chandra" / "aca_psf_lib.dat", sep=" ")
    table = table.sort_values(["row_bin_idx", "col_bin_idx"])
    images = table.iloc[:, 6:].to_numpy().reshape(12, 12, 8, 8)
    edges = table["row_bin_left_edge"].to_numpy() + table["row_bin_right_edge"].to_numpy()
    return images, edges[::12] / 2


def tracker() -> dict[str, Any]:
    """Return the lights and the tracker of Chandra, as `Platform.of_spots` takes them."""
    path = data_folder() / "instruments" / "chandra" / "platform.toml"
    return tomllib.loads(path.read_text(encoding="utf-8"))


def _year(date: str) -> float:
    """Return the year of a date such as 2019:001:02:27:50.816, whose day counts from one."""
    year, day, *clock = date.split(":")
    days: float = int(day) - 1 + sum(float(one) / 24 / 60**n for n, one in enumerate(clock))
    length = datetime.date(int(year) + 1, 1, 1) - datetime.date(int(year), 1, 1)
    return float(int(year) + days / length.days)


@cache
def aimpoints() -> pd.DataFrame:
    """Return 28 observations of Chandra, by time: what was foretold and what was measured.

    ``year``; ``detector``; ``temperature`` of the tracker's detector, in degrees Celsius; and in
    arcsec ``foretold y`` and ``z``, the drift that the pointing allowed for, with ``left y`` and
    ``z``, what was measured less what was foretold.
    """
    import pandas as pd

    folder = data_folder() / "instruments" / "chandra"
    known = tomllib.loads((folder / "detectors.toml").read_text(encoding="utf-8"))
    table = pd.read_csv(folder / "aimpoint.ecsv", sep=" ", comment="#")
    rows = []
    for one in table.to_dict("records"):
        plate = known[one["detector"]]
        matrix = np.array(plate["matrix"])
        place = np.array([one["chipx"], one["chipy"]]) - plate["origin"]
        moved = known["arcsec_per_mm"] * np.linalg.solve(matrix, place)
        foretold = moved - [one["aca_offset_y"], one["aca_offset_z"]]
        turn = matrix / np.sqrt(abs(np.linalg.det(matrix)))
        left = -np.linalg.solve(turn, [one["dx"], one["dy"]])
        when = _year(one["mean_date"])
        rows.append((when, one["detector"], one["mean_t_ccd"], *foretold, *left))
    names = ["year", "detector", "temperature", "foretold y", "foretold z", "left y", "left z"]
    return pd.DataFrame(rows, columns=names).sort_values("year", ignore_index=True)


def drift_model(
    years: NDArray[np.float64], temperatures: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the drift (y, z) that Chandra's flight model tells, shape (n, 2), in arcsec.

    Temperatures of the tracker's detector are in degrees Celsius. The model knows jumps of the
    years 2015 to 2026, and is for years from 2012 on.
    """
    path = data_folder() / "instruments" / "chandra" / "aca_drift_model.json"
    told = json.loads(path.read_text(encoding="utf-8"))
    axes = []
    for one in (told["dy"], told["dz"]):
        warmth = (1.8 * temperatures + 32 - one["offset"]) * one["scale"]
        jumps = sum(size * (years >= _year(date)) for date, size in one["jumps"])
        axes.append(warmth + (years - one["year0"]) * one["trend"] + jumps)
    return np.stack(axes, axis=-1)
