"""The head of a page: its description, its citation and its data as JSON-LD."""

import json
import re
from html import unescape
from unittest.mock import Mock

import pytest
from commands import output_of
from docutils.core import publish_doctree
from places import ROOT
from pyld import jsonld
from reading import HTML

from page_heads import MAX_LENGTH, described, finish, linked
from reproduce import version
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import PAPERS, anchor, library
from reproduce.views._export import table_files
from reproduce.views.citations import cite

META = re.compile(r'<meta name="(\w+)" content="([^"]*)" />')
SCRIPT = re.compile(
    r'<script type="application/ld\+json">\n(.*?)\n</script>', re.DOTALL
)
SCHEMA, BASE = "http://schema.org/", "https://example.org/book/"
LICENCE = "https://creativecommons.org/licenses/by/4.0/"
REQUIRED = set(
    "name description identifier creator datePublished version license isBasedOn "
    "distribution variableMeasured".split()
)
# Part of the context of schema.org; a test uses no network.
LINKS = "license url contentUrl isBasedOn about creator distribution".split()
CONTEXT = {"@vocab": SCHEMA, **{n: {"@id": SCHEMA + n, "@type": "@id"} for n in LINKS}}
DESCRIBED = {
    "A title\n=======\n\nFirst *words*,\nfolded.\n\nSecond.": "First words, folded.",
    ".. note::\n\n   The answer.\n\nThe rest.": "The answer.",
    "It is :math:`95\\,\\%` long.": "It is 95 % long.",
    ".. role:: html(raw)\n   :format: html\n\nOf :html:`<b>all</b>`.": "Of all.",
    "A title\n=======": "",
}


def dois(paper):
    """Return the addresses of a paper, of both, or of none."""
    papers = PAPERS if paper == "all" else {paper} & set(PAPERS)
    items = [json.loads(cite(f"{p}/text-context", "csl"))[1] for p in papers]
    return {f"https://doi.org/{item['DOI']}" for item in items}


def expanded(document, page):
    """Expand a JSON-LD document of a page that is published below `BASE`; plain values."""

    def load(address, options):
        document = {"@context": CONTEXT}
        return {"contextUrl": None, "documentUrl": address, "document": document}

    def plain(node):
        if isinstance(node, list):
            return [plain(entry) for entry in node]
        if not isinstance(node, dict):
            return node
        short = {k.removeprefix(SCHEMA): plain(value) for k, value in node.items()}
        return short.get(
            "@value", short.get("@id", short) if len(short) == 1 else short
        )

    options = {"base": f"{BASE}{page}.html", "documentLoader": load}
    return plain(jsonld.expand(document, options)[0])


def test_a_page_is_described_by_its_first_paragraph():
    settings = {"doctitle_xform": False, "raw_enabled": True}
    for text, description in DESCRIBED.items():
        doctree = publish_doctree(text, settings_overrides=settings)
        assert described(doctree) == description
    long = described(publish_doctree("seven letters " * 100))
    assert len(long) <= MAX_LENGTH
    assert long.endswith((" seven …", " letters …"))


def test_every_table_is_a_dataset():
    """JSON-LD with the properties, units and files that harvesters of data read."""
    for key in (*library(), *catalogue("studies")):
        name = f"study-{anchor(key)}" if key in catalogue("studies") else anchor(key)
        (document,) = linked("chapter/page", {name: "chapter/page"}, "")
        data, papers = expanded(document, "chapter/page"), dois(key.partition("/")[0])
        assert data["@type"] == [f"{SCHEMA}Dataset"]
        absent = {part for part in REQUIRED if not data.get(part)}
        assert absent <= (set() if papers else {"license", "isBasedOn"})
        assert 50 <= len(data["description"][0]) <= 5000
        assert {paper["@id"] for paper in data.get("isBasedOn", [])} == papers
        assert data.get("license", []) == [LICENCE] * bool(papers)
        assert key in data["identifier"]
        files = [file["contentUrl"][0] for file in data["distribution"]]
        assert files == [BASE + path for path in table_files(key)]
        names = {one["name"][0] for one in data["variableMeasured"]}
        if table := library().get(key):
            assert names == {line.label for line in (*table.rows, *table.columns)}
            assert "not a fault" in data["description"][0]


