"""Locations of the papers and their data: in the checkout or the wheel, and on a search path.

The search path is the environment variable ``REPRODUCE_PATH``. Each folder on it has the layout of
the project: ``data/`` with printed numbers, items, references, errata and frozen verdicts, and
``papers/`` with one package for each paper. No file of the project changes for a new paper.
"""

from __future__ import annotations

import os
import re
import tomllib
from functools import cache
from pathlib import Path
from typing import Any

_ENTRY = re.compile(r"^@\w+\{([^,\s]+),", re.MULTILINE)


@cache
def data_folder() -> Path:
    """Return the data folder of the project.

    Returns
    -------
    pathlib.Path
        `data/` of the checkout, or the copy in the wheel.

    Raises
    ------
    FileNotFoundError
        If neither exists, because the installation is broken.

    Examples
    --------
    >>> data_folder().is_dir()
    True
    """
    package = Path(__file__).parent
    candidates = (package.parent.parent / "data", package / "_data")
    for folder in candidates:
        if (folder / "printed").is_dir():
            return folder
    raise FileNotFoundError(
        f"data: expected printed numbers in one of {', '.join(map(str, candidates))}, got none. "
        "Reinstall the package or run it from a complete checkout"
    )


def search_path() -> list[Path]:
    """Return the folders of further papers, from ``REPRODUCE_PATH``."""
    parts = os.environ.get("REPRODUCE_PATH", "").split(os.pathsep)
    return [Path(part) for part in parts if part]


@cache
def data_folders() -> tuple[Path, ...]:
    """Return the data folder of the project, then the data folders on the search path."""
    return (data_folder(), *(folder / "data" for folder in search_path()))


def data_files(name: str) -> list[Path]:
    """Return the files with a name in the data folders, such as ``captions/niu2024.toml``."""
    paths = (folder / name for folder in data_folders())
    return [path for path in paths if path.is_file()]


def read_toml(path: Path, kind: Any) -> Any:
    """Return the content of a TOML file as a type; an error names the file and every fault."""
    from pydantic import TypeAdapter  # slow to import

    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        return TypeAdapter(kind).validate_python(content)
    except ValueError as error:  # of pydantic or of TOML
        raise ValueError(f"{path}: {error}") from error


@cache
def papers() -> dict[str, Path]:
    """Return the data folder of every paper by its name.

    Returns
    -------
    dict
        In the order of the entries of each folder's ``references.bib``.

    Raises
    ------
    FileNotFoundError
        If a folder on the search path has no ``references.bib``.
    ValueError
        If a paper with printed numbers has no entry, or two folders hold the same paper.

    Examples
    --------
    >>> list(papers())[:2]
    ['niu2024', 'chen2023']
    """
    folders: dict[str, Path] = {}
    for folder in data_folders():
        entries = _ENTRY.findall(
            (folder / "references.bib").read_text(encoding="utf-8")
        )
        printed = {
            path.name for path in (folder / "printed").iterdir() if path.is_dir()
        }
        if strays := printed - {*entries} | printed & {*folders}:
            raise ValueError(
                f"{folder}: expected one entry of references.bib for each paper in printed/, and "
                f"each paper in one folder, got {', '.join(sorted(strays))}. Correct these papers"
            )
        folders |= {name: folder for name in entries if name in printed}
    return folders
