"""Write an archive of wheel, lock and notebooks, which run without the checkout."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile, ZipInfo

from reproduce.store import studies
from reproduce.version import RELEASED

ARCHIVE = "downloads/reproduce-book.zip"
# The library and JupyterLab, without what builds the pages.
LOCK = "tools/environment-notebooks.txt"
INSTALL = (
    "python -m venv .venv",
    ".venv/bin/python -m pip install -r environment.txt",
    ".venv/bin/python -m pip install --no-deps reproduce_pointing-*.whl",
)
OPEN = ".venv/bin/python -m jupyter lab notebooks"
README = """The book "Pointing, reproduced", to run and to change.

Install, once, with Python 3.11 or newer:

{install}

Open the notebooks:

    {open}

On Windows the programs are in .venv\\Scripts instead of .venv/bin. environment.txt contains every
package with its hash: the library and JupyterLab, not the tools of the book. They take {size} MB.
The notebooks are independent of each other. `.venv/bin/reproduce` is the command line.
"""


def readme() -> str:
    """Return the instructions of the archive."""
    install = "\n".join(f"    {line}" for line in INSTALL)
    (taken,) = studies.table("installed").itertuples()
    return README.format(install=install, open=OPEN, size=taken.megabytes)


def build_wheel(root: Path, folder: Path, *what: str) -> None:
    """Build the wheel of a checkout into a folder; further options are those of uv."""
    folder.mkdir(parents=True, exist_ok=True)
    day = datetime.fromisoformat(RELEASED).replace(tzinfo=UTC)
    dated = os.environ | {"SOURCE_DATE_EPOCH": str(int(day.timestamp()))}
    command = [
        sys.executable,
        "-m",
        "uv",
        "build",
        "--quiet",
        "--no-build-isolation",
        "--wheel",
    ]
    command += [*what, "--python", sys.executable, "--out-dir", str(folder), str(root)]
    subprocess.run(command, check=True, env=dated)
    (folder / ".gitignore").unlink(missing_ok=True)


def contents(root: Path, build: Path) -> Iterator[tuple[str, bytes]]:
    """Yield the files of the archive, by name."""
    yield "README.txt", readme().encode()
    yield "environment.txt", (root / LOCK).read_bytes()
    (wheel,) = (build / "wheel").glob("*.whl")
    yield wheel.name, wheel.read_bytes()
    folder = build / "notebooks"
    for path in sorted(folder.rglob("*.ipynb")):
        yield f"notebooks/{path.relative_to(folder).as_posix()}", path.read_bytes()


def pack(root: Path) -> Path:
    """Write the archive of a built book and its wheel, and return the path of the archive.

    Equal files give an equal archive.
    """
    build = root / "book" / "_build"
    archive = build / "html" / ARCHIVE
    archive.parent.mkdir(parents=True, exist_ok=True)
    (wheel,) = (build / "wheel").glob("*.whl")
    shutil.copy(wheel, archive.parent)
    write_zip(archive, "reproduce-book", contents(root, build))
    return archive


def write_zip(archive: Path, folder: str, files: Iterable[tuple[str, bytes]]) -> None:
    """Write files, by name, into a folder of an archive, with a fixed date."""
    with ZipFile(archive, "w") as file:
        for name, content in files:
            entry = ZipInfo(f"{folder}/{name}", (1980, 1, 1, 0, 0, 0))
            entry.external_attr = 0o644 << 16
            file.writestr(entry, content, ZIP_DEFLATED)
