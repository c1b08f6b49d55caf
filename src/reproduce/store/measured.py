"""Catalogue stars and tabulated spectra of other authors, which come with the package.

Each file is read once. Do not write to the arrays.
"""

from __future__ import annotations

from functools import cache

import erfa
import numpy as np

from reproduce.locate import data_folder
from reproduce.physics.validate import FloatArray, IntArray

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


@cache
def bright_stars() -> tuple[IntArray, FloatArray, FloatArray]:
    """Return the Bright Star Catalogue, without the entries that are no stars.

    Returns
    -------
    number : ndarray of int, shape (n,)
        Number in the catalogue.
    directions : ndarray, shape (n, 3)
        Unit vectors in the celestial frame, epoch J2000.
    magnitude : ndarray, shape (n,)
        Visual magnitude.

    Examples
    --------
    Sirius is number 2491.

    >>> number, _, magnitude = bright_stars()
    >>> float(magnitude[number == 2491][0])
    -1.46
    """
    content = (data_folder() / "stars" / "bsc5.dat").read_bytes()
    table = np.frombuffer(content, _RECORD, offset=_HEADER_BYTES)
    # Fourteen numbers of the catalogue are novae and clusters, entered without a place.
    table = table[(table["right_ascension"] != 0) | (table["declination"] != 0)]
    directions = erfa.s2c(table["right_ascension"], table["declination"])
    return table["number"].astype(np.int64), directions, table["magnitude"] / 100


@cache
def spectra() -> dict[str, tuple[FloatArray, FloatArray]]:
    """Return the tabulated spectra of Vega and the Sun, as seen from the Earth.

    ``vega`` and ``sun``, each to wavelengths, in metres, and photons per second, square metre and
    metre of wavelength; both of shape (n,).
    """
    table = np.genfromtxt(
        data_folder() / "stars" / "spectra.csv", delimiter=",", names=True
    )
    wavelength = table["wavelength_nm"] * 1e-9
    return {name: (wavelength, table[name] * 1e9) for name in ("vega", "sun")}
