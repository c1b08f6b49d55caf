"""Sphinx extension: a search that knows keys, tables, equations, numbers and sections.

Sphinx's own search drops numbers and does not look into tables. Before its results the search page
shows those of an index of our own: what a reader would type (``Table V``, ``0.9973``,
``niu2024/table-3``, ``equation 17``) and the place where it stands. The index is a script beside
the pages, so that it answers from a disk too.
"""

from __future__ import annotations

import json
import re
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeAlias

from docutils import nodes
from sphinx.application import Sphinx

SCRIPT = Path(__file__).with_name("own_search.js")
INDEX = "search-index.js"
ROMAN = ("i", "ii", "iii", "iv", "v", "vi", "vii", "viii", "ix", "x", "xi", "xii")
IDENTIFIED = re.compile(r'\bid="([^"]+)"')
# What a reader may look for under another word than the title of its page.
WORDS = {
    "audit/errata": ["misprint", "misprints", "erratum", "corrections"],
    "posteriors/diagnostics": [
        "coverage",
        "convergence",
        "R-hat",
        "simulation-based calibration",
    ],
    "audit/relations": ["contradiction", "contradictions", "consistency"],
}
# Where something stands, what is shown of it, its own names, and other names for it.
Entry: TypeAlias = tuple[str, str, list[str], list[str]]


def renumbered(place: str) -> list[str]:
    """Return a place under the other kind of numerals, where it has one.

    >>> renumbered("Table V"), renumbered("Table 3"), renumbered("Section 2.1")
    (['Table 5'], ['Table III'], [])
    """
    word, _, number = place.partition(" ")
    if number.lower() in ROMAN:
        return [f"{word} {ROMAN.index(number.lower()) + 1}"]
    if word == "Table" and number.isdigit() and int(number) <= len(ROMAN):
        return [f"{word} {ROMAN[int(number) - 1].upper()}"]
    return []


def places(root: Path, pages: Mapping[str, str]) -> dict[str, dict[str, str]]:
    """Return, for every anchor of the written pages, the addresses by the folder of the page."""
    found: dict[str, dict[str, str]] = {}
    for page in sorted(pages):
        text = (root / f"{page}.html").read_text(encoding="utf-8")
        for name in IDENTIFIED.findall(text):
            found.setdefault(name, {}).setdefault(
                page.partition("/")[0], f"{page}.html#{name}"
            )
    return found


def of_items(anchors: Mapping[str, Mapping[str, str]]) -> Iterator[Entry]:
    """Yield tables, figures and groups of quoted numbers, then their printed numbers."""
    from reproduce.papers.catalogue import catalogue
    from reproduce.printed.cells import anchor, library
    from reproduce.views import keys

    def where(name: str, paper: str) -> str | None:
        known = anchors.get(name) or anchors.get(f"figure-{name}") or {}
        return known.get(paper) or next(iter(known.values()), None)

    addresses = {key: where(anchor(key), key.partition("/")[0]) for key in catalogue()}
    for key, address in addresses.items():
        paper, whole = key.partition("/")[0], keys.place(key)
        place = whole.partition(",")[0]
        # Groups of quoted numbers all stand in the text.
        own = [] if place == "Text" else [place, f"{paper} {place}"]
        own += [one.replace("Figure", "Fig.") for one in own if "Figure" in one]
        others = [*renumbered(place), *(f"{paper} {one}" for one in renumbered(place))]
        if address:
            yield address, f"{whole} of {paper}: {keys.title(key)}", [key, *own], others
    for key, table in library().items():
        paper = key.partition("/")[0]
        for cell in table.cells:
            if address := where(cell.anchor, paper) or addresses.get(key):
                shown = (
                    f"{cell.shown}, printed in {cell.place} of {paper}: {cell.label}"
                )
                yield address, shown, [cell.address], [*printed_as(cell), cell.name]


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


def of_studies(anchors: Mapping[str, Mapping[str, str]]) -> Iterator[Entry]:
    """Yield the tables of our own."""
    from reproduce.papers.catalogue import studies
    from reproduce.printed.cells import anchor

    for key, study in studies().items():
        if address := next(
            iter(anchors.get(f"study-{anchor(key)}", {}).values()), None
        ):
            yield address, f"{study.title}: a table of our own", [key, study.title], []


def of_pages(titles: Mapping[str, str]) -> Iterator[Entry]:
    """Yield the pages, by title."""
    for page, title in titles.items():
        yield f"{page}.html", title, [title], WORDS.get(page, [])


def of_sections(app: Sphinx, titles: Mapping[str, str]) -> Iterator[Entry]:
    """Yield the sections that stand once in the book, by heading."""
    found = [
        (f"{page}.html{link['anchorname']}", link.astext(), title)
        for page, title in titles.items()
        for link in app.env.tocs[page].findall(nodes.reference)
        if link["anchorname"]
    ]
    headings = [heading for _, heading, _ in found]
    for address, heading, title in found:
        if headings.count(heading) == 1:
            yield address, f"{heading}, in {title}", [heading], []


def entries(app: Sphinx) -> list[Entry]:
    """Return the whole index, in the order in which equals are shown."""
    titles = {page: title.astext() for page, title in sorted(app.env.titles.items())}
    anchors = places(Path(app.outdir), titles)
    return [
        *of_items(anchors),
        *of_equations(app),
        *of_pages(titles),
        *of_sections(app, titles),
        *of_studies(anchors),
    ]


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
