"""Build the book, doing again only what has to be done: ``make book``.

1. Files that were made of other sources are removed; if nothing has changed, that is all.
2. `run_notebooks` computes numbers and pages on every core.
3. Jupyter Book reads and writes the pages that have changed.
4. The descriptions of the project are added, with the address of the book.
5. `pack_book` puts wheel, lock and notebooks into one archive.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from pack_book import build_wheel, pack
from release import DESCRIBE
from reproduce.store.files import write_text
from reproduce.version import ADDRESS, DOI

ROOT = Path(__file__).resolve().parent.parent
# Jupyter Book as on its own command line: every warning is an error, all are shown.
JUPYTER_BOOK = (sys.executable, "-c", "from jupyter_book.cli.main import main; main()")
STRICT = ("-W", "--keep-going", "-n")
# Sources of the numbers, of all pages in addition, and of single pages in addition.
SOURCES = {
    "numbers": ("src", "data", "environment.txt"),
    "pages": ("book/_ext", "book/_config.yml", "book/_toc.yml", "tools", "README.md"),
    "book": ("book", "pyproject.toml", "CHANGELOG.md", "CITATION.cff"),
}
# Folders that the build itself or Python makes.
MADE = {"_build", "_extra", "__pycache__"}


def source_files(root: Path, part: str) -> Iterator[Path]:
    """Yield the source files of a part, in a fixed order."""
    for start in (root / name for name in SOURCES[part]):
        for path in [start] if start.is_file() else sorted(start.rglob("*")):
            if path.is_file() and not MADE & set(path.relative_to(root).parts):
                yield path


def digests(root: Path) -> dict[str, str]:
    """Return a SHA-256 of each part: Python's version, addresses, names and contents of files."""
    found = {}
    for part in SOURCES:
        total = hashlib.sha256(f"{sys.version} {ADDRESS} {DOI}".encode())
        for path in source_files(root, part):
            total.update(path.relative_to(root).as_posix().encode())
            total.update(hashlib.sha256(path.read_bytes()).digest())
        found[part] = total.hexdigest()
    return found


def drop_stale(root: Path) -> bool:
    """Remove what was made of other sources, and return whether the book is up to date."""
    build = root / "book" / "_build"
    made_of, present = build / "made-of.json", digests(root)
    try:
        known = json.loads(made_of.read_text())
    except (OSError, ValueError):  # no file, or a damaged file
        known = {}
    if known == present and (build / "html" / "index.html").is_file():
        return True
    stale = [build / "html"]
    if known.get("pages") != present["pages"]:
        stale += [build / ".doctrees", build / "wheel"]
    if known.get("numbers") != present["numbers"]:
        stale = [build]
    for folder in stale:
        shutil.rmtree(folder, ignore_errors=True)
    # A page that was read with a warning must be read again if this build is cut short.
    remember(root, numbers=present["numbers"])
    return False


def remember(root: Path, **made_of: str) -> None:
    """Write the digests of the sources of the present build."""
    file = root / "book" / "_build" / "made-of.json"
    file.parent.mkdir(parents=True, exist_ok=True)
    write_text(file, json.dumps(made_of, indent=2) + "\n")


def build(root: Path) -> int:
    """Build the book of a checkout and return the exit code."""
    if drop_stale(root):
        print("Nothing has changed since the last build.")
        return 0
    from run_notebooks import compute, cores

    book, begin = root / "book", time.perf_counter()
    if not compute(book, cores()):
        return 1
    print(f"Numbers and notebooks: {time.perf_counter() - begin:.0f} s", flush=True)
    begin = time.perf_counter()
    command = (*JUPYTER_BOOK, "build", str(book), *STRICT)
    if code := subprocess.run(command, check=False).returncode:
        return code
    for name, text in DESCRIBE.items():
        if "/" not in name:
            write_text(book / "_build" / "html" / name, text())
    wheel = book / "_build" / "wheel"
    if not wheel.is_dir():
        build_wheel(root, wheel)
    pack(root)
    print(f"Pages: {time.perf_counter() - begin:.0f} s", flush=True)
    remember(root, **digests(root))
    return 0


if __name__ == "__main__":
    if code := build(ROOT):
        sys.exit(code)
    print(f"\nThe book is ready. Open {ROOT / 'book/_build/html/index.html'}")
