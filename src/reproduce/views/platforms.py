"""A user's own lights and tracker, from a file."""

from __future__ import annotations

import inspect
import tomllib
from pathlib import Path
from typing import Any

from reproduce.physics.attitude import Platform
from reproduce.store.points import TableFileError


def platform_of(source: Platform | str | Path) -> Platform:
    """Return a platform, as it is or from a TOML file of the arguments that make one.

    Beside the tracker's numbers stand ``lasers`` and ``camera_focal_length``, or ``directions``, or
    ``spots`` alone.
    """
    if isinstance(source, Platform):
        return source
    try:
        table = tomllib.loads(Path(source).read_text(encoding="utf-8"))
    except (tomllib.TOMLDecodeError, UnicodeError) as error:
        raise TableFileError(f"{source}: expected TOML ({error})") from error
    make: Any = Platform if "lasers" in table else Platform.of_spots
    make = Platform.of_directions if "directions" in table else make
    known = inspect.signature(make).parameters
    needed = {name for name, one in known.items() if one.default is one.empty}
    if set(table) - set(known) or needed - set(table):
        raise TableFileError(f"{source}: expected {', '.join(known)}, got {', '.join(table)}")
    try:
        platform: Platform = make(**table)
    except (TypeError, ValueError) as error:
        raise TableFileError(f"{source}: {error}") from error
    return platform
