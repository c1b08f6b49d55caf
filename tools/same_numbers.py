"""Compute every number that the book shows under different arithmetic, and compare.

``make same`` runs this. Each setting computes the ledger and runs the cells of all pages in fresh
processes: with another processor's linear algebra, without the wide instructions, on one thread,
and from another place, with another locale, time zone and order of sets, and no home to write to.
What several pages show is computed once in each setting, as in a build of the book.
Words and tables must be the same letter by letter, drawings to a thousandth of a pixel (those of
draws, in which rounding grows from step to step, to what can be seen), the ledger's own numbers to
`CLOSE`. The pages that sample take most of the time; they run under the
settings of `SAMPLED`, as in CI, under all with ``--all``, or under none with ``--quick``.
"""

from __future__ import annotations

import argparse
import ctypes
import json
import locale
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Collection, Iterator, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np

# What NumPy was built for is told by no public function.
from numpy._core import _multiarray_umath  # type: ignore[attr-defined]

from page_cells import BOOK, notebooks, posteriors_on, run

ROOT = BOOK.parent
CLOSE = 1e-12
DRAWN, SEEN = 1e-3, 0.05  # px
USUAL, PLAIN, ONE, ELSEWHERE = (
    "as it is",
    "plain instructions",
    "one thread",
    "some where",
)
SAMPLED = (USUAL, PLAIN, ONE)
KEPT = "REPRODUCE_BUILD"  # the folder of what is computed once, one for each setting
# What a process needs of the checkout to make the pages.
NEEDED = ("src", "data", "book", "tools")
# What a setting may change is not taken over from outside.
CHANGED = (
    "LC_",
    "LANG",
    "TZ",
    "OPENBLAS_",
    "OMP_",
    "NPY_",
    "PYTHONHASHSEED",
    "PYTHONUTF8",
)
NUMBER = re.compile(r"(?<![\w#.])-?\d+(?:\.\d+)?(?:e[-+]\d+)?")
OTHER, MOVES = "a drawing has other parts", "a drawing moves by "
SVG = re.compile(r"<svg.*?</svg>", re.DOTALL)
# A contour that ends where it began may be closed by a command or by its last point.
CLOSING = re.compile(r"\n *z\b")
# Matplotlib names markers and clipping paths by a hash of their coordinates.
HASH = re.compile(r"\b[mp][0-9a-f]{10}\b|(?<=-)[mp][0-9a-f]{10}\b")


def settings() -> dict[str, dict[str, str]]:
    """Return the settings by name: what each puts into the environment."""
    features, usual = _multiarray_umath.__cpu_features__, as_it_is()
    found = {
        USUAL: {},
        PLAIN: {
            "OPENBLAS_CORETYPE": "Prescott",
            "NPY_DISABLE_CPU_FEATURES": " ".join(usual["instructions"]),
        },
        ELSEWHERE: {
            "LC_ALL": "C",
            "PYTHONCOERCECLOCALE": "0",
            "PYTHONUTF8": "0",
            "TZ": "Pacific/Chatham",
            "PYTHONHASHSEED": "1",
            # Not XDG_CONFIG_HOME: astropy warns of any that is no folder, and a warning fails.
            "HOME": os.devnull,
            "XDG_CACHE_HOME": os.devnull,
        },
    }
    if (os.cpu_count() or 1) > 1:
        found[ONE] = {"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"}
    for core, feature in (("Haswell", "AVX2"), ("SkylakeX", "X86_V4")):
        if features.get(feature) and core != usual["core"]:
            found[core] = {"OPENBLAS_CORETYPE": core}
    return found


@cache
def as_it_is() -> dict[str, Any]:
    """Return the arithmetic of a process into which nothing is put from outside."""
    code = "import json, same_numbers; print(json.dumps(same_numbers.arithmetic()))"
    environment = {
        **bare(),
        "PYTHONPATH": f"{ROOT / 'src'}{os.pathsep}{ROOT / 'tools'}",
    }
    told = subprocess.check_output(
        [sys.executable, "-c", code], env=environment, text=True
    )
    found: dict[str, Any] = json.loads(told)
    return found