def test_a_published_dataset_has_its_address(monkeypatch):
    held = {"niu2024-table-3": "x"}
    assert "url" not in next(linked("x", held, ""))
    monkeypatch.setattr(version, "ADDRESS", "https://example.org/book")
    monkeypatch.setattr(version, "DOI", "10.1234/x")
    data = expanded(next(linked("x", held, "")), "x")
    assert data["url"] == [f"{BASE}goto.html#niu2024-table-3"]
    assert "https://doi.org/10.1234/x" in data["identifier"]


@pytest.mark.browser
def test_a_built_page_allows_only_its_own_scripts(open_page):
    """`defects` reports each script that the policy of a page stops, for each page."""
    for path in (path for path in HTML.rglob("*.html") if "_static" not in path.parts):
        start, policy, _ = path.read_text("utf-8").partition(
            '<meta http-equiv="Content-Security-Policy"'
        )
        assert policy, path
        assert "<script" not in start, path
    page = open_page("404.html")
    page.evaluate(
        "() => document.body.insertAdjacentHTML('beforeend', '<img src=x onerror=done=1>')"
    )
    page.wait_for_timeout(200)
    assert page.evaluate("() => window.done") is None


def test_other_addresses_lead_to_the_book(tmp_path, monkeypatch):
    app = Mock(outdir=tmp_path, builder=Mock(format="html"))
    app.env.found_docs = {"index", "niu2024/own"}
    finish(app)
    assert 'href="index.html"' in (tmp_path / "404.html").read_text("utf-8")
    assert not (tmp_path / "sitemap.txt").exists()
    monkeypatch.setattr(version, "ADDRESS", "https://example.org/book")
    finish(app)
    assert f'href="{BASE}index.html"' in (tmp_path / "404.html").read_text("utf-8")
    pages = [f"{BASE}{name}.html" for name in ("index", "niu2024/own")]
    assert (tmp_path / "sitemap.txt").read_text("utf-8").split() == pages


@pytest.mark.browser
def test_built_pages_have_a_head_and_describe_every_table():
    titles, described_on = [], {}
    for source in sorted((HTML / "_sources").rglob("*.md")):
        path = source.relative_to(HTML / "_sources").with_suffix("")
        text = (HTML / f"{path}.html").read_text("utf-8")
        head = {name: unescape(value) for name, value in META.findall(text)}
        assert {"citation_author", "citation_publication_date"} < set(head), path
        assert re.fullmatch(r"[^<>{}\\#]{20,}", head["description"]), path
        titles.append(head["citation_title"])
        # Signposting, whose links and JSON-LD name the page alike.
        links = dict(re.findall(r'<link rel="([\w-]+)" href="([^"]+)" />\n', text))
        file = ROOT / "book" / f"{path}.md"
        digest = output_of("git", "hash-object", "--no-filters", file).strip()
        identity = f"swh:1:cnt:{digest}"
        assert (links["cite-as"], links["license"]) == (identity, LICENCE)
        assert (HTML / f"{path}.html").parent.joinpath(links["describedby"]).is_file()
        whole, *parts = (json.loads(found) for found in SCRIPT.findall(text))
        assert [one["@id"] for one in whole["hasPart"]] == [one["@id"] for one in parts]
        for found in parts:
            assert found["@id"].startswith(f"{identity}#")
            data = expanded(found, path.as_posix())
            if SCHEMA + "Book" in data["@type"]:
                assert {paper["@id"] for paper in data["about"]} == dois("all")
                continue
            (name,) = data["identifier"]
            assert name not in described_on, "on two pages"
            described_on[name] = path.as_posix()
            files = [one["contentUrl"][0] for one in data["distribution"]]
            assert all((HTML / file.removeprefix(BASE)).is_file() for file in files)
    assert len(set(titles)) == len(titles) > 30
    whole = {"ledger": "cells", "errata": "audit/errata"}
    assert set(described_on) == {*library(), *catalogue("studies"), *whole}
    assert whole.items() <= described_on.items()
