"""What a build of the book was made of, and what of it may stay.

Notebooks are executed through a cache whose key is their text alone, and Sphinx looks at a page's
own source alone: a change in the code, the data, the locked packages or our extensions of Sphinx
would leave old numbers and old pages standing. The digests of all of these are kept beside the
pages, and what was made of other files is removed.
"""

import hashlib
import json
import re
import shutil
import sys
from collections.abc import Iterator
from pathlib import Path

from reproduce.store.files import write_text

ROOT = Path(__file__).resolve().parent.parent
BUILD = "book/_build"
# What the numbers depend on, the pages whose cells compute numbers of sentences, what every page
# depends on, and what the whole book depends on.
PARTS = {
    "numbers": ("src", "data", "environment.txt"),
    "quoted": ("book/instruments",),
    "pages": (
        "book/_ext",
        "book/_config.yml",
        "book/_toc.yml",
        "tools",
        "pyproject.toml",
        "README.md",
    ),
    "book": ("book", "CHANGELOG.md", "CITATION.cff"),
}
# The lines of a page that other pages show or count: headings, labels, citations, directives, and
# the beginning of the file, which names the kernel. All others are the page's own.
SHARED = re.compile(r"\s*(#|\(|\$\$|:|`{3}|\{|<|---|\w+:)|.*\{cite")
# Made by the build itself, or by Python.
MADE = {"_build", "_extra", "__pycache__"}


def input_files(root: Path, part: str) -> Iterator[Path]:
    """Yield every file of a part, in a fixed order."""
    for name in PARTS[part]:
        start = root / name
        found = [start] if start.is_file() else sorted(start.rglob("*"))
        for path in found:
            if path.is_file() and not MADE & set(path.relative_to(root).parts):
                yield path


def digest(root: Path, part: str) -> str:
    """Return one SHA-256 over the names and contents of a part's files, and Python's version."""
    total = hashlib.sha256(sys.version.encode())
    for path in input_files(root, part):
        content = hashlib.sha256(path.read_bytes()).hexdigest()
        total.update(f"{path.relative_to(root).as_posix()} {content}\n".encode())
    return total.hexdigest()


def structure(root: Path) -> str:
    """Return one SHA-256 over the lines of the book's sources that matter beyond their own page."""
    total = hashlib.sha256()
    for path in input_files(root, "book"):
        total.update(f"{path.relative_to(root).as_posix()}\n".encode())
        if path.suffix != ".md":
            total.update(path.read_bytes())
            continue
        lines = path.read_text(encoding="utf-8").splitlines()
        total.update("\n".join(line for line in lines if SHARED.match(line)).encode())
    return total.hexdigest()


class State:
    """What the built book of a checkout was made of, beside what the checkout is now.

    Parameters
    ----------
    root : pathlib.Path
        The checkout.
    """

    def __init__(self, root: Path) -> None:
        self.build = root / BUILD
        self.file = self.build / "made-of.json"
        self.present = {part: digest(root, part) for part in PARTS}
        self.present["structure"] = structure(root)

    def drop_stale(self) -> bool:
        """Remove what was made of other files, and return whether the book stands as it should.

        Where more than sentences and cells of single pages has changed, all written pages go: those
        of a page or module that is gone, or whose neighbours have changed, would otherwise stay.
        """
        try:
            known = json.loads(self.file.read_text())
        except (OSError, ValueError):  # no file, or a damaged file
            known = {}
        if known == self.present and (self.build / "html" / "index.html").is_file():
            return True
        if known.get("numbers") != self.present["numbers"]:
            shutil.rmtree(self.build, ignore_errors=True)
        elif known.get("pages") != self.present["pages"]:
            for name in (".doctrees", "wheel"):
                shutil.rmtree(self.build / name, ignore_errors=True)
        if known.get("quoted") != self.present["quoted"]:
            (self.build / "facts.json").unlink(missing_ok=True)
        if {**known, "book": "", "quoted": ""} != {
            **self.present,
            "book": "",
            "quoted": "",
        }:
            shutil.rmtree(self.build / "html", ignore_errors=True)
        # A page that was read and warned of is not warned of again: should this build be cut short,
        # the next one reads all pages.
        self._write({"numbers": self.present["numbers"]})
        return False

    def remember(self) -> None:
        """Write down that the whole book is built."""
        self._write(self.present)

    def _write(self, made_of: dict[str, str]) -> None:
        self.build.mkdir(parents=True, exist_ok=True)
        write_text(self.file, json.dumps(made_of, indent=2) + "\n")
