"""Change the code in a few hundred places, one at a time, and see whether the tests notice.

``make mutants`` runs this; it writes ``data/studies/mutants.toml``.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.metadata
import os
import tempfile
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

import pandas as pd

import reproduce
from mutant_runs import FOLDERS, PACKAGE, ROOT, Outcome, run
from mutants import OPERATORS, Mutant, draw, mutants
from reproduce.store import studies

SEED = 20_240_102
COUNT = 360
STUDY = "mutants"
MET = "all tests of their folder"
COLUMNS = "name file function line operator before after outcome test".split()


def rows(outcomes: Sequence[Outcome]) -> pd.DataFrame:
    """Return the study as a table, a mutant in each row."""
    found = []
    for one in outcomes:
        m = one.mutant
        entries = (m.name, m.file, m.function, m.line, m.operator, m.before, one.after)
        found.append((*entries, one.outcome, one.test))
    return pd.DataFrame(found, columns=COLUMNS)


def hashes(root: Path) -> dict[str, str]:
    """Return the SHA-256 of every file that can be changed, by its path below the package."""
    return {
        f"{folder}/{path.name}": hashlib.sha256(path.read_bytes()).hexdigest()
        for folder in FOLDERS
        for path in sorted((root / PACKAGE / folder).rglob("*.py"))
    }


def killed_before(
    stored: pd.DataFrame, sample: Sequence[Mutant], now: Mapping[str, str]
) -> list[Outcome]:
    """Return the outcomes of a stored study that still stand.

    They are those of mutants that were killed, in files that have not changed since: tests are
    only added.
    """
    same = {file for file, digest in stored.attrs["sources"].items() if now.get(file) == digest}
    killed = stored[(stored["outcome"] != "survived") & stored["file"].isin(same)]
    known = killed.set_index("name")[["after", "outcome", "test"]]
    return [Outcome(one, *known.loc[one.name]) for one in sample if one.name in known.index]


def note(everything: Sequence[Mutant], sources: Mapping[str, str]) -> dict[str, object]:
    """Return how the study came about."""
    sizes = Counter(one.file.partition("/")[0] for one in everything)
    return {
        "about": "What the tests make of small changes of the code, one at a time.",
        "command": "make mutants",
        "version": reproduce.__version__,
        "tool": f"cosmic-ray {importlib.metadata.version('cosmic-ray')}",
        "seed": SEED,
        "survivors_met": MET,
        "operators": [name.partition("/")[2] for name in OPERATORS],
        "made": {folder: sizes[folder] for folder in FOLDERS},
        "sources": dict(sources),
    }


def main() -> None:
    """Draw the sample, run it, and store what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--only", nargs="+", help="names of mutants; stores nothing")
    parser.add_argument(
        "--keep", action="store_true", help="what was killed before, in files that are the same"
    )
    chosen = parser.parse_args()
    everything = list(mutants(ROOT / PACKAGE, FOLDERS))
    sample = draw(everything, COUNT, SEED)
    if chosen.only:
        sample = [one for one in everything if one.name in chosen.only]
    sources = hashes(ROOT)
    before = killed_before(studies.table(STUDY), sample, sources) if chosen.keep else []
    kept = {one.mutant.name: one for one in before}
    with tempfile.TemporaryDirectory() as folder:
        left = [one for one in sample if one.name not in kept]
        kept |= {one.mutant.name: one for one in run(left, chosen.jobs, Path(folder))}
    found = [kept[one.name] for one in sample]
    print(f"{sum(one.outcome != 'survived' for one in found)} of {len(found)} killed")
    if not chosen.only:
        studies.write_table(STUDY, rows(found), note(everything, sources))


if __name__ == "__main__":
    main()
