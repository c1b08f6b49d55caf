"""Build sdist and wheel, install the wheel alone into an empty environment, and use it there.

The wheel is built from the sdist. In the empty environment, in a folder far from the checkout,
`reproduce check` judges everything and one notebook of the book runs in its own kernel. Where the
book is built, its archive is unpacked in another folder and installed by the very lines it gives.
Last, the wheel is installed with the oldest packages that it allows.
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

import nbformat
from myst_nb.core.read import read_myst_markdown_notebook

from pack_book import ARCHIVE, readme

ROOT = Path(__file__).resolve().parent.parent
PAGE = ROOT / "book" / "niu2024" / "context.md"
# Notebooks of each part, and the commands of the page that says how to run them.
PAGES = (
    *("niu2024/context", "chen2023/context", "posteriors/own", "audit/relations"),
    *("instruments/three-detectors", "instruments/laser-metrology"),
)
COMMANDS = re.compile(r"^\.venv/bin/reproduce .*", re.MULTILINE)


def run(*command: str | Path, folder: Path) -> None:
    """Run a command in a folder, without the variables that could lead back to the checkout."""
    clean = {
        name: value
        for name, value in os.environ.items()
        if not name.startswith("PYTHON")
    }
    subprocess.run([str(part) for part in command], cwd=folder, env=clean, check=True)


def cite(python: Path, folder: Path) -> str:
    """Return how a cell is cited where this Python has the package."""
    command = (python, "-m", "reproduce", "cite", "niu2024/table-3", "--format", "text")
    return subprocess.run(
        command, cwd=folder, check=True, capture_output=True, text=True
    ).stdout


def main() -> None:
    """Build, install, check and run; a failing step stops with its own exit code."""
    uv = (sys.executable, "-m", "uv")
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        run(
            *uv,
            "build",
            "--quiet",
            "--no-build-isolation",
            "--python",
            sys.executable,
            "--out-dir",
            folder,
            ROOT,
            folder=folder,
        )
        (wheel,) = folder.glob("*.whl")
        (sdist,) = folder.glob("*.tar.gz")
        print(f"{sdist.name}: {sdist.stat().st_size / 2**20:.1f} MiB")
        print(f"{wheel.name}: {wheel.stat().st_size / 2**20:.1f} MiB")
        venv.create(folder / "empty")
        python = folder / "empty" / "bin" / "python"
        extras = f"{wheel}[book,notebooks]"
        run(
            *uv,
            "pip",
            "install",
            "--quiet",
            "--python",
            python,
            "--constraint",
            ROOT / "environment.txt",
            extras,
            folder=folder,
        )
        run(python.with_name("reproduce"), "check", folder=folder)
        cited = {cite(one, folder) for one in (Path(sys.executable), python)}
        if len(cited) > 1:
            sys.exit(
                f"expected the wheel to cite the commit of the checkout, got {sorted(cited)}"
            )
        notebook = read_myst_markdown_notebook(PAGE.read_text(encoding="utf-8"))
        notebook.metadata["kernelspec"] = {
            "name": "python3",
            "display_name": "Python 3",
        }
        # Neither function of nbformat has types.
        nbformat.write(notebook, folder / "page.ipynb")  # type: ignore[no-untyped-call]
        run(
            python,
            "-m",
            "jupyter",
            "nbconvert",
            "--to",
            "notebook",
            "--execute",
            "--log-level",
            "WARN",
            "page.ipynb",
            "--output",
            "executed.ipynb",
            folder=folder,
        )
        executed = folder / "executed.ipynb"
        shown = nbformat.read(executed, as_version=4)  # type: ignore[no-untyped-call]
        outputs = sum(
            len(cell.outputs) for cell in shown.cells if cell.cell_type == "code"
        )
        if not outputs:
            sys.exit(f"{PAGE.name}: expected outputs, got none")
        print(f"{PAGE.name}: {outputs} outputs")
        if (archive := ROOT / "book/_build/html" / ARCHIVE).is_file():
            check_archive(archive, folder)
        # The oldest releases have wheels for the oldest Python alone.
        if sys.version_info[:2] == (3, 11):
            check_oldest(uv, wheel, folder)


def check_oldest(uv: tuple[str, ...], wheel: Path, folder: Path) -> None:
    """Install the wheel with the oldest packages that it allows, judge everything and sample."""
    venv.create(folder / "oldest")
    python = folder / "oldest" / "bin" / "python"
    install: tuple[str | Path, ...] = (
        *uv,
        "pip",
        "install",
        "--quiet",
        "--python",
        python,
    )
    # Lowest of what the project itself asks for; of what that asks for, the newest.
    run(
        *install,
        "--resolution",
        "lowest-direct",
        "-r",
        ROOT / "pyproject.toml",
        folder=folder,
    )
    run(*install, "--no-deps", wheel, folder=folder)
    reproduce = python.with_name("reproduce")
    run(reproduce, "check", folder=folder)
    run(reproduce, "show", "niu2024/stars", folder=folder)
    run(reproduce, "posterior", "registration", folder=folder)


def check_archive(archive: Path, folder: Path) -> None:
    """Unpack the archive of the book, install it as its words say, and run a notebook in it."""
    with ZipFile(archive) as file:
        file.extractall(folder)
    inside = folder / "reproduce-book"
    if (inside / "README.txt").read_text() != readme():
        sys.exit("README.txt: expected the words of tools/pack_book.py, got others")
    lines = [line for line in readme().splitlines() if line.startswith("    ")]
    *install, opened = (line.strip() for line in lines)
    for line in install:
        run(
            "sh",
            "-c",
            line.replace("python -m venv", f"{sys.executable} -m venv"),
            folder=inside,
        )
    run("sh", "-c", f"{opened} --version", folder=inside)
    for name in PAGES:
        run(
            inside / ".venv/bin/python",
            "-m",
            "jupyter",
            "execute",
            f"notebooks/{name}.ipynb",
            folder=inside,
        )
    for line in COMMANDS.findall((ROOT / "book/run.md").read_text(encoding="utf-8")):
        run("sh", "-c", line, folder=inside)
    size = sum(
        path.stat().st_size for path in (inside / ".venv").rglob("*") if path.is_file()
    )
    print(
        f"{archive.name}: {archive.stat().st_size / 2**20:.1f} MiB, installed "
        f"{size / 1e6:.0f} MB, {', '.join(PAGES)} run"
    )


if __name__ == "__main__":
    main()
