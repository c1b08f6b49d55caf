"""Cards of the links: one for each printed cell, on hover, focus and tap."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from reading import DESKTOP, HTML, PHONE, built_pages, violations

import reproduce as rp
from reproduce.printed.cells import PAPERS, library

pytestmark = pytest.mark.browser
PAGE = "niu2024/simulation.html"
ADDRESS = "niu2024/table-3#scale.red"
PLACE = f"{PAGE}#niu2024-table-3-scale-red"
CELL = "#niu2024-table-3-scale-red a.rp-has-card"
CELLS = [cell for table in library().values() for cell in table.cells]


@pytest.fixture(scope="module")
def scripts():
    """Return the cards by anchor, and the records of the ledger by cell."""
    lines = (HTML / "cards.js").read_text(encoding="utf-8").splitlines()
    return [json.loads(line.partition(" = ")[2].rstrip(";")) for line in lines]


@pytest.fixture
def wide(open_page):
    permissions = ["clipboard-read", "clipboard-write"]
    return open_page(PAGE, viewport=DESKTOP, permissions=permissions)


def names_with_cards(page):
    """Return the names of the cards of all marked links of a page."""
    text = (HTML / page).read_text(encoding="utf-8")
    links = re.findall(r'<a\b(?=[^>]*rp-has-card)[^>]*href="([^"#]*)#([^"]*)"', text)
    start = {True: "bibliography-", False: ""}
    return {start[place.endswith("bibliography.html")] + name for place, name in links}


def test_every_printed_cell_has_a_card_and_a_record(scripts):
    cards, records = scripts
    assert all(cell.address in cards[cell.anchor] for cell in CELLS)
    ledger = json.loads((HTML / "ledger.json").read_text(encoding="utf-8"))["records"]
    assert records == {record["cell"]: record for record in ledger}
    assert set(records) == {cell.address for cell in CELLS}


def test_every_marked_link_has_a_card(scripts):
    names = {page: names_with_cards(page) for page in built_pages()}
    every = set().union(*names.values())
    assert every <= set(scripts[0])
    kinds = {name.partition("-")[0] for name in every}
    assert {"equation", "figure", "symbol", "bibliography", *PAPERS} <= kinds
    assert "chen2023-table-5-columns" in names["chen2023/effectiveness.html"]  # erratum
    assert names["index.html"] >= {cell.anchor for cell in CELLS}


def test_symbols_are_those_of_the_paper_of_the_page(scripts):
    """The laser transform of one paper has the symbol of the residuals of the other."""
    (transform,) = (
        n for n, c in scripts[0].items() if c.endswith(": laser transform</p>")
    )
    assert transform in names_with_cards("chen2023/attitude.html")
    assert transform not in names_with_cards("niu2024/calibration.html")
    notation = (HTML / "notation.html").read_text(encoding="utf-8")
    rows = re.findall(r'id="(symbol-\d+)"', notation)
    assert rows == [name for name in scripts[0] if name.startswith("symbol-")]


def test_links_and_images_of_cards_exist(scripts):
    texts, images = {}, 0
    for card, text in scripts[0].items():
        for page, name in re.findall(r'href="(?!https)([^"#]*)#?([^"]*)"', text):
            if page not in texts:
                texts[page] = (HTML / page).read_text(encoding="utf-8")
            assert f'id="{name}"' in texts[page] or not name, (card, page, name)
        for file in re.findall(r'data-src="([^"]+)"', text):
            assert set(Path(file).stem.split("-")) <= set(card.split("-")), card
            assert (HTML / file).is_file()
            images += 1
    assert images > 30


def test_a_card_opens_if_the_pointer_rests_and_copies_its_contents(wide):
    link, card = wide.locator(CELL), wide.locator(".rp-card")
    link.scroll_into_view_if_needed()
    link.hover()
    wide.mouse.move(2, 2)
    wide.wait_for_timeout(600)
    assert card.count() == 0
    link.hover()
    card.wait_for(state="visible")
    cell, shown, copied = rp.table(ADDRESS), card.inner_text(), []
    assert cell.printed in shown
    assert cell.verdict in shown
    assert card.locator("a[href*=equation]").count() == len(cell.record.equations)
    for button in card.locator("button").all():
        button.click()
        copied.append(wide.evaluate("navigator.clipboard.readText()"))
    link_, text, bibtex, ris, code, record = copied
    # The pages may be of another commit than the tests.
    commit = re.compile(r", commit (not recorded|\w+)")
    for form, cited in (("text", text), ("bibtex", bibtex), ("ris", ris)):
        expected = commit.sub("", rp.cite(ADDRESS, form))
        assert commit.sub("", cited.replace("\r\n", "\n")) == expected
    assert rp.verify(text) == "unchanged"
    assert code.startswith(f'rp.table("{ADDRESS}").rerun(')
    stated = json.loads(record)
    assert (stated["cell"], tuple(stated["stands_for"])) == (
        ADDRESS,
        cell.record.stands_for,
    )
    wide.keyboard.press("Escape")
    card.wait_for(state="hidden")
    assert link_ == f"file://{HTML}/{PLACE}"
    wide.goto(link_)
    assert wide.locator(CELL).is_visible()


def test_the_keyboard_leads_into_a_card_and_out_of_it(wide):
    link, card = wide.locator(CELL), wide.locator(".rp-card")
    focused = card.locator(":focus")
    link.focus()
    wide.keyboard.press("Shift+Tab")
    wide.keyboard.press("Tab")
    card.wait_for(state="visible")
    wide.keyboard.press("ArrowDown")
    assert focused.count() == 1
    wide.keyboard.press("Escape")
    card.wait_for(state="hidden")
    wide.keyboard.press("Tab")
    wide.keyboard.press("Shift+Tab")
    card.wait_for(state="visible")
    wide.keyboard.press("Tab")
    assert focused.count() == 1
    wide.keyboard.press("Tab")
    assert focused.count() == 0, "the Tab key leads to the next number"


OTHER_CARDS = (
    (PAGE, "p a.rp-has-card[href*=equation]", "mjx-container"),
    ("index.html", ".rp-wall a[href*=niu2024-table-3-scale-red]", "table"),
    ("chen2023/attitude.html", "a.rp-has-card[href*='#symbol-']", "mjx-container"),
    (PAGE, "a.rp-has-card[href*='errata.html#']", "table"),
    ("find.html", "a.rp-has-card[href*='#figure-']", "img"),
    ("chen2023/attitude.html", "a.rp-has-card[href*='bibliography.html#']", "em"),
)


def test_marks_symbols_equations_errata_figures_and_references_have_cards(wide):
    card = wide.locator(".rp-card")
    for page, link, part in OTHER_CARDS:
        wide.goto(f"file://{HTML}/{page}")
        target = wide.locator(f"article {link}").locator("visible=true").first
        target.scroll_into_view_if_needed()
        target.hover()
        card.locator(part).first.wait_for(state="visible")
        assert card.bounding_box()["width"] <= DESKTOP["width"]
        if part == "img":
            assert card.locator("img").evaluate("image => image.naturalWidth") > 0


def test_a_function_of_a_card_leads_to_its_text(wide):
    wide.locator(CELL).hover()
    wide.locator(".rp-card a[href*='#function-']").click()
    text = wide.locator("#function-niu2024-table-3-calibrated_parameters")
    text.wait_for(state="visible")
    assert "def calibrated_parameters(" in text.inner_text()


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_tap_opens_a_card_that_fits_and_is_accessible(open_page, scheme):
    page = open_page(PAGE, has_touch=True, is_mobile=True, color_scheme=scheme)
    page.locator(CELL).tap()
    card = page.locator(".rp-card")
    card.wait_for(state="visible")
    box = card.bounding_box()
    assert 0 <= box["x"] <= PHONE["width"] - box["width"]
    assert violations(page, part=".rp-card") == []


def test_without_a_script_a_link_leads_to_its_cell(open_page):
    page = open_page(PAGE, viewport=DESKTOP, java_script_enabled=False)
    page.locator(CELL).click()
    assert page.url.endswith(PLACE)


def test_goto_leads_to_cells_and_tables(open_page):
    for name, page in (
        ("niu2024-table-3-scale-red", PAGE),
        ("chen2023-table-5", "chen2023/effectiveness.html"),
    ):
        open_page(f"goto.html#{name}").wait_for_url(f"file://{HTML}/{page}#{name}")


def test_every_verdict_follows_from_the_files_of_the_book():
    command = [sys.executable, "-I", str(HTML / "verify_ledger.py")]
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    assert result.returncode == 0, result.stdout
