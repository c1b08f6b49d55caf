"""Sphinx extension: a search for sections, keys, tables, figures, equations and printed numbers.

The search of Sphinx ignores numbers and the outputs of notebooks. The search page first shows the
results of this index of names, such as ``Table V``, ``0.9973``, ``niu2024/table-3`` and
``equation 17``, and of the words of each section. The index is a script, so that it works from a
disk.
"""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

from docutils import nodes
from markupsafe import Markup
from sphinx.application import Sphinx

from after_build import SAFE, after_build
from anchors import pages
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import anchor, library
from reproduce.views import _keys as keys

SCRIPT = Path(__file__).with_name("own_search.js")
INDEX = "search-index.js"
ROMAN = ("i", "ii", "iii", "iv", "v", "vi", "vii", "viii", "ix", "x", "xi", "xii")
# Address, text of the result, main names, other names and further words.
Entry: TypeAlias = tuple[str, str, list[str], list[str], str]
# Subjects of a page under other names than its title has.
SUBJECTS = {
    "run": "install, installation, download the notebooks",
    "data": "download data, LaTeX, BibTeX, export, CSV, JSON",
    "reading": "verdicts, what is blocked",
    "notation": "sign convention, symbols",
    "chen2023/attitude": "QUEST, Wahba",
    "posteriors/index": "how many stars",
    "posteriors/registration": "uncertainty of rotation, interval",
    "posteriors/misalignment": "misalignment interval, roll",
}
WORD = re.compile(r"[^\W\d_][\w-]+")


def renumbered(place: str) -> list[str]:
    """Return a place with the other kind of numerals, if any.

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
    links = {name: f"{page}.html#{name}" for name, page in held.items()}
    for key in catalogue():
        paper, whole = key.partition("/")[0], keys.place(key)
        place = whole.partition(",")[0]
        # Groups of quoted numbers have only a key.
        names = [] if place == "Text" else [place, place.replace("Figure", "Fig.")]
        link = links.get(anchor(key)) or links.get(f"figure-{anchor(key)}", "")
        if link:
            shown = f"{whole} of {paper}: {keys.title(key)}"
            others = with_paper(paper, renumbered(place))
            yield link, shown, [key, *with_paper(paper, names)], others, ""
        for cell in library()[key].cells if key in library() else ():
            if place := links.get(cell.anchor, link):
                shown = (
                    f"{cell.shown}, printed in {cell.place} of {paper}: {cell.label}"
                )
                numbers = dict.fromkeys([cell.text, cell.shown, cell.name])
                yield place, shown, [cell.address], [*numbers], ""


def with_paper(paper: str, names: list[str]) -> list[str]:
    """Return names without and with the paper before them."""
    return [*names, *(f"{paper} {name}" for name in names)]


def of_equations(app: Sphinx) -> Iterator[Entry]:
    """Yield the numbered equations."""
    math: Any = app.env.get_domain("math")
    for label, (page, number) in sorted(math.equations.items()):
        paper = label.partition("-")[0]
        forms = [
            form.format(number) for form in ("equation {}", "eq. {}", "eq {}", "({})")
        ]
        names = [*with_paper(paper, forms), label, f"{paper} {number}"]
        link, shown = f"{page}.html#equation-{label}", f"Equation ({number}) of {paper}"
        yield link, shown, names, [], ""


def of_sections(page: str, doctree: nodes.document) -> Iterator[Entry]:
    """Yield a page and its sections, with the words of their text and of their tables."""
    title, subjects = "", SUBJECTS.get(page, "")
    for section in doctree.findall(nodes.section):
        heading = next(section.findall(nodes.title)).astext()
        shown, title = (f"{title}: {heading}", title) if title else (heading, heading)
        words = set[str]()
        for part in section.findall(nodes.Text):
            is_html = isinstance(part.parent, nodes.raw)
            text = Markup(part.replace("<", " <")).striptags() if is_html else str(part)
            words |= {*WORD.findall(text.lower())}
        names = [heading, *filter(None, subjects.split(", "))]
        link, subjects = f"{page}.html#{section['ids'][0]}", ""
        yield link, shown, names, [], " ".join(sorted(words))


def of_studies(held: dict[str, str]) -> Iterator[Entry]:
    """Yield the supplementary tables."""
    for key in catalogue("studies"):
        if page := held.get(name := f"study-{anchor(key)}"):
            title = keys.title(key)
            shown = f"{title}: a supplementary table"
            yield f"{page}.html#{name}", shown, [key, title], [], ""


def entries(app: Sphinx) -> list[Entry]:
    """Return the whole index, tables and figures before their cells."""
    held = pages(app.env)
    items = sorted(of_items(held), key=lambda entry: "#" in entry[2][0])
    sections = (
        entry
        for page in sorted(app.env.found_docs)
        for entry in of_sections(page, app.env.get_doctree(page))
    )
    return [*items, *of_equations(app), *of_studies(held), *sections]


def write(app: Sphinx) -> None:
    """Write index and script next to the pages."""
    folder = Path(app.outdir) / "_static"
    index = json.dumps(entries(app), ensure_ascii=False, separators=(",", ":"))
    text = f"window.REPRODUCE_INDEX = {index};\n"
    (folder / INDEX).write_text(text, encoding="utf-8")
    shutil.copyfile(SCRIPT, folder / SCRIPT.name)


def load(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Load the script only on the search page."""
    if page == "search":
        address = context["pathto"](f"_static/{SCRIPT.name}", 1)
        tag = f'<script defer src="{address}"></script>'
        context["metatags"] = context.get("metatags", "") + tag


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handlers."""
    app.connect("html-page-context", load)
    after_build(app, write)
    return SAFE
