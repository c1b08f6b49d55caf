"""Where the project's data lie: in the checkout, or in the copy that a wheel carries."""

from __future__ import annotations

from pathlib import Path


def data_folder() -> Path:
    """Return the folder that holds the project's data.

    Returns
    -------
    pathlib.Path
        `data/` of the checkout if the package runs from one, else the wheel's own copy.

    Raises
    ------
    FileNotFoundError
        If neither exists, that is, if the installation is broken.

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
        f"expected the printed numbers in one of {', '.join(map(str, candidates))}, found none; "
        "reinstall the package or run it from a complete checkout"
    )
