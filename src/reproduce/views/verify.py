"""Comparison of citations of cells with the statements of this package and of its releases."""

from __future__ import annotations

import re
from functools import cache
from typing import Any

from reproduce.judge.ledger import Record, record_of
from reproduce.locate import data_folder, read_toml
from reproduce.physics.validate import Text, checked
from reproduce.version import NAME, version
from reproduce.views.citations import mark, statement


@checked
def verify(citation: Text) -> str:
    """Compare the citation of a cell with the statements of this package and of its releases.

    The mark of a citation is a checksum of its statement, which anyone can compute. It protects
    the statement against changes. It is no signature, so only statements that this package makes
    or that a stored release made are confirmed. Authors and addresses are not compared.

    Parameters
    ----------
    citation : str
        Citation of a cell from `cite` in the form ``text``, with the mark ``rp:...`` at its end.

    Returns
    -------
    str
        ``current`` if this package made the statement, or if a stored release made it and the
        computed value, to six digits, and the verdict are the same now.
        ``moved since VERSION: now ...`` if the stored release VERSION made the statement and the
        value or the verdict is another one now, with the reason for the present verdict.
        ``unknown: ...`` otherwise, with the reason: it is no citation of a cell as text, statement
        and mark do not belong together, or neither this package nor a release made the statement.

    Raises
    ------
    TypeError
        If the citation is not text.

    Examples
    --------
    >>> from reproduce import cite
    >>> verify(cite("niu2024/table-2#scale.red", "text"))
    'current'
    """
    text, _, rest = " ".join(citation.split()).partition(f". {NAME} ")
    # Authors and year are before the statement, except in citations of version 0.2.0.
    stated = re.sub(r"^[^\[(]* \(\d{4}\)\. ", "", text, count=1)
    source, _, rest = rest.partition(". ")
    marked = re.search(r"\brp:\w+", rest)
    if not marked or marked[0] != mark(stated):
        return (
            "unknown: its words and its mark do not belong together, or it is not the citation of "
            "a cell as text"
        )
    named = re.search(r"(?:\[|^)(\S+#[^]\s]+)\]?: ", stated)
    address = named[1] if named else "it"
    is_released = marked[0] in released().get(source, ())
    try:
        record = record_of(address)
    except KeyError:
        now = f"{address} is not a printed number"
    else:
        now = statement(record)
        is_same = now == stated or (is_released and _agrees(stated, record))
        if is_same and (is_released or source == version()):
            return "current"
        now = f"{now}, for {record.reason or record.why}"
    if is_released:
        return f"moved since {source}: now {now}"
    return f"unknown: not stated by version {source}; now {now}"


def _agrees(text: str, record: Record) -> bool:
    """Return whether a statement of version 0.2.0 has the verdict and the value of a record."""
    found = re.search(r"(?:recomputed|assumed) ([-−]?[\d.]+(?:e[-+]?\d+)?)", text)
    stated = found and float(found[1].replace("−", "-"))
    value = record.computed
    same = stated == (None if value is None else float(f"{value:.6g}"))
    return same and text.endswith(f", {record.verdict}")


@cache
def released() -> dict[str, list[str]]:
    """Return the marks of all statements of earlier releases, by version, day and commit."""
    release = read_toml(data_folder() / "last-release.toml", dict[str, Any])
    marks: dict[str, list[str]] = release.get("marks", {})
    return marks
