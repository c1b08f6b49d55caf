"""Sphinx extension: what a link leads to, shown beside it as a card.

A link to a printed cell, an equation or a reference gets the class ``rp-has-card``, which is the
one sign of it; `cards.js` shows the card. The cards of all cells come from `tools/book_facts.py`,
those of equations and references from the pages themselves. They stand in one script beside the
pages, since a page that is opened from a disk may load nothing else.
"""

import json
import re
from functools import cache
from pathlib import Path
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx

import anchors

FILE = Path("_build") / "cards.json"
LINK = re.compile(r'<a\b([^>]*?)\bhref="([^"#]*)#([^"]+)"([^>]*)>')
CLASS = re.compile(r'\bclass="')
SIGN = "rp-has-card"
WITHIN = re.compile(r'\b(href|data-link)="#([^"]+)"')
# What a page shows under an anchor of its own.
EQUATION = re.compile(
    r'<div class="math[^"]*" id="(equation-[^"]+)">\s*(?:<span class="eqno">.*?</span>)?'
    r"(.*?)</div>",
    re.DOTALL,
)
REFERENCE = re.compile(r'<div class="citation" id="([^"]+)".*?<p>(.*?)</p>', re.DOTALL)
BIBLIOGRAPHY = "bibliography"


@cache
def cards(path: Path, changed: float) -> dict[str, str]:
    """Read the cards of all printed cells, by anchor, from a file that last changed at a time."""
    found: dict[str, str] = json.loads(path.read_text(encoding="utf-8"))
    return found


def cells(app: Sphinx) -> dict[str, str]:
    """Return the cards of all printed cells; none in a book without any."""
    path = Path(app.srcdir) / FILE
    return cards(path, path.stat().st_mtime) if path.is_file() else {}


def mark(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Give every link of a page that has a card its sign."""
    known = cells(app)

    def signed(link: re.Match[str]) -> str:
        before, page_of, name, after = link.groups()
        has = (
            name in known
            or name.startswith("equation-")
            or page_of.endswith(f"{BIBLIOGRAPHY}.html")
        )
        if not has or "headerlink" in before + after:
            return link.group(0)
        marks = f'{before}href="{page_of}#{name}"{after}'
        if CLASS.search(marks):
            return "<a" + CLASS.sub(f'class="{SIGN} ', marks, count=1) + ">"
        return f'<a class="{SIGN}"{marks}>'

    if body := context.get("body", ""):
        context["body"] = LINK.sub(signed, body)


def write(app: Sphinx, error: Exception | None) -> None:
    """Write the script of all cards, once the pages stand."""
    if error is not None or app.builder.format != "html":
        return
    found = {name: led(app, html) for name, html in cells(app).items()}
    for path in sorted(Path(app.outdir).rglob("*.html")):
        page = path.read_text(encoding="utf-8")
        found |= {name: f"<p>{html.strip()}</p>" for name, html in EQUATION.findall(page)}
        if path.stem == BIBLIOGRAPHY:
            listed = REFERENCE.findall(page)
            found |= {f"{BIBLIOGRAPHY}-{name}": f"<p>{html}</p>" for name, html in listed}
    script = f"window.rpCards = {json.dumps(found, ensure_ascii=False)};\n"
    (Path(app.outdir) / "cards.js").write_text(script, encoding="utf-8")


def led(app: Sphinx, html: str) -> str:
    """Lead the links of a card to the pages that hold their anchors, from the root of the site."""

    def turned(link: re.Match[str]) -> str:
        kind, name = link.groups()
        if "/" in name:
            return f'{kind}="{name}"'
        return f'{kind}="{held[name]}.html#{name}"' if name in held else link.group(0)

    held = anchors.pages(app.env)
    return WITHIN.sub(turned, html)


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handlers, the first after links have found their pages."""
    app.connect("html-page-context", mark, priority=600)
    app.connect("build-finished", write)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
