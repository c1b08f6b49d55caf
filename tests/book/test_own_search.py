"""What a reader types is found on the first rank, from a disk and without a network."""

from urllib.parse import quote, unquote, urldefrag

import pytest
from playwright.sync_api import Browser, Page
from reading import HTML

from own_search import of_items, of_studies, renumbered
from reproduce.printed.cells import library

FOUND = "#rp-found li a"


def test_every_printed_number_of_a_shown_table_is_in_the_index() -> None:
    table, *cells = of_items({"niu2024-table-3": "here"})
    assert table[0] == "here.html#niu2024-table-3"
    assert {"niu2024/table-3", "Table 3", "niu2024 Table 3"} <= set(table[2])
    assert len(cells) == len(library()["niu2024/table-3"].cells)
    (scale,) = (cell for cell in cells if cell[2] == ["niu2024/table-3#scale.red"])
    assert scale[0] == "here.html#niu2024-table-3"
    assert "0.9973" in scale[3]
    cell = "niu2024-table-3-scale-red"
    _, *cells = of_items({"niu2024-table-3": "here", cell: "there"})
    assert f"there.html#{cell}" in {address for address, *_ in cells}


def test_both_kinds_of_numerals_are_known() -> None:
    assert renumbered("Table IV") == ["Table 4"]
    assert renumbered("Figure 4") == []


def test_supplementary_tables_are_found_by_key_and_title() -> None:
    ((address, shown, names, _),) = of_studies({"study-chen2023-frames": "there"})
    assert address == "there.html#study-chen2023-frames"
    assert names == ["chen2023/frames", "Number of frames to average"]
    assert shown.startswith(names[1])


@pytest.mark.browser
@pytest.mark.parametrize(
    ("query", "anchor"),
    [
        ("Table 3", "niu2024-table-3"),
        ("table iii", "chen2023-table-3"),
        ("Table V", "chen2023-table-5"),
        ("0.9973", "niu2024-table-3-scale-red"),
        ("niu2024/table-3", "niu2024-table-3"),
        ("niu2024/table-3#scale.red", "niu2024-table-3-scale-red"),
        ("niu2024 equation 17", "equation-niu2024-17"),
        ("chen2023/frames", "study-chen2023-frames"),
        ("scale.red", "niu2024-table-2-scale-red"),
    ],
)
def test_first_rank_from_the_disk(page: Page, query: str, anchor: str) -> None:
    page.goto(f"{(HTML / 'search.html').as_uri()}?q={quote(query)}")
    first = page.locator(FOUND).first
    first.wait_for(timeout=10_000)
    address, fragment = urldefrag(str(first.get_attribute("href")))
    assert unquote(fragment) == anchor
    assert f'id="{anchor}"' in (HTML / address).read_text(encoding="utf-8")


@pytest.mark.browser
def test_answers_stand_before_those_of_sphinx(page: Page, served: str) -> None:
    page.goto(f"{served}/search.html?q=table")
    page.wait_for_selector("#search-results ul.search li a", timeout=10_000)
    ours, theirs = (
        page.locator(one).first.bounding_box()
        for one in (FOUND, "#search-results ul.search")
    )
    assert ours is not None
    assert theirs is not None
    assert ours["y"] < theirs["y"]


@pytest.mark.browser
def test_nonsense_finds_nothing_of_ours(page: Page) -> None:
    page.goto(f"{(HTML / 'search.html').as_uri()}?q=xyzzy")
    page.wait_for_load_state("load")
    assert page.locator(FOUND).count() == 0


@pytest.mark.browser
def test_no_search_from_the_disk_logs_an_error(browser: Browser) -> None:
    """Sphinx fetches a summary of each result, which a browser refuses there."""
    page, logged = browser.new_page(), []
    page.on(
        "console",
        lambda told: logged.append(told.text) if told.type == "error" else None,
    )
    page.on("pageerror", lambda error: logged.append(str(error)))
    page.goto(f"{(HTML / 'search.html').as_uri()}?q=simulation")
    page.wait_for_selector("#search-results ul.search li a", timeout=10_000)
    page.wait_for_timeout(500)
    page.close()
    assert logged == []
