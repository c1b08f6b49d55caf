"""Images of a user: two-dimensional arrays, Astropy `CCDData`, or images of a FITS file.

Arrays are indexed [y, x], with the centre of the first pixel at (0, 0). Astropy reads FITS files
and is imported on first use.
"""

from __future__ import annotations

import gzip
import math
import re
import warnings
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.floating]
Mask = NDArray[np.bool_]

# The end of a FITS file name, and the extension in brackets behind it.
_FITS = re.compile(
    r"(?P<file>.*\.(?:fits|fit|fts)(?:\.gz|\.bz2|\.fz)?|.*\.fz)(?:\[(?P<extension>[^\]]+)\])?",
    re.I,
)
# Shortest side of an image, in px.
_SHORTEST = 16
# Pixels of an image, at most: beyond, the memory of a usual machine is full.
_MOST_PIXELS = 400_000_000
# Largest magnitude of a pixel: single precision ends at 3e38.
_LARGEST = 1e30
# Pixels that suffice to find the step between two digital numbers.
_SAMPLE = 100_000
# Bytes of a compressed file that are checked at once.
_BLOCK = 1 << 20
# Touching pixels that share the highest value if a star is saturated.
_PLATEAU = 4


class ImageError(ValueError):
    """An image cannot be used; the message names it and the reason."""


@dataclass(frozen=True, eq=False)
class Image:
    """An image of one channel.

    Parameters
    ----------
    name : str
        Name of the file or array.
    light : ndarray, shape (height, width)
        Digital numbers; NaN if a pixel is masked or missing.
    full : ndarray of bool, shape (height, width)
        Saturated pixels.
    step : float
        Step between two digital numbers of the background; nearly zero for real numbers.
    sigma : ndarray, shape (height, width), optional
        Standard deviations of the pixels, if the source states them.
    """

    name: str
    light: FloatArray
    full: Mask
    step: float = 0.0
    sigma: FloatArray | None = None


def is_image(source: Any) -> bool:
    """Return whether `source` is an array, a `CCDData` or a FITS file with an image.

    Examples
    --------
    >>> is_image("stars.csv"), is_image(np.zeros((99, 2))), is_image(np.zeros((99, 64)))
    (False, False, True)
    """
    if isinstance(source, str | Path):
        if Path(source).is_char_device():
            raise ImageError(
                f"{source}: expected a regular file, got a device. Name a file"
            )
        found = _FITS.fullmatch(str(source))
        return found is not None and (
            bool(found["extension"]) or bool(_image_names(found["file"]))
        )
    shape = (
        np.shape(source.data) if _is_nddata(source) else getattr(source, "shape", ())
    )
    return (
        not hasattr(source, "columns")
        and len(shape) in (2, 3)
        and sorted(shape)[-2] >= _SHORTEST
    )


def _is_nddata(source: Any) -> bool:
    """Return whether `source` is an Astropy `NDData`, such as `CCDData`."""
    return hasattr(source, "meta") and hasattr(source, "uncertainty")


def read_image(source: Any, name: str = "array") -> Image:
    """Return an image.

    Parameters
    ----------
    source : path or array_like, shape (height, width)
        FITS file, with the extension in brackets if it contains several images
        (``field.fits[SCI]``), array, masked array or `CCDData`, whose mask and uncertainty apply.
    name : str
        Name of an array.

    Raises
    ------
    ImageError
        If the source is not one two-dimensional image with light and dark pixels.
    """
    if isinstance(source, str | Path):
        name = Path(source).name
        source = _from_fits(str(source))
    content = np.ma.asarray(source.data if _is_nddata(source) else source)
    if content.ndim != 2 or min(content.shape) < _SHORTEST:
        raise ImageError(
            f"{name}: expected an image of shape (height, width) with {_SHORTEST} px or more on "
            f"each side, got {content.shape}. Pass one channel, such as image[..., 1]"
        )
    if content.dtype.kind not in "iufb":
        raise ImageError(
            f"{name}: expected real numbers, got {content.dtype}. Convert the image"
        )
    if content.size > _MOST_PIXELS:
        raise _too_large(name, content.size)
    # Single precision if it is exact: it halves the memory.
    exact = np.can_cast(content.dtype, np.float32)
    light: FloatArray = np.asarray(
        content.data, dtype=np.float32 if exact else np.float64
    )
    missing = ~np.isfinite(light) | np.ma.getmask(content)
    if _is_nddata(source) and source.mask is not None:
        with reading(f"{name}: mask"):
            missing |= np.asarray(source.mask, dtype=bool)
    if missing.any():
        light = np.where(missing, np.nan, light)
    top = float(np.iinfo(content.dtype).max) if content.dtype.kind in "iu" else math.inf
    full = light >= _highest(light, top)
    _check_range(name, light, missing, full)
    return Image(name, light, full, _step(light), _sigma(name, source, light))


def _sigma(name: str, source: Any, light: FloatArray) -> FloatArray | None:
    """Return the standard deviations of a `CCDData` with an uncertainty."""
    if not _is_nddata(source) or source.uncertainty is None:
        return None
    from astropy.nddata import StdDevUncertainty

    # Astropy squares in the type of the array, and small integers overflow.
    with reading(f"{name}: uncertainty"):
        values = type(source.uncertainty)(
            np.asarray(source.uncertainty.array, dtype=np.float64)
        )
        found = np.broadcast_to(
            values.represent_as(StdDevUncertainty).array, light.shape
        )
    if not (found[np.isfinite(light)] > 0).all():
        raise ImageError(
            f"{name}: uncertainty: expected values above zero. Mask such pixels"
        )
    return found


