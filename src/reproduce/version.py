"""The version of the project, the day of its release and the commit that computes."""

import subprocess
from functools import cache
from pathlib import Path

NAME = "reproduce-pointing"
__version__ = "0.2.0"
RELEASED = "2026-11-25"
# Where the book is published, without a slash at its end, and the DOI of its archive; empty while
# there is none. Every citation takes them from here.
ADDRESS = ""
DOI = ""


def version() -> str:
    """Return the version, the day of its release and the commit of this package."""
    found = commit(Path(__file__).parents[2]) or "not recorded"
    return f"{__version__}, {RELEASED}, commit {found}"


def software() -> str:
    """Return the name and the version of this package."""
    return f"{NAME} {version()}"


@cache
def commit(root: Path) -> str:
    """Return the commit of a checkout, shortened; nothing elsewhere, or where files differ.

    A wheel carries that of the checkout that it was built from.
    """
    built = Path(__file__).with_name("_commit")
    if built.is_file():
        return built.read_text()
    if not (root / ".git").exists():
        return ""
    asked = (
        ("status", "--porcelain", "--untracked-files=no"),
        ("rev-parse", "--short=10", "HEAD"),
    )
    try:
        changed, found = (
            subprocess.run(
                ["git", "--no-optional-locks", "-C", root, *words],
                check=True,
                capture_output=True,
                text=True,
            ).stdout.strip()
            for words in asked
        )
    except (OSError, subprocess.CalledProcessError):
        return ""
    return "" if changed else found
