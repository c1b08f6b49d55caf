"""The stored study of the tests: which small changes of the code they notice, and which not."""

from __future__ import annotations

import hashlib
import re
import tomllib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from scipy.stats import binomtest


@dataclass(frozen=True)
class Mutant:
    """A small change of the code, and what the tests made of it.

    Parameters
    ----------
    name : str
        Ten hexadecimal digits.
    file, function, line : str, str, int
        Where it lies; the file below the package.
    operator : str
        What cosmic-ray calls the change.
    before, after : str
        The line as it stands, and as it was changed.
    outcome : str
        ``killed`` by a failing test, ``timeout`` where a test no longer ended, or ``survived``.
    test : str
        The test that failed.
    """

    name: str
    file: str
    function: str
    line: int
    operator: str
    before: str
    after: str
    outcome: str
    test: str

    @property
    def folder(self) -> str:
        """Folder of the package in which it lies."""
        return self.file.partition("/")[0]


@dataclass(frozen=True)
class Study:
    """All mutants that were drawn.

    Parameters
    ----------
    mutants : tuple of Mutant
        In order of file and line.
    made : mapping
        How many mutants there were to draw from, by folder.
    note : mapping
        Command, tool, seed, operators and the hash of each changed file.
    """

    mutants: tuple[Mutant, ...]
    made: Mapping[str, int]
    note: Mapping[str, object]


@dataclass(frozen=True)
class Reason:
    """Why a mutant survives.

    Parameters
    ----------
    equivalent : bool
        Whether the changed code does the same, so that no test can tell them apart.
    text : str
        The reason in words.
    """

    equivalent: bool
    text: str


@dataclass(frozen=True)
class Tally:
    """Counts of mutants.

    Parameters
    ----------
    sampled, killed, timeouts, survived, equivalent : int
        Timeouts are among the killed, the equivalent ones among the survivors.
    """

    sampled: int
    killed: int
    timeouts: int
    survived: int
    equivalent: int

    def share(self, confidence: float = 0.95) -> tuple[float, float, float]:
        """Return the killed share of all that were sampled, with its interval.

        Parameters
        ----------
        confidence : float
            Of the interval, between 0 and 1.

        Returns
        -------
        tuple of float
            The share, and the lower and upper end of the exact binomial interval of Clopper and
            Pearson. The sample is stratified and drawn without replacement, which scatters less
            than the binomial law: the interval is rather too wide.

        Examples
        --------
        >>> share, low, high = Tally(20, 20, 0, 0, 0).share()
        >>> share, round(low, 6) == round(0.025 ** (1 / 20), 6), high
        (1.0, True, 1.0)
        """
        found = binomtest(self.killed, self.sampled).proportion_ci(confidence, method="exact")
        return self.killed / self.sampled, float(found.low), float(found.high)

    @property
    def share_of_killable(self) -> float:
        """Killed share of those that a test could kill: all but the equivalent ones."""
        return self.killed / (self.sampled - self.equivalent)


def stored(text: str) -> Study:
    """Read the stored study.

    Parameters
    ----------
    text : str
        The content of ``data/studies/mutants.toml``.

    Returns
    -------
    Study
        All that it holds.

    Raises
    ------
    ValueError
        If the mutants are not those whose hash the file names.
    """
    content = tomllib.loads(text)
    found = re.search(r"mutants = \[\n(.*?)\n\]\n", text, flags=re.DOTALL)
    digest = hashlib.sha256(found.group(1).encode()).hexdigest() if found else ""
    if digest != content["sha256"]:
        raise ValueError("mutants.toml was changed by hand; run make mutants again")
    note = {key: value for key, value in content.items() if key not in ("mutants", "made")}
    return Study(tuple(Mutant(*row) for row in content["mutants"]), content["made"], note)


def reasons(text: str, study: Study) -> dict[str, Reason]:
    """Read why each survivor survives.

    Parameters
    ----------
    text : str
        The content of ``data/studies/mutants-survivors.toml``.
    study : Study
        Whose survivors these are.

    Returns
    -------
    dict
        Name of the mutant to reason.

    Raises
    ------
    ValueError
        If a survivor has no reason, or a reason no survivor.
    """
    found = {
        name: Reason(entry["equivalent"], entry["reason"])
        for name, entry in tomllib.loads(text).items()
    }
    survivors = {one.name for one in study.mutants if one.outcome == "survived"}
    if survivors != set(found):
        lacking, idle = sorted(survivors - set(found)), sorted(set(found) - survivors)
        raise ValueError(f"expected a reason for every survivor; none for {lacking}, idle: {idle}")
    return found


def tally(mutants: Iterable[Mutant], why: Mapping[str, Reason]) -> Tally:
    """Count outcomes.

    Parameters
    ----------
    mutants : iterable of Mutant
        What to count.
    why : mapping
        Reasons of the survivors among them.

    Returns
    -------
    Tally
        The counts.
    """
    all_ = list(mutants)
    survivors = [one for one in all_ if one.outcome == "survived"]
    return Tally(
        sampled=len(all_),
        killed=len(all_) - len(survivors),
        timeouts=sum(one.outcome == "timeout" for one in all_),
        survived=len(survivors),
        equivalent=sum(why[one.name].equivalent for one in survivors),
    )