def bare() -> dict[str, str]:
    """Return the environment without what a setting may change."""
    return {k: v for k, v in os.environ.items() if not k.startswith(CHANGED)}


def arithmetic() -> dict[str, Any]:
    """Return what a setting may change, as it is in this process."""
    import reproduce

    features = _multiarray_umath.__cpu_features__
    core, threads = "", 0
    for path in Path(np.__file__).parent.parent.glob("numpy.libs/*openblas64*"):
        library = ctypes.CDLL(str(path))
        name = library.scipy_openblas_get_corename64_
        name.restype = ctypes.c_char_p
        core, threads = name().decode(), library.scipy_openblas_get_num_threads64_()
    return {
        "core": core,
        "threads": threads,
        "instructions": [f for f in _multiarray_umath.__cpu_dispatch__ if features[f]],
        "package": reproduce.__file__,
        "encoding": locale.getpreferredencoding(),
    }


# A copy of the project elsewhere is no checkout, and so has no commit to name.
@patch("reproduce.version.commit", lambda root: "")
def computed(pages: list[str]) -> dict[str, Any]:
    """Return the ledger and what the given pages show, computed in this process."""
    shown = {name: {"texts": run(BOOK / name).texts, "seconds": 0} for name in pages}
    from book_facts import of_posteriors, unsampled
    from reproduce.views.computed import whole_ledger

    if pages:
        for name in pages:  # the posteriors of a page are sampled here already
            shown[name]["words"] = of_posteriors(posteriors_on(BOOK / name))
        return {"arithmetic": arithmetic(), "pages": shown, "ledger": {}}
    ledger = json.loads(whole_ledger().model_dump_json())
    return {
        "arithmetic": arithmetic(),
        "pages": {"sentences": unsampled()},
        "ledger": ledger,
    }


def apart(
    environment: Mapping[str, str], root: Path, pages: list[str]
) -> dict[str, Any]:
    """Return what `computed` does in a process of its own, in a checkout at `root`."""
    process = subprocess.run(
        [sys.executable, str(root / "tools/same_numbers.py"), "--here", *pages],
        env={**bare(), **environment, "PYTHONPATH": str(root / "src")},
        capture_output=True,
        encoding="utf-8",
        check=False,
    )
    if process.returncode or process.stderr:
        what = " ".join(pages) or "the ledger"
        raise RuntimeError(f"{what}: exit code {process.returncode}, {process.stderr}")
    answer: dict[str, Any] = json.loads(process.stdout)
    return answer


def differences(
    one: Any, other: Any, place: str = "", size: float = 0.0
) -> Iterator[str]:
    """Yield where two results differ, by the kind of what stands there.

    Parameters
    ----------
    one, other : object
        Results as JSON has them.
    place : str
        Where they stand.
    size : float
        Of the numbers that a number is the difference of.

    Yields
    ------
    str
        Place, and both values.
    """
    if isinstance(one, dict) and isinstance(other, dict) and one.keys() == other.keys():
        # A tolerance is half the distance of an interval's ends, and no better than they are.
        ends = one["interval"] or () if "tolerance" in one else ()
        for key in one:
            size = max(map(abs, ends), default=0.0) if key == "tolerance" else 0.0
            yield from differences(one[key], other[key], f"{place} {key}", size)
    elif isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        for index, pair in enumerate(zip(one, other, strict=True)):
            yield from differences(*pair, f"{place} {index}")
    elif isinstance(one, float) and isinstance(other, float):
        if not math.isclose(one, other, rel_tol=CLOSE, abs_tol=CLOSE * size):
            yield f"{place}: {one!r}, {other!r}"
    elif isinstance(one, str) and isinstance(other, str):
        yield from _in_texts(one, other, place)
    elif type(one) is not type(other) or one != other:
        yield f"{place}: {one!r}, {other!r}"


