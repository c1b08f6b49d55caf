"""The table of all printed numbers: sorted, filtered and read by mouse, keyboard, touch and eye."""

import json
from collections.abc import Iterator

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page
from reading import DESKTOP, HTML, PHONE, SETTLED

from reproduce.judge.ledger import Record
from reproduce.printed.cells import anchor
from reproduce.views.computed import whole_ledger

pytestmark = pytest.mark.browser
ADDRESS = f"file://{HTML}/cells.html"
ROWS = "table.rp-sortable tbody tr"
LINKS = "all => all.map(row => row.querySelector('th a').hash.slice(1))"
PLACES = "all => all.map(row => row.querySelector('th a').getAttribute('href'))"


@pytest.fixture(scope="module")
def records() -> tuple[Record, ...]:
    return whole_ledger().records


@pytest.fixture
def table(browser: Browser) -> Iterator[Page]:
    context = browser.new_context(viewport=DESKTOP, reduced_motion="reduce")
    page = context.new_page()
    page.goto(ADDRESS)
    yield page
    context.close()


def shown(page: Page) -> list[str]:
    """Return the anchors of the rows in sight, in their order."""
    found: list[str] = page.locator(f"{ROWS}:visible").evaluate_all(LINKS)
    return found


def heads(page: Page) -> list[str | None]:
    """Return how each column is sorted."""
    cells = page.locator("table.rp-sortable thead th").all()
    return [cell.get_attribute("aria-sort") for cell in cells]


def test_every_number_is_there_and_leads_to_its_place(
    browser: Browser, records: tuple[Record, ...]
) -> None:
    """Without a script as well: a plain table, in the order of print."""
    context = browser.new_context(viewport=DESKTOP, java_script_enabled=False)
    page = context.new_page()
    page.goto(ADDRESS)
    rows = page.locator(f"{ROWS}:visible")
    assert rows.evaluate_all(LINKS) == [anchor(one.cell) for one in records]
    assert page.locator(".rp-filter").count() == 0
    for row, one in zip(rows.all_inner_texts(), records, strict=True):
        assert one.verdict in row
        assert one.key in row
    for place in rows.evaluate_all(PLACES):
        file, _, name = place.partition("#")
        assert f'id="{name}"' in (HTML / file).read_text(encoding="utf-8"), place
    context.close()


def test_a_click_sorts_by_number_and_what_is_empty_comes_last(
    table: Page, records: tuple[Record, ...]
) -> None:
    before = shown(table)
    share = table.get_by_role("button", name="Share of the tolerance")
    known = {
        anchor(one.cell): round(one.share, 2)
        for one in records
        if one.share is not None
    }
    for turn in ("ascending", "descending"):
        share.click()
        after = shown(table)
        assert sorted(after) == sorted(before)
        assert {*after[: len(known)]} == set(known)
        values = [known[name] for name in after[: len(known)]]
        assert values == sorted(values, reverse=turn == "descending")
        assert len(set(values)) > 5
        assert [one for one in heads(table) if one] == [turn]
    table.get_by_role("button", name="Verdict").click()
    verdicts = {anchor(one.cell): one.verdict for one in records}
    words = [verdicts[name] for name in shown(table)]
    assert words == sorted(words)
    assert [one for one in heads(table) if one] == ["ascending"]


def test_powers_of_ten_and_signs_are_sorted_as_numbers(table: Page) -> None:
    values = {
        "2\u202f×\u202f10⁻⁵ m": 2e-5,
        "10⁻³": 1e-3,
        "≈\u00a03.5\u202fpx": 3.5,
        "−7": -7.0,
        "12": 12,
    }
    put = (
        "[...document.querySelectorAll('.rp-sortable tbody tr')].forEach((row, at) => {"
    )
    put += f"row.cells[3].textContent = {json.dumps(list(values))}[at] ?? '' }})"
    # Before the page's own script.
    table.add_init_script(f"document.addEventListener('DOMContentLoaded', () => {put})")
    table.goto(ADDRESS)
    table.get_by_role("button", name="Printed").click()
    first = table.locator(f"{ROWS} td:nth-child(4)").all_text_contents()[: len(values)]
    assert [values[text] for text in first] == sorted(values.values())


