"""Sphinx extension: equations with the numbers of the papers.

A label contains the paper and its number: ``$$ ... $$ (niu2024-17)`` and ``{eq}`niu2024-17``` are
shown as (17). ``-printed`` after the number marks a printed formula that is wrong. The setting
``equation_prefixes`` maps each prefix to a sign before the number: ``book-1`` becomes (B1).
"""

import re
from typing import Any

from sphinx.application import Sphinx
from sphinx.domains.math import MathDomain
from sphinx.util import logging

from after_build import SAFE

logger = logging.getLogger(__name__)

LABEL = re.compile(
    r"(?P<prefix>[a-z0-9]+)-(?P<number>[0-9]+[a-z]?)(?P<printed>-printed)?"
)


def printed_number(label: str, prefixes: dict[str, str]) -> str | None:
    """Return the shown number of the label of an equation, None if it has no number.

    >>> printed_number("niu2024-17", {"niu2024": ""})
    '17'
    >>> printed_number("niu2024-19-printed", {"niu2024": ""})
    '19, as extracted'
    >>> printed_number("book-3", {"book": "B"})
    'B3'
    >>> for label in ("energy", "smith1999-1", "niu2024", "niu2024-x", "niu2024-1-2"):
    ...     assert printed_number(label, {"niu2024": ""}) is None
    """
    parts = LABEL.fullmatch(label)
    if parts is None or parts["prefix"] not in prefixes:
        return None
    suffix = ", as extracted" if parts["printed"] else ""
    return prefixes[parts["prefix"]] + parts["number"] + suffix


class PaperMathDomain(MathDomain):
    """The mathematics domain, with the numbers of the labels.

    A number depends only on its label, so pages can be read in any order and in parallel.
    """

    def note_equation(self, docname: str, labelid: str, location: Any = None) -> None:
        """Record an equation under its printed number."""
        super().note_equation(docname, labelid, location)
        prefixes = self.env.config.equation_prefixes
        number = printed_number(labelid, prefixes)
        if number is None:
            logger.warning(
                "equation label %r: expected one of %s, a hyphen and the printed number, "
                "for example 'niu2024-17'",
                labelid,
                ", ".join(sorted(prefixes)),
                location=location,
            )
            return
        # The type in Sphinx is int, but the number is only formatted.
        self.equations[labelid] = (docname, number)  # type: ignore[assignment]


def setup(app: Sphinx) -> dict[str, bool]:
    """Replace the mathematics domain."""
    app.add_config_value("equation_prefixes", {}, "env", [dict])
    app.add_domain(PaperMathDomain, override=True)
    return SAFE
