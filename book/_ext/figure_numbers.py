"""Sphinx extension: our own figures are numbered in the order in which the book is read.

Figure B3 is the third of the whole book: the papers' own figures keep the papers' numbers, which
their captions say. Every figure brings an empty place for a number, which is filled as its page is
written.
"""

import re
from collections.abc import Iterator
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.environment import BuildEnvironment

FIGURE = re.compile(
    r'<figure class="rp-figure" id="((?!figure-\w+-fig-)[^"]+)".*?</figure>', re.DOTALL
)
PLACE = '<span class="rp-number"></span>'


def held(env: BuildEnvironment) -> dict[str, Any]:
    """Return the figures of each page, and the number of the first of each."""
    return env.domaindata.setdefault("figure_numbers", {"pages": {}, "first": {}})


def collect(app: Sphinx, doctree: nodes.document) -> None:
    """Note the figures of a page, in order."""
    outputs = "".join(output.astext() for output in doctree.findall(nodes.raw))
    held(app.env)["pages"][app.env.docname] = FIGURE.findall(outputs)


def drop(app: Sphinx, env: BuildEnvironment, page: str) -> None:
    """Forget a page that is read again or gone."""
    held(env)["pages"].pop(page, None)


def merge(
    app: Sphinx, env: BuildEnvironment, pages: set[str], other: BuildEnvironment
) -> None:
    """Take over what a parallel reader found."""
    found = held(other)["pages"]
    held(env)["pages"].update({page: found[page] for page in pages if page in found})


def in_order(page: str, below: dict[str, list[str]]) -> Iterator[str]:
    """Yield a page and those below it as a reader meets them.

    >>> list(in_order("a", {"a": ["c", "b"], "c": ["d"]}))
    ['a', 'c', 'd', 'b']
    """
    yield page
    for one in below.get(page, []):
        yield from in_order(one, below)


def count(app: Sphinx, env: BuildEnvironment) -> list[str]:
    """Number the figures, and return the pages whose numbers are others than before."""
    first, number = {}, 1
    for page in in_order(app.config.root_doc, env.toctree_includes):
        first[page] = number
        number += len(held(env)["pages"].get(page, []))
    before, held(env)["first"] = held(env)["first"], first
    pages = held(env)["pages"]
    return [
        page for page in first if pages.get(page) and before.get(page) != first[page]
    ]


def fill(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Write the numbers of a page, each a link to its figure."""
    first = held(app.env)["first"].get(page)
    if doctree is None or first is None:
        return
    numbers = iter(range(first, first + len(held(app.env)["pages"].get(page, []))))

    def numbered(figure: re.Match[str]) -> str:
        link = f'<a class="rp-number" href="#{figure[1]}">Figure B{next(numbers)}.</a> '
        return figure[0].replace(PLACE, link)

    context["body"] = FIGURE.sub(numbered, context["body"])


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handlers."""
    app.connect("doctree-read", collect)
    app.connect("env-purge-doc", drop)
    app.connect("env-merge-info", merge)
    app.connect("env-updated", count)
    app.connect("html-page-context", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
