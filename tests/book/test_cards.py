"""Cards: every printed cell has one, on hover, focus and tap, and what it offers is right."""

import json
import re
from collections.abc import Iterator
from pathlib import Path

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page
from reading import DESKTOP, HTML, PHONE

import reproduce as rp
from reproduce.printed.cells import library

pytestmark = pytest.mark.browser
PLACE = "niu2024/simulation.html#niu2024-table-3-scale-red"
CELL = "#niu2024-table-3-scale-red a.rp-has-card"
LINK = re.compile(r'href="(?!https)([^"#]*)#?([^"]*)"')


@pytest.fixture(scope="module")
def cards() -> dict[str, str]:
    text = (HTML / "cards.js").read_text(encoding="utf-8")
    found: dict[str, str] = json.loads(text.removeprefix("window.rpCards = ").rstrip(";\n"))
    return found


@pytest.fixture
def wide(browser: Browser) -> Iterator[Page]:
    context = browser.new_context(viewport=DESKTOP, reduced_motion="reduce")
    context.grant_permissions(["clipboard-read", "clipboard-write"])
    page = context.new_page()
    page.goto(f"file://{HTML}/{PLACE.partition('#')[0]}")
    yield page
    context.close()


def test_every_cell_of_the_ledger_has_its_card(cards: dict[str, str]) -> None:
    cells = [cell for table in library().values() for cell in table.cells]
    assert {cell.anchor for cell in cells} <= set(cards)
    assert all(cell.address in cards[cell.anchor] for cell in cells)


def test_every_link_of_a_card_leads_somewhere(cards: dict[str, str]) -> None:
    held: dict[str, str] = {}
    for card in cards.values():
        for page, name in LINK.findall(card):
            assert (HTML / page).is_file(), (page, name)
            text = held.setdefault(page, (HTML / page).read_text(encoding="utf-8"))
            assert not name or f'id="{name}"' in text, (page, name)


def test_a_pointer_that_rests_opens_a_card_and_one_that_passes_does_not(wide: Page) -> None:
    link, card = wide.locator(CELL), wide.locator(".rp-card")
    link.scroll_into_view_if_needed()
    link.hover()
    wide.mouse.move(2, 2)
    wide.wait_for_timeout(600)
    assert card.count() == 0
    link.hover()
    card.wait_for(state="visible")
    record = rp.table("niu2024/table-3#scale.red")
    assert record.printed in card.inner_text()
    assert record.verdict in card.inner_text()
    assert card.locator("a[href*=equation]").count() == len(record.record.equations)
    wide.keyboard.press("Escape")
    card.wait_for(state="hidden")


def test_what_a_card_offers_is_copied(wide: Page) -> None:
    link, card = wide.locator(CELL), wide.locator(".rp-card")
    link.hover()
    card.wait_for(state="visible")
    taken = []
    for button in card.locator("button").all():
        button.click()
        taken.append(wide.evaluate("navigator.clipboard.readText()"))
    address = "niu2024/table-3#scale.red"
    forms = [rp.cite(address, form) for form in ("text", "bibtex", "ris")]
    # The pages may be of another commit than the tests.
    commit = re.compile(r", commit (not recorded|\w+)")
    assert taken[0] == f"file://{HTML}/{PLACE}"
    assert [commit.sub("", text.replace("\r\n", "\n")) for text in taken[1:4]] == [
        commit.sub("", form) for form in forms
    ]
    assert taken[4].startswith(f'rp.table("{address}").rerun(')
    assert rp.verify(taken[1]) == "unchanged"
    wide.goto(taken[0])
    assert wide.locator(CELL).is_visible()


def test_the_keyboard_leads_into_a_card_and_out_of_it(wide: Page) -> None:
    link, card = wide.locator(CELL), wide.locator(".rp-card")
    link.scroll_into_view_if_needed()
    link.focus()
    wide.keyboard.press("Shift+Tab")
    wide.keyboard.press("Tab")
    card.wait_for(state="visible")
    wide.keyboard.press("ArrowDown")
    assert card.locator(":focus").count() == 1
    wide.keyboard.press("Escape")
    card.wait_for(state="hidden")
    wide.keyboard.press("Tab")
    wide.keyboard.press("Shift+Tab")
    card.wait_for(state="visible")
    wide.keyboard.press("Tab")
    assert card.locator(":focus").count() == 1
    wide.keyboard.press("Tab")
    assert card.locator(":focus").count() == 0, "the Tab key goes on to the next number"


def test_an_equation_and_a_mark_of_the_first_page_have_cards(wide: Page) -> None:
    card = wide.locator(".rp-card")
    wide.locator("p a.rp-has-card[href*=equation]").first.hover()
    card.locator("mjx-container").wait_for(state="visible")
    wide.goto(f"file://{HTML}/index.html")
    wide.locator(".rp-wall a[href*=niu2024-table-3-scale-red]").hover()
    card.wait_for(state="visible")
    assert "niu2024/table-3#scale.red" in card.inner_text()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_tap_opens_a_card_that_fits_and_can_be_read(browser: Browser, scheme: str) -> None:
    context = browser.new_context(
        viewport=PHONE, has_touch=True, is_mobile=True, color_scheme=scheme, reduced_motion="reduce"
    )
    page = context.new_page()
    page.goto(f"file://{HTML}/{PLACE.partition('#')[0]}")
    page.locator(CELL).scroll_into_view_if_needed()
    page.locator(CELL).tap()
    card = page.locator(".rp-card")
    card.wait_for(state="visible")
    box = card.bounding_box()
    assert box is not None
    assert box["x"] >= 0
    assert box["x"] + box["width"] <= PHONE["width"]
    found = Axe().run(page, context=".rp-card")
    assert found.violations_count == 0, found.generate_report()
    context.close()


def test_without_the_script_a_link_leads_to_its_cell(browser: Browser) -> None:
    context = browser.new_context(viewport=DESKTOP, java_script_enabled=False)
    page = context.new_page()
    page.goto(f"file://{HTML}/{PLACE.partition('#')[0]}")
    page.locator(CELL).click()
    assert page.url.endswith(PLACE)
    context.close()


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("goto.html#niu2024-table-3-scale-red", PLACE),
        ("goto.html#chen2023-table-5", "chen2023/effectiveness.html#chen2023-table-5"),
        (
            "posteriors/diagnostics-niu2024.html",
            "posteriors/diagnostics.html#diagnostics-niu2024",
        ),
    ],
)
def test_addresses_lead_on(wide: Page, old: str, new: str) -> None:
    wide.goto(f"file://{HTML}/{old}")
    wide.wait_for_url(f"file://{HTML}/{new}")


def test_a_referee_derives_every_verdict_from_the_files_beside_the_pages() -> None:
    import subprocess
    import sys

    command = [sys.executable, "-I", str(Path(HTML) / "verify_ledger.py")]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout
