"""How a cell's numbers and its verdict are written: in the terminal, the book and the exports."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from reproduce.judge.ledger import ReadingRecord, Record, TableRecord, WholeReading
from reproduce.judge.verdicts import VERDICTS
from reproduce.printed.cells import Cell, library
from reproduce.printed.units import symbol
from reproduce.views.writing.numbers import chance, minus

MEANINGS: dict[str, str] = {
    "exact": "recomputed and rounds to the printed digits",
    "consistent": "inside the central 99 % of what the reproduction predicts",
    "differs": "recomputed and does not agree",
    "blocked": "needs something the paper does not publish, or depends on how the text is read",
    "input": "taken from the paper, nothing to compute",
}

FLAG_MEANINGS: dict[str, str] = {
    "through_rounding": "agrees only because the printed inputs are rounded",
    "repeated": "the print repeats another printed cell",
    "difference": "one printed number less another",
    "uninformative": "the predicted interval is wider than the number itself",
    "bound": "the print states a limit, not a value",
    "stand_in": "the value shown stands in for something unpublished",
    "about": "printed as an approximate number",
    "nominal": "printed as a nominal value",
}


WEAK = ("repeated", "difference", "through_rounding", "uninformative")


def name_of(record: Record) -> str:
    """Return the name of a record's cell within its item."""
    return record.cell.partition("#")[2]


def cell_of(record: Record) -> Cell:
    """Return the printed cell that a record judges."""
    return library()[record.key].by_name[name_of(record)]


def computed(record: Record, extra: int = 0) -> str:
    """Write a record's computed value with as many decimals as the print."""
    if record.computed is None:
        return ""
    # One more digit where the printed ones alone could not show the difference.
    hidden = record.verdict == "differs" or "through_rounding" in record.flags
    return minus(cell_of(record).number.format(record.computed, extra=extra + hidden))


def interval(record: Record, *, unit: bool = False) -> str:
    """Write a record's interval, empty where there is none."""
    if record.interval is None or record.interval[0] == record.interval[1]:
        return ""
    number = cell_of(record).number
    low, high = (minus(number.format(end, extra=1)) for end in record.interval)
    text = f"{low} to {high}"
    return quantity(text, symbol(record.unit)) if unit and record.unit else text


def probability(record: Record) -> str:
    """Write a record's probability with no more digits than its Monte Carlo error allows."""
    if record.probability is None or record.mcse is None:
        return ""
    return chance(record.probability, record.mcse)


def joint_chance(joint: TableRecord) -> str:
    """Write the joint probability of a table."""
    return _counted(joint.joint_probability, joint.mcse, joint.replicates)


def _counted(probability: float, mcse: float, replicates: int, before: str = "") -> str:
    """Write a probability counted among replicates: a bound where next to none lie so far out."""
    if probability * (replicates + 1) < 1.5:
        return f"below 1 in {replicates:,}"
    return before + chance(probability, mcse)


def fitting(readings: tuple[WholeReading, ...]) -> str:
    """Say whether one reading of the text fits all cells of a table that depend on one."""
    count = sum(one.fits for one in readings)
    closest = max(
        readings,
        key=lambda one: (one.fits, one.agreeing - one.apart, one.joint_probability or 0.0),
    )
    what = "fits" if count == 1 else "fit"
    return (
        f"One reading for all cells that depend on a reading: {count or 'none'} of "
        f"{len(readings)} {what}. Closest: {closest.name}, {whole(closest)}."
    )


def whole(reading: WholeReading) -> str:
    """Write how a reading fares on all cells at once."""
    told = f"{reading.agreeing} of {reading.cells} cells one by one"
    if reading.apart:
        told += f", {reading.apart} of them through rounding"
    return told + (f"; together {chance_of(reading)}" if reading.replicates else "")


def chance_of(reading: WholeReading) -> str:
    """Write the joint probability of a reading, empty without one."""
    if reading.joint_probability is None or reading.mcse is None:
        return ""
    return _counted(reading.joint_probability, reading.mcse, reading.replicates, "p = ")


def read(record: Record, reading: ReadingRecord) -> str:
    """Write what a blocked cell is under one reading of the text."""
    marks = flags(reading.flags, {"through_rounding", "uninformative"})
    hidden = not reading.agrees or "through_rounding" in reading.flags
    value = minus(cell_of(record).number.format(reading.computed, extra=int(hidden)))
    return f"{quantity(value, unit(record))}, {reading.verdict}{f' ({marks})' * bool(marks)}"


def unit(record: Record) -> str:
    """Write the unit of a record, empty for pure numbers, counts and words."""
    return symbol(record.unit) if record.unit else ""


def quantity(value: str, mark: str) -> str:
    """Write a number before the sign of its unit."""
    gap = "" if mark in {"", "°", "″"} else "\u202f"
    return f"{value}{gap}{mark}"


def tally(records: Collection[Record]) -> dict[str, int]:
    """Count records by verdict, every verdict present, in the order in which they are shown."""
    return {verdict: sum(r.verdict == verdict for r in records) for verdict in VERDICTS}


def weak_agreement(record: Record) -> bool:
    """Tell whether a record agrees in a way that says little."""
    return record.verdict in {"exact", "consistent"} and not {*WEAK}.isdisjoint(record.flags)


def weak(records: Iterable[Record]) -> int:
    """Count the records that agree in a way that says little."""
    return sum(map(weak_agreement, records))


def flags(names: Iterable[str], shown: Collection[str] = WEAK) -> str:
    """Write flags as words."""
    return ", ".join(name.replace("_", " ") for name in names if name in shown)


def qualified(record: Record) -> str:
    """Write a verdict with what makes it weak."""
    marks = flags(record.flags)
    return f"{record.verdict} ({marks})" if marks else record.verdict
