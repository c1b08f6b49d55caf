"""Every built page in a browser, and the links, numbers and weight of the pages as files."""

import re
from html import unescape
from pathlib import Path
from urllib.parse import unquote, urldefrag, urljoin, urlsplit

import pytest
from reading import (
    DESKTOP,
    HTML,
    LARGE_PRINT,
    POOR_FIGURES,
    SCROLLING,
    UNFOLD,
    built_pages,
    defects,
    violations,
)

pytestmark = pytest.mark.browser
TEXTS = {page: (HTML / page).read_text("utf-8") for page in built_pages()}
# The pages of source code are alike.
PAGES = [page for page in TEXTS if not page.startswith("_modules/reproduce/")]
SOURCE_PAGE = "_modules/reproduce/physics/validate.html"
LOADED = re.compile(r'<(?:script|link|img)\b[^>]*?\b(?:src|href)="([^"#?:]+)[^"]*"')
MATHJAX = "tex-svg-full.js"
MAX_BYTES, MAX_BYTES_INDEX = 1_500_000, 1_000_000  # on the disk, without MathJax
EQUATION = re.compile(
    r'class="eqno">(\([^)]*\))<a class="headerlink" href="#equation-([^"]+)"'
)
REFERENCE = re.compile(
    r'reference internal" href="[^"#]*#equation-([^"]+)">(?:<span[^>]*>)?([^<]+)<'
)
FIGURE_NUMBER = re.compile(r'<a class="rp-number" href="#([^"]+)">Figure B(\d+)\.</a>')
PAPER_FIGURE = re.compile(
    r'id="figure-\w+-fig-(\w+)".*?<figcaption><span class="rp-number"></span>Figure (\w+):',
    re.DOTALL,
)


def test_the_book_is_built():
    assert "index.html" in TEXTS, "no pages to read: run `make book` first"


@pytest.mark.parametrize("address", [*PAGES, SOURCE_PAGE])
def test_a_page_has_no_defect(open_page, address):
    """One load: console, network, formulas, accessibility, widths, paper, figures."""
    page = open_page()
    assert defects(page, (HTML / address).as_uri()) == {}
    if address in {f"{name}.html" for name in WIDE_TABLES}:
        for width in (1280, 1440, 1920):
            page.set_viewport_size({"width": width, "height": 1000})
            assert page.evaluate(SCROLLING) == page.evaluate(LARGE_PRINT) == []


WIDE_TABLES = ("chen2023/effectiveness", "niu2024/simulation", "niu2024/experiment")


def test_defects_are_found(open_page):
    page = open_page()
    page.set_content(
        "<html lang='en'><title>x</title><img src='x.png'><button></button>"
        '<figure class="rp-figure" id="x" style="width:100px;overflow-x:auto">'
        '<svg style="width:200px" viewBox="0 0 100 9"><text style="font-size:4px">x</text></svg>'
    )
    assert page.evaluate(POOR_FIGURES) == [["x", 1, True, 8]]
    rules = {fault.partition(":")[0] for fault in violations(page)}
    assert {"button-name", "image-alt"} <= rules


def test_links_lead_to_files_and_anchors():
    ids = {
        page: set(re.findall(r'\bid="([^"]+)"', text)) for page, text in TEXTS.items()
    }
    broken = []
    for page, text in TEXTS.items():
        for link in set(re.findall(r'\s(?:href|src)="([^"]*)"', text)):
            url, name = urldefrag(urljoin((HTML / page).as_uri(), unescape(link)))
            parts = urlsplit(url)
            target = Path(unquote(parts.path))
            if parts.scheme != "file":
                continue
            if not target.is_file() or not target.is_relative_to(HTML):
                broken.append((page, link))
                continue
            anchors = ids.get(target.relative_to(HTML).as_posix())
            if name and anchors is not None and unquote(name) not in anchors:
                broken.append((page, link))
    assert broken == []


def test_no_page_shows_a_traceback():
    assert [p for p, text in TEXTS.items() if "(most recent call last)" in text] == []


def test_pages_are_light_and_load_mathjax_only_with_formulas():
    for address, text in TEXTS.items():
        page = HTML / address
        files = {(page.parent / name).resolve() for name in LOADED.findall(text)}
        files = {file for file in files if file.is_file() and file.suffix != ".html"}
        mathjax = {file for file in files if file.name == MATHJAX}
        assert bool(mathjax) == ('class="math' in text), address
        weight = sum(file.stat().st_size for file in {page, *files} - mathjax)
        limit = MAX_BYTES_INDEX if address == "index.html" else MAX_BYTES
        assert weight < limit, address
        (icon,) = re.findall(r'<link rel="icon" href="([^"]+)"', text)
        assert (page.parent / icon).is_file()


def test_icons_are_drawn(open_page):
    page = open_page("niu2024/simulation.html")
    page.wait_for_selector("svg[data-icon=download]", state="attached", timeout=10_000)
    assert page.locator("svg[data-icon] g.missing").count() == 0
    paths = page.locator("svg[data-icon]").evaluate_all(
        "all => all.map(i => i.querySelector('path')?.getAttribute('d') ?? '')"
    )
    assert len(paths) > 5
    assert min(map(len, paths)) >= 20


def test_equations_have_the_numbers_of_the_papers():
    """Label, shown number and the text of each reference agree."""
    pairs = [pair for text in TEXTS.values() for pair in EQUATION.findall(text)]
    shown = {label: number for number, label in pairs}
    assert len(shown) > 40
    for label, number in shown.items():
        prefix, digits, *printed = label.split("-")
        expected = (
            f"{'B' * (prefix == 'book')}{digits}{', as extracted' * bool(printed)}"
        )
        assert number == f"({expected})"
    referred = [pair for text in TEXTS.values() for pair in REFERENCE.findall(text)]
    assert len(referred) > 40
    assert [pair for pair in referred if shown.get(pair[0]) != pair[1]] == []


def test_figures_are_numbered_in_the_order_of_reading():
    """A figure of a paper keeps the number of its caption; the others are B1, B2, ..."""
    numbers, of_papers = {}, []
    for address, text in TEXTS.items():
        names = re.findall(r'<figure class="rp-figure" id="([^"]+)"', text)
        pairs = FIGURE_NUMBER.findall(text)
        assert [name for name, _ in pairs] == [n for n in names if "-fig-" not in n]
        of_papers += PAPER_FIGURE.findall(text)
        if pairs:
            numbers[address] = [int(number) for _, number in pairs]
    assert [pair for pair in of_papers if len(set(pair)) > 1] == []
    every = sorted(number for group in numbers.values() for number in group)
    assert every == list(range(1, len(every) + 1))
    for group in numbers.values():
        assert group == list(range(group[0], group[0] + len(group)))
    order = ("niu2024/images", "chen2023/effectiveness", "posteriors/index")
    starts = [numbers[f"{page}.html"] for page in order]
    assert starts == sorted(starts)


def test_a_served_book_requests_nothing_else_and_is_searched(open_page, served):
    page, requests = open_page(viewport=DESKTOP), []
    page.on("request", lambda request: requests.append(request.url))
    page.goto(f"{served}/index.html", wait_until="load")
    page.evaluate(UNFOLD)
    page.goto(f"{served}/search.html?q=printed")
    page.wait_for_selector("#search-results ul.search li a", timeout=10_000)
    assert [url for url in requests if not url.startswith((served, "data:"))] == []
