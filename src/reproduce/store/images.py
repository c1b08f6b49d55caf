"""Images as two-dimensional arrays, Astropy `CCDData`, or images of a FITS file.

Arrays are indexed [y, x], with the centre of the first pixel at (0, 0). Astropy reads FITS files
and is imported on first use.
"""

from __future__ import annotations

import gzip
import math
import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reproduce.physics.validate import BoolArray
from reproduce.store.files import FilePath

FloatArray = NDArray[np.floating]

# The end of a FITS file name, and the extension in brackets behind it.
_FITS = re.compile(
    r"(?P<file>.*\.(?:fits|fit|fts)(?:\.gz|\.bz2|\.fz)?|.*\.fz)(?:\[(?P<extension>[^\]]+)\])?",
    re.I,
)
# Shortest side of an image, in px.
_MIN_SIDE = 16
# Pixels of an image, at most. Larger images exceed the memory of a usual computer.
_MAX_PIXELS = 400_000_000
# Largest magnitude of a pixel: single precision ends at 3e38.
_MAX_VALUE = 1e30
# Bytes of a compressed file that are checked at once.
_BLOCK_BYTES = 1 << 20
# Touching pixels with the highest value, at least, in an image with a saturated star.
_MIN_SATURATED = 4


def is_image(source: Any) -> bool:
    """Return whether `source` is an array, a `CCDData` or a FITS file with an image.

    Examples
    --------
    >>> is_image("stars.csv"), is_image(np.zeros((99, 2))), is_image(np.zeros((99, 64)))
    (False, False, True)
    """
    if isinstance(source, FilePath):
        name = _FITS.fullmatch(str(source))
        if name is None or name["extension"]:
            return name is not None
        with reading(str(source)), _fits_images(name["file"]) as images:
            return bool(images)
    content = source.data if hasattr(source, "uncertainty") else source
    shape = getattr(content, "shape", ())
    has_sides = len(shape) in (2, 3) and sorted(shape)[-2] >= _MIN_SIDE
    return has_sides and not hasattr(source, "columns")


def read_image(source: Any) -> tuple[NDArray[Any], float, FloatArray | None]:
    """Return the pixels of an image, their saturation, and their standard deviations.

    Parameters
    ----------
    source : path or array_like, shape (height, width)
        FITS file, with the extension in brackets if it contains several images
        (``field.fits[SCI]``), array, masked array or `CCDData`, whose mask and uncertainty apply.

    Returns
    -------
    pixels : ndarray, shape (height, width)
        Digital numbers; NaN if a pixel is masked or missing.
    saturation : float
        Digital number of saturated pixels; infinity if no pixel is saturated.
    sigma : ndarray, shape (height, width), or None
        Standard deviations of the pixels, in digital numbers, if the source contains them.

    Raises
    ------
    ValueError
        If the source is not one two-dimensional image with different pixels.
    """
    if isinstance(source, FilePath):
        source = _from_fits(str(source))
    image = source
    if hasattr(source, "uncertainty"):
        image = np.ma.array(source.data, mask=source.mask)
    pixels = np.ma.getdata(image, subok=False)  # without a unit
    if pixels.dtype.kind not in "iufb":
        raise ValueError(
            f"expected real numbers, got {pixels.dtype}. Convert the image to an array"
        )
    if pixels.ndim != 2 or min(pixels.shape) < _MIN_SIDE:
        raise ValueError(
            f"expected an image of shape (height, width) with {_MIN_SIDE} px or more on each "
            f"side, got {pixels.shape}. Pass one channel, such as image[..., 1]"
        )
    missing = ~np.isfinite(pixels) | np.ma.getmask(image)
    sigma = None
    if getattr(source, "uncertainty", None) is not None:
        sigma = _deviations(source.uncertainty, source.unit or "", missing)
        missing |= np.isinf(sigma)
    if missing.any():
        pixels = np.where(missing, np.nan, pixels)
    low, high = (float(end.reduce(pixels, axis=None)) for end in (np.fmin, np.fmax))
    if not (max(-low, high) < _MAX_VALUE and high - low > 1 / _MAX_VALUE):
        raise ValueError(
            f"expected different pixels of less than {_MAX_VALUE:g}, got {low:g} to {high:g}. "
            "Check or scale the image"
        )
    return pixels, high if _is_saturated(pixels, high) else np.inf, sigma


