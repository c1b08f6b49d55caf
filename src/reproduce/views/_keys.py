"""Validation of keys with suggestions, and the items that keys name."""

from __future__ import annotations

import difflib
from collections import ChainMap
from collections.abc import Collection

from reproduce.papers.catalogue import KINDS, catalogue
from reproduce.papers.declare import declarations
from reproduce.physics.validate import Text, checked
from reproduce.printed.cells import PAPERS, anchor, library


@checked
def check_key(key: Text) -> str:
    """Return `key` if it names an item.

    Examples
    --------
    >>> check_key("niu2024/table-3")
    'niu2024/table-3'
    """
    if key in catalogue():
        return key
    kind = place(key).lower()
    if kind.startswith("supplementary"):
        raise KeyError(f"key: expected an item of a paper, got the {kind} {key}")
    near = difflib.get_close_matches(key, ChainMap(*map(catalogue, KINDS)), cutoff=0.5)
    hint = f"such as {', '.join(near)}, " if near else ""
    raise KeyError(
        f"key: expected a key of `reproduce contents`, {hint}got {key!r}. Correct the key"
    )


def check_choice(argument: str, name: str, known: Collection[str]) -> str:
    """Return the value `name` of an argument if it is a known one."""
    if name not in known:
        raise ValueError(
            f"{argument}: expected one of {', '.join(known)}, got {name!r}"
        )
    return name


def chosen_papers(paper: str | None) -> tuple[str, ...]:
    """Return the paper of this name, or all papers."""
    return PAPERS if paper is None else (check_choice("paper", paper, PAPERS),)


def title(key: str) -> str:
    """Return the title of an item, a supplementary table or a drawing."""
    named = [library()[key]] if key in library() else declarations(key)
    return "; ".join(dict.fromkeys(one.title for one in named))


def place(key: str) -> str:
    """Return the place of an item in its paper, such as ``Table 3`` or ``Figure 4``."""
    if key in catalogue("studies"):
        return "Supplementary table"
    if key in catalogue("drawings"):
        return "Supplementary figure"
    if key in library():
        return library()[key].place
    return f"Figure {key.rpartition('-')[2]}"


def element(address: str) -> str:
    """Return the anchor of an item, a cell or a posterior on its page.

    Examples
    --------
    >>> element("niu2024/fig-4"), element("chen2023/heat"), element("niu2024/table-2#scale.red")
    ('figure-niu2024-fig-4', 'study-chen2023-heat', 'niu2024-table-2-scale-red')
    """
    if address.partition("#")[0] in library() or "/" not in address:
        return anchor(address)
    kind = "study" if address in catalogue("studies") else "figure"
    return f"{kind}-{anchor(address)}"
