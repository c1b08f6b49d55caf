"""The stored study of the detection power: which planted slips the checks would see."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from reproduce.audit.power import Plant
from reproduce.audit.report import Audit


@dataclass(frozen=True)
class Seen:
    """A planted slip and who would see it.

    Parameters
    ----------
    plant : Plant
        The slip.
    compared : bool
        Whether a relation that holds the number against another one turns from agreement to
        disagreement.
    relation, verdict : bool
        Whether any relation does, one that knows a sign or a last digit included, or a verdict.
    refused : bool
        Whether a computation raised an error on the changed input instead.
    """

    plant: Plant
    compared: bool
    relation: bool
    verdict: bool
    refused: bool

    @property
    def either(self) -> bool:
        """Whether any check sees it."""
        return self.relation or self.verdict


def stored(text: str) -> tuple[int, list[Seen]]:
    """Read the stored study.

    Parameters
    ----------
    text : str
        The content of ``data/studies/detection-power.toml``.

    Returns
    -------
    tuple of int and list of Seen
        The seed and all slips, in the order of the cells.

    Raises
    ------
    ValueError
        If the slips are not those whose hash the file names.
    """
    content = tomllib.loads(text)
    found = re.search(r"slips = \[\n(.*)\n\]\n\Z", text, flags=re.DOTALL)
    digest = hashlib.sha256(found.group(1).encode()).hexdigest() if found else ""
    if digest != content["sha256"]:
        raise ValueError("detection-power.toml was changed by hand; run its command again")
    slips = [Seen(Plant(cell, kind, told), *flags) for cell, kind, told, *flags in content["slips"]]
    return content["seed"], slips


Counts = tuple[int, int, int, int, int]


def share(slips: Iterable[Seen], by: Callable[[Seen], str]) -> dict[str, Counts]:
    """Count slips and those seen, sorted by some trait.

    Parameters
    ----------
    slips : iterable of Seen
        The slips.
    by : callable
        What to sort them by, such as the table of the cell.

    Returns
    -------
    dict
        Trait to: slips, seen by a relation that compares numbers, by any relation, by a verdict,
        by either.
    """
    counts: dict[str, Counts] = {}
    for slip in slips:
        one, two, three, four, five = counts.get(by(slip), (0, 0, 0, 0, 0))
        counts[by(slip)] = (
            one + 1,
            two + slip.compared,
            three + slip.relation,
            four + slip.verdict,
            five + slip.either,
        )
    return counts


def blind(slips: Iterable[Seen]) -> list[str]:
    """Return the cells in which no slip of any kind is seen, in the order of the study."""
    seen: dict[str, bool] = {}
    for slip in slips:
        seen[slip.plant.address] = seen.get(slip.plant.address, False) or slip.either
    return [address for address, found in seen.items() if not found]


def why_unseen(slip: Seen, audit: Audit) -> str:
    """Say why no check sees a planted slip.

    Parameters
    ----------
    slip : Seen
        A slip that nothing sees.
    audit : Audit
        The audit of its paper.

    Returns
    -------
    str
        One of a few reasons.
    """
    holding = [f for f in audit.findings if slip.plant.address in f.relation.addresses]
    comparing = [finding for finding in holding if finding.relation.compares]
    if slip.refused:
        return "a computation refuses the number with an error, which is not counted"
    if not holding:
        return "the number is in no relation"
    if not comparing:
        return "no other number depends on it; only its sign or its digits are bounded"
    if any(finding.outcome == "contradicts" for finding in comparing):
        return "a relation that would see it contradicts already"
    return "it stays within the rounding, the tolerance or the bound of its relations"
