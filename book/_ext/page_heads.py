"""Sphinx extension: description, citation and data for the head of each page.

Search engines show the description, and reference managers read the citation. Harvesters of data
read the links of Signposting, and JSON-LD in the terms of schema.org: a ``WebPage``, a ``Dataset``
for each table of the page, and on the first page the ``Book`` and its papers. The policy of a page
allows only scripts in files of the book, and scripts with the text that the build wrote.
"""

from __future__ import annotations

import json
import re
import textwrap
from base64 import b64encode
from collections.abc import Iterator, Mapping
from hashlib import sha256
from html import escape
from pathlib import Path
from typing import Any

from docutils import nodes
from markupsafe import Markup
from sphinx.application import Sphinx

import anchors
from after_build import SAFE, after_build

MAX_LENGTH = 300  # of a description, in characters
META = '<meta name="{}" content="{}" />\n'
LINK = '<link rel="{}" href="{}" />\n'
LINKED = '<script type="application/ld+json">\n{}\n</script>\n'
LICENSE = "https://creativecommons.org/licenses/by/4.0/"
# `file:` is for pages from a disk. The theme writes scripts and two handlers into the pages.
POLICY = (
    "default-src 'self' file:; script-src 'self' file: 'unsafe-hashes' {}; object-src 'none'; "
    "style-src 'self' file: 'unsafe-inline'; img-src 'self' file: data:; base-uri 'none'"
)
PROTECTED = '{}<meta http-equiv="Content-Security-Policy" content="{}" />'
CHARSET = re.compile(r'<meta charset="utf-8" ?/?>')
SCRIPT = re.compile(r"<script(?![^>]*\b(?:src|type)=)[^>]*>(.*?)</script>", re.DOTALL)
# The search reads other pages, so every page allows the handlers of all.
HANDLERS = {"toggleFullScreen()", "window.print()"}
ABSENT = """<!doctype html>
<html lang="en"><meta charset="utf-8"><title>Page not found</title>
<meta name="viewport" content="width=device-width">
<p>No page has this address. See <a href="{0}index.html">the first page</a> or
<a href="{0}find.html">find a number</a>.</p></html>
"""
MEDIA = {"csv": "text/csv", "json": "application/json", "tex": "application/x-tex"}
MEDIA |= {"md": "text/markdown", "parquet": "application/vnd.apache.parquet"}
FAIR = "A verdict of differs is a difference that we find, not a fault."
# The ledger and the register by their page: name of the files, description, columns.
WHOLE = {
    "cells": (
        "ledger",
        f"Every printed number, recomputed where that is possible. {FAIR}",
        ("printed", "computed", "verdict", "fraction of the tolerance"),
    ),
    "audit/errata": (
        "errata",
        "The register of errata: contradictions, and their effect on the conclusions.",
        ("printed", "problem", "conclusion", "status"),
    ),
}


def described(doctree: nodes.document) -> str:
    """Return the first paragraph of a page, cut at a word."""
    first = doctree.next_node(nodes.paragraph)
    parts = first.findall(nodes.Text) if first is not None else ()
    return textwrap.shorten("".join(map(plain, parts)), MAX_LENGTH, placeholder=" …")


def plain(part: nodes.Text) -> str:
    """Return a piece of text without HTML tags, and without the spaces of TeX.

    >>> plain(nodes.raw("", "<a href='x'>one digit</a>", format="html").next_node(nodes.Text))
    'one digit'
    >>> plain(nodes.math("", r"95\\,\\%").next_node(nodes.Text))
    '95 %'
    """
    match part.parent:
        case nodes.raw():
            is_html = part.parent["format"] == "html"
            return Markup(part).striptags() if is_html else ""
        case nodes.math():
            return part.replace(r"\,", " ").replace("\\", "")
    return str(part)


def linked(page: str, held: Mapping[str, str], text: str) -> Iterator[dict[str, Any]]:
    """Yield the data of a page in the terms of schema.org.

    Parameters
    ----------
    page : str
        Name of the page.
    held : mapping
        Page of each anchor.
    text : str
        Description of the page.

    Yields
    ------
    dict
        A document of JSON-LD.
    """
    from reproduce.locate import papers
    from reproduce.papers.catalogue import catalogue
    from reproduce.printed.cells import anchor, library
    from reproduce.views._export import table_files
    from reproduce.views._keys import place, title

    if page == "index":
        kinds = ["Book", "ScholarlyArticle"]
        yield work("all", text, "about") | {"@type": kinds}
    if page in WHOLE:
        name, text, columns = WHOLE[page]
        files = [f"{name}.{ending}" for ending in ("csv", "json", "parquet")]
        whole = dataset("all", page, text, files, [{"name": one} for one in columns])
        short = text.partition(":")[0].partition(",")[0]
        yield whole | {"name": short, "identifier": [name]}
    for key in (*library(), *catalogue("studies")):
        study, paper = key in catalogue("studies"), key.split("/")[0]
        if held.get(f"{'study-' * study}{anchor(key)}") == page:
            relation = "supplement to" if study else "of"
            of_paper = f", {relation} {paper}" if paper in papers() else ""
            text = f"{title(key)}: {place(key)}{of_paper}.{'' if study else f' {FAIR}'}"
            yield dataset(key, page, text, list(table_files(key)), list(measured(key)))