def _is_saturated(pixels: NDArray[Any], high: float) -> bool:
    """Return whether pixels of the highest value touch each other or exhaust their type."""
    from scipy.ndimage import label

    if pixels.dtype.kind in "iu" and high == np.iinfo(pixels.dtype).max:
        return True
    at = pixels == high
    touching = np.bincount(label(at, np.ones((3, 3)))[0][at])
    return bool(touching.max() >= _MIN_SATURATED)


def _deviations(uncertainty: Any, unit: Any, missing: BoolArray) -> FloatArray:
    """Return the standard deviations of pixels of a unit from an Astropy uncertainty."""
    from astropy.nddata import StdDevUncertainty
    from astropy.units import Unit

    # Astropy squares in the type of the array, and small integers overflow.
    array = np.asarray(uncertainty.array, np.float64)
    values = type(uncertainty)(array, unit=uncertainty.unit)
    with np.errstate(divide="ignore"):  # an inverse variance of zero
        found = values.represent_as(StdDevUncertainty)
    sigma = found.array * Unit(found.unit or "").to(unit)
    if sigma.shape not in ((), missing.shape) or not (missing | (sigma > 0)).all():
        raise ValueError(
            "uncertainty: expected one value above zero for each pixel, got values of the shape "
            f"{sigma.shape} from {np.min(sigma):g}. Mask pixels without an uncertainty"
        )
    return np.broadcast_to(sigma, missing.shape)


@contextmanager
def reading(name: str) -> Iterator[None]:
    """Raise a `ValueError` with the name of the image for any error."""
    try:
        yield
    except ImportError as error:
        raise ValueError(
            f"{name}: expected the packages astropy and photutils, got no "
            f"{error.name}. Install both"
        ) from error
    except Exception as error:  # libraries raise many types for a damaged file
        message = " ".join(str(error).split()) or type(error).__name__
        if not re.match(r"([\w, ]+: )?expected ", message):
            message = f"expected a complete and readable image, got {message!r}. Check the file"
        raise ValueError(f"{name}: {message}") from error


@contextmanager
def _fits_images(file: str) -> Iterator[dict[int, Any]]:
    """Yield the two-dimensional images of a FITS file by number, and close it after any error."""
    from astropy.io import fits

    path = Path(file)
    if path.exists() and not path.is_file():
        raise ValueError("expected a regular file, got a folder or a device. Copy it")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", message=".*truncated")
        with path.open("rb") as stream, fits.open(stream, memmap=False) as units:
            yield {
                number: unit
                for number, unit in enumerate(units)
                if unit.is_image and len(unit.shape) > 1
            }


def _from_fits(path: str) -> Any:
    """Return the data of one image of a FITS file."""
    name: Any = _FITS.fullmatch(path)
    file, wanted = name["file"], (name["extension"] or "").strip().upper()
    with _fits_images(file) as images:
        found = [
            unit
            for number, unit in images.items()
            if wanted in ("", str(number), unit.name)
        ]
        if len(found) != 1:
            listed = [f"{number} ({unit.name})" for number, unit in images.items()]
            raise ValueError(
                f"expected one image, got {', '.join(listed) or 'none'}. Name the extension in "
                f"brackets, such as {Path(file).name}[{min(images, default='SCI')}]"
            )
        shape = found[0].shape
        if not 0 < math.prod(shape) <= _MAX_PIXELS:
            raise ValueError(
                f"expected an image of up to {_MAX_PIXELS:,} px, got the shape {shape}. Name "
                "another extension, or use a part"
            )
        data = np.squeeze(found[0].data)
    if file.lower().endswith(".gz"):  # Astropy does not read the check sum
        with gzip.open(file) as stream:
            while stream.read(_BLOCK_BYTES):
                pass
    return data