def _in_texts(one: str, other: str, place: str) -> Iterator[str]:
    """Yield where two texts differ; only the coordinates of a drawing may, by next to nothing."""
    lines, others = (SVG.sub("<svg>", text).splitlines() for text in (one, other))
    if lines != others:
        pairs = zip(lines, others, strict=False)
        yield f"{place}: {next((p for p in pairs if p[0] != p[1]), 'another length')}"
    for drawn, again in zip(SVG.findall(one), SVG.findall(other), strict=False):
        drawn, again = (CLOSING.sub("", HASH.sub("", svg)) for svg in (drawn, again))
        numbers = [np.array(NUMBER.findall(svg), float) for svg in (drawn, again)]
        if NUMBER.sub("", drawn) != NUMBER.sub("", again):
            yield f"{place}: {OTHER}"
        elif (moved := np.abs(np.subtract(*numbers)).max(initial=0.0)) > DRAWN:
            yield f"{place}: {MOVES}{moved:.2g}"


def compared(*, sampled: Collection[str] = SAMPLED) -> int:
    """Compute under all settings, print what differs, and return how many places do.

    The pages that sample run under the settings of `sampled` alone.
    """
    names = [page.relative_to(BOOK).as_posix() for page in notebooks()]
    slow = [name for name in names if name.startswith("posteriors/")]
    quick = [name for name in names if name not in slow]
    with (
        tempfile.TemporaryDirectory() as folder,
        ThreadPoolExecutor(os.cpu_count()) as pool,
    ):
        away = Path(folder) / ELSEWHERE
        for part in NEEDED:
            shutil.copytree(
                ROOT / part, away / part, ignore=shutil.ignore_patterns("_build")
            )
        parts: dict[str, list[Future[dict[str, Any]]]] = {
            name: [] for name in settings()
        }
        # Settings take turns, so that what works at the same time seldom needs the same posterior.
        for batch in [*([page] for page in slow), quick, []]:
            for name, environment in settings().items():
                if name in sampled or batch in (quick, []):
                    own = {**environment, KEPT: str(Path(folder) / "kept" / name)}
                    root = away if name == ELSEWHERE else ROOT
                    parts[name].append(pool.submit(apart, own, root, batch))
        results = {
            name: [part.result() for part in each] for name, each in parts.items()
        }
    usual = {
        page: shown for part in results[USUAL] for page, shown in part["pages"].items()
    }
    wrong = 0
    for name, found in results.items():
        setting, ledger = found[-1]["arithmetic"], found[-1]["ledger"]
        if name != USUAL and setting == results[USUAL][-1]["arithmetic"]:
            raise RuntimeError(
                f"{name}: expected to change something, got {setting} as usual"
            )
        pages = {page: shown for part in found for page, shown in part["pages"].items()}
        places = [
            *differences({page: usual[page] for page in pages}, pages),
            *differences(results[USUAL][-1]["ledger"], ledger, "ledger"),
        ]
        print(f"{name}: {len(pages)} pages, {len(places)} differences, {setting}")
        print(*places, sep="\n", end="\n" if places else "", flush=True)
        wrong += sum(
            not (place.split()[0] in slow and unseen(place)) for place in places
        )
    return wrong


def unseen(place: str) -> bool:
    """Tell whether a difference of draws is no more than rounding: it is told, and no number."""
    _, moves, distance = place.rpartition(MOVES)
    return place.endswith(OTHER) or bool(moves and float(distance) < SEEN)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--all", action="store_true", help="sample under every setting")
    parser.add_argument(
        "--quick", action="store_true", help="leave out the pages that sample"
    )
    parser.add_argument(
        "--here", nargs="*", help="print what these pages show, and no more"
    )
    asked = parser.parse_args()
    if asked.here is not None:
        # It is a TextIOWrapper, which the annotation TextIO does not say.
        sys.stdout.reconfigure(encoding="utf-8")  # type: ignore[union-attr]
        json.dump(computed(asked.here), sys.stdout)
    else:
        chosen = () if asked.quick else tuple(settings()) if asked.all else SAMPLED
        sys.exit(1 if compared(sampled=chosen) else 0)
