"""Sphinx extension: a search for keys, tables, figures, equations and printed numbers.

Sphinx's own search drops numbers and the outputs of notebooks. Before its results the search page
shows those of this index: names such as ``Table V``, ``0.9973``, ``niu2024/table-3`` and
``equation 17``, and their places. The index is a script next to the pages, so that it works from a
disk too.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

from docutils import nodes
from sphinx.application import Sphinx

from anchors import pages

SCRIPT = Path(__file__).with_name("own_search.js")
INDEX = "search-index.js"
ROMAN = ("i", "ii", "iii", "iv", "v", "vi", "vii", "viii", "ix", "x", "xi", "xii")
# Address, text of the result, its own names, and other names for it.
Entry: TypeAlias = tuple[str, str, list[str], list[str]]


def renumbered(place: str) -> list[str]:
    """Return a place with the other kind of numerals, if it has one.

    >>> renumbered("Table V"), renumbered("Table 3"), renumbered("Section 2.1")
    (['Table 5'], ['Table III'], [])
    """
    word, _, number = place.partition(" ")
    if number.lower() in ROMAN:
        return [f"{word} {ROMAN.index(number.lower()) + 1}"]
    if word == "Table" and number.isdigit() and int(number) <= len(ROMAN):
        return [f"{word} {ROMAN[int(number) - 1].upper()}"]
    return []


def of_items(held: dict[str, str]) -> Iterator[Entry]:
    """Yield tables, figures and groups of quoted numbers, then their cells.

    `held` is the page of each anchor.
    """
    from reproduce.papers.catalogue import catalogue
    from reproduce.printed.cells import anchor, library
    from reproduce.views import keys

    places = {}
    for key in catalogue():
        names = (anchor(key), f"figure-{anchor(key)}")
        if found := [f"{held[name]}.html#{name}" for name in names if name in held]:
            places[key] = found[0]
            paper, whole = key.partition("/")[0], keys.place(key)
            place = whole.partition(",")[0]
            # Groups of quoted numbers have no name of their own.
            own = [] if place == "Text" else [place, place.replace("Figure", "Fig.")]
            own += [f"{paper} {name}" for name in own]
            others = [
                *renumbered(place),
                *(f"{paper} {one}" for one in renumbered(place)),
            ]
            shown = f"{whole} of {paper}: {keys.title(key)}"
            yield found[0], shown, [key, *own], others
    for key, table in library().items():
        for cell in table.cells:
            place = places.get(key, "")
            if cell.anchor in held:
                place = f"{held[cell.anchor]}.html#{cell.anchor}"
            if place:
                paper = key.partition("/")[0]
                shown = (
                    f"{cell.shown}, printed in {cell.place} of {paper}: {cell.label}"
                )
                yield place, shown, [cell.address], [*printed_as(cell), cell.name]


def printed_as(cell: Any) -> list[str]:
    """Return a cell's print, with and without its unit, and as the ledger writes it."""
    plain = cell.content.text if cell.is_number else str(cell.content)
    return list(dict.fromkeys([plain, str(cell.shown)]))


def of_equations(app: Sphinx) -> Iterator[Entry]:
    """Yield the numbered equations."""
    math: Any = app.env.get_domain("math")
    for label, (page, number) in sorted(math.equations.items()):
        paper = label.partition("-")[0]
        own = [f"equation {number}", f"eq. {number}", f"eq {number}", f"({number})"]
        names = [*own, label, f"{paper} {number}", *(f"{paper} {one}" for one in own)]
        yield (
            f"{page}.html#equation-{label}",
            f"Equation ({number}) of {paper}",
            names,
            [],
        )


def of_studies(held: dict[str, str]) -> Iterator[Entry]:
    """Yield the supplementary tables."""
    from reproduce.papers.catalogue import studies
    from reproduce.printed.cells import anchor

    for key, study in studies().items():
        if page := held.get(name := f"study-{anchor(key)}"):
            shown = f"{study.title}: a supplementary table"
            yield f"{page}.html#{name}", shown, [key, study.title], []


def entries(app: Sphinx) -> list[Entry]:
    """Return the whole index; of equal results the first is shown first."""
    held = pages(app.env)
    return [*of_items(held), *of_equations(app), *of_studies(held)]


def write(app: Sphinx, error: Exception | None) -> None:
    """Write index and script beside the pages."""
    if error is None and app.builder.format == "html":
        folder = Path(app.outdir) / "_static"
        index = json.dumps(entries(app), ensure_ascii=False, separators=(",", ":"))
        text = f"window.REPRODUCE_INDEX = {index};\n"
        (folder / INDEX).write_text(text, encoding="utf-8")
        (folder / SCRIPT.name).write_text(
            SCRIPT.read_text(encoding="utf-8"), encoding="utf-8"
        )


def load(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Load both on the search page alone."""
    if page == "search":
        scripts = [
            context["pathto"](f"_static/{name}", 1) for name in (INDEX, SCRIPT.name)
        ]
        tags = "".join(f'<script defer src="{script}"></script>' for script in scripts)
        context["metatags"] = context.get("metatags", "") + tags


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handlers."""
    app.connect("html-page-context", load)
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
