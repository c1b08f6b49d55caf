"""Sphinx extension: links with cards.

A link to a printed cell, an equation, a figure, a symbol, an erratum or a reference gets the class
``rp-has-card``, and `cards.js` shows the card. `tools/book_facts.py` writes the cards of the cells,
the pages contain the others. Each page has a script with the cards of its anchors, since a page
from a disk can load only scripts.
"""

import json
import re
from functools import cache
from html import escape
from pathlib import Path
from posixpath import dirname
from typing import NamedTuple

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.builders.html import StandaloneHTMLBuilder

from after_build import SAFE, after_build
from anchors import HREF, TAG, address, outputs, pages
from reproduce.printed.cells import anchor

FILE = Path("_build") / "cards.json"
HAS_CARD = "rp-has-card"
# A link to its own place.
OWN = re.compile("headerlink|rp-number|Permalink")
WITHIN = re.compile(r'\b(href|data-link)="#([^"]+)"')
BIBLIOGRAPHY, ERRATA, NOTATION = "bibliography", "audit/errata", "notation"
WITH_CARDS = ("equation-", "figure-", "symbol-")
MATH = re.compile(r"\$(.+?)\$")


class Symbol(NamedTuple):
    """A row of the table of symbols: anchor, notations, meaning and paper."""

    name: str
    written: list[str]
    meaning: str
    paper: str


@cache
def cells(book: Path) -> dict[str, str]:
    """Return the cards of the printed cells, by anchor."""
    path = book / FILE
    return dict(json.loads(path.read_text("utf-8"))) if path.is_file() else {}


@cache
def symbols(book: Path) -> list[Symbol]:
    """Return the rows of the table of symbols."""
    page = book / f"{NOTATION}.md"
    lines = page.read_text(encoding="utf-8").splitlines() if page.is_file() else []
    rows = [
        [part.strip() for part in one.split("|")[1:-1]]
        for one in lines
        if one[:3] == "| $"
    ]
    return [
        Symbol(f"symbol-{number}", MATH.findall(row[0]), row[1], row[3])
        for number, row in enumerate(rows)
    ]


def symbol(book: Path, page: str, tex: str) -> str:
    r"""Return the anchor of a symbol of a page, empty if it is not in the table."""
    plain = tex.replace(r"\mathrm", r"\text")
    for one in symbols(book):
        written = (known.replace(r"\mathrm", r"\text") for known in one.written)
        if one.paper in {"both", dirname(page)} and plain in written:
            return one.name
    return ""


def mark(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Complete the links of a page, mark those with a card, and link symbols."""
    book, held = Path(app.srcdir), pages(app.env)

    def has_card(uri: str) -> bool:
        place, _, name = uri.partition("#")
        cited = place.endswith(f"{BIBLIOGRAPHY}.html")
        known = name in cells(book) or held.get(name) == ERRATA
        return bool(name) and (known or cited or name.startswith(WITH_CARDS))

    def marked(tag: re.Match[str]) -> str:
        found = HREF.search(tag[0])
        if found is None:
            return tag[0]
        uri = f"{found[1]}#{found[2]}" if found[1] else address(app, page, found[2])
        link = tag[0].replace(found[0], f'href="{uri}"')
        if OWN.search(link) or not has_card(uri):
            return link
        if 'class="' in link:
            return link.replace('class="', f'class="{HAS_CARD} ', 1)
        return link.replace("<a", f'<a class="{HAS_CARD}"', 1)

    for raw in doctree.findall(nodes.raw):
        raw[:] = [nodes.Text(TAG.sub(marked, raw.astext()))]
    for link in doctree.findall(nodes.reference):
        uri = link.get("refuri") or f"#{link.get('refid', '')}"
        if uri[:1] == "#" and "refuri" in link:
            uri = link["refuri"] = address(app, page, uri[1:])
        if has_card(uri):
            link["classes"].append(HAS_CARD)
    if page == NOTATION:
        rows = (row for row in doctree.findall(nodes.row) if starts_with_math(row))
        for row, one in zip(rows, symbols(book), strict=True):
            row["ids"].append(one.name)
    for math in list(doctree.findall(nodes.math)):
        if name := symbol(book, page, math.astext()):
            uri = f"{app.builder.get_relative_uri(page, NOTATION)}#{name}"
            # A formula has no text before it is typeset.
            label = escape(f"Symbol {math.astext()}")
            opening = f'<a class="{HAS_CARD}" href="{uri}" aria-label="{label}">'
            first, last = (
                nodes.raw("", tag, format="html") for tag in (opening, "</a>")
            )
            math.replace_self([first, math.deepcopy(), last])


def starts_with_math(row: nodes.row) -> bool:
    """Return whether the first cell of a row begins with a formula."""
    text = row.next_node(nodes.paragraph)
    return text is not None and isinstance(text[0], nodes.math)


def cite(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Collect the cards of the references."""
    if page == BIBLIOGRAPHY and isinstance(app.builder, StandaloneHTMLBuilder):
        found = outputs(app.env)[page]["cards"]
        for citation in doctree.findall(nodes.citation):
            text = app.builder.render_partial(citation[-1].deepcopy())["fragment"]
            found[f"{BIBLIOGRAPHY}-{citation['ids'][0]}"] = text


def write(app: Sphinx) -> None:
    """Write a script for each page, with the cards of its anchors and the records of its cells."""
    book, out, held = Path(app.srcdir), Path(app.outdir), pages(app.env)

    def from_root(link: re.Match[str]) -> str:
        kind, name = link.groups()
        place = name if "/" in name else f"{held[name]}.html#{name}"
        return f'{kind}="{place}"'

    known = dict(cells(book))
    shown = {page: {**one["cards"]} for page, one in outputs(app.env).items()}
    for page, found in shown.items():
        names = {*outputs(app.env)[page]["anchors"]} & {*known}
        found |= {name: known[name] for name in sorted(names)}
    for one in symbols(book):
        signs = ", ".join(f"${tex}$" for tex in one.written)
        text = MATH.sub(r"\\(\1\\)", escape(f"{signs}: {one.meaning}"))
        shown[NOTATION][one.name] = f"<p>{text}</p>"
    records = json.loads((out / "ledger.json").read_text(encoding="utf-8"))["records"]
    by_cell = {anchor(one["cell"]): one for one in records}
    for page, found in shown.items():
        held_here = {
            "cards": {
                name: WITHIN.sub(from_root, text) for name, text in found.items()
            },
            "records": {
                by_cell[name]["cell"]: by_cell[name] for name in {*by_cell} & {*found}
            },
        }
        path = out / "cards" / f"{page}.js"
        path.parent.mkdir(parents=True, exist_ok=True)
        text = json.dumps(held_here, ensure_ascii=False, sort_keys=True)
        path.write_text(
            f"(window.rpCards ??= {{}})[{json.dumps(page)}] = {text};\n", "utf-8"
        )


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handlers."""
    app.connect("doctree-resolved", mark)
    app.connect("doctree-resolved", cite)
    after_build(app, write)
    return SAFE
