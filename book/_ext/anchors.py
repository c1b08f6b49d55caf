"""Sphinx extension: anchors and figures of the outputs of notebooks.

An output, such as a table, links to ``#anchor`` on any page, and to files below the root of the
site, such as ``#tables/x.csv``. Both become relative addresses. `goto.html#anchor` redirects to the
page of an anchor. Figures of the papers have the numbers of their captions. The other figures are
numbered B1, B2, ... in the order of reading.
"""

import json
import re
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any, TypedDict

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

from after_build import SAFE, after_build

ID = re.compile(r'\bid="([^"]+)"')
TAG = re.compile(r"<a\b[^>]*>")
HREF = re.compile(r'\bhref="([^"#]*)#([^"]+)"')
FIGURE = re.compile(
    r'<figure class="rp-figure" id="((?!figure-\w+-fig-)[^"]+)".*?</figure>', re.DOTALL
)
NUMBER = '<span class="rp-number"></span>'
# The parts of a figure and of an erratum that a card shows.
DRAWN = re.compile(
    r'<figure class="rp-figure" id="([^"]+)".*?<svg role="img" aria-label="([^"]*)".*?'
    r"<figcaption>(.*?)</figcaption>.*?href=\"[^\"]*?(figures/[^\"]+\.svg)\"",
    re.DOTALL,
)
ERRATUM = re.compile(
    r'id="([^"]+)"[^>]*>\s*(<table class="[^"]*rp-erratum">.*?</table>)', re.DOTALL
)
LINK = re.compile(r"</?a\b[^>]*>")
GOTO = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>To a printed number</title>
<p>It is on a page of <a href="index.html">the book</a>.</p>
<script>
  const places = PLACES, name = location.hash.slice(1), page = places[name];
  if (Object.hasOwn(places, name)) location.replace(`${page}.html${location.hash}`);
</script></html>
"""


class Outputs(TypedDict):
    """Anchors, numbered figures and cards of a page."""

    anchors: list[str]
    figures: list[str]
    cards: dict[str, str]


def outputs(env: BuildEnvironment) -> dict[str, Outputs]:
    """Return the outputs of each page, which Sphinx keeps among its metadata."""
    return {
        page: found["outputs"]
        for page, found in env.metadata.items()
        if "outputs" in found
    }


def collect(app: Sphinx, doctree: nodes.document) -> None:
    """Store the anchors, figures and equations of a page as it is read."""
    text = "".join(output.astext() for output in doctree.findall(nodes.raw))
    app.env.metadata[app.env.docname]["outputs"] = {
        "anchors": ID.findall(text),
        "figures": FIGURE.findall(text),
        "cards": dict(cards(doctree, text)),
    }


def cards(doctree: nodes.document, text: str) -> Iterator[tuple[str, str]]:
    """Yield the anchors and cards of the equations, figures and errata of a page."""
    for equation in doctree.findall(nodes.math_block):
        if label := equation.get("label"):
            tex = escape(equation.astext())
            yield (
                f"equation-{label}",
                rf"<p>\[\begin{{split}}{tex}\end{{split}}\]</p>",
            )
    for name, alternative, caption, file in DRAWN.findall(text):
        image = f'<img data-src="{file}" alt="{alternative}">'
        yield name, f"{image}<p>{LINK.sub('', caption)}</p>"
    yield from ERRATUM.findall(text)


def pages(env: BuildEnvironment) -> dict[str, str]:
    """Return the page of each anchor, including equations; of two pages, the one in a folder."""
    equations: Any = env.get_domain("math").data["objects"]  # label to page, number
    found = {f"equation-{label}": page for label, (page, _) in equations.items()}
    return found | {
        name: page
        for page, held in sorted(
            outputs(env).items(), key=lambda one: ("/" in one[0], one[0])
        )
        for name in held["anchors"]
    }


def address(app: Sphinx, page: str, name: str) -> str:
    """Return the relative address of an anchor or a file."""
    if "/" in name:
        return "../" * page.count("/") + name
    holder = pages(app.env).get(name, page)
    if holder == page or name in outputs(app.env)[page]["anchors"]:
        return f"#{name}"
    return f"{app.builder.get_relative_uri(page, holder)}#{name}"


def in_order(page: str, below: dict[str, list[str]]) -> Iterator[str]:
    """Yield a page and those below it in the order of reading.

    >>> list(in_order("a", {"a": ["c", "b"], "c": ["d"]}))
    ['a', 'c', 'd', 'b']
    """
    yield page
    for one in below.get(page, []):
        yield from in_order(one, below)


def number(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Write the numbers of a page's figures, each a link to its figure."""
    env = app.env
    every = [
        name
        for one in in_order(app.config.root_doc, env.toctree_includes)
        for name in outputs(env).get(one, {"figures": []})["figures"]
    ]

    shown = outputs(env)[page]["cards"]

    def numbered(figure: re.Match[str]) -> str:
        name, text = figure[1], f"Figure B{every.index(figure[1]) + 1}."
        if name in shown:
            shown[name] = shown[name].replace(NUMBER, f"{text} ")
        link = f'<a class="rp-number" href="#{name}">{text}</a> '
        return figure[0].replace(NUMBER, link)

    for raw in doctree.findall(nodes.raw):
        raw[:] = [nodes.Text(FIGURE.sub(numbered, raw.astext()))]


def write(app: Sphinx) -> None:
    """Write the page that redirects to an anchor."""
    places = json.dumps(pages(app.env), ensure_ascii=False)
    path = Path(app.outdir) / "goto.html"
    path.write_text(GOTO.replace("PLACES", places), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handlers."""
    app.connect("doctree-read", collect)
    app.connect("doctree-resolved", number)
    after_build(app, write)
    return SAFE
