"""Change the code in a few hundred places, one at a time, and see whether the tests notice.

``make mutants`` runs this as ``python tools/mutation.py``; it writes ``data/studies/mutants.toml``.
"""

from __future__ import annotations

import argparse
import hashlib
import importlib.metadata
import json
import os
import tempfile
import tomllib
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path

from mutant_runs import FOLDERS, PACKAGE, ROOT, Outcome, run
from mutants import OPERATORS, Mutant, draw, mutants

SEED = 20_240_102
COUNT = 360
STUDY = ROOT / "data/studies/mutants.toml"
MET = "all tests of their folder"
HEAD = """\
# What the tests make of small changes of the code, one at a time. Columns: name of the mutant,
# file, function, line, operator of cosmic-ray, the line before and after, outcome, and the test
# that failed.
"""


def rows(outcomes: Sequence[Outcome]) -> str:
    """Return one line of TOML for each mutant."""
    lines = []
    for one in outcomes:
        m = one.mutant
        entries = (m.name, m.file, m.function, m.line, m.operator, m.before, one.after)
        lines.append(f"    {json.dumps([*entries, one.outcome, one.test], ensure_ascii=False)},")
    return "\n".join(lines)


def hashes(root: Path) -> dict[str, str]:
    """Return the SHA-256 of every file that can be changed, by its path below the package."""
    return {
        f"{folder}/{path.name}": hashlib.sha256(path.read_bytes()).hexdigest()
        for folder in FOLDERS
        for path in sorted((root / PACKAGE / folder).rglob("*.py"))
    }


def killed_before(text: str, sample: Sequence[Mutant], now: Mapping[str, str]) -> list[Outcome]:
    """Return the outcomes of a stored study that still stand.

    Parameters
    ----------
    text : str
        The stored study.
    sample : sequence of Mutant
        What is to be run now.
    now : mapping
        Hashes of the files.

    Returns
    -------
    list of Outcome
        Of mutants that were killed, in files that have not changed since. Tests are only added.
    """
    content = tomllib.loads(text)
    rows = {row[0]: row for row in content["mutants"] if row[-2] != "survived"}
    same = {file for file, digest in content["sources"].items() if now.get(file) == digest}
    return [
        Outcome(one, *rows[one.name][-3:])
        for one in sample
        if one.file in same and one.name in rows
    ]


def written(
    outcomes: Sequence[Outcome], everything: Sequence[Mutant], sources: Mapping[str, str]
) -> str:
    """Return the study as text, with its hash."""
    body = rows(outcomes)
    sizes = Counter(one.file.partition("/")[0] for one in everything)
    fields = {
        "command": "make mutants",
        "version": importlib.metadata.version("reproduce-pointing"),
        "tool": f"cosmic-ray {importlib.metadata.version('cosmic-ray')}",
        "seed": SEED,
        "survivors_met": MET,
        "operators": [name.partition("/")[2] for name in OPERATORS],
        "sha256": hashlib.sha256(body.encode()).hexdigest(),
    }
    head = "".join(f"{key} = {json.dumps(value)}\n" for key, value in fields.items())
    made = "".join(f"{key} = {sizes[key]}\n" for key in FOLDERS)
    files = "".join(f'"{file}" = "{digest}"\n' for file, digest in sources.items())
    return f"{HEAD}{head}mutants = [\n{body}\n]\n\n[made]\n{made}\n[sources]\n{files}"


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
    old = STUDY.read_text(encoding="utf-8") if chosen.keep else "mutants = []\n[sources]\n"
    kept = {one.mutant.name: one for one in killed_before(old, sample, sources)}
    with tempfile.TemporaryDirectory() as folder:
        left = [one for one in sample if one.name not in kept]
        kept |= {one.mutant.name: one for one in run(left, chosen.jobs, Path(folder))}
    found = [kept[one.name] for one in sample]
    print(f"{sum(one.outcome != 'survived' for one in found)} of {len(found)} killed")
    if not chosen.only:
        STUDY.write_text(written(found, everything, sources), encoding="utf-8")


if __name__ == "__main__":
    main()
