"""A user's own pictures, from files or arrays: light, and which pixels of it can be used.

FITS is read by astropy, TIFF by tifffile, what else there is by Pillow (the extra ``images``); none
is loaded before a picture is read. Arrays are [y, x], the centre of the first pixel at (0, 0). A
colour picture is split into its channels. A Bayer mosaic stays one picture: of each channel the
pixels under its filter are seen, at their own places.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

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


class _Read(NamedTuple):
    """What a file holds, its header, and what to hear of it."""

    content: Any
    header: Mapping[str, Any]
    notes: tuple[str, ...] = ()


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
    array = hasattr(source, "dtype") and not hasattr(source, "iloc")
    return array and len(shape) in (2, 3) and sorted(shape)[-2] >= _LEAST


def read_pictures(source: Any, bayer: str | None = None) -> dict[str, Picture]:
    """Read a picture; return its channels by name, the only one of a grey picture under "".

    Parameters
    ----------
    source : path or array_like, shape (height, width) or (height, width, 3)
    bayer : str, optional
        The colours of a mosaic's first two by two pixels, row by row, such as "RGGB".

    A pixel is full from the number that the file says, else at the largest number of its type or at
    one that touching pixels share as their highest.
    """
    if isinstance(source, str | Path):
        name, read = Path(source).name, _file(Path(source))
    else:
        name, read = "the array", _Read(np.ma.asarray(getattr(source, "value", source)), {}, ())
    content, header, notes = read
    if content.dtype.kind not in "biuf":
        raise PictureError(f"{name}: expected numbers, got {content.dtype}")
    planes = _planes(name, content)
    pattern = bayer.upper() if bayer else str(header.get("BAYERPAT", "")).strip().upper()
    if bayer and len(planes) > 1:
        raise PictureError(f"{name}: expected a mosaic of one channel, got {len(planes)} channels")
    level = header.get("SATURATE")
    top = float(np.iinfo(content.dtype).max) if content.dtype.kind in "iu" else math.inf
    found = {}
    for colour, plane in planes.items():
        light = np.ma.filled(plane.astype(np.float64), np.nan)
        light[~np.isfinite(light)] = np.nan
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
    if np.isnan(light).all():
        raise PictureError(f"{name}: expected light, got no number in any pixel")
    if np.nanmin(light) == np.nanmax(light):
        raise PictureError(
            f"{name}: expected light and dark pixels, got {np.nanmax(light):g} in every "
            "one: saturated or empty"
        )
    if (full | np.isnan(light)).all():
        raise PictureError(f"{name}: expected light, got every pixel saturated")


def _highest(light: FloatArray, top: float) -> float:
    """Return from where on pixels are full: infinity where none seems to be."""
    from scipy.ndimage import label

    most = np.nanmax(light, initial=-math.inf)
    touching = np.bincount(label(light == most, np.ones((3, 3)))[0].ravel())[1:]
    return float(most) if most == top or touching.max(initial=0) >= _PLATEAU else math.inf


def _planes(name: str, content: Any) -> dict[str, Any]:
    """Return the channels of an array, by name."""
    content = content if content.ndim < 3 else content[tuple(
        slice(None) if size > 1 else 0 for size in content.shape)]  # fmt: skip
    if content.ndim == 3 and content.shape[0] == len(COLOURS):
        content = np.moveaxis(content, 0, -1)
    if content.ndim == 2 and min(content.shape) >= _LEAST:
        return {"": content}
    if content.ndim == 3 and content.shape[-1] in (3, 4) and min(content.shape[:2]) >= _LEAST:
        return {colour: content[..., i] for i, colour in enumerate(COLOURS)}
    raise PictureError(
        f"{name}: expected one picture or three channels, at least {_LEAST} px wide and high, got "
        f"shape {content.shape}"
    )


def _mosaic(picture: Picture, pattern: str) -> dict[str, Picture]:
    """Return the channels of a mosaic: of each the pixels under its filter."""
    if sorted(pattern) != ["B", "G", "G", "R"]:
        raise PictureError(f"bayer: expected R, G, G and B in some order, got {pattern!r}")
    found = {}
    for colour in COLOURS:
        light = np.full_like(picture.light, np.nan)
        for y, x in (divmod(i, 2) for i, one in enumerate(pattern) if one == colour[0].upper()):
            light[y::2, x::2] = picture.light[y::2, x::2]
        name = f"{picture.name}, {colour}"
        found[colour] = replace(picture, name=name, light=light, pitch=2)
    return found


def fits_table(path: Path) -> Any:
    """Return the first table of a FITS file; what is wrong with it is told as of a picture."""
    return _told(path, _table).content


def _file(path: Path) -> _Read:
    """Return what a file holds, its header, and what to hear of it."""
    name = str(path).lower()
    others = _from_tiff if name.endswith(_TIFF) else _from_pillow
    return _told(path, _from_fits if name.endswith(_FITS) else others)


def _told(path: Path, read: Callable[[Path], _Read]) -> _Read:
    """Read a file; say in a line what is wrong with it."""
    if not path.stat().st_size:
        raise PictureError(f"{path.name}: expected a picture, got an empty file")
    try:
        return read(path)
    except PictureError:
        raise
    except ImportError as error:
        raise PictureError(
            f'{path.name}: reading it needs {error.name}: pip install "reproduce-pointing[images]"'
        ) from error
    # What libraries raise over a broken file is not one kind of error.
    except (OSError, ValueError, TypeError, EOFError, IndexError, SyntaxError, Warning) as error:
        cause = " ".join(str(error).split())
        raise PictureError(
            f"{path.name}: expected a whole picture, got one that cannot be read ({cause})"
        ) from error


def _from_fits(path: Path) -> _Read:
    from astropy.io import fits

    with (
        warnings.catch_warnings(record=True) as told,
        path.open("rb") as file,
        fits.open(file, memmap=False) as units,
    ):
        warnings.simplefilter("always")
        for number, unit in enumerate(units):
            if cut := [str(one.message) for one in told if "truncated" in str(one.message)]:
                raise OSError(cut[0])
            if unit.is_image and unit.header.get("NAXIS", 0) >= 2 and unit.data is not None:
                header = {**units[0].header, **unit.header}
                native = unit.data.astype(unit.data.dtype.newbyteorder("="), copy=True)
                notes = (f"picture of extension {number}",) if number else ()
                return _Read(np.ma.asarray(native), header, notes)
    raise PictureError(f"{path.name}: expected a picture in the FITS file, got tables alone")


def _table(path: Path) -> _Read:
    from astropy.io import fits

    return _Read(fits.getdata(path), {})


def _from_tiff(path: Path) -> _Read:
    import tifffile

    try:
        return _Read(np.ma.asarray(tifffile.imread(path)), {})
    except ValueError:  # a compression that tifffile leaves to another package
        return _from_pillow(path)


def _from_pillow(path: Path) -> _Read:
    from PIL import Image

    with Image.open(path) as opened:
        deep = any(";16" in str(tile[3]) for tile in opened.tile) and opened.mode == "RGB"
        notes: tuple[str, ...] = ()
        notes += ("16 bits of each colour are read as 8: save it as TIFF",) * deep
        grey = opened.mode in ("L", "1") or opened.mode.startswith(("I", "F"))
        light = np.asarray(opened if grey else opened.convert("RGB"))
        light = light.astype(np.uint8) if light.dtype == bool else light
        # Grey, though written as a palette or with transparency.
        light = light[..., 0] if light.ndim == 3 and not np.ptp(light, axis=2).any() else light
        if opened.format != "JPEG":
            return _Read(np.ma.asarray(light), {}, notes)
    # A camera writes sRGB: undone, so that light adds up, with the full pixels still the highest.
    encoded = light / 255
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    notes = (*notes, "sRGB turned into linear light")
    return _Read(np.ma.asarray(255 * linear), {"SATURATE": 255.0}, notes)
