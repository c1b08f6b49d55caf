"""What independent readings of the papers found, and how much they may have missed.

The paper was read line by line twice for relations that it should keep; the second reader did not
know the first list. What both found tells how much each of them finds, and so how much neither
found: the estimate of Lincoln and Petersen, in Chapman's form that is nearly unbiased for small
counts. A third reader, who knew neither list, looked for contradictions alone: the row ``third``
lays the errata of all others (``first``) beside those of the third (``second``).
``python tools/evidence/two_readings.py`` counts the relations and the errata and stores
the estimates.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable

import pandas as pd

import reproduce
from keep import write_table
from reproduce.audit.relation import Relation
from reproduce.audit.report import audit_paper, register
from reproduce.locate import data_folder
from reproduce.printed.cells import PAPERS

NAME = "two-readings"
COMMAND = "python tools/evidence/two_readings.py"
FOUND = ("first", "second", "both", "merging")


def missed(first: int, second: int, both: int) -> tuple[float, float]:
    """Estimate what two readings missed, with the standard error, from what each found alone.

    Each reader finds half of what the other finds, so about a quarter escapes both:

    >>> round(missed(first=2, second=2, both=2)[0], 2)
    1.33
    """
    one, two, shared = first + both + 1, second + both + 1, both + 1
    error = math.sqrt(one * two * first * second / (shared**2 * (shared + 1)))
    return one * two / shared - 1 - (first + second + both), error


def lines(relations: Iterable[Relation]) -> list[str]:
    """Return who found each line of declaration, of which several relations can come."""
    return list({(r.declared, r.source): r.reading for r in relations}.values())


def study() -> pd.DataFrame:
    """Count what each reading found, and estimate what both missed."""
    relations = [f.relation for paper in PAPERS for f in audit_paper(paper).findings]
    errata = register((data_folder() / "errata.toml").read_text(encoding="utf-8"))
    found: dict[str, list[str]] = {"lines": lines(relations)}
    found["errata"] = [e.reading for e in errata]
    found["third"] = [by_the_third(e.reading, e.again) for e in errata]
    rows = []
    for what, finders in found.items():
        counts = Counter(finders)
        if strays := set(counts) - {*FOUND, "third"}:
            raise ValueError(
                f"{what}: expected one of {', '.join(FOUND)}, third, got {strays}"
            )
        estimate = missed(counts["first"], counts["second"], counts["both"])
        rows.append((what, *(counts[name] for name in FOUND), *estimate))
    return pd.DataFrame(rows, columns=["what", *FOUND, "missed", "error"])


def by_the_third(reading: str, again: bool) -> str:
    """Say who found an erratum where all other readings are the first and the third the second."""
    if reading == "third":
        return "second"
    return "both" if again else "first"


if __name__ == "__main__":
    write_table(NAME, study(), {"command": COMMAND, "version": reproduce.__version__})
