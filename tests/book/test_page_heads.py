"""What the head of a page says: what stands first on it, and how to cite it."""

import json
import re
from collections.abc import Iterator
from html import unescape
from typing import Any

import pytest
from docutils.frontend import get_default_settings
from docutils.nodes import document
from docutils.parsers.rst import Parser
from docutils.utils import new_document
from pyld import jsonld
from reading import HTML

from page_heads import LONGEST, MEDIA, described, linked
from reproduce import version
from reproduce.papers.catalogue import studies
from reproduce.printed.cells import PAPERS, anchor, library
from reproduce.views import export

META = re.compile(r'<meta name="(\w+)" content="([^"]*)" />')


def read(text: str) -> document:
    found = new_document("x", get_default_settings(Parser))
    Parser().parse(text, found)
    return found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            "A title\n=======\n\nFirst *words*,\nfolded.\n\nSecond.",
            "First words, folded.",
        ),
        (".. note::\n\n   The answer.\n\nThe rest.", "The answer."),
        ("It is :math:`95\\,\\%` long.", "It is 95 % long."),
        (
            ".. role:: raw-html(raw)\n   :format: html\n\nOf :raw-html:`<b>all</b>`.",
            "Of all.",
        ),
        ("A title\n=======", ""),
    ],
)
def test_a_page_is_described_by_what_it_says_first(text: str, said: str) -> None:
    assert described(read(text)) == said


def test_a_long_text_is_cut_at_a_word() -> None:
    found = described(read("seven letters " * 100))
    assert len(found) <= LONGEST
    assert found.endswith((" seven …", " letters …"))


@pytest.mark.browser
def test_every_page_of_text_has_a_head() -> None:
    sources = sorted((HTML / "_sources").rglob("*.md"))
    assert sources, "no pages to read: run `make book` first"
    titles, said = [], []
    for source in sources:
        page = (HTML / source.relative_to(HTML / "_sources")).with_suffix(".html")
        whole = page.read_text("utf-8")
        assert "&lt;meta" not in whole, page
        told = {name: unescape(text) for name, text in META.findall(whole)}
        assert {"citation_author", "citation_publication_date"} < set(told), page
        titles.append(told["citation_title"])
        said.append(told["description"])
    assert len(set(titles)) == len(titles)
    assert all(title.endswith("Pointing, reproduced") for title in titles)
    assert min(map(len, said)) > 20, min(said, key=len)
    assert [text for text in said if re.search(r"[<>{}\\\\#]", text)] == []


SCHEMA = "http://schema.org/"
# What schema.org's own context says of the words used here; a test asks no network.
IDS = ("license", "url", "contentUrl", "isBasedOn", "about", "creator", "distribution")
CONTEXT = {
    "@vocab": SCHEMA,
    **{name: {"@id": SCHEMA + name, "@type": "@id"} for name in IDS},
}
SCRIPT = re.compile(
    r'<script type="application/ld\+json">\n(.*?)\n</script>', re.DOTALL
)
BASE = "https://example.org/book/"
REQUIRED = (
    "name description identifier creator datePublished version license isBasedOn distribution "
    "variableMeasured"
).split()


def expanded(told: dict[str, Any], page: str) -> dict[str, Any]:
    """Expand what a page says, as it would be read at an address on the web."""

    def load(address: str, options: dict[str, Any]) -> dict[str, Any]:
        assert address == "https://schema.org"
        found = {
            "contextUrl": None,
            "documentUrl": address,
            "contentType": "application/ld+json",
        }
        return {**found, "document": {"@context": CONTEXT}}

    options = {"base": f"{BASE}{page}.html", "documentLoader": load}
    (found,) = jsonld.expand(told, options)
    return found


def values(node: dict[str, Any], name: str) -> list[Any]:
    """Return the values or addresses that an expanded node has under a name."""
    return [one.get("@value", one.get("@id")) for one in node.get(SCHEMA + name, [])]


