"""Texts of cells and verdicts, and the facts that captions and pages quote by name."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Mapping, Sequence

from markupsafe import Markup, escape

from reproduce.judge.ledger import (
    Record,
    TableRecord,
    expected,
    item_ledger,
    record_of,
)
from reproduce.judge.readings import MAX_CONDITIONS, ReadingSummary
from reproduce.judge.verdicts import VERDICTS, Flag
from reproduce.papers.declare import computation_for
from reproduce.printed.cells import PrintedCell, anchor
from reproduce.printed.number import minus, quantity
from reproduce.views._blocks import Entry, badge, code, link
from reproduce.views._numbers import digits

# Kinds of weak agreement, and their names for readers.
WEAK: dict[Flag, str] = {
    "copy": "copy",
    "difference": "difference",
    "rounding": "through rounding",
    "tolerance": "wide tolerance",
    "wide": "wide prediction",
}
_FLAGS = {**WEAK, "stand_in": "assumed value"}
# Columns of `texts` with the numbers of a cell.
NUMBERS = (
    "printed",
    "stands for",
    "computed",
    "Monte Carlo error",
    "allowed by rounded inputs",
    "predicted, central 99 %",
    "fraction of the tolerance",
    "probability",
)


def _with_unit(record: Record, text: str) -> str:
    """Return a number of a record with its unit; empty for an empty text."""
    return quantity(minus(text), record.printed_cell.symbol)


def printed(cell: PrintedCell) -> str:
    """Return a printed value with its standard deviations."""
    return " ".join((*cell.shown.split(), *[f"({cell.sigma}σ)"] * bool(cell.sigma)))


def texts(record: Record) -> dict[str, Entry]:
    """Return the texts of a record by name of the column; empty texts do not apply."""
    cell = record.printed_cell
    interval = _interval(record, record.interval)
    is_drawn = record.probability is not None
    known = expected(record.cell)
    shown: dict[str, Entry] = {
        "cell": link(cell.anchor, code(cell.name)),
        "printed": cell.shown + f" ({cell.sigma}σ)" * bool(cell.sigma),
        "stands for": _interval(record, record.stands_for),
        "computed": _with_unit(record, computed(record, extra=1)),
        "Monte Carlo error": _with_unit(
            record, f"{record.error:.1g}" if record.error else ""
        ),
        "allowed by rounded inputs": "" if is_drawn else interval,
        "predicted, central 99 %": interval if is_drawn else "",
        "fraction of the tolerance": ""
        if record.share is None
        else f"{record.share:.2f}",
        "probability": _probability(record),
        "verdict": badge(record.verdict, qualified(record)),
        "why": minus(record.reason or record.why),
    }
    if known.erratum:
        shown["why"] = Markup("{} {}. The authors' reply: {}").format(
            shown["why"],
            link(known.erratum, f"Erratum {known.erratum}"),
            replied(known.erratum, known.answer),
        )
    if made := computation_for(record.cell):
        place = f"function-{anchor(record.key)}-{made.function.__name__}"
        equations = (
            link(f"equation-{record.paper}-{n}", f"({n})") for n in made.equations
        )
        shown |= {
            "function": Markup("{} ({})").format(link(place, made.name), made.line),
            "equations": Markup(", ").join(equations),
        }
        if made.replicates:
            project, function = made.entropy
            shown["seed"] = (
                f"{project} of the project, {function} of this function; "
                f"{made.replicates:,} replicates"
            )
    if readings := record.readings:
        closest = readings.closest
        other = record.model_copy(update=dict(closest))
        text = (
            f"{choices_text(closest.choices)}: {_with_unit(other, computed(other))}, "
        )
        text += qualified(other)
        if p := _probability(other):
            text = f"{text}, p = {p}".replace("= <", "<")
        shown |= {
            "readings that agree": f"{readings.agreeing} of {readings.count}",
            "agrees with": deciding(readings),
            "closest reading": text,
        }
    return shown


def computed(record: Record, extra: int = 0) -> str:
    """Return the computed value of a record with the decimals of the printed value.

    One more digit is shown where the printed digits do not show the difference.
    """
    if record.computed is None:
        return ""
    is_near = not {"rounding", "tolerance"}.isdisjoint(record.flags)
    extra += is_near or not record.agrees
    return minus(record.printed_cell.number.format(record.computed, extra=extra))


def _interval(record: Record, ends: Sequence[float | None] | None) -> str:
    """Return an interval of a record; empty if it is open or a point."""
    if not ends or None in ends or len({*ends}) == 1:
        return ""
    texts = (record.printed_cell.number.format(end or 0.0) for end in ends)
    return _with_unit(record, " to ".join(texts))


def _probability(record: Record) -> str:
    return "" if record.mcse is None else chance(record.probability or 0.0, record.mcse)


def chance(value: float, mcse: float) -> str:
    """Return a probability to a tenth of its Monte Carlo error, or a bound below this error.

    Examples
    --------
    >>> chance(0.4321, 0.01)
    '0.43'
    """
    if value < mcse:
        return f"<\u00a0{2 * mcse:.1g}"
    return digits(value, mcse / 10)


def _joint_facts(joint: TableRecord) -> dict[str, str]:
    """Return the facts of a table on all its predicted cells together."""
    return {
        "joint": _joint_chance(joint.joint_probability, joint),
        "replicates": f"{joint.replicates:,}",
        "readings": f"{joint.readings:,}",
        "fitting": str(joint.fitting or "none"),
        "closest": choices_text(joint.closest),
        "closest-agreeing": str(joint.closest_agreeing),
        "closest-joint": _joint_chance(joint.closest_probability, joint),
        "predicted": str(joint.cells),
    }


def joint_sentence(joint: TableRecord) -> str:
    """Return sentences on all cells of a table together, and on its readings."""
    text = (
        f"Outside the central 99 % of the prediction lie {joint.outside} of {{predicted}} "
        f"predicted cells; {joint.expected_outside:.2g} are expected by chance. The "
        "probability of a table as far from the prediction as the printed one, or farther, is "
        "{joint} ({replicates} simulated tables)."
    )
    if joint.readings > 1:
        text += (
            f" {joint.fitting or 'None'} of {{readings}} readings of the text fits all "
            "{predicted} predicted cells together. Closest: {closest}, with {closest-agreeing} "
            "cells and a joint probability of {closest-joint}."
        )
    return text.format_map(_joint_facts(joint)).replace("of below", "below")


def _joint_chance(probability: float, joint: TableRecord) -> str:
    """Return a joint probability; a bound if fewer than two replicates are as far out."""
    if probability * (joint.replicates + 1) < 1.5:
        return f"below 1/{joint.replicates:,}"
    error = (probability * (1 - probability) / joint.replicates) ** 0.5
    return chance(probability, error)


def choices_text(choices: Mapping[str, str]) -> str:
    """Return the choices of a reading as on the command line.

    Examples
    --------
    >>> choices_text({"noise": "green", "repeats": "one"})
    'noise=green, repeats=one'
    """
    return ", ".join(map("=".join, choices.items())) or "every reading"


def deciding(summary: ReadingSummary) -> str:
    """Return the options that decide, and choices with which a number agrees or never does."""
    if summary.agreeing in {0, summary.count}:
        return ""
    always = "; or ".join(map(choices_text, summary.agrees_if))
    text = f"Decided by {', '.join(summary.decided_by)}. Always with {always}"
    if len(summary.agrees_if) == MAX_CONDITIONS:
        text += " (at most four choices are listed)"
    never = [f"{n}={one}" for n, listed in summary.never.items() for one in listed]
    return f"{text}. Never with {'; or '.join(never)}" if never else text


def tally(records: Collection[Record]) -> dict[str, int]:
    """Count records by verdict, in the order in which they are shown, and those that are weak."""
    counts = {word: sum(r.verdict == word for r in records) for word in VERDICTS}
    return counts | {"weak": weak(records)}


def weak(records: Iterable[Record]) -> int:
    """Count the records that agree weakly."""
    return sum(r.agrees and not {*WEAK}.isdisjoint(r.flags) for r in records)


def flags(record: Record) -> str:
    """Return the flags of a verdict in words."""
    return ", ".join(_FLAGS[name] for name in record.flags if name in _FLAGS)


def qualified(record: Record) -> str:
    """Return a verdict with its flags."""
    marks = flags(record)
    return f"{record.verdict} ({marks})" if marks else record.verdict


def replied(erratum: str, reply: str) -> Markup:
    """Return the reply of the authors to an erratum, or the page of the letter to them."""
    paper = erratum.partition("-")[0]
    letter = link(f"letter-{paper}", f"A letter to the authors of {paper}")
    return escape(reply) or Markup("none yet (page {})").format(letter)


def replied_state(record: Record) -> str:
    """Return the state of the authors' reply to a cell; empty without a reply."""
    state = record.reply
    return f"reply of the authors: {state}" if state not in {"", "none"} else ""


