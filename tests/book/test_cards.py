"""Cards: every printed cell has one, on hover, focus and tap, and what it offers is right."""

import json
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page
from reading import DESKTOP, HTML, PHONE, built_pages

import reproduce as rp
from reproduce.printed.cells import PAPERS, library

pytestmark = pytest.mark.browser
PLACE = "niu2024/simulation.html#niu2024-table-3-scale-red"
CELL = "#niu2024-table-3-scale-red a.rp-has-card"
LINK = re.compile(r'href="(?!https)([^"#]*)#?([^"]*)"')


@pytest.fixture(scope="module")
def scripts() -> list[dict[str, Any]]:
    lines = (HTML / "cards.js").read_text(encoding="utf-8").splitlines()
    return [json.loads(line.partition(" = ")[2].rstrip(";")) for line in lines]


@pytest.fixture(scope="module")
def cards(scripts: list[dict[str, Any]]) -> dict[str, str]:
    return scripts[0]


def signed(page: str) -> Iterator[str]:
    """Yield the name of the card of every link of a page that has the sign of one."""
    for link in re.findall(r"<a\b[^>]*>", (HTML / page).read_text(encoding="utf-8")):
        if "rp-has-card" in link:
            (href,) = re.findall(r'href="([^"]*)"', link)
            place, name = href.split("#")
            yield (
                f"bibliography-{name}" if place.endswith("bibliography.html") else name
            )


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


def test_every_cell_of_the_ledger_gives_its_record(
    scripts: list[dict[str, Any]],
) -> None:
    written = json.loads((HTML / "ledger.json").read_text(encoding="utf-8"))["records"]
    assert scripts[1] == {one["cell"]: one for one in written}
    cells = [cell.address for table in library().values() for cell in table.cells]
    assert set(scripts[1]) == set(cells)


def test_every_sign_of_a_card_has_one(cards: dict[str, str]) -> None:
    names = {page: list(signed(page)) for page in built_pages()}
    assert [
        (page, n) for page, some in names.items() for n in some if n not in cards
    ] == []
    kinds = {name.partition("-")[0] for some in names.values() for name in some}
    assert {"equation", "figure", "symbol", "bibliography", *PAPERS} <= kinds
    assert "chen2023-table-5-columns" in names["chen2023/effectiveness.html"], (
        "an erratum"
    )


def test_every_mark_of_the_first_page_has_a_card(cards: dict[str, str]) -> None:
    text = (HTML / "index.html").read_text(encoding="utf-8")
    marks = re.findall(
        r'<a class="rp-has-card"\s+href="[^"#]*#([^"]+)" tabindex="-1">', text
    )
    assert sorted(marks) == sorted(
        c.anchor for table in library().values() for c in table.cells
    )


def test_symbols_are_those_of_their_paper(cards: dict[str, str]) -> None:
    """The laser transform of one paper is written as the residuals of the other."""
    transform = next(
        n for n, card in cards.items() if card.endswith(": laser transform</p>")
    )
    assert transform in set(signed("chen2023/attitude.html"))
    assert transform not in set(signed("niu2024/calibration.html"))
    rows = re.findall(
        r'id="(symbol-\d+)"', (HTML / "notation.html").read_text(encoding="utf-8")
    )
    assert rows == [name for name in cards if name.startswith("symbol-")]


def test_the_picture_of_a_card_is_that_of_its_figure(cards: dict[str, str]) -> None:
    pictures = {n: re.findall(r'data-src="([^"]+)"', card) for n, card in cards.items()}
    found = {name: files for name, files in pictures.items() if files}
    assert len(found) > 30
    for name, (file,) in found.items():
        assert set(Path(file).stem.split("-")) <= set(name.split("-")), name
        assert (HTML / file).is_file()


def test_every_link_of_a_card_leads_somewhere(cards: dict[str, str]) -> None:
    held: dict[str, str] = {}
    for card in cards.values():
        for page, name in LINK.findall(card):
            assert (HTML / page).is_file(), (page, name)
            text = held.setdefault(page, (HTML / page).read_text(encoding="utf-8"))
            assert not name or f'id="{name}"' in text, (page, name)


def test_a_pointer_that_rests_opens_a_card_and_one_that_passes_does_not(
    wide: Page,
) -> None:
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
    taken: list[str] = []
    for button in card.locator("button").all():
        button.click()
        taken.append(wide.evaluate("navigator.clipboard.readText()"))
    address = "niu2024/table-3#scale.red"
    record = rp.table(address).record
    forms = [rp.cite(address, form) for form in ("text", "bibtex", "ris")]
    # The pages may be of another commit than the tests.
    commit = re.compile(r", commit (not recorded|\w+)")
    assert taken[0] == f"file://{HTML}/{PLACE}"
    assert [commit.sub("", text.replace("\r\n", "\n")) for text in taken[1:4]] == [
        commit.sub("", form) for form in forms
    ]
    assert taken[4].startswith(f'rp.table("{address}").rerun(')
    assert rp.verify(taken[1]) == "unchanged"
    assert json.loads(taken[5])["stands_for"] == list(record.stands_for or ())
    assert json.loads(taken[5])["cell"] == address
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


@pytest.mark.parametrize(
    ("page", "link", "shown"),
    [
        ("chen2023/attitude.html", "a.rp-has-card[href*='#symbol-']", "mjx-container"),
        ("niu2024/simulation.html", "a.rp-has-card[href*='errata.html#']", "table"),
        ("find.html", "a.rp-has-card[href*='#figure-']", "img"),
        ("chen2023/attitude.html", "a.rp-has-card[href*='bibliography.html#']", "em"),
    ],
)
def test_symbols_errata_figures_and_references_have_cards(
    wide: Page, page: str, link: str, shown: str
) -> None:
    wide.goto(f"file://{HTML}/{page}")
    one = wide.locator(f"article {link}").locator("visible=true").first
    one.scroll_into_view_if_needed()
    one.hover()
    card = wide.locator(".rp-card")
    card.locator(shown).first.wait_for(state="visible")
    assert card.bounding_box()["width"] <= DESKTOP["width"]
    if shown == "img":
        assert card.locator("img").evaluate("image => image.naturalWidth") > 0


def test_a_function_of_a_card_leads_to_its_text(wide: Page) -> None:
    wide.locator(CELL).scroll_into_view_if_needed()
    wide.locator(CELL).hover()
    wide.locator(".rp-card a[href*='#function-']").click()
    text = wide.locator("#function-niu2024-table-3-calibrated_parameters")
    text.wait_for(state="visible")
    assert "def calibrated_parameters(" in text.inner_text()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_tap_opens_a_card_that_fits_and_can_be_read(
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
