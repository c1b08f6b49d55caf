"""Sphinx extension: every page says in its head what it is and how to cite it.

Search engines show the description, and reference managers read the rest.
"""

from __future__ import annotations

import textwrap
from html import escape
from typing import Any

from docutils import nodes
from markupsafe import Markup
from sphinx.application import Sphinx

LONGEST = 300
META = '<meta name="{}" content="{}" />\n'


def described(doctree: nodes.document) -> str:
    """Return what a page says first, cut at a word: its answer, where it opens with one."""
    said = doctree.next_node(nodes.paragraph)
    if said is None:
        return ""
    words = "".join(map(plain, said.findall(nodes.Text)))
    return textwrap.shorten(words, LONGEST, placeholder=" …")


def plain(part: nodes.Text) -> str:
    """Return a piece of text without marks: of HTML what it shows, of TeX no commands for space.

    >>> plain(nodes.raw("", "<a href='x'>one digit</a>", format="html").next_node(nodes.Text))
    'one digit'
    >>> plain(nodes.math("", r"95\\,\\%").next_node(nodes.Text))
    '95 %'
    """
    match part.parent:
        case nodes.raw():
            return Markup(part).striptags()
        case nodes.math():
            return part.replace(r"\,", " ").replace("\\", "")
    return str(part)


def fill(
    app: Sphinx, page: str, template: str, context: dict[str, Any], doctree: nodes.document | None
) -> None:
    """Put description and citation into the head of a page that has a text."""
    from reproduce.version import RELEASED
    from reproduce.views.export import DEVELOPERS

    if doctree is None:
        return
    title, book = app.env.titles[page].astext(), app.config.html_title
    told = {
        "description": described(doctree),
        "citation_title": title if title == book else f"{title}, in {book}",
        "citation_author": DEVELOPERS,
        "citation_publication_date": RELEASED.replace("-", "/"),
    }
    tags = "".join(META.format(name, escape(text)) for name, text in told.items() if text)
    context["metatags"] = context.get("metatags", "") + tags


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handler."""
    app.connect("html-page-context", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
