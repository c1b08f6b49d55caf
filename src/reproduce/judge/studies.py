"""Every table of our own: those of the papers, and those that hold a study against the print."""

from __future__ import annotations

from functools import cache

from reproduce.papers import catalogue
from reproduce.papers.declare import Study

# The modules of the tables that see printed answers, which no module of a paper may.
JUDGED = dict.fromkeys(("niu2024/readings", "niu2024/closest-readings"), "reproduce.judge.readings")


@cache
def studies() -> catalogue.Declared[Study]:
    """Return every table of our own by its key; its module is imported when it is used.

    Examples
    --------
    >>> "niu2024/readings" in studies()
    True
    """
    return catalogue.Declared({**catalogue.studies().modules, **JUDGED}, catalogue.own)
