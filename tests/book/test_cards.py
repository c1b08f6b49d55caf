"""Cards of the links: one for each printed cell, on hover, focus and tap."""

import json
import re
import subprocess
import sys
from pathlib import Path
from posixpath import basename, dirname, join, normpath

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
    """Return cards and records of each page."""
    found = {}
    for path in sorted((HTML / "cards").rglob("*.js")):
        text = path.read_text(encoding="utf-8")
        page = path.relative_to(HTML / "cards").with_suffix("").as_posix()
        assert text.startswith(f'(window.rpCards ??= {{}})["{page}"] = ')
        found[page] = json.loads(text.partition(" = ")[2].rstrip().rstrip(";"))
    return found


@pytest.fixture
def wide(open_page):
    permissions = ["clipboard-read", "clipboard-write"]
    return open_page(PAGE, viewport=DESKTOP, permissions=permissions)


def all_cards(scripts):
    return {
        name: text for one in scripts.values() for name, text in one["cards"].items()
    }


def linked(page):
    """Yield page and name of the cards of all marked links of a page."""
    text = (HTML / page).read_text(encoding="utf-8")
    links = re.findall(r'<a\b(?=[^>]*rp-has-card)[^>]*href="([^"#]*)#([^"]*)"', text)
    for place, name in links:
        target = normpath(join(dirname(page), place or basename(page)))
        start = "bibliography-" * (target == "bibliography.html")
        yield target.removesuffix(".html"), start + name


def test_every_printed_cell_has_a_card_and_a_record(scripts):
    cards = all_cards(scripts)
    assert all(cell.address in cards[cell.anchor] for cell in CELLS)
    ledger = json.loads((HTML / "ledger.json").read_text(encoding="utf-8"))["records"]
    for one in scripts.values():
        names = {cell.address for cell in CELLS if cell.anchor in one["cards"]}
        found = {r["cell"]: r for r in ledger if r["cell"] in names}
        assert one["records"] == found


def test_every_marked_link_has_a_card_in_the_script_of_its_page(scripts):
    links = {page: {*linked(page)} for page in built_pages()}
    every = set().union(*links.values())
    assert [one for one in every if one[1] not in scripts[one[0]]["cards"]] == []
    kinds = {name.partition("-")[0] for _, name in every}
    assert {"equation", "figure", "symbol", "bibliography", *PAPERS} <= kinds
    assert ("audit/errata", "chen2023-table-5-columns") in links[
        "chen2023/effectiveness.html"
    ]
    assert {name for _, name in links["index.html"]} >= {cell.anchor for cell in CELLS}
    largest = max((HTML / "cards").rglob("*.js"), key=lambda path: path.stat().st_size)
    assert largest.stat().st_size < 600_000


def test_symbols_are_those_of_the_paper_of_the_page(scripts):
    """The laser transform of one paper has the symbol of the residuals of the other."""
    cards = scripts["notation"]["cards"]
    (transform,) = (n for n, c in cards.items() if c.endswith(": laser transform</p>"))
    assert ("notation", transform) in linked("chen2023/attitude.html")
    assert ("notation", transform) not in linked("niu2024/calibration.html")
    notation = (HTML / "notation.html").read_text(encoding="utf-8")
    rows = re.findall(r'id="(symbol-\d+)"', notation)
    assert sorted(rows) == [name for name in cards if name.startswith("symbol-")]


def test_links_and_images_of_cards_exist(scripts):
    texts, images = {}, 0
    for card, text in all_cards(scripts).items():
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
    cell, shown, copied = rp.table(ADDRESS), card.inner_text(), {}
    assert shown.startswith(f"{cell.verdict} printed {cell.printed}, recomputed ")
    box = card.bounding_box()
    assert (box["width"] <= 360, box["height"] <= 320) == (True, True)
    assert card.locator("button:visible, table:visible").count() == 0
    for fold in card.locator("summary").all():
        fold.click()
    for button in card.locator("button").all():
        button.click()
        name = button.inner_text().rstrip(" ✓")
        copied[name] = wide.evaluate("navigator.clipboard.readText()")
    # The pages may be of another commit than the tests.
    for form, name, end in (
        ("text", "citation", ". reproduce-pointing "),
        ("sentence", "sentence", "(The reproduce-pointing"),
    ):
        assert (
            copied[name].partition(end)[:2] == rp.cite(ADDRESS, form).partition(end)[:2]
        )
    for name, start in (("BibTeX", "@misc"), ("RIS", "TY  - COMP")):
        assert copied[name].startswith(start)
    assert copied["code"] == cell.rerun_code
    assert json.loads(copied["JSON"])["cell"] == ADDRESS
    wide.keyboard.press("Escape")
    card.wait_for(state="hidden")
    # A path on a disk leads nowhere for others.
    assert copied["link"].endswith(f": goto.html#{PLACE.partition('#')[2]}")


def test_the_link_of_a_card_is_an_address_on_a_server(open_page, served):
    page = open_page(
        permissions=["clipboard-read", "clipboard-write"], viewport=DESKTOP
    )
    page.goto(f"{served}/{PLACE}")
    page.locator(CELL).hover()
    page.locator(".rp-card summary").first.click()
    page.locator(".rp-card [data-link]").click()
    assert page.evaluate("navigator.clipboard.readText()") == f"{served}/{PLACE}"


ADDED = """() => [...document.querySelectorAll('article a.rp-has-card')].filter(e =>
    e.tabIndex >= 0 && e.checkVisibility() && e.getClientRects().length).length"""


def test_cards_add_few_stops_and_arrows_lead_through_a_table(open_page):
    page = open_page(viewport=DESKTOP)
    for address in built_pages():
        page.goto(f"file://{HTML}/{address}")
        assert page.evaluate(ADDED) <= 60, address
    page.goto(f"file://{HTML}/{PAGE}")
    first = page.locator("#niu2024-table-3 a.rp-has-card").first
    first.focus()
    page.keyboard.press("ArrowRight")
    href = page.evaluate("document.activeElement.getAttribute('href')")
    assert href == page.locator("#niu2024-table-3 a.rp-has-card").nth(1).get_attribute(
        "href"
    )
    page.keyboard.press("ArrowLeft")
    assert first.evaluate("e => e === document.activeElement")


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
    ("index.html", ".rp-wall a[href*=niu2024-table-3-scale-red]", ".rp-badge"),
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
