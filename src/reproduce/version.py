"""Version of the project, date of its release, and commit of the code."""

import subprocess
from functools import cache
from pathlib import Path

NAME = "reproduce-pointing"
__version__ = "0.2.0"
RELEASED = "2026-11-25"
# Address of the published book, without a slash at its end, and DOI of its archive. Every citation
# contains them. They are empty before the publication.
ADDRESS = ""
DOI = ""


def version() -> str:
    """Return the version, the day of its release and the commit of this package."""
    name = commit(Path(__file__).parents[2]) or "not recorded"
    return f"{__version__}, {RELEASED}, commit {name}"


def software() -> str:
    """Return the name and the version of this package."""
    return f"{NAME} {version()}"


@cache
def commit(root: Path) -> str:
    """Return the abbreviated commit of an unchanged checkout; empty otherwise.

    A wheel contains the commit of the checkout that it was built from.
    """
    built = Path(__file__).with_name("_commit")
    if built.is_file():
        return built.read_text()
    if not (root / ".git").exists():
        return ""
    queries = (
        ("status", "--porcelain", "--untracked-files=no"),
        ("rev-parse", "--short=10", "HEAD"),
    )
    try:
        changed, name = (
            subprocess.run(
                ["git", "--no-optional-locks", "-C", root, *words],
                check=True,
                capture_output=True,
                text=True,
            ).stdout.strip()
            for words in queries
        )
    except (OSError, subprocess.CalledProcessError):
        return ""
    return "" if changed else name
