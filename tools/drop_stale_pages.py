"""Clear the way for a build: old pages, and notebooks whose results may be old.

Notebooks are executed through a cache whose key is their text alone, so a
change in the code, in the data or in the locked packages would leave old
numbers standing. The digest of those is kept beside the pages.
"""

import hashlib
import shutil
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
INPUTS = ("src", "data", "environment.txt")
BUILD = "book/_build"
DIGEST = "inputs.sha256"


def input_files(root: Path) -> Iterator[Path]:
    """Yield every file that a notebook's result may depend on, in a fixed order."""
    for name in INPUTS:
        start = root / name
        found = [start] if start.is_file() else start.rglob("*")
        yield from sorted(
            path for path in found if path.is_file() and "__pycache__" not in path.parts
        )


def digest(root: Path) -> str:
    """Return one SHA-256 over the names and contents of all inputs."""
    total = hashlib.sha256()
    for path in input_files(root):
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        total.update(f"{path.relative_to(root).as_posix()} {content}\n".encode())
    return total.hexdigest()


def drop_stale_pages(root: Path) -> bool:
    """Remove the pages, and the executed notebooks unless nothing they use has changed.

    Pages always go: those of a page or module that is gone, or whose style has
    changed, would otherwise stay. Returns whether the notebooks went too.
    """
    build = root / BUILD
    recorded = build / DIGEST
    present = digest(root)
    if recorded.is_file() and recorded.read_text() == present:
        shutil.rmtree(build / "html", ignore_errors=True)
        return False
    shutil.rmtree(build, ignore_errors=True)
    build.mkdir(parents=True)
    recorded.write_text(present)
    return True


if __name__ == "__main__":
    if drop_stale_pages(ROOT):
        print("Code, data or packages changed: every notebook is executed again.")
