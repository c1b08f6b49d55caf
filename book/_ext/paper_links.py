"""Sphinx extension: links from the documentation of a function to its equations.

In ``Implements: niu2024 (17), (18).`` each number becomes a link to the equation in the book. An
equation that no page shows fails the build.
"""

import re
from typing import Any

from sphinx.application import Sphinx

from after_build import SAFE

CLAIM = re.compile(
    r"^(\s*)(Implements:|Printed form of) (niu2024|chen2023) (\(\d+\).*)$"
)


def linked(line: str) -> str:
    """Return a line of a docstring with links instead of its equation numbers.

    >>> linked("Implements: niu2024 (17), (18).")
    'Implements: niu2024 :eq:`niu2024-17`, :eq:`niu2024-18`.'
    >>> linked("Printed form of niu2024 (24). It diverges.")
    'Printed form of niu2024 :eq:`niu2024-24-printed`. It diverges.'
    >>> linked("Nothing is claimed (17).")
    'Nothing is claimed (17).'
    """
    match = CLAIM.match(line)
    if match is None:
        return line
    indent, verb, paper, rest = match.groups()
    suffix = "-printed" if verb.startswith("Printed") else ""
    claim, stop, remark = rest.partition(".")
    claim = re.sub(r"\((\d+)\)", rf":eq:`{paper}-\1{suffix}`", claim)
    return f"{indent}{verb} {paper} {claim}{stop}{remark}"


def claimed(line: str) -> list[str]:
    """Return the labels of the equations in a line of a docstring.

    >>> claimed("Implements: niu2024 (17), (18).")
    ['niu2024-17', 'niu2024-18']
    >>> claimed("Printed form of niu2024 (24). It diverges.")
    ['niu2024-24-printed']
    >>> claimed("Nothing is claimed (17).")
    []
    """
    return re.findall(r":eq:`([^`]+)`", linked(line)) if CLAIM.match(line) else []


def link_equations(
    app: Sphinx, what: str, name: str, obj: Any, options: Any, lines: list[str]
) -> None:
    """Replace the equation numbers of a docstring by links."""
    lines[:] = [linked(line) for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handler, before napoleon turns sections into fields."""
    app.connect("autodoc-process-docstring", link_equations, priority=400)
    return SAFE
