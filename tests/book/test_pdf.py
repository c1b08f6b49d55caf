"""The book as a PDF holds what its pages hold, every link in it leads on, and nothing is cut."""

import os
import re
import unicodedata
from collections import Counter
from collections.abc import Iterator
from typing import Any

import pytest
import yaml
from playwright.sync_api import Browser, Page
from pypdf import PdfReader

import make_pdf

pytestmark = pytest.mark.browser
BODY = 9.5  # points, as the style sheet says
NUMBER = re.compile(r"\d+(?:\.\d+)?")
TOC = make_pdf.ROOT / "book" / "_toc.yml"
# What a page shows outside of folds, formulas, drawings and controls; code of a cell is shown too.
SHOWN = """() => {
    const copy = document.querySelector('article').cloneNode(true);
    const not = 'details, svg, script, style, .math, .rp-bar, .rp-dial, .rp-filter, .viewcode-link';
    copy.querySelectorAll(not).forEach(e => e.remove());
    const walk = document.createTreeWalker(copy, NodeFilter.SHOW_TEXT), texts = [];
    while (walk.nextNode()) texts.push(walk.currentNode.data);
    return texts.join('\\n');
}"""
# Names of the places that visible links lead to.
LINKED = """() => [...document.querySelectorAll('a[href^="#"]')]
    .filter(e => e.checkVisibility({contentVisibilityAuto: true}) && e.getClientRects().length)
    .map(e => decodeURIComponent(e.getAttribute('href').slice(1)))"""
# What is wider or higher than the text block of a sheet, upright or turned.
TOO_LARGE = """() => {
    const out = [], block = document.body;
    const blocks = [['17.6cm', '26.2cm', false], ['26.3cm', '17.5cm', true]];
    const large = 'article :is(table, figure, svg, pre, mjx-container)';
    for (const [width, height, turned] of blocks) {
        block.style.width = width;
        const ruler = block.appendChild(document.createElement('div'));
        ruler.style.height = height;
        const {right, height: high} = ruler.getBoundingClientRect();
        for (const e of document.querySelectorAll(large)) {
            if (!e.checkVisibility() || e.parentElement.closest('svg')) continue;
            if (Boolean(e.closest('.rp-turned')) !== turned) continue;
            const box = e.getBoundingClientRect(), may_break = e.matches('table, pre');
            if (box.right > right + 1 || (!may_break && box.height > high))
                out.push(e.tagName + ' ' + (e.closest('[id]')?.id ?? ''));
        }
        ruler.remove();
    }
    block.style.width = '';
    return out;
}"""


def documents(part: Any) -> Iterator[str]:
    """Yield the documents that the book's own table of contents names, in order."""
    if isinstance(part, list):
        for one in part:
            yield from documents(one)
    elif isinstance(part, dict):
        yield from (part[key] for key in ("root", "file") if key in part)
        for key in ("parts", "chapters", "sections"):
            yield from documents(part.get(key, []))


NAMES = list(documents(yaml.safe_load(TOC.read_text(encoding="utf-8"))))
each_page = pytest.mark.parametrize("name", NAMES)


@pytest.fixture(scope="module")
def pdf() -> PdfReader:
    if not make_pdf.PDF.is_file():
        told = "no PDF to read: run `make pdf` first"
        if os.environ.get("REPRODUCE_REQUIRE_BROWSER") == "1":
            pytest.fail(told)
        pytest.skip(told)
    return PdfReader(make_pdf.PDF)


@pytest.fixture(scope="module")
def texts(pdf: PdfReader) -> list[str]:
    return [sheet.extract_text() for sheet in pdf.pages]


@pytest.fixture(scope="module")
def places(pdf: PdfReader) -> dict[str, int]:
    """The sheet of every named place, counted from zero."""
    found = pdf.named_destinations.items()
    return {name[1:]: pdf.get_destination_page_number(place) for name, place in found}


@pytest.fixture(scope="module")
def begins(places: dict[str, int]) -> list[int]:
    """The first sheet of every page in order, and the number of sheets."""
    return [0, *(places[name] for name in NAMES[1:])]


