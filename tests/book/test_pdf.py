"""The book as a PDF: its numbers, links, outline and sheets."""

import re
import unicodedata
from collections import Counter

import pytest
from pypdf import PdfReader
from reading import skip_or_fail
from sphinx_external_toc.parsing import parse_toc_yaml

import make_pdf

pytestmark = pytest.mark.browser
BODY = 9.0  # size of the text in the style sheet, in points
NUMBER = re.compile(r"\d+(?:\.\d+)?")
MAX_SHEETS, MIN_FILL = 200, 0.55
TOP, BOTTOM = (72 / 25.4 * margin for margin in (17, 18))  # as in the style sheet
TOC = make_pdf.ROOT / "book" / "_toc.yml"
# Text of a page without folds, formulas, drawings and controls, with the code of its cells.
SHOWN = """() => {
    const copy = document.querySelector('article').cloneNode(true);
    const not = 'details, svg, script, style, .math, .rp-bar, .rp-dial, .rp-filter, '
        + '.viewcode-link, .rp-pdfs';
    copy.querySelectorAll(not).forEach(e => e.remove());
    const walk = document.createTreeWalker(copy, NodeFilter.SHOW_TEXT), texts = [];
    while (walk.nextNode()) texts.push(walk.currentNode.data);
    return texts.join('\\n');
}"""
# Targets of the visible links.
LINKED = """() => [...document.querySelectorAll('a[href^="#"]')]
    .filter(e => e.checkVisibility({contentVisibilityAuto: true}) && e.getClientRects().length)
    .map(e => decodeURIComponent(e.getAttribute('href').slice(1)))"""
# Elements wider or higher than the text block of a sheet, in portrait and landscape format.
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


NAMES = [name for name in parse_toc_yaml(TOC) if not make_pdf.LISTED.match(name)]


@pytest.fixture(scope="module")
def pdf():
    if not make_pdf.PDF.is_file():
        skip_or_fail("no PDF to read: run `make pdf` first")
    return PdfReader(make_pdf.PDF)


def sheets_of(pdf):
    """Return the text of each sheet, and the filled fraction of its height."""

    def read(sheet):
        heights = []

        def note(text, outer, inner, font, size):
            if text.strip():
                heights.append(outer[1] * inner[4] + outer[3] * inner[5] + outer[5])

        text, height = sheet.extract_text(visitor_text=note), float(sheet.mediabox[3])
        bottom, top = BOTTOM, height - TOP
        lowest = min(at for at in [*heights, top] if at > bottom)
        return text, (top - lowest) / (top - bottom)

    return [read(sheet) for sheet in pdf.pages]


@pytest.fixture(scope="module")
def places(pdf):
    """Return the sheet of every named place, counted from zero."""
    return make_pdf.places(pdf)


@pytest.fixture(scope="module")
def starts(places):
    """Return the first sheet of every page, in order."""
    return [places[name] for name in NAMES]


@pytest.fixture(scope="module")
def joined(browser, pdf):
    """Yield the joined document with the layout for paper."""
    page = browser.new_page()
    make_pdf.set_joined(page)
    yield page
    page.close()


@pytest.mark.slow
def test_sheets_are_full_and_have_all_numbers_in_order(
    open_page, joined, pdf, starts, places
):
    """One test, since the sheets take long to read."""
    texts, fills = zip(*sheets_of(pdf), strict=True)
    assert len(NAMES) > 30
    assert starts == sorted(starts)
    assert starts[-1] < len(texts) <= MAX_SHEETS
    page = open_page(java_script_enabled=False)
    ends = [*starts[1:], len(texts) - 1]  # two pages may share a sheet
    for name, start, end in zip(NAMES, starts, ends, strict=True):
        page.goto((make_pdf.HTML / f"{name}.html").as_uri())
        shown = Counter(NUMBER.findall(page.evaluate(SHOWN)))
        printed = Counter(NUMBER.findall("\n".join(texts[start : end + 1])))
        assert shown, name
        assert shown - printed == Counter(), name
    # Only the title and the ends of chapters are half empty.
    chapters = [places[make_pdf.name(pages[0])] for _, pages in make_pdf.parts()]
    ends = {0, *(start - 1 for start in chapters), len(fills) - 1}
    assert max(fills) > 0.9
    assert [n + 1 for n, f in enumerate(fills) if f < MIN_FILL and n not in ends] == []
    # The sheets and the contents have the numbers of the sheets.
    assert [
        n for n, text in enumerate(texts, 1) if str(n) not in text.splitlines()
    ] == []
    script = "() => [...document.querySelectorAll('nav a')].map(e => e.innerText)"
    contents = unicodedata.normalize("NFKC", "\n".join(texts[: starts[0]]))
    pairs = zip(joined.evaluate(script), starts, strict=True)
    lines = {f"{title} {start + 1}" for title, start in pairs}
    assert lines <= set(contents.splitlines())


def test_every_link_leads_to_a_place(joined, pdf, places):
    linked = joined.evaluate(LINKED)
    marks = [m.get_object() for sheet in pdf.pages for m in sheet.get("/Annots", [])]
    inside = {mark["/Dest"][1:] for mark in marks if "/Dest" in mark}
    outside = {mark["/A"]["/URI"] for mark in marks if "/Dest" not in mark}
    assert len(linked) > 1000
    assert set(linked) == inside <= set(places)
    assert all(address.startswith("https://") for address in outside)


def test_no_element_is_larger_than_its_sheet(joined):
    assert joined.evaluate(TOO_LARGE) == []


def test_every_image_is_loaded(joined):
    widths = joined.evaluate("() => [...document.images].map(e => e.naturalWidth)")
    assert len(widths) > 3
    assert min(widths) > 0


def test_no_sheet_is_shrunk(pdf):
    """Chromium shrinks all sheets without a message if one element is too wide."""
    sizes = Counter()

    def count(text, outer, inner, font, size):
        sizes[round(size * inner[3] * outer[3], 1)] += len(text.strip())

    pdf.pages[0].extract_text(visitor_text=count)
    assert abs(sizes.most_common(1)[0][0]) == BODY


def test_the_outline_has_every_heading_in_order(joined, pdf):
    headings = joined.evaluate(make_pdf.TITLES)
    entries = list(make_pdf.flat(pdf.outline))
    sheets = [pdf.get_destination_page_number(entry) for entry in entries]
    assert [entry.title for entry in entries] == headings
    assert sheets == sorted(sheets)
    assert len(pdf.outline) < len(headings) / 10, "sections are below chapters"


def test_chapters_and_lists_are_files(pdf, places):
    """Each chapter has the sheets from its first page to the next chapter."""
    chapters = [pages[0].removesuffix(".html") for _, pages in make_pdf.parts()]
    ends = [*(places[name] for name in chapters[1:]), len(pdf.pages)]
    for name, end in zip(chapters, ends, strict=True):
        if "/" in name:
            file = f"reproduce-{name.partition('/')[0]}.pdf"
            cut = PdfReader(make_pdf.HTML / file)
            assert len(cut.pages) == end - places[name]
    lists = make_pdf.places(PdfReader(make_pdf.LISTS))
    assert {"cells", "audit/errata", "api/optics"} <= set(lists)
    assert not set(lists) & set(NAMES)