def check_dataset(found: dict[str, Any], papers: set[str]) -> list[str]:
    """Check what every Dataset has, and return the addresses of its files."""
    assert found["@type"] == [f"{SCHEMA}Dataset"]
    absent = [name for name in REQUIRED if not found.get(SCHEMA + name)]
    assert absent == ([] if papers else ["license", "isBasedOn"])
    assert 50 <= len(values(found, "description")[0]) <= 5000, "as harvesters ask"
    assert set(values(found, "isBasedOn")) == papers
    kinds = {one["@type"][0] for one in found.get(f"{SCHEMA}isBasedOn", [])}
    assert kinds == ({f"{SCHEMA}ScholarlyArticle"} if papers else set())
    assert values(found, "version") == [version.__version__]
    licence = "https://creativecommons.org/licenses/by/4.0/"
    assert values(found, "license") == [licence] * bool(papers)
    assert all(
        one["@type"] == [f"{SCHEMA}PropertyValue"]
        for one in found[f"{SCHEMA}variableMeasured"]
    )
    files = found[f"{SCHEMA}distribution"]
    for file in files:
        assert file["@type"] == [f"{SCHEMA}DataDownload"]
        ending = values(file, "contentUrl")[0].rpartition(".")[2]
        assert values(file, "encodingFormat") == [MEDIA[ending]]
    return [address for file in files for address in values(file, "contentUrl")]


def dois(*papers: str) -> set[str]:
    """Return the addresses of those that are papers."""
    ours = [f"{paper}/text-context" for paper in papers if paper in PAPERS]
    cited = [json.loads(export.citation(one, "csl"))[1] for one in ours]
    return {f"https://doi.org/{one['DOI']}" for one in cited}


@pytest.mark.parametrize(
    "key", ["niu2024/table-3", "chen2023/text-platform", "chen2023/heat"]
)
def test_a_table_is_a_dataset(key: str) -> None:
    mark = f"study-{anchor(key)}" if key in studies() else anchor(key)
    (told,) = linked("chapter/page", {mark: "chapter/page"}, "")
    found = expanded(told, "chapter/page")
    files = check_dataset(found, dois(key.split("/")[0]))
    assert files == [BASE + path for path in export.table_files(key)]
    assert key in values(found, "identifier")
    measured = {
        values(one, "name")[0]: one for one in found[f"{SCHEMA}variableMeasured"]
    }
    if key in library():
        assert set(measured) == {
            one.label for one in (*library()[key].rows, *library()[key].columns)
        }
        assert "not a fault" in values(found, "description")[0]
    if key == "niu2024/table-3":
        assert values(measured["Translation, x"], "unitText") == ["px"]
        assert f"{SCHEMA}unitText" not in measured["Red"]


def test_a_published_dataset_has_its_address(monkeypatch: pytest.MonkeyPatch) -> None:
    held = {"niu2024-table-3": "x"}
    (told,) = linked("x", held, "")
    assert "url" not in told
    monkeypatch.setattr(export, "ADDRESS", "https://example.org/book")
    monkeypatch.setattr(export, "DOI", "10.1234/x")
    (told,) = linked("x", held, "")
    found = expanded(told, "x")
    assert values(found, "url") == [
        "https://example.org/book/goto.html#niu2024-table-3"
    ]
    assert "https://doi.org/10.1234/x" in values(found, "identifier")


def test_a_page_without_a_table_says_nothing_of_data() -> None:
    assert list(linked("run", {"niu2024-table-3": "x"}, "said")) == []


def linked_pages() -> Iterator[tuple[str, dict[str, Any]]]:
    """Yield what the built pages say of themselves, expanded, with the page."""
    for path in sorted(HTML.rglob("*.html")):
        page = path.relative_to(HTML).with_suffix("").as_posix()
        for text in SCRIPT.findall(path.read_text("utf-8")):
            yield page, expanded(json.loads(text), page)


@pytest.mark.browser
def test_the_pages_say_of_every_table_what_it_is() -> None:
    said, files = {}, set()
    for page, found in linked_pages():
        kinds = found["@type"]
        if page == "index":
            assert set(kinds) == {f"{SCHEMA}Book", f"{SCHEMA}ScholarlyArticle"}
            assert set(values(found, "about")) == dois(*PAPERS)
            assert len(values(found, "description")[0]) > 50
            continue
        (named,) = values(found, "identifier")
        whole = named in {"ledger", "errata"}
        files |= set(
            check_dataset(found, dois(*(PAPERS if whole else [named.split("/")[0]])))
        )
        assert named not in said, "stands on two pages"
        said[named] = page
    assert set(said) == {*library(), *studies(), "ledger", "errata"}
    assert (said["ledger"], said["errata"]) == ("cells", "audit/errata")
    assert [one for one in files if not (HTML / one.removeprefix(BASE)).is_file()] == []