def test_the_keyboard_sorts_filters_and_leads_to_a_cell(
    table: Page, records: tuple[Record, ...]
) -> None:
    table.get_by_label("Filter").focus()
    table.keyboard.type("differs table-2")
    wanted = [
        one for one in records if one.verdict == "differs" and "table-2" in one.key
    ]
    assert shown(table) == [anchor(one.cell) for one in wanted] != []
    count = table.locator(".rp-filter output").inner_text()
    assert count == f"{len(wanted)} of {len(records)} shown"
    table.keyboard.press("Tab")  # into the table, which scrolls
    for _ in range(4):
        table.keyboard.press("Tab")
    assert table.evaluate("document.activeElement.textContent") == "Printed"
    table.keyboard.press("Enter")
    assert heads(table)[3] == "ascending"
    table.keyboard.press("Space")
    assert heads(table)[3] == "descending"
    assert sorted(shown(table)) == sorted(anchor(one.cell) for one in wanted)
    for _ in range(5):
        table.keyboard.press("Tab")
    first = shown(table)[0]
    assert table.evaluate("document.activeElement.hash") == f"#{first}"
    table.keyboard.press("Enter")
    table.wait_for_url(f"**/*.html#{first}")
    table.locator(f"#{first}").wait_for(state="visible")


def test_a_verdict_is_looked_for_among_verdicts_and_other_words_everywhere(
    table: Page, records: tuple[Record, ...]
) -> None:
    box = table.get_by_label("Filter")
    for word in ("differs", "ambiguous", "unpublished", "input", "exact", "consistent"):
        box.fill(word)
        assert (
            shown(table)
            == [anchor(one.cell) for one in records if one.verdict == word]
            != []
        )
    box.fill("NIU2024/table-1")
    assert shown(table) == [
        anchor(one.cell) for one in records if one.key == "niu2024/table-1"
    ]
    box.fill("nothing that is there")
    assert shown(table) == []
    box.fill("")
    assert len(shown(table)) == len(records)


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_shows_a_table_to_sort_and_filter_by_touch(
    browser: Browser, scheme: str
) -> None:
    context = browser.new_context(
        viewport=PHONE,
        has_touch=True,
        is_mobile=True,
        color_scheme=scheme,
        reduced_motion="reduce",
    )
    page = context.new_page()
    page.goto(ADDRESS)
    page.evaluate(SETTLED)
    box = page.get_by_label("Filter")
    box.tap()
    page.keyboard.type("differs")
    page.get_by_role("button", name="Cell").tap()
    assert "ascending" in heads(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    edges = page.locator(f"{ROWS}:visible th").first.bounding_box()
    assert edges is not None
    assert edges["width"] < PHONE["width"] / 2, (
        "the cell's name leaves room for the rest"
    )
    verdict = page.locator(f"{ROWS}:visible .rp-badge").first
    verdict.scroll_into_view_if_needed()
    at = verdict.bounding_box()
    assert at is not None
    assert edges["width"] <= at["x"] <= PHONE["width"] - at["width"]
    found = Axe().run(page)
    assert found.violations_count == 0, found.generate_report()
    context.close()


def test_the_same_data_lie_beside_the_page(table: Page) -> None:
    links = table.locator("article a[download]").evaluate_all(
        "all => all.map(a => a.href)"
    )
    names = [link.rpartition("/")[2] for link in links]
    assert names == [
        "ledger.csv",
        "ledger.parquet",
        "ledger.json",
        "ledger.schema.json",
    ]
    assert all((HTML / name).stat().st_size > 1000 for name in names)
