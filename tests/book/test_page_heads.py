"""What the head of a page says: what stands first on it, and how to cite it."""

import re
from html import unescape

import pytest
from docutils.frontend import get_default_settings
from docutils.nodes import document
from docutils.parsers.rst import Parser
from docutils.utils import new_document
from reading import HTML

from page_heads import LONGEST, described

META = re.compile(r'<meta name="(\w+)" content="([^"]*)" />')


def read(text: str) -> document:
    found = new_document("x", get_default_settings(Parser))
    Parser().parse(text, found)
    return found


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("A title\n=======\n\nFirst *words*,\nfolded.\n\nSecond.", "First words, folded."),
        (".. note::\n\n   The answer.\n\nThe rest.", "The answer."),
        ("It is :math:`95\\,\\%` long.", "It is 95 % long."),
        (".. role:: raw-html(raw)\n   :format: html\n\nOf :raw-html:`<b>all</b>`.", "Of all."),
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
