"""What two independent readings of the papers found, and how much both may have missed.

The paper was read line by line twice for relations that it should keep; the second reader did not
know the first list. What both found tells how much each of them finds, and so how much neither
found: the estimate of Lincoln and Petersen, in Chapman's form that is nearly unbiased for small
counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass

from reproduce.audit.relation import Reading, Relation


@dataclass(frozen=True)
class Merged:
    """Counts of two readings.

    Parameters
    ----------
    first, second : int
        Found by that reading alone.
    both : int
        Found by both.
    merging : int
        Found by neither, but when their lists were laid side by side.

    Examples
    --------
    Each reader finds half of what the other finds, so about a quarter escapes both.

    >>> merged = Merged(first=2, second=2, both=2)
    >>> round(merged.missed, 2)
    1.33
    """

    first: int
    second: int
    both: int
    merging: int = 0

    @property
    def found(self) -> int:
        """All that is known, however it was found."""
        return self.first + self.second + self.both + self.merging

    @property
    def missed(self) -> float:
        """The estimate of what both readings missed, what the merging found included."""
        one, two = self.first + self.both, self.second + self.both
        whole = (one + 1) * (two + 1) / (self.both + 1) - 1
        return whole - (self.first + self.second + self.both)

    @property
    def error(self) -> float:
        """The standard error of that estimate."""
        one, two = self.first + self.both + 1, self.second + self.both + 1
        share = self.first * self.second / ((self.both + 1) ** 2 * (self.both + 2))
        return math.sqrt(one * two * share)


def merged(readings: Iterable[Reading]) -> Merged:
    """Count what each reading found.

    Parameters
    ----------
    readings : iterable of str
        For each thing found: ``first``, ``second``, ``both`` or ``merging``.

    Returns
    -------
    Merged
        The counts.

    Raises
    ------
    ValueError
        If a thing does not say who found it.
    """
    counts = {"first": 0, "second": 0, "both": 0, "merging": 0}
    for reading in readings:
        if reading not in counts:
            raise ValueError(f"expected one of {', '.join(counts)}, got {reading!r}")
        counts[reading] += 1
    return Merged(**counts)


def lines(relations: Iterable[Relation]) -> list[Reading]:
    """Return who found each line of declaration, of which several relations can come.

    Parameters
    ----------
    relations : iterable of Relation
        Relations as declared.

    Returns
    -------
    list of str
        One reading for each line.
    """
    return list({(r.line, r.source): r.reading for r in relations}.values())