def dataset(
    key: str, page: str, text: str, files: list[str], columns: list[dict[str, str]]
) -> dict[str, Any]:
    """Return a table, the ledger or the register as a Dataset."""
    root = "../" * page.count("/")
    downloads = [(root + path, MEDIA[path.rpartition(".")[2]]) for path in files]
    return work(key, text, "isBasedOn") | {
        "@type": "Dataset",
        "variableMeasured": [{"@type": "PropertyValue", **one} for one in columns],
        "distribution": [
            {"@type": "DataDownload", "contentUrl": path, "encodingFormat": kind}
            for path, kind in downloads
        ],
    }


def measured(key: str) -> Iterator[dict[str, str]]:
    """Yield the rows and columns of a table, with the common unit of their numbers."""
    from reproduce.papers.catalogue import catalogue
    from reproduce.papers.declare import item_text
    from reproduce.printed.cells import library
    from reproduce.printed.number import symbol

    if key in catalogue("studies"):
        yield from ({"name": column.name} for column in item_text(key).columns)
        return
    table = library()[key]
    for line in (*table.rows, *table.columns):
        units = {c.unit for c in table.cells if line.id in c.name.split(".")}
        units -= {"", "1"}
        unit = {"unitText": symbol(units.pop())} if len(units) == 1 else {}
        yield {"name": line.label} | unit


def work(address: str, text: str, relation: str) -> dict[str, Any]:
    """Return the description of a citable item, with its relation to the papers."""
    from reproduce.version import RELEASED
    from reproduce.views.citations import DEVELOPERS, cite

    item, *papers = json.loads(cite(address, "csl"))

    def doi(entry: Mapping[str, str]) -> list[str]:
        return [f"https://doi.org/{entry['DOI']}"] if "DOI" in entry else []

    found = {
        "@context": "https://schema.org",
        "name": item["title"],
        "description": text,
        "identifier": [address, *doi(item)],
        "creator": {"@type": "Organization", "name": DEVELOPERS},
        "datePublished": RELEASED,
        "version": item["version"],
        relation: [
            {"@type": "ScholarlyArticle", "name": paper["title"]}
            | dict.fromkeys(["@id"] * ("DOI" in paper), "".join(doi(paper)))
            for paper in papers
        ],
    }
    # Measurements of other instruments have their own licences, next to the data.
    found |= {"license": LICENSE} if papers else {}
    return found | ({"url": item["URL"]} if "URL" in item else {})


def fill(
    app: Sphinx,
    page: str,
    template: str,
    context: dict[str, Any],
    doctree: nodes.document | None,
) -> None:
    """Add description, citation and data to the head of a page with text."""
    from reproduce.printed.cells import anchor
    from reproduce.version import ADDRESS, RELEASED, content_id
    from reproduce.views.citations import DEVELOPERS

    if doctree is None:
        return
    source = content_id(Path(app.env.doc2path(page)))
    own = f"{ADDRESS}/{page}.html" if ADDRESS else source
    title, book = app.env.titles[page].astext(), app.config.html_title
    head = {
        "description": described(doctree),
        "citation_title": title if title == book else f"{title}, in {book}",
        "citation_author": DEVELOPERS,
        "citation_publication_date": RELEASED.replace("-", "/"),
    }
    tags = [META.format(name, escape(text)) for name, text in head.items() if text]
    about = context["pathto"]("codemeta.json", 1)
    links = zip(
        ("cite-as", "license", "describedby"), (own, LICENSE, about), strict=True
    )
    tags += [LINK.format(*link) for link in links]
    parts = [
        {"@id": data.get("url", f"{own}#{anchor(data['identifier'][0])}")} | data
        for data in linked(page, anchors.pages(app.env), head["description"])
    ]
    whole = {
        "@context": "https://schema.org",
        "@type": "WebPage",
        "@id": own,
        "name": title,
        "isPartOf": {"@type": "Book", "name": book},
        "hasPart": [{"@id": part["@id"]} for part in parts],
    }
    for data in (whole, *parts):
        text = json.dumps(data, ensure_ascii=False).replace("</", "<\\/")
        tags.append(LINKED.format(text))
    context["metatags"] = context.get("metatags", "") + "".join(tags)


def protected(text: str) -> str:
    """Return a page with a policy that allows its own scripts.

    >>> "'sha256-LXEWQrcmsEQBYnyp+6wy9chTD7GQPMTbAiWHF5IaSIE='" in protected(
    ...     '<meta charset="utf-8"><script>x</script>'
    ... )
    True
    """
    scripts = HANDLERS | set(SCRIPT.findall(text))
    digests = (b64encode(sha256(script.encode()).digest()) for script in scripts)
    policy = POLICY.format(
        " ".join(sorted(f"'sha256-{one.decode()}'" for one in digests))
    )
    return CHARSET.sub(lambda found: PROTECTED.format(found[0], policy), text, count=1)


def finish(app: Sphinx) -> None:
    """Write the page for unknown addresses and the list of pages, and protect all pages."""
    from reproduce.version import ADDRESS

    root, start = Path(app.outdir), ADDRESS and f"{ADDRESS}/"
    (root / "404.html").write_text(ABSENT.format(start), encoding="utf-8")
    if ADDRESS:
        pages = "".join(f"{start}{page}.html\n" for page in sorted(app.env.found_docs))
        (root / "sitemap.txt").write_text(pages, encoding="utf-8")
    for path in root.rglob("*.html"):
        path.write_text(protected(path.read_text(encoding="utf-8")), encoding="utf-8")


def setup(app: Sphinx) -> dict[str, bool]:
    """Connect the handler."""
    app.connect("html-page-context", fill)
    after_build(app, finish, priority=900)  # after the other writers
    return SAFE
