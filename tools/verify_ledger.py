"""Derive every verdict of the ledger again, from the ledger and the list of readings only.

    python verify_ledger.py [ledger.json [readings.csv]]

Needs only Python. A printed number stands for the interval `stands_for` (an open end is null). A
computed number agrees if it, or the interval that its rounded inputs allow, meets that interval. A
predicted number agrees if its probability, two-sided and over that interval, leaves it in the
central 99 %. If the text has several readings, the cell is ambiguous if some of them agree and
others do not. A cell that needs unpublished data has no comparison.
"""

import csv
import json
import math
import sys
from pathlib import Path
from typing import Any

OUTSIDE = 0.01
Record = dict[str, Any]
Ends = tuple[float | None, float | None]


def judged(found: Record, stands_for: Ends) -> str:
    """Return exact, consistent or differs for a record or a reading."""
    if found["probability"] is not None:
        return "consistent" if found["probability"] >= OUTSIDE else "differs"
    first, last = stands_for
    low, high = (
        -math.inf if first is None else first,
        math.inf if last is None else last,
    )
    # Sums of decimal numbers leave a few units of the last binary place.
    width = high - low if math.isfinite(high - low) else 0.0
    slack = 1e-9 * max(width / 2, 1e-3 * min(abs(low), abs(high)), 1e-12)
    ways = ((found["computed"], found["computed"]), found["interval"])
    met = any(least <= high + slack and most >= low - slack for least, most in ways)
    return "exact" if met else "differs"


def verdict(record: Record, readings: list[Record]) -> str:
    """Return the verdict that follows from a record and its readings."""
    if record["role"] == "given":
        return "input"
    if record["interval"] is None:
        return "unpublished"
    agree = {judged(one, record["stands_for"]) != "differs" for one in readings}
    return "ambiguous" if len(agree) == 2 else judged(record, record["stands_for"])


def follows(record: Record, readings: list[Record]) -> bool:
    """Return whether the verdict of a record and the counts of its readings follow."""
    counted = record["readings"] or {"count": 0, "agreeing": 0}
    agreeing = sum(judged(one, record["stands_for"]) != "differs" for one in readings)
    counts = (len(readings), agreeing) == (counted["count"], counted["agreeing"])
    return counts and record["verdict"] == verdict(record, readings)


def listed(path: Path) -> dict[str, list[Record]]:
    """Return the readings of each cell."""
    found: dict[str, list[Record]] = {}
    lines = path.read_text(encoding="utf-8").splitlines()
    for row in csv.DictReader(line for line in lines if not line.startswith("#")):
        computed, low, high = (float(row[n]) for n in ("computed", "low", "high"))
        probability = float(row["probability"]) if row["probability"] else None
        numbers = {"computed": computed, "interval": (low, high)}
        found.setdefault(row["cell"], []).append(
            {**numbers, "probability": probability}
        )
    return found


def main(ledger: str | Path, readings: str | Path) -> int:
    """Print every verdict that does not follow, and the number of those that do."""
    records = json.loads(Path(ledger).read_text(encoding="utf-8"))["records"]
    every = listed(Path(readings))
    wrong = [one for one in records if not follows(one, every.get(one["cell"], []))]
    for one in wrong:
        print(f"{one['cell']}: {one['verdict']} does not follow from its record")
    print(
        f"{len(records) - len(wrong)} of {len(records)} verdicts follow from their records"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    inputs = [
        Path(__file__).with_name(name) for name in ("ledger.json", "readings.csv")
    ]
    inputs[: len(sys.argv) - 1] = map(Path, sys.argv[1:])
    sys.exit(main(*inputs))