@pytest.fixture(scope="module")
def joined(browser: Browser, pdf: PdfReader) -> Iterator[Page]:
    """The one document as it was printed, under print's own rules."""
    page = browser.new_page()
    make_pdf.set_joined(page)
    yield page
    page.close()


def test_every_page_of_the_contents_is_in_it(
    places: dict[str, int], pdf: PdfReader
) -> None:
    assert len(NAMES) > 30
    assert set(NAMES[1:]) - set(places) == set()
    at = [places[name] for name in NAMES[1:]]
    assert at == sorted(set(at))
    assert at[-1] < len(pdf.pages)


@each_page
def test_the_numbers_of_a_page_are_in_it(
    page: Page, begins: list[int], texts: list[str], name: str
) -> None:
    page.goto((make_pdf.HTML / f"{name}.html").as_uri())
    shown = Counter(NUMBER.findall(page.evaluate(SHOWN)))
    at = NAMES.index(name)
    end = [*begins, len(texts)][at + 1]
    printed = Counter(NUMBER.findall("\n".join(texts[begins[at] : end])))
    assert shown
    assert shown - printed == Counter()


def test_every_link_leads_to_a_place(
    joined: Page, pdf: PdfReader, places: dict[str, int]
) -> None:
    linked = joined.evaluate(LINKED)
    marks = [
        mark.get_object() for sheet in pdf.pages for mark in sheet.get("/Annots", [])
    ]
    inside = {mark["/Dest"][1:] for mark in marks if "/Dest" in mark}
    outside = {mark["/A"]["/URI"] for mark in marks if "/Dest" not in mark}
    assert len(linked) > 1000
    assert set(linked) == inside
    assert inside <= set(places)
    assert {
        address for address in outside if not address.startswith("https://")
    } == set()


def test_nothing_is_larger_than_its_sheet(joined: Page) -> None:
    assert joined.evaluate(TOO_LARGE) == []


def test_no_sheet_is_shrunk(pdf: PdfReader) -> None:
    """Chromium shrinks all sheets where one thing is wider than its own, and tells nobody."""
    sizes = Counter[float]()

    def note(text: str, outer: Any, inner: Any, font: Any, size: float) -> None:
        sizes[round(size * inner[3] * outer[3], 1)] += len(text.strip())

    pdf.pages[0].extract_text(visitor_text=note)
    assert abs(sizes.most_common(1)[0][0]) == BODY


def test_every_sheet_carries_its_number(texts: list[str]) -> None:
    bare = [at for at, text in enumerate(texts, 1) if str(at) not in text.splitlines()]
    assert bare == []


def test_the_contents_name_the_sheets_of_all_pages(
    joined: Page, texts: list[str], begins: list[int]
) -> None:
    titles = joined.evaluate(
        "() => [...document.querySelectorAll('nav a')].map(e => e.innerText)"
    )
    contents = unicodedata.normalize("NFKC", "\n".join(texts[: begins[1]])).splitlines()
    wanted = [
        f"{title} {first + 1}" for title, first in zip(titles, begins[1:], strict=True)
    ]
    assert [line for line in wanted if line not in contents] == []


def test_the_outline_has_every_heading_in_order(joined: Page, pdf: PdfReader) -> None:
    headings = joined.evaluate(
        "() => [...document.querySelectorAll(':is(h1, h2, h3, h4, h5, h6)')]"
        ".filter(e => e.checkVisibility()).map(e => e.innerText.trim())"
    )
    entries = list(make_pdf.flat(pdf.outline))
    sheets = [pdf.get_destination_page_number(entry) for entry in entries]
    assert [entry.title for entry in entries] == headings
    assert sheets == sorted(sheets)
    assert len(pdf.outline) < len(headings) / 10, (
        "chapters stand below parts, sections below these"
    )


def test_the_first_page_leads_to_it(pdf: PdfReader) -> None:
    first = (make_pdf.HTML / "index.html").read_text(encoding="utf-8")
    assert first.count(make_pdf.LINK) == 1
    assert make_pdf.LINK not in make_pdf.joined()
