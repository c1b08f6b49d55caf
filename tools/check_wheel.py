"""Install the built package in empty environments, and use it there.

The wheel is built from the sdist. In an empty environment, in a folder outside of the checkout,
`reproduce check` judges every cell. With ``--all``, the archive of the built book is installed by
its own commands and runs notebooks in their kernel, and the wheel is installed with the oldest
packages that it allows.
"""

from __future__ import annotations

import os
import re
import subprocess
import sys
import tempfile
import venv
from pathlib import Path
from zipfile import ZipFile

from pack_book import ARCHIVE, readme

ROOT = Path(__file__).resolve().parent.parent
UV = (sys.executable, "-m", "uv")
# Notebooks of each part, and the commands of the page on running them.
PAGES = (
    "niu2024/context chen2023/context posteriors/own audit/relations "
    "instruments/three-detectors instruments/laser-metrology"
).split()
COMMANDS = re.compile(r"^\.venv/bin/reproduce .*", re.MULTILINE)


def run(*command: str | Path, folder: Path) -> str:
    """Run a command in a folder, without the variables that lead back to the checkout."""
    clean = {k: v for k, v in os.environ.items() if not k.startswith("PYTHON")}
    words = list(map(str, command))
    return subprocess.check_output(words, cwd=folder, env=clean, text=True)


def install(folder: Path, *wanted: str | Path) -> Path:
    """Install packages into a new environment and return its Python."""
    venv.create(folder)
    python = folder / "bin" / "python"
    run(*UV, "pip", "install", "--quiet", "--python", python, *wanted, folder=folder)
    return python


def check_installed(wheel: Path, folder: Path) -> None:
    """Install the wheel with the locked packages, judge every cell, and compare the citation."""
    lock = ROOT / "environment.txt"
    python = install(folder / "locked", wheel, "--constraint", lock)
    print(run(python.with_name("reproduce"), "check", folder=folder))
    cite = ("-m", "reproduce", "cite", "niu2024/table-3", "--format", "text")
    one, other = (run(p, *cite, folder=folder) for p in (Path(sys.executable), python))
    if one != other:
        sys.exit(f"expected the citation of the checkout, {one}, got {other}")


def check_oldest(wheel: Path, folder: Path) -> None:
    """Install the wheel with the oldest packages that it allows, judge every cell and sample."""
    oldest = ("--resolution", "lowest-direct", "-r", ROOT / "pyproject.toml")
    python = install(folder / "oldest", *oldest)
    pip = (*UV, "pip", "install", "--quiet", "--no-deps", "--python", python)
    run(*pip, wheel, folder=folder)
    for command in ("check", "show niu2024/stars", "posterior registration"):
        run(python.with_name("reproduce"), *command.split(), folder=folder)


def check_archive(archive: Path, folder: Path) -> None:
    """Unpack the archive of the book, install it by its README, and run notebooks."""
    with ZipFile(archive) as file:
        file.extractall(folder)
    inside = folder / "reproduce-book"
    if (inside / "README.txt").read_text() != readme():
        sys.exit("README.txt: expected the text of tools/pack_book.py, got another")
    lines = [line for line in readme().splitlines() if line.startswith("    ")]
    *steps, opened = (line.strip() for line in lines)
    steps = [
        step.replace("python -m venv", f"{sys.executable} -m venv") for step in steps
    ]
    notebooks = [
        f".venv/bin/python -m jupyter execute notebooks/{n}.ipynb" for n in PAGES
    ]
    commands = COMMANDS.findall((ROOT / "book/run.md").read_text(encoding="utf-8"))
    for step in (*steps, f"{opened} --version", *notebooks, *commands):
        run("sh", "-c", step, folder=inside)
    print(f"{archive.name}: {archive.stat().st_size / 2**20:.1f} MiB, {len(PAGES)} run")


def main(*, everything: bool) -> None:
    """Build the packages and check them; a step that fails stops with its own exit code."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        build = ("build", "--quiet", "--no-build-isolation", "--python", sys.executable)
        run(*UV, *build, "--out-dir", folder, ROOT, folder=folder)
        (wheel,) = folder.glob("*.whl")
        check_installed(wheel, folder)
        if everything:
            check_oldest(wheel, folder)
            check_archive(ROOT / "book/_build/html" / ARCHIVE, folder)


if __name__ == "__main__":
    main(everything=sys.argv[1:] == ["--all"])