def facts_of(name: str) -> dict[str, str]:
    """Return the facts of a cell or of an item, by name.

    Examples
    --------
    >>> facts_of("niu2024/table-2#scale.red")["computed"]
    '0.9976'
    """
    if "#" in name:
        record = record_of(name)
        value = _with_unit(record, computed(record))
        return {"printed": record.printed_cell.shown, "computed": value}
    ledger = item_ledger(name)
    facts = counts(ledger.records)
    for joint in ledger.tables:
        facts |= _joint_facts(joint)
    return facts


def filled(text: str) -> str:
    """Fill the placeholders of a text with facts.

    Examples
    --------
    >>> filled("a scale of {niu2024/table-2#scale.red printed}")
    'a scale of 0.9976'
    """
    return re.sub(
        r"\{([^{} ]+) ?([^{}]*)\}", lambda blank: facts_of(blank[1])[blank[2]], text
    )


def counts(records: Collection[Record]) -> dict[str, str]:
    """Count verdicts; a count of agreement includes the number of weak agreements."""
    facts = {"results": str(sum(record.role == "result" for record in records))}
    for name in (*VERDICTS, "agree"):
        chosen = [
            r for r in records if (r.agrees if name == "agree" else r.verdict == name)
        ]
        count = weak(chosen)
        part = "all" if count == len(chosen) else count
        facts[name] = f"{len(chosen)}" + f" ({part} of them weakly)" * bool(count)
    return facts | {"strong": str(len(chosen) - count), "weak": str(count)}
