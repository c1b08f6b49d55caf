"""Sphinx extension: equations numbered as the papers number them.

A label names the paper and its number: ``$$ ... $$ (niu2024-17)`` is shown as
(17), and ``{eq}`niu2024-17``` reads (17) too. ``-printed`` after the number
marks the formula as the paper prints it, where that cannot be right. The
prefixes stand in the configuration value ``equation_prefixes``, each with what
it puts before the number: our own equations, ``book-1``, become (B1).
"""

import re
from typing import Any

from sphinx.application import Sphinx
from sphinx.domains.math import MathDomain
from sphinx.util import logging

logger = logging.getLogger(__name__)

LABEL = re.compile(
    r"(?P<prefix>[a-z0-9]+)-(?P<number>[0-9]+[a-z]?)(?P<printed>-printed)?"
)


def printed_number(label: str, prefixes: dict[str, str]) -> str | None:
    """Return the number to show for an equation's label, or None if it names none.

    >>> printed_number("niu2024-17", {"niu2024": ""})
    '17'
    >>> printed_number("niu2024-19-printed", {"niu2024": ""})
    '19, as extracted'
    >>> printed_number("book-3", {"book": "B"})
    'B3'
    >>> printed_number("energy", {"book": "B"})
    """
    parts = LABEL.fullmatch(label)
    if parts is None or parts["prefix"] not in prefixes:
        return None
    suffix = ", as extracted" if parts["printed"] else ""
    return prefixes[parts["prefix"]] + parts["number"] + suffix


class PaperMathDomain(MathDomain):
    """The mathematics domain, with numbers read off the labels.

    The number is set as each page is read and depends on nothing but the label,
    so pages can be read in any order and in parallel.
    """

    def note_equation(self, docname: str, labelid: str, location: Any = None) -> None:
        """Record an equation under its printed number."""
        super().note_equation(docname, labelid, location)
        prefixes = self.env.config.equation_prefixes
        number = printed_number(labelid, prefixes)
        if number is None:
            logger.warning(
                "equation label %r names no number: expected one of %s, a hyphen, "
                "and the number as printed, for example 'niu2024-17'",
                labelid,
                ", ".join(sorted(prefixes)),
                location=location,
            )
            return
        # Sphinx annotates the number as int, yet only ever formats it.
        self.equations[labelid] = (docname, number)  # type: ignore[assignment]


def setup(app: Sphinx) -> dict[str, bool]:
    """Replace the mathematics domain."""
    app.add_config_value("equation_prefixes", {}, "env", [dict])
    app.add_domain(PaperMathDomain, override=True)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
