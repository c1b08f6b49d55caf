"""Compute every number of the book with other arithmetic, and compare: ``make same``.

A copy of the checkout computes the ledger, the facts and the pages with the linear algebra of
another processor, without wide instructions, with another locale, time zone and order of sets, and
with a read-only home. The results are compared with those of the built book. Words and tables must
be equal, drawings within `MAX_SHIFT`, the numbers of the ledger within `RELATIVE_TOLERANCE`. In
drawings of random draws the rounding grows from step to step: `MAX_SHIFT_RANDOM`.
``python tools/same_numbers.py Haswell`` uses the linear algebra of that processor, and
``python tools/same_numbers.py Prescott numbers`` compares only the ledger and the facts.
"""

from __future__ import annotations

import ctypes
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

# NumPy has no public function for the instructions that it was built for.
from numpy._core import _multiarray_umath  # type: ignore[attr-defined]

from reproduce.version import build_record

ROOT = Path(__file__).resolve().parent.parent
BOOK = ROOT / "book"
RELATIVE_TOLERANCE = 1e-12
MAX_SHIFT, MAX_SHIFT_RANDOM = 1e-3, 0.05  # px
COPIED = ("src", "data", "book", "tools")
NUMBER = re.compile(r"(?<![\w#.])-?\d+(?:\.\d+)?(?:e[-+]\d+)?")
SVG = re.compile(r"<svg.*?</svg>", re.DOTALL)
OTHER_PARTS, MOVES = "a drawing has other parts", "a drawing moves by "
# A contour may be closed by a command or by a last point. The names of markers and clipping paths
# contain a hash of their coordinates.
IGNORED = re.compile(r"\n *z\b|\b[mp][0-9a-f]{10}\b|(?<=-)[mp][0-9a-f]{10}\b")


def instructions() -> list[str]:
    """Return the instructions beyond those of every processor that NumPy uses."""
    features = _multiarray_umath.__cpu_features__
    return [name for name in _multiarray_umath.__cpu_dispatch__ if features[name]]


def arithmetic() -> list[str]:
    """Return the processor of the linear algebra and the instructions of NumPy, in this process."""
    used = instructions()
    for path in Path(np.__file__).parent.parent.glob("numpy.libs/*openblas64*"):
        name = ctypes.CDLL(str(path)).scipy_openblas_get_corename64_
        name.restype = ctypes.c_char_p
        used.append(name().decode())
    return used


def other_settings(core: str) -> dict[str, str]:
    """Return the environment of the other arithmetic."""
    return {
        "OPENBLAS_CORETYPE": core,
        "NPY_DISABLE_CPU_FEATURES": " ".join(instructions()),
        "LC_ALL": "C",
        "PYTHONCOERCECLOCALE": "0",
        "PYTHONUTF8": "0",
        "TZ": "Pacific/Chatham",
        "PYTHONHASHSEED": "1",
        # Not XDG_CONFIG_HOME: astropy warns of any that is no folder, and a warning fails.
        "HOME": os.devnull,
        "XDG_CACHE_HOME": os.devnull,
    }


def results(book: Path) -> dict[str, Any]:
    """Return the ledger, the facts and the outputs of the computed pages of a book."""
    # A process that only prints its arithmetic does not load Jupyter.
    from page_cells import notebooks
    from run_notebooks import cache_of, outputs

    ledger = json.loads((book / "_extra" / "ledger.json").read_text(encoding="utf-8"))
    facts = json.loads((book / "_build" / "facts.json").read_text(encoding="utf-8"))
    with cache_of(book) as cache:
        pages = {
            page.relative_to(book).as_posix(): list(texts(cells))
            for page in notebooks(book)
            if (cells := outputs(cache, page)) is not None
        }
    return {"ledger": ledger, "facts": facts, **pages}


def texts(cells: Any) -> Iterator[str]:
    """Yield the outputs of a page's cells except pixels, whose text differs for a last bit."""
    for output in (output for cell in cells for output in cell):
        data = output.get("data", {})
        yield output.get("text") or data.get("text/html") or data["text/plain"]


