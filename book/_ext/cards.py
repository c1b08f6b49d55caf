"""Sphinx extension: what a link leads to, shown beside it as a card.

A link to a printed cell, an equation, a figure, a symbol, an erratum or a reference gets the class
``rp-has-card``, which is the one sign of it; `cards.js` shows the card. The cards of all cells come
from `tools/book_facts.py`, all others from the pages themselves. They stand in one script beside
the pages, since a page that is opened from a disk may load nothing else.
"""

import json
import re
from collections.abc import Iterator
from functools import cache
from html import escape, unescape
from pathlib import Path
from posixpath import dirname, join, normpath
from typing import Any, NamedTuple

from docutils import nodes
from sphinx.application import Sphinx

import anchors

FILE = Path("_build") / "cards.json"
LINK = re.compile(r'<a\b([^>]*?)\bhref="([^"#]*)#([^"]+)"([^>]*)>')
CLASS = re.compile(r'\bclass="')
SIGN = "rp-has-card"
# What leads to its own place.
OWN = re.compile("headerlink|rp-number|Permalink")
WITHIN = re.compile(r'\b(href|data-link)="#([^"]+)"')
HREF = re.compile(r'\bhref="(?!https?:)([^"]*)"')
ANCHOR = re.compile(r"</?a\b[^>]*>")
# What a page shows under an anchor of its own.
EQUATION = re.compile(
    r'<div class="math[^"]*" id="(equation-[^"]+)">\s*(?:<span class="eqno">.*?</span>)?'
    r"(.*?)</div>",
    re.DOTALL,
)
REFERENCE = re.compile(r'<div class="citation" id="([^"]+)".*?<p>(.*?)</p>', re.DOTALL)
FIGURE = re.compile(
    r'<figure class="rp-figure" id="([^"]+)".*?<svg role="img" aria-label="([^"]*)".*?'
    r"<figcaption>(.*?)</figcaption>.*?href=\"[^\"]*?(figures/[^\"]+\.svg)\"",
    re.DOTALL,
)
ERRATUM = re.compile(
    r'id="([^"]+)"[^>]*>\s*(<table class="[^"]*rp-erratum">.*?</table>)', re.DOTALL
)
BIBLIOGRAPHY, ERRATA, NOTATION = "bibliography", "audit/errata", "notation"
INLINE = re.compile(r'<span class="math notranslate nohighlight">\\\((.*?)\\\)</span>')
MATH = re.compile(r"\$(.+?)\$")
ROW = re.compile(r'<tr class="row-(?:even|odd)">(?=<td><p><span class="math)')


class Symbol(NamedTuple):
    """A row of the table of symbols: its anchor, how it is written, what it means, whose it is."""

    name: str
    written: list[str]
    meaning: str
    paper: str


@cache
def cards(path: Path, changed: float) -> dict[str, str]:
    """Read the cards of all printed cells, by anchor, from a file that last changed at a time."""
    found: dict[str, str] = json.loads(path.read_text(encoding="utf-8"))
    return found


def cells(app: Sphinx) -> dict[str, str]:
    """Return the cards of all printed cells; none in a book without any."""
    path = Path(app.srcdir) / FILE
    return cards(path, path.stat().st_mtime) if path.is_file() else {}


@cache
def symbols(book: Path) -> list[Symbol]:
    """Read the table of symbols; a book may have none."""
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


def plain(tex: str) -> str:
    """Write a symbol in one way.

    >>> plain(r"\\mathbf R_{\\mathrm{st}}")
    '\\\\mathbf R_{\\\\text{st}}'
    """
    return unescape(tex).replace(r"\mathrm", r"\text")


def symbol(app: Sphinx, page: str, tex: str) -> str:
    """Return the anchor of a symbol that a page shows, empty where it is none of its paper."""
    known = [
        one for one in symbols(Path(app.srcdir)) if one.paper in {"both", dirname(page)}
    ]
    return next(
        (one.name for one in known if plain(tex) in map(plain, one.written)), ""
    )


