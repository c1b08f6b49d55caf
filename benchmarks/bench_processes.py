"""Times of new processes: first use of the package, all verdicts, and a long user file."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
import pytest

# What any program imports that shows and judges tables with these packages.
PACKAGES = (
    "import click, jinja2, numpy, pandas, pydantic, rich, scipy.optimize, scipy.special"
)
# The same, and about as many random numbers as all verdicts need, from as many streams.
NUMBERS = (
    f"{PACKAGES}\nfor one in numpy.random.SeedSequence(1).spawn(20_000):"
    "\n    numpy.random.default_rng(one).standard_normal(2_500)"
)
FIT = "rp.register([[0, 0], [9, 0], [4, 5]], [[0, 1], [9, 1], [4, 6]])"
STARS = 1_000_000
# A similarity by least squares: scale and turn, then the shift, of complex positions.
SOLVED = (
    "import numpy; z, w = (stars[:, at] + 1j * stars[:, at + 1] for at in (0, 2)); "
    "numpy.linalg.lstsq(numpy.stack([z, numpy.ones_like(z)], axis=1), w)"
)


def python(*arguments: str) -> str:
    """Run Python in a new process and return its output."""
    command = [sys.executable, *arguments]
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@pytest.mark.parametrize(
    ("name", "package", "reference", "at_most"),
    [
        ("import", ["-c", "import reproduce"], "import numpy", 0.5),
        (
            "first registration",
            ["-c", f"import reproduce as rp; {FIT}"],
            "import numpy",
            2.5,
        ),
        ("first table", ["-m", "reproduce", "show", "niu2024/table-1"], PACKAGES, 1),
        (
            "first simulated table",
            ["-m", "reproduce", "show", "niu2024/table-3"],
            PACKAGES,
            2,
        ),
        ("check", ["-m", "reproduce", "check"], NUMBERS, 4),
        ("audit", ["-m", "reproduce", "audit"], NUMBERS, 5),
    ],
    ids=lambda value: value if isinstance(value, str) and len(value) < 24 else "",
)
def bench_a_fresh_process(
    promise: Callable[..., None],
    name: str,
    package: list[str],
    reference: str,
    at_most: float,
) -> None:
    """Compare a new process with its reference; no result is stored between rounds."""
    promise(name, partial(python, *package), partial(python, "-c", reference), at_most)


def bench_a_million_stars(promise: Callable[..., None], tmp_path: Path) -> None:
    """Compare a registration of a long file with pandas and one least-squares solution."""
    path, generator = tmp_path / "stars.csv", np.random.default_rng(1)
    source = generator.uniform(0, 4000, (STARS, 2))
    target = 1.001 * source + generator.normal(0, 0.05, source.shape)
    header = "x,y,x_reference,y_reference"
    rows = np.hstack([source, target])
    np.savetxt(path, rows, fmt="%.4f", delimiter=",", header=header, comments="")
    memory = (
        "import resource; {}; print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss)"
    )
    package = memory.format(f"import reproduce as rp; repr(rp.register({str(path)!r}))")
    read = f"import pandas; stars = pandas.read_csv({str(path)!r}).to_numpy()"
    other = memory.format(f"{read}; {SOLVED}")
    promise(
        f"{STARS:,} stars",
        partial(python, "-c", package),
        partial(python, "-c", other),
        3,
    )
    assert int(python("-c", package)) < 3 * int(python("-c", other))
