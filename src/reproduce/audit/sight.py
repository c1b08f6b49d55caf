"""The stored study of the detection power: which planted slips the checks would see."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from reproduce.audit.power import Plant


@dataclass(frozen=True)
class Seen:
    """A planted slip and who would see it.

    Parameters
    ----------
    plant : Plant
        The slip.
    relation, verdict : bool
        Whether a relation, or a verdict, turns from agreement to disagreement.
    refused : bool
        Whether a computation raised an error on the changed input instead.
    """

    plant: Plant
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


def share(slips: Iterable[Seen], by: Callable[[Seen], str]) -> dict[str, tuple[int, int, int, int]]:
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
        Trait to: slips, seen by a relation, seen by a verdict, seen by either.
    """
    counts: dict[str, tuple[int, int, int, int]] = {}
    for slip in slips:
        have = counts.get(by(slip), (0, 0, 0, 0))
        new = (1, slip.relation, slip.verdict, slip.either)
        counts[by(slip)] = (
            have[0] + new[0],
            have[1] + new[1],
            have[2] + new[2],
            have[3] + new[3],
        )
    return counts


def blind(slips: Iterable[Seen]) -> list[str]:
    """Return the cells in which no slip of any kind is seen, in the order of the study."""
    seen: dict[str, bool] = {}
    for slip in slips:
        seen[slip.plant.address] = seen.get(slip.plant.address, False) or slip.either
    return [address for address, found in seen.items() if not found]
