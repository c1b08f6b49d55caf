"""The built pages, read as a reader's browser reads them."""

from pathlib import Path
from urllib.parse import unquote, urldefrag, urljoin, urlsplit

import pytest
from playwright.sync_api import Page
from reading import HTML, Visit, built_pages, read

pytestmark = pytest.mark.browser
LOCAL = {"file", "data", "blob"}
each_page = pytest.mark.parametrize("address", built_pages())


def test_the_book_is_built() -> None:
    assert (HTML / "index.html").is_file(), "no pages to read: run `make book` first"


@each_page
def test_page_logs_no_error(visits: dict[str, Visit], address: str) -> None:
    assert visits[address].console == []


@each_page
def test_page_asks_the_network_for_nothing(
    visits: dict[str, Visit], address: str
) -> None:
    outside = [
        url for url in visits[address].requests if urlsplit(url).scheme not in LOCAL
    ]
    assert outside == []


@each_page
def test_mathematics_is_typeset(visits: dict[str, Visit], address: str) -> None:
    assert visits[address].raw_mathematics == []


@each_page
def test_no_page_shows_a_traceback(address: str) -> None:
    """What cannot be shown does not stop a notebook."""
    assert "(most recent call last)" not in (HTML / address).read_text(encoding="utf-8")


@each_page
def test_no_rounding_noise_is_shown_as_a_result(
    visits: dict[str, Visit], address: str
) -> None:
    assert visits[address].noise == []


@each_page
def test_no_cell_of_a_table_is_cut(visits: dict[str, Visit], address: str) -> None:
    assert visits[address].cut == []


@each_page
def test_print_loses_no_table(visits: dict[str, Visit], address: str) -> None:
    assert visits[address].cut_in_print == []


@each_page
@pytest.mark.parametrize("width", [390, 1280])
def test_nothing_sticks_out_of_the_window(
    visits: dict[str, Visit], address: str, width: int
) -> None:
    assert visits[address].overflowing[width] == []


@each_page
def test_links_lead_somewhere(visits: dict[str, Visit], address: str) -> None:
    broken = [
        ref
        for ref in visits[address].references
        if not leads_somewhere(ref, address, visits)
    ]
    assert broken == []


def test_equations_carry_the_papers_numbers(visits: dict[str, Visit]) -> None:
    """The shown number, the label and every reference agree."""
    shown = {
        label: number
        for visit in visits.values()
        for label, number in visit.shown_numbers
    }
    referred = [pair for visit in visits.values() for pair in visit.referred_numbers]
    assert shown, "no numbered equation in the book"
    assert shown == {label: expected_number(label) for label in shown}
    assert [pair for pair in referred if shown.get(pair[0]) != pair[1]] == []


@pytest.mark.parametrize(
    "address",
    [
        "chen2023/effectiveness.html",
        "niu2024/simulation.html",
        "niu2024/experiment.html",
    ],
)
@pytest.mark.parametrize("width", [1440, 1920])
def test_tables_of_printed_numbers_are_whole_on_a_desk(
    page: Page, address: str, width: int
) -> None:
    page.set_viewport_size({"width": width, "height": 1000})
    page.goto((HTML / address).as_uri())
    page.evaluate(
        "() => document.querySelectorAll('article details').forEach(e => e.open = true)"
    )
    cut = page.evaluate(
        """() => [...document.querySelectorAll('.rp-scroll:has(.rp-cell, .rp-numbers)')]
            .filter(e => e.scrollWidth > e.clientWidth + 1).map(e => e.ariaLabel)"""
    )
    assert cut == []
    larger = page.evaluate(
        """() => [...document.querySelectorAll('article small')].filter(e =>
            parseFloat(getComputedStyle(e).fontSize)
            >= parseFloat(getComputedStyle(e.parentElement).fontSize)).length"""
    )
    assert larger == 0, "small print is smaller than what it stands in"


def test_no_request_leaves_a_served_book(page: Page, served: str) -> None:
    visit = Visit()
    page.on("request", lambda request: visit.requests.append(request.url))
    read(page, f"{served}/index.html", visit)
    assert [
        url for url in visit.requests if not url.startswith((served, "data:"))
    ] == []


def test_search_finds_a_word(page: Page, served: str) -> None:
    page.goto(f"{served}/search.html?q=printed")
    page.wait_for_selector("#search-results ul.search li a", timeout=10_000)


def expected_number(label: str) -> str:
    """Spell out the number a label stands for."""
    prefix, number, *printed = label.split("-")
    own = {"book": "B"}.get(prefix, "")
    return f"({own}{number}{', as extracted' if printed else ''})"


def leads_somewhere(reference: str, address: str, visits: dict[str, Visit]) -> bool:
    """Tell whether a link inside the book has a file, and its fragment an anchor."""
    here = (HTML / address).as_uri()
    url, fragment = urldefrag(urljoin(here, reference))
    parts = urlsplit(url)
    if parts.scheme != "file":
        return True
    target = Path(unquote(parts.path))
    if not target.is_file() or not target.is_relative_to(HTML):
        return False
    inside = target.relative_to(HTML).as_posix()
    return (
        not fragment or inside not in visits or unquote(fragment) in visits[inside].ids
    )