def copy_checkout(target: Path) -> None:
    """Copy the files that the computation needs, and name the commit as a wheel does."""
    for part in COPIED:
        ignored = shutil.ignore_patterns("_build", "_extra", "__pycache__")
        shutil.copytree(ROOT / part, target / part, ignore=ignored)
    (target / "book" / "_extra").mkdir()
    (target / "src/reproduce/_commit").write_text(build_record(ROOT), encoding="utf-8")


def differences(
    one: Any, other: Any, place: str = "", size: float = 0.0
) -> Iterator[str]:
    """Yield the places in which two results differ.

    Parameters
    ----------
    one, other : object
        Results as JSON has them.
    place : str
        Their place.
    size : float
        Size of the numbers of which a number is the difference.

    Yields
    ------
    str
        Place and both values.
    """
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        # A tolerance is half the width of an interval, and the error of a median is half the
        # distance of two quantiles inside it. Both have the rounding of the ends of the interval.
        ends = one["interval"] or () if "tolerance" in one else ()
        widest = max(map(abs, ends), default=0.0)
        for key in one:
            size = widest if key in {"tolerance", "error"} else 0.0
            yield from differences(one[key], other[key], f"{place} {key}", size)
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for index, pair in enumerate(zip(one, other, strict=True)):
            yield from differences(*pair, f"{place} {index}")
    elif isinstance(one, float) and isinstance(other, float):
        if not math.isclose(
            one, other, rel_tol=RELATIVE_TOLERANCE, abs_tol=RELATIVE_TOLERANCE * size
        ):
            yield f"{place}: {one!r}, {other!r}"
    elif isinstance(one, str) and isinstance(other, str):
        yield from _differences_of_texts(one, other, place)
    elif type(one) is not type(other) or one != other:
        yield f"{place}: {one!r}, {other!r}"


def _differences_of_texts(one: str, other: str, place: str) -> Iterator[str]:
    """Yield the differences of two texts; coordinates of a drawing may differ by `MAX_SHIFT`."""
    lines, others = (SVG.sub("<svg>", text).splitlines() for text in (one, other))
    if lines != others:
        pairs = zip(lines, others, strict=False)
        yield f"{place}: {next((p for p in pairs if p[0] != p[1]), 'another length')}"
    for drawings in zip(SVG.findall(one), SVG.findall(other), strict=False):
        plain = [IGNORED.sub("", drawing) for drawing in drawings]
        if NUMBER.sub("", plain[0]) != NUMBER.sub("", plain[1]):
            yield f"{place}: {OTHER_PARTS}"
            continue
        numbers = [np.array(NUMBER.findall(drawing), float) for drawing in plain]
        if (moved := np.abs(np.subtract(*numbers)).max(initial=0.0)) > MAX_SHIFT:
            yield f"{place}: {MOVES}{moved:.2g}"


def is_wrong(difference: str) -> bool:
    """Return whether a difference is more than the rounding of random draws in a drawing."""
    if not difference.startswith(" posteriors/"):
        return True
    _, moves, distance = difference.rpartition(MOVES)
    drawn = bool(moves) and float(distance) < MAX_SHIFT_RANDOM
    return not (drawn or difference.endswith(OTHER_PARTS))


def main(core: str = "Prescott", *parts: str) -> int:
    """Compute with other arithmetic, print the differences, and return the exit code."""
    environment = {**os.environ, **other_settings(core)}
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "a copy"
        copy_checkout(copy)
        paths = (copy / "src", copy / "tools")
        environment["PYTHONPATH"] = os.pathsep.join(map(str, paths))
        source = "import same_numbers; print(*same_numbers.arithmetic())"
        python = [sys.executable, "-c", source]
        other = subprocess.check_output(python, env=environment, text=True).split()
        if other == arithmetic():
            raise RuntimeError(f"{core}: expected other arithmetic, got {other}")
        command = [sys.executable, str(copy / "tools/run_notebooks.py"), *parts]
        if code := subprocess.run(command, env=environment, check=False).returncode:
            return code
        other_results = results(copy / "book")
        built = results(BOOK)
        compared = other_results if parts else built
        found = list(differences({key: built[key] for key in compared}, other_results))
    print(f"{' '.join(other)}: {len(found)} differences", *found, sep="\n")
    return int(any(map(is_wrong, found)))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
