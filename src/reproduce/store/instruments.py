"""Data of real instruments that come with the project; their origin stands beside them."""

from __future__ import annotations

from functools import cache
from typing import TYPE_CHECKING

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
    try:
        from astropy.io import fits
    except ImportError as error:
        raise ImportError(
            "expected astropy, got none; install reproduce-pointing[images]"
        ) from error
    path = data_folder() / "instruments" / "2mass" / f"2MASS_{band}.fits"
    image = np.asarray(fits.getdata(path), dtype=np.float64)
    image.flags.writeable = False
    return image


@cache
def lenses() -> pd.DataFrame:
    """Return measured lateral colour, one row per lens and focal length; not to be written to.

    A point of the green image at r, in half heights of the image, lies in the red one at
    r (br r^2 + cr r + vr), in the blue one with bb, cb and vb.
    """
    import pandas as pd

    return pd.read_csv(data_folder() / "instruments" / "lensfun" / "tca.csv")