def mark(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Give every link of a page that has a card its sign, and symbols their links."""
    known, held = cells(app), anchors.pages(app.env)
    shown = ("equation-", "figure-", "drawing-", "symbol-")

    def signed(link: re.Match[str]) -> str:
        before, page_of, name, after = link.groups()
        has = (
            name in known
            or page_of.endswith(f"{BIBLIOGRAPHY}.html")
            or held.get(name) == ERRATA
        )
        if not (has or name.startswith(shown)) or OWN.search(before + after):
            return link.group(0)
        marks = f'{before}href="{page_of}#{name}"{after}'
        if CLASS.search(marks):
            return "<a" + CLASS.sub(f'class="{SIGN} ', marks, count=1) + ">"
        return f'<a class="{SIGN}"{marks}>'

    def named(math: re.Match[str]) -> str:
        if not (name := symbol(app, page, math[1])):
            return math[0]
        # A formula has no text before it is typeset.
        uri = app.builder.get_relative_uri(page, NOTATION)
        return f'<a href="{uri}#{name}" aria-label="Symbol {escape(math[1])}">{math[0]}</a>'

    if body := context.get("body", ""):
        if page == NOTATION:
            rows = iter(symbols(Path(app.srcdir)))
            body = ROW.sub(lambda row: f'{row[0][:-1]} id="{next(rows).name}">', body)
        context["body"] = LINK.sub(signed, INLINE.sub(named, body))


def write(app: Sphinx, error: Exception | None) -> None:
    """Write the script of all cards, once the pages stand."""
    if error is not None or app.builder.format != "html":
        return
    found = {name: led(app, html) for name, html in cells(app).items()}
    root = Path(app.outdir)
    for path in sorted(root.rglob("*.html")):
        page = path.relative_to(root).as_posix()
        found |= {
            n: rooted(page, html) for n, html in shown(page, path.read_text("utf-8"))
        }
    for one in symbols(Path(app.srcdir)):
        signs = ", ".join(f"${tex}$" for tex in one.written)
        html = MATH.sub(r"\\(\1\\)", escape(f"{signs}: {one.meaning}"))
        found[one.name] = f"<p>{html}</p>"
    script = f"window.rpCards = {json.dumps(found, ensure_ascii=False)};\n"
    if (ledger := root / "ledger.json").is_file():
        records = json.loads(ledger.read_text(encoding="utf-8"))["records"]
        by_cell = json.dumps({one["cell"]: one for one in records}, ensure_ascii=False)
        script += f"window.rpLedger = {by_cell};\n"
    (root / "cards.js").write_text(script, encoding="utf-8")


def shown(page: str, text: str) -> Iterator[tuple[str, str]]:
    """Yield the anchor and the card of what a page shows beside printed cells."""
    for name, html in EQUATION.findall(text):
        yield name, f"<p>{html.strip()}</p>"
    for name, label, caption, file in FIGURE.findall(text):
        yield (
            name,
            f'<img data-src="{file}" alt="{label}"><p>{ANCHOR.sub("", caption)}</p>',
        )
    if page == f"{ERRATA}.html":
        yield from ERRATUM.findall(text)
    if page == f"{BIBLIOGRAPHY}.html":
        yield from (
            (f"{BIBLIOGRAPHY}-{n}", f"<p>{h}</p>") for n, h in REFERENCE.findall(text)
        )


def rooted(page: str, html: str) -> str:
    """Write the links of a page as links from the root of the site.

    >>> rooted("audit/errata.html", '<a href="../data.html#ledger"><a href="#one">')
    '<a href="data.html#ledger"><a href="audit/errata.html#one">'
    """

    def turned(link: re.Match[str]) -> str:
        own = link[1].startswith("#")
        return f'href="{page + link[1] if own else normpath(join(dirname(page), link[1]))}"'

    return HREF.sub(turned, html)


def led(app: Sphinx, html: str) -> str:
    """Lead the links of a card to the pages that hold their anchors, from the root of the site."""

    def turned(link: re.Match[str]) -> str:
        kind, name = link.groups()
        return f'{kind}="{held[name]}.html#{name}"' if name in held else link.group(0)

    held = anchors.pages(app.env)
    return WITHIN.sub(turned, html)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handlers, the first after links have found their pages."""
    app.connect("html-page-context", mark, priority=600)
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
