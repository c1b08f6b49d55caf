"""Version of the project, its address, and identifiers of its code and data."""

import os
import re
import subprocess
from functools import cache
from hashlib import sha1
from pathlib import Path

NAME = "reproduce-pointing"
__version__ = "0.3.0"
RELEASED = "2026-11-27"
# A person is "Family, Given". `pyproject.toml` names the same authors.
AUTHORS = ("The reproduce-pointing developers",)
# A wheel contains the commit of its checkout, and the address and the DOI of its build.
_BUILT = Path(__file__).with_name("_commit")
_LINES = _BUILT.read_text().split("\n") if _BUILT.is_file() else []
_COMMIT, _ADDRESS, _DOI = (*_LINES, "", "", "")[:3]
# Address of the published book, and DOI of its archive. Every citation contains them. They are
# empty before the publication.
ADDRESS = os.environ.get("REPRODUCE_ADDRESS", _ADDRESS).rstrip("/")
DOI = os.environ.get("REPRODUCE_DOI", _DOI)


def version() -> str:
    """Return the version, the day of its release and the commit of this package."""
    return f"{__version__}, {RELEASED}, commit {commit()[:10] or 'not recorded'}"


def software() -> str:
    """Return the name and the version of this package."""
    return f"{NAME} {version()}"


def build_record(root: Path) -> str:
    """Return the text of the file ``_commit`` of a wheel."""
    return "\n".join((commit(root), ADDRESS, DOI))


def content_id(path: Path) -> str:
    """Return the identifier of a file at Software Heritage, with the hash of Git."""
    content = path.read_bytes()
    header = f"blob {len(content)}\0".encode()
    return f"swh:1:cnt:{sha1(header + content, usedforsecurity=False).hexdigest()}"


@cache
def commit(root: Path = Path(__file__).parents[2]) -> str:
    """Return the commit of an unchanged checkout, by default of this package; empty otherwise.

    A wheel contains the commit of the checkout that it was built from.
    """
    if _LINES:
        return _COMMIT
    # Without a folder, Windows would run a program of this name in the current folder.
    name = "git.exe" if os.name == "nt" else "git"
    folders = map(Path, os.get_exec_path())
    programs = [f / name for f in folders if f.is_absolute() and (f / name).is_file()]
    if not programs or not (root / ".git").exists():
        return ""
    query = ("status", "--porcelain=v2", "--branch", "--untracked-files=no")
    try:
        status = subprocess.run(
            [programs[0], "--no-optional-locks", "-C", root, *query],
            check=True,
            capture_output=True,
            text=True,
        ).stdout
    except (OSError, subprocess.CalledProcessError):
        return ""
    # A changed file has a line after the header.
    unchanged = re.fullmatch(r"# branch\.oid (\w+)\n(#.*\n)*", status)
    return unchanged[1] if unchanged else ""
