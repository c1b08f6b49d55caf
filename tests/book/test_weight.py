"""How much a reader loads: pages stay light, and MathJax comes with formulas alone."""

import re
from pathlib import Path

import pytest
from playwright.sync_api import Page
from reading import HTML, built_pages

pytestmark = pytest.mark.browser
LOADED = re.compile(r'<(?:script|link|img)\b[^>]*?\b(?:src|href)="([^"#?]+)[^"]*"')
MATHJAX = "tex-svg-full.js"
# In bytes, as they lie on the disk, MathJax apart.
PAGE, LANDING = 1_500_000, 1_000_000


def loaded(page: Path) -> set[Path]:
    """Return the files of the book that a page names to be loaded with it."""
    found = LOADED.findall(page.read_text(encoding="utf-8"))
    files = {(page.parent / name).resolve() for name in found if "://" not in name}
    return {file for file in files if file.is_file() and file.suffix != ".html"}


def weight(page: Path) -> int:
    """Return the bytes of a page and of what it loads, MathJax apart."""
    files = {page, *(file for file in loaded(page) if file.name != MATHJAX)}
    return sum(file.stat().st_size for file in files)


@pytest.mark.parametrize("address", built_pages())
def test_mathjax_comes_with_formulas_alone(address: str) -> None:
    page = HTML / address
    with_formula = 'class="math' in page.read_text(encoding="utf-8")
    assert (MATHJAX in {file.name for file in loaded(page)}) == with_formula


@pytest.mark.parametrize("address", built_pages())
def test_a_page_is_light(address: str) -> None:
    assert weight(HTML / address) < (LANDING if address == "index.html" else PAGE)


def test_every_page_has_an_icon() -> None:
    for address in built_pages():
        page = HTML / address
        (icon,) = re.findall(
            r'<link rel="icon" href="([^"]+)"', page.read_text(encoding="utf-8")
        )
        assert (page.parent / icon).is_file()


def test_the_icons_that_are_left_are_all_that_is_shown(page: Page) -> None:
    complaints: list[str] = []
    page.on("console", lambda message: complaints.append(message.text))
    page.goto((HTML / "niu2024" / "simulation.html").as_uri(), wait_until="load")
    page.wait_for_selector("svg[data-icon=download]", state="attached", timeout=10_000)
    assert page.locator("svg[data-icon] g.missing").count() == 0
    icons = page.locator("svg[data-icon]")
    drawings = icons.evaluate_all(
        "all => all.map(i => i.querySelector('path')?.getAttribute('d'))"
    )
    assert len(drawings) > 5
    assert [drawing for drawing in drawings if len(drawing or "") < 20] == []
    assert [text for text in complaints if "icon" in text.lower()] == []