def _step(light: FloatArray) -> float:
    """Return the step between two digital numbers of the background."""
    every = math.isqrt(light.size // _SAMPLE) + 1
    some = light[::every, ::every].astype(np.float64)
    some = some[np.isfinite(some)]
    numbers = np.unique(some)
    at = np.searchsorted(numbers, np.median(some)) if len(some) else 0
    return float(np.diff(numbers[max(at - 1, 0) : at + 2]).min(initial=math.inf))


def _check_range(name: str, light: FloatArray, missing: Mask, full: Mask) -> None:
    """Raise `ImageError` if all pixels are missing, saturated or equal, or if one is too large."""
    seen = ~(missing | full)
    low, high = (
        float(one(light, where=seen, initial=start))
        for one, start in ((np.min, math.inf), (np.max, -math.inf))
    )
    if not low < high:
        raise ImageError(
            f"{name}: expected light and dark pixels, got {missing.sum()} missing and {full.sum()} "
            f"saturated of {light.size}, and equal values in the others. Check the image"
        )
    if max(-low, high) > _LARGEST or high - low < 1 / _LARGEST:
        raise ImageError(
            f"{name}: expected pixels of up to {_LARGEST:g} that differ by {1 / _LARGEST:g} or "
            f"more, got {low:g} to {high:g}. Scale the image"
        )


def _highest(light: FloatArray, top: float) -> float:
    """Return the value from which on pixels are saturated; infinity if none seems to be."""
    from scipy.ndimage import label

    most = np.nanmax(light, initial=-math.inf)
    at = light == most
    touching = np.bincount(label(at, np.ones((3, 3)))[0][at])
    return (
        float(most) if most == top or touching.max(initial=0) >= _PLATEAU else math.inf
    )


@contextmanager
def reading(name: str) -> Iterator[None]:
    """Raise `ImageError` with the name of the file for an error of another library."""
    try:
        yield
    except ImageError:
        raise
    except ImportError as error:
        raise ImageError(
            f"{name}: expected astropy and photutils, got no {error.name}. Install both"
        ) from error
    except MemoryError as error:
        raise ImageError(
            f"{name}: expected an image that fits into memory, got a larger one. Use a part of it"
        ) from error
    # Libraries raise several kinds of error for a damaged file.
    except (
        OSError,
        ValueError,
        TypeError,
        EOFError,
        LookupError,
        ArithmeticError,
        zlib.error,
        SyntaxError,
        Warning,
    ) as error:
        message = " ".join(str(error).split())
        if not re.match(r"(\w+: )?expected ", message):
            message = f"expected a complete and readable image, got {message!r}. Check the file"
        raise ImageError(f"{name}: {message}") from error


@contextmanager
def _units(file: str) -> Iterator[Any]:
    """Open a FITS file, and close it also if Astropy raises an error."""
    from astropy.io import fits

    path = Path(file)
    if path.exists() and not path.is_file():
        raise ImageError(
            f"{path.name}: expected a regular file, got a folder or a device. Copy it"
        )
    with (
        path.open("rb") as stream,
        fits.open(stream, memmap=False, lazy_load_hdus=False) as units,
    ):
        yield units


def _image_names(file: str) -> list[str]:
    """Return the two-dimensional images of a FITS file: names of extensions, or numbers."""
    with reading(Path(file).name), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with _units(file) as units:
            names = [unit.name for unit in units]
            return [
                unit.name
                if unit.name != "PRIMARY" and names.count(unit.name) == 1
                else str(place)
                for place, unit in enumerate(units)
                if unit.is_image and unit.header.get("NAXIS", 0) >= 2
            ]


def _from_fits(path: str) -> Any:
    """Return the data of one image of a FITS file."""
    found = _FITS.fullmatch(path)
    name = Path(path).name
    if found is None:
        raise ImageError(
            f"{name}: expected a FITS file. Read other formats into an array"
        )
    extension, images = found["extension"], _image_names(found["file"])
    if extension is None and len(images) != 1:
        raise ImageError(
            f"{name}: expected one image, got {', '.join(images) or 'none'}. Name the extension, "
            f"such as {name}[{images[0] if images else 'SCI'}]"
        )
    wanted = images[0] if extension is None else extension
    with reading(name), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", message=".*truncated")
        with _units(found["file"]) as units:
            unit = units[int(wanted) if wanted.isdecimal() else wanted]
            if not unit.is_image or not unit.shape:
                raise ImageError(
                    f"{name}: expected an extension with an image, got {wanted}"
                )
            if math.prod(unit.shape) > _MOST_PIXELS:
                raise _too_large(name, math.prod(unit.shape))
            data = np.squeeze(unit.data)
        if found["file"].lower().endswith(".gz"):  # Astropy does not read the check sum
            with gzip.open(found["file"]) as stream:
                while stream.read(_BLOCK):
                    pass
        return data


def _too_large(name: str, size: int) -> ImageError:
    return ImageError(
        f"{name}: expected an image of up to {_MOST_PIXELS:,} px, got {size:,} px. Use a part of it"
    )
