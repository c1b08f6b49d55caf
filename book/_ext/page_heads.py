"""Sphinx extension: every page says in its head what it is and how to cite it.

Search engines show the description, and reference managers read the citation. Harvesters of data
read JSON-LD in the words of schema.org: a ``Dataset`` for each table of the page, and on the first
page the ``Book`` and the papers that it is about.
"""

from __future__ import annotations

import json
import textwrap
from collections.abc import Iterable, Iterator, Mapping
from html import escape
from typing import Any

from docutils import nodes
from markupsafe import Markup
from sphinx.application import Sphinx

import anchors

MAX_LENGTH = 300
META = '<meta name="{}" content="{}" />\n'
LINKED = '<script type="application/ld+json">\n{}\n</script>\n'
LICENSE = "https://creativecommons.org/licenses/by/4.0/"
MEDIA = {"csv": "text/csv", "json": "application/json", "tex": "application/x-tex"}
MEDIA |= {"md": "text/markdown", "parquet": "application/vnd.apache.parquet"}
FAIR = "A verdict of differs is a difference that we find, not a fault."
# What is whole, by its page: the name of its files, what they hold, and what is said of each entry.
WHOLE = {
    "cells": (
        "ledger",
        f"Every printed number, recomputed where that is possible. {FAIR}",
        ("printed", "computed", "verdict", "share of the tolerance"),
    ),
    "audit/errata": (
        "errata",
        "The register of errata: what does not fit, and whether the paper's conclusion stands.",
        ("printed", "problem", "conclusion", "status"),
    ),
}


def described(doctree: nodes.document) -> str:
    """Return what a page says first, cut at a word: its answer, where it opens with one."""
    said = doctree.next_node(nodes.paragraph)
    if said is None:
        return ""
    words = "".join(map(plain, said.findall(nodes.Text)))
    return textwrap.shorten(words, MAX_LENGTH, placeholder=" …")


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


def linked(page: str, held: Mapping[str, str], said: str) -> Iterator[dict[str, Any]]:
    """Yield what a page holds in the words of schema.org; `held` is the page of each anchor."""
    from reproduce.locate import papers
    from reproduce.papers.catalogue import studies
    from reproduce.printed.cells import anchor, library
    from reproduce.views.export import table_files
    from reproduce.views.keys import place, title

    if page == "index":
        yield described_work("all", said, "about") | {
            "@type": ["Book", "ScholarlyArticle"]
        }
    if page in WHOLE:
        name, said, columns = WHOLE[page]
        files = [f"{name}.{ending}" for ending in ("csv", "json", "parquet")]
        whole = dataset(
            "all", page, said, files, [{"name": column} for column in columns]
        )
        yield whole | {
            "name": said.partition(":")[0].partition(",")[0],
            "identifier": [name],
        }
    for key in (*library(), *studies()):
        own = key in studies()
        if held.get(f"{'study-' * own}{anchor(key)}") == page:
            paper = key.split("/")[0]
            beside = (
                f", {'beside' if own else 'of'} {paper}" if paper in papers() else ""
            )
            where = f"{title(key)}: {place(key)}{beside}."
            said = where if own else f"{where} {FAIR}"
            yield dataset(key, page, said, table_files(key), measured(key))


def dataset(
    key: str,
    page: str,
    said: str,
    files: Iterable[str],
    columns: Iterable[dict[str, str]],
) -> dict[str, Any]:
    """Return a table, or the whole, as a Dataset."""
    media = {
        "../" * page.count("/") + path: MEDIA[path.rpartition(".")[2]] for path in files
    }
    return described_work(key, said, "isBasedOn") | {
        "@type": "Dataset",
        "variableMeasured": [{"@type": "PropertyValue", **one} for one in columns],
        "distribution": [
            {"@type": "DataDownload", "contentUrl": path, "encodingFormat": kind}
            for path, kind in media.items()
        ],
    }


def measured(key: str) -> Iterator[dict[str, str]]:
    """Yield the rows and columns of a table, with the unit that the numbers of each share."""
    from reproduce.papers.catalogue import studies
    from reproduce.printed.cells import library
    from reproduce.printed.number import symbol

    if key in studies():
        yield from ({"name": column.name} for column in studies()[key].columns)
        return
    table = library()[key]
    for line in (*table.rows, *table.columns):
        units = {c.unit for c in table.cells if line.id in c.name.split(".")} - {
            "",
            "1",
        }
        unit = {"unitText": symbol(units.pop())} if len(units) == 1 else {}
        yield {"name": line.label} | unit


def described_work(address: str, said: str, tie: str) -> dict[str, Any]:
    """Return what can be cited, tied to the papers that it comes from."""
    from reproduce.version import RELEASED
    from reproduce.views.export import DEVELOPERS, citation

    ours, *papers = json.loads(citation(address, "csl"))
    return {
        "@context": "https://schema.org",
        "name": ours["title"],
        "description": said,
        "identifier": [
            address,
            *(f"https://doi.org/{doi}" for doi in [ours.get("DOI")] if doi),
        ],
        **({"url": ours["URL"]} if "URL" in ours else {}),
        "creator": {"@type": "Organization", "name": DEVELOPERS},
        "datePublished": RELEASED,
        "version": ours["version"],
        # What is made from others' measurements is under their licences, beside the data.
        **({"license": LICENSE} if papers else {}),
        tie: [
            {
                "@type": "ScholarlyArticle",
                **(
                    {"@id": f"https://doi.org/{paper['DOI']}"} if "DOI" in paper else {}
                ),
                "name": paper["title"],
            }
            for paper in papers
        ],
    }


def fill(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
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
    tags = "".join(
        META.format(name, escape(text)) for name, text in told.items() if text
    )
    for one in linked(page, anchors.pages(app.env), told["description"]):
        tags += LINKED.format(json.dumps(one, ensure_ascii=False).replace("</", "<\\/"))
    context["metatags"] = context.get("metatags", "") + tags


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handler."""
    app.connect("html-page-context", fill)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
