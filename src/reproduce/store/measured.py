"""Catalogue stars and tabulated spectra of other authors, which come with the package.

Each file is read once. Do not write to the arrays.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from reproduce.locate import data_folder

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
class _CatalogueStars:
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
def bright_stars() -> _CatalogueStars:
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
        [np.cos(delta) * np.cos(alpha), np.cos(delta) * np.sin(alpha), np.sin(delta)],
        axis=-1,
    )
    return _CatalogueStars(
        table["number"].astype(np.int64),
        directions,
        table["magnitude"].astype(np.float64) / 100,
    )


@cache
def spectra() -> dict[str, tuple[NDArray[np.float64], NDArray[np.float64]]]:
    """Return the tabulated spectra of Vega and the Sun, as seen from the Earth.

    ``vega`` and ``sun``, each to wavelengths, in metres, and photons per second, square metre and
    metre of wavelength; both of shape (n,).
    """
    table = np.genfromtxt(
        data_folder() / "stars" / "spectra.csv", delimiter=",", names=True
    )
    wavelength = table["wavelength_nm"] * 1e-9
    return {name: (wavelength, table[name] * 1e9) for name in ("vega", "sun")}
