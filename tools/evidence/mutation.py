"""Change the code in a few hundred places, one at a time, and see whether the tests notice.

``make mutants`` runs this. It prints the mutants that survive, and the share that was killed.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

from mutant_runs import FOLDERS, PACKAGE, ROOT, run
from mutants import draw, mutants

SEED = 20_240_102
COUNT = 360


def main() -> None:
    """Draw the sample, run it, and say what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--jobs", type=int, default=os.cpu_count())
    parser.add_argument("--count", type=int, default=COUNT, help="how many are drawn")
    parser.add_argument("--only", nargs="+", help="names of mutants")
    chosen = parser.parse_args()
    everything = list(mutants(ROOT / PACKAGE, FOLDERS))
    sample = draw(everything, chosen.count, SEED)
    if chosen.only:
        sample = [one for one in everything if one.name in chosen.only]
    with tempfile.TemporaryDirectory() as folder:
        found = list(run(sample, chosen.jobs, Path(folder)))
    for one in found:
        if one.outcome == "survived":
            m = one.mutant
            print(
                f"{m.name} survived: {m.file}:{m.line} {m.before.strip()} -> {one.after.strip()}"
            )
    killed = sum(one.outcome != "survived" for one in found)
    print(f"{killed} of {len(found)} killed, drawn from {len(everything)}")


if __name__ == "__main__":
    main()
