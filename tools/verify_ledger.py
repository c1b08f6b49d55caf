"""Derive every verdict of the ledger again, from what each record holds and nothing else.

    python verify_ledger.py [ledger.json]

Needs Python alone. A print stands for the interval `stands_for` (an open end is null). A number
that was computed agrees where it, or the interval that its rounded inputs allow, meets that
interval. A number that was predicted agrees where its probability, two-sided and over that
interval, leaves it in the central 99 %. Where the text can be read in several ways, the cell has a
verdict if all readings agree or all disagree, and is blocked otherwise, as is a cell of which
something is not published.
"""

import json
import math
import sys
from pathlib import Path
from typing import Any

CENTRAL = 0.99
Record = dict[str, Any]
Ends = tuple[float | None, float | None]


def judged(found: Record, stands_for: Ends) -> str:
    """Return exact, consistent or differs for a record or a reading."""
    if found["probability"] is not None:
        return "consistent" if found["probability"] >= 1 - CENTRAL else "differs"
    first, last = stands_for
    low, high = -math.inf if first is None else first, math.inf if last is None else last
    # Sums of decimal numbers leave a few units of the last binary place.
    width = high - low if math.isfinite(high - low) else 0.0
    slack = 1e-9 * max(width / 2, 1e-3 * min(abs(low), abs(high)), 1e-12)
    ways = ((found["computed"], found["computed"]), found["interval"])
    met = any(least <= high + slack and most >= low - slack for least, most in ways)
    return "exact" if met else "differs"


def verdict(record: Record) -> str:
    """Return the verdict that follows from a record."""
    if record["role"] == "given":
        return "input"
    readings = {judged(one, record["stands_for"]) for one in record["readings"]}
    agree = {one != "differs" for one in readings}
    if len(agree) == 2 or (not readings and record["interval"] is None):
        return "blocked"
    return judged(record, record["stands_for"])


def follows(record: Record) -> bool:
    """Tell whether the verdict of a record, and that of each of its readings, follows from it."""
    ways = ((way["verdict"], judged(way, record["stands_for"])) for way in record["readings"])
    return record["verdict"] == verdict(record) and all(told == found for told, found in ways)


def main(path: str | Path) -> int:
    """Print every verdict that does not follow, and how many do."""
    records = json.loads(Path(path).read_text(encoding="utf-8"))["records"]
    wrong = [one for one in records if not follows(one)]
    for one in wrong:
        print(f"{one['cell']}: {one['verdict']} does not follow from its record")
    print(f"{len(records) - len(wrong)} of {len(records)} verdicts follow from their records")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).with_name("ledger.json")))
