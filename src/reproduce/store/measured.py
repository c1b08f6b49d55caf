"""What others measured and comes with the project, its origin beside it: stars, instruments.

Files are read once: what comes of them is not to be written to.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reproduce.locate import data_folder
from reproduce.store.images import fits_table, read_image

if TYPE_CHECKING:
    import pandas as pd

_HEADER_BYTES = 28
# One star: number, right ascension, declination, spectral type, 100 V, proper motions.
_RECORD = np.dtype(
    [
        ("number", "<f4"),
        ("right_ascension", "<f8"),
        ("declination", "<f8"),
        ("spectrum", "S2"),
        ("magnitude", "<i2"),
        ("motion", "<f4", (2,)),
    ]
)


@dataclass(frozen=True, eq=False)
class Stars:
    """Stars of a catalogue.

    Attributes
    ----------
    number : ndarray of int, shape (n,)
        In the catalogue.
    directions : ndarray, shape (n, 3)
        Unit vectors in the celestial frame, epoch J2000.
    magnitude : ndarray, shape (n,)
        Visual.
    """

    number: NDArray[np.int64]
    directions: NDArray[np.float64]
    magnitude: NDArray[np.float64]


@cache
def bright_stars() -> Stars:
    """Return the Bright Star Catalogue, without the entries that are no stars.

    Examples
    --------
    Sirius is number 2491.

    >>> stars = bright_stars()
    >>> float(stars.magnitude[stars.number == 2491][0])
    -1.46
    """
    content = (data_folder() / "stars" / "bsc5.dat").read_bytes()
    table = np.frombuffer(content, _RECORD, offset=_HEADER_BYTES)
    # Fourteen numbers of the catalogue are novae and clusters, entered without a place.
    table = table[(table["right_ascension"] != 0) | (table["declination"] != 0)]
    alpha, delta = table["right_ascension"], table["declination"]
    directions = np.stack(
        [np.cos(delta) * np.cos(alpha), np.cos(delta) * np.sin(alpha), np.sin(delta)], axis=-1
    )
    return Stars(
        table["number"].astype(np.int64), directions, table["magnitude"].astype(np.float64) / 100
    )


@cache
def spectra() -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return the tabulated spectra of Vega and the Sun, as seen from the Earth.

    ``vega`` and ``sun``, each to wavelengths, in metres, and photons per second, square metre and
    metre of wavelength; both of shape (n,).
    """
    table = np.genfromtxt(data_folder() / "stars" / "spectra.csv", delimiter=",", names=True)
    wavelength = table["wavelength_nm"] * 1e-9
    return {name: (wavelength, table[name] * 1e9) for name in ("vega", "sun")}


def _file(name: str) -> Path:
    """Return where a file of a real instrument lies."""
    return data_folder() / "instruments" / name


@cache
def mosaic(band: str) -> NDArray[np.float64]:
    """Return the image of 2MASS in one of its bands, ``j``, ``h`` or ``k``.

    Shape (720, 721), rows from the south, in the units of the file.

    Raises
    ------
    ImageError
        Without astropy.
    """
    picture = read_image(_file(f"2mass/2MASS_{band}.fits"))
    return picture.light.astype(np.float64)


@cache
def lenses() -> pd.DataFrame:
    """Return measured lateral colour, one row per lens and focal length.

    A point of the green image at r, in half heights of the image, lies in the red one at
    r (br r^2 + cr r + vr), in the blue one with bb, cb and vb.
    """
    import pandas as pd

    return pd.read_csv(_file("lensfun/tca.csv"))


@dataclass(frozen=True, eq=False)
class Windows:
    """What Chandra's star tracker saw of one light or star."""

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
    ImageError
        Without astropy.
    """
    table = fits_table(_file(f"chandra/acaf686111014N001_{slot}_img0.fits.gz"))
    table = table[table["IMGFUNC1"] == _TRACKING][:-_LAST]
    corners = np.stack([table["IMGCOL0"], table["IMGROW0"]], axis=-1)
    columns = (table["TIME"], corners, table["IMGRAW"])
    return Windows(*(np.array(one, dtype=np.float64) for one in columns))


def star_images() -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return images of a star in Chandra's tracker, by place in the pixel, and the places.

    Shape (12, 12, 8, 8), unit light: down the first axis the row of the star grows, along the
    second its column; places, (12,), in px, of either.
    """
    import pandas as pd

    table = pd.read_csv(_file("chandra/aca_psf_lib.dat"), sep=" ")
    images = table.iloc[:, 6:].to_numpy().reshape(12, 12, 8, 8)
    edges = table["row_bin_left_edge"].to_numpy() + table["row_bin_right_edge"].to_numpy()
    return images, edges[::12] / 2


def tracker() -> dict[str, Any]:
    """Return the lights and the tracker of Chandra, as `Platform.of_spots` takes them."""
    return tomllib.loads(_file("chandra/platform.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True, eq=False)
class Aimpoints:
    """Observations of Chandra, by time; drifts are (y, z), in arcsec."""

    years: NDArray[np.float64]  # (n,)
    temperatures: NDArray[np.float64]  # (n,), of the tracker's detector, in degrees Celsius
    foretold: NDArray[np.float64]  # (n, 2), what the pointing allowed for
    left: NDArray[np.float64]  # (n, 2), what was measured less what was foretold

    @property
    def measured(self) -> NDArray[np.float64]:
        """The drift as measured, (n, 2)."""
        return self.foretold + self.left


@cache
def aimpoints() -> Aimpoints:
    """Return 28 observations of Chandra: what was foretold and what was measured."""
    import pandas as pd

    known = tomllib.loads(_file("chandra/detectors.toml").read_text(encoding="utf-8"))
    table = pd.read_csv(_file("chandra/aimpoint.ecsv"), sep=" ", comment="#")
    date = pd.DatetimeIndex(pd.to_datetime(table["mean_date"], format="%Y:%j:%H:%M:%S.%f"))
    start, end = (pd.to_datetime((date.year + n).astype(str), format="%Y") for n in (0, 1))
    years = date.year + (date - start) / (end - start)
    rows = []
    for year, one in zip(years, table.to_dict("records"), strict=True):
        plate = known[one["detector"]]
        matrix = np.array(plate["matrix"])
        place = np.array([one["chipx"], one["chipy"]]) - plate["origin"]
        moved = known["arcsec_per_mm"] * np.linalg.solve(matrix, place)
        foretold = moved - [one["aca_offset_y"], one["aca_offset_z"]]
        turn = matrix / np.sqrt(abs(np.linalg.det(matrix)))
        left = -np.linalg.solve(turn, [one["dx"], one["dy"]])
        rows.append((year, one["mean_t_ccd"], *foretold, *left))
    found = np.array(sorted(rows))
    return Aimpoints(found[:, 0], found[:, 1], found[:, 2:4], found[:, 4:])
