"""A user's own pictures, from files or arrays: light, and which pixels of it can be used.

FITS is read by astropy, TIFF by tifffile, what else there is by Pillow (the extra ``images``); none
is loaded before a picture is read. Arrays are [y, x], the centre of the first pixel at (0, 0). A
colour picture is split into its channels. A Bayer mosaic stays one picture: of each channel the
pixels under its filter are seen, at their own places.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
Mask = NDArray[np.bool_]

_FITS = (".fits", ".fit", ".fts", ".fz", ".fits.gz", ".fit.gz", ".fts.gz")
_TIFF = (".tif", ".tiff")
_OTHERS = (".png", ".jpg", ".jpeg", ".bmp", ".gif", ".webp")
COLOURS = ("red", "green", "blue")
# An array whose sides are shorter is no picture.
_LEAST = 16
# So many pixels tell the gap between two numbers.
_SOME = 100_000
# So many touching pixels share the highest value where a spot is cut off.
_PLATEAU = 4


class PictureError(ValueError):
    """A picture cannot be used; the message names it and says why."""


# What a file holds, its header, and what to hear of it.
_Read = tuple[Any, Mapping[str, Any], tuple[str, ...]]


@dataclass(frozen=True, eq=False)
class Picture:
    """One channel of a picture.

    - `name`: the file or what else it comes from, and the channel of several.
    - `light`: digital numbers, (height, width); not a number where one is missing, or under
      the filter of another colour.
    - `full`: pixels that are saturated.
    - `step`: between two numbers of the background, next to nothing where they are not digital.
    - `pitch`: from a pixel to the next of the channel: 2 in a mosaic.
    - `notes`: what a user should hear of the reading.
    """

    name: str
    light: FloatArray
    full: Mask
    step: float = 0.0
    pitch: int = 1
    notes: tuple[str, ...] = ()


def is_picture(source: object) -> bool:
    """Say whether something is a picture: a file by its ending, or an array that is wide enough.

    Examples
    --------
    >>> is_picture("red.fits"), is_picture("stars.csv"), is_picture(np.zeros((99, 2)))
    (True, False, False)
    """
    if isinstance(source, str | Path):
        return str(source).lower().endswith((*_FITS, *_TIFF, *_OTHERS))
    shape = getattr(source, "shape", ())
    return hasattr(source, "dtype") and len(shape) in (2, 3) and sorted(shape)[-2] >= _LEAST


def read_pictures(source: Any, bayer: str | None = None, name: str = "array") -> dict[str, Picture]:
    """Read a picture; return its channels by name, the only one of a grey picture under "".

    Parameters
    ----------
    source : path or array_like, shape (height, width) or (height, width, 3)
    bayer : str, optional
        The colours of a mosaic's first two by two pixels, row by row, such as "RGGB".
    name : str
        Of an array.

    A pixel is full from the number that the file says, else at the largest number of its type or at
    one that touching pixels share as their highest.
    """
    if isinstance(source, str | Path):
        name, (content, header, notes) = Path(source).name, _file(Path(source))
    else:
        content, header, notes = getattr(source, "value", source), {}, ()
    content = np.ma.asarray(content)
    planes = _planes(name, content)
    pattern = bayer.upper() if bayer else str(header.get("BAYERPAT", "")).strip().upper()
    if bayer and len(planes) > 1:
        raise PictureError(f"{name}: expected a mosaic of one channel, got {len(planes)} channels")
    level = header.get("SATURATE")
    top = float(np.iinfo(content.dtype).max) if content.dtype.kind in "iu" else math.inf
    found = {}
    for colour, plane in planes.items():
        light = np.ma.masked_invalid(plane.astype(np.float64)).filled(np.nan)
        full = light >= (_highest(light, top) if level is None else float(level))
        label = f"{name}, {colour}" if colour else name
        _refuse_dark(label, light, full)
        found[colour] = Picture(label, light, full, _step(light), notes=notes)
    return _mosaic(found[""], pattern) if pattern and "" in found else found


def _step(light: FloatArray) -> float:
    """Return the gap between two numbers of the background, by some of the pixels."""
    known = light[np.isfinite(light)]
    some = known[:: max(len(known) // _SOME, 1)]
    numbers = np.unique(some)
    at = np.searchsorted(numbers, np.median(some))
    return float(np.diff(numbers[max(at - 1, 0) : at + 2]).min(initial=math.inf))


def _refuse_dark(name: str, light: FloatArray, full: Mask) -> None:
    """Refuse a picture in which there is nothing to see; say what there is instead."""
    missing = np.isnan(light)
    seen = light[~missing & ~full]
    if not len(seen) or not np.ptp(seen):
        raise PictureError(
            f"{name}: expected light and dark pixels, got {missing.sum()} missing and {full.sum()} "
            f"at the highest number of {light.size}, the others alike"
        )


def _highest(light: FloatArray, top: float) -> float:
    """Return from where on pixels are full: infinity where none seems to be."""
    from scipy.ndimage import label

    most = np.nanmax(light, initial=-math.inf)
    touching = np.bincount(label(light == most, np.ones((3, 3)))[0].ravel())[1:]
    return float(most) if most == top or touching.max(initial=0) >= _PLATEAU else math.inf


def _planes(name: str, content: Any) -> dict[str, Any]:
    """Return the channels of an array, by name."""
    content = content.squeeze()
    if content.ndim == 3 and content.shape[0] == len(COLOURS):
        content = np.moveaxis(content, 0, -1)
    if content.ndim == 2 and min(content.shape) >= _LEAST:
        return {"": content}
    if content.ndim == 3 and content.shape[-1] in (3, 4) and min(content.shape[:2]) >= _LEAST:
        return {colour: content[..., i] for i, colour in enumerate(COLOURS)}
    raise PictureError(f"{name}: expected 1 or 3 channels of {_LEAST}+ px, got {content.shape}")


def _mosaic(picture: Picture, pattern: str) -> dict[str, Picture]:
    """Return the channels of a mosaic: of each the pixels under its filter."""
    if sorted(pattern) != ["B", "G", "G", "R"]:
        raise PictureError(f"bayer: expected R, G, G and B in some order, got {pattern!r}")
    found = {}
    for colour in COLOURS:
        light = np.full_like(picture.light, np.nan)
        for y, x in (divmod(i, 2) for i, one in enumerate(pattern) if one == colour[0].upper()):
            light[y::2, x::2] = picture.light[y::2, x::2]
        found[colour] = replace(picture, name=f"{picture.name}, {colour}", light=light, pitch=2)
    return found


@contextmanager
def telling(name: str, told: str = "") -> Iterator[None]:
    """Say in a line why a picture cannot be used, or what it takes."""
    try:
        yield
    except ImportError as error:
        raise PictureError(
            f'{name}: this needs {error.name}: pip install "reproduce-pointing[images]"'
        ) from error
    # What libraries raise over a broken file is not one kind of error.
    except (OSError, ValueError, TypeError, EOFError, IndexError, SyntaxError, Warning) as error:
        raise PictureError(f"{name}: {told}{' '.join(str(error).split())}") from error


def fits_table(path: Path) -> Any:
    """Return the first table of a FITS file; what is wrong with it is told as of a picture."""
    with telling(path.name):
        from astropy.io import fits

        return fits.getdata(path)


def _file(path: Path) -> _Read:
    name = str(path).lower()
    others = _from_tiff if name.endswith(_TIFF) else _from_pillow
    with telling(path.name, "cannot be read: "):
        return (_from_fits if name.endswith(_FITS) else others)(path)


def _from_fits(path: Path) -> _Read:
    from astropy.io import fits

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.filterwarnings("error", message=".*truncated")
        with path.open("rb") as file, fits.open(file, memmap=False) as units:
            for unit in units:
                if unit.is_image and unit.header.get("NAXIS", 0) >= 2:
                    return unit.data, {**units[0].header, **unit.header}, ()
    raise ValueError("expected a picture, got tables alone")


def _from_tiff(path: Path) -> _Read:
    import tifffile

    try:
        return tifffile.imread(path), {}, ()
    except ValueError:  # a compression that tifffile leaves to another package
        return _from_pillow(path)


def _from_pillow(path: Path) -> _Read:
    from PIL import Image

    with Image.open(path) as opened:
        deep = opened.mode == "RGB" and any(";16" in str(tile[3]) for tile in opened.tile)
        notes = ("16 bits of each colour are read as 8: save it as TIFF",) * deep
        grey = opened.mode == "L" or opened.mode.startswith(("I", "F"))
        light = np.asarray(opened if grey else opened.convert("RGB"))
        # Grey, though written as a palette or with transparency.
        light = light[..., 0] if light.ndim == 3 and not np.ptp(light, axis=2).any() else light
        if opened.format != "JPEG":
            return light, {}, notes
    # A camera writes sRGB: undone, so that light adds up, with the full pixels still the highest.
    encoded = light / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return 255 * linear, {"SATURATE": 255.0}, ("sRGB turned into linear light",)
