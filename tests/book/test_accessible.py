"""Every page keeps WCAG 2.1, levels A and AA, as far as axe-core can tell, light and dark."""

import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Browser, Page
from reading import DESKTOP, HTML, SETTLED, built_pages

pytestmark = pytest.mark.browser
RUN = """async () => (await axe.run(document, {
    runOnly: {type: 'tag', values: ['wcag2a', 'wcag2aa', 'wcag21a', 'wcag21aa']},
    resultTypes: ['violations'],
})).violations.map(v => `${v.id}: ${v.nodes.slice(0, 3).map(n => n.target.join(' ')).join()}`)"""
SCHEMES = ("light", "dark")


def axe() -> str:
    """Return the script of axe-core."""
    package = find_spec("axe_playwright_python")
    assert package is not None
    assert package.submodule_search_locations
    path = Path(package.submodule_search_locations[0]) / "axe.min.js"
    return path.read_text(encoding="utf-8")


@pytest.fixture(scope="module", params=SCHEMES)
def themed(request: pytest.FixtureRequest, browser: Browser) -> Any:
    # Without motion: halfway through a fade from light to dark no colour is the reader's.
    context = browser.new_context(
        viewport=DESKTOP, color_scheme=request.param, reduced_motion="reduce"
    )
    yield context.new_page()
    context.close()


# The pages of source code are alike.
PAGES = [page for page in built_pages() if not page.startswith("_modules/reproduce/")]


@pytest.mark.parametrize(
    "address", [*PAGES, "_modules/reproduce/physics/validate.html"]
)
def test_page_has_no_violation(themed: Page, address: str) -> None:
    themed.goto((HTML / address).as_uri(), wait_until="load")
    themed.evaluate(SETTLED)
    themed.evaluate(axe())
    assert themed.evaluate(RUN) == []


def test_a_violation_is_seen(themed: Page) -> None:
    themed.set_content(
        "<html lang='en'><title>x</title><img src='x.png'><button></button>"
    )
    themed.evaluate(axe())
    found = [one.partition(":")[0] for one in themed.evaluate(RUN)]
    assert found == ["button-name", "image-alt"]


@pytest.mark.parametrize("address", ["run.html"])
def test_a_slider_moves_with_the_keyboard(themed: Page, address: str) -> None:
    themed.goto((HTML / address).as_uri(), wait_until="load")
    dial = themed.locator(".rp-sweep input").first
    before = themed.locator(".rp-sweep output").first.text_content()
    dial.focus()
    themed.keyboard.press("ArrowRight")
    after = themed.locator(".rp-sweep output").first.text_content()
    assert before != after
    assert themed.locator(".rp-sweep tbody tr:visible").count() == 1


def test_without_a_script_a_slider_is_a_table(browser: Browser) -> None:
    context = browser.new_context(viewport=DESKTOP, java_script_enabled=False)
    page = context.new_page()
    page.goto((HTML / "run.html").as_uri())
    assert page.locator(".rp-sweep tbody tr:visible").count() > 1
    assert page.locator(".rp-dial:visible").count() == 0
    context.close()


def test_a_mark_of_the_wall_leads_to_its_cell(themed: Page) -> None:
    themed.goto((HTML / "index.html").as_uri(), wait_until="load")
    themed.locator('a[href$="#niu2024-table-3-scale-red"]').first.click()
    themed.wait_for_url("**/niu2024/simulation.html#niu2024-table-3-scale-red")
    # Below the bar at the top, and in the window.
    in_sight = (
        "(e) => { const y = e.getBoundingClientRect().top;"
        " return y > 40 && y < innerHeight }"
    )
    cell = themed.locator("#niu2024-table-3-scale-red").element_handle()
    themed.wait_for_function(in_sight, arg=cell, timeout=10_000)


# Of each class of marks how many stand out and how many fade.
MARKS = """() => {
    const found = {};
    for (const mark of document.querySelectorAll('.rp-wall [class^="rp-mark"]')) {
        const bright = getComputedStyle(mark).opacity === '1';
        (found[mark.getAttribute('class')] ??= []).push(bright);
    }
    const told = all => all.every(b => b) ? 'bright' : all.some(b => b) ? 'mixed' : 'faded';
    return Object.fromEntries(Object.entries(found).map(([name, all]) => [name, told(all)]));
}"""
SHOWN = {
    "exact": {"rp-mark-exact", "rp-mark-exact rp-mark-weak"},
    "consistent": {"rp-mark-consistent", "rp-mark-consistent rp-mark-weak"},
    "weak": {"rp-mark-exact rp-mark-weak", "rp-mark-consistent rp-mark-weak"},
    "differs": {"rp-mark-differs"},
    "ambiguous": {"rp-mark-ambiguous"},
    "unpublished": {"rp-mark-unpublished"},
    "input": {"rp-mark-input"},
}


@pytest.mark.parametrize("word", SHOWN)
@pytest.mark.parametrize("way", ["hover", "focus"])
def test_an_entry_of_the_legend_makes_its_marks_stand_out(
    themed: Page, way: str, word: str
) -> None:
    themed.goto((HTML / "index.html").as_uri(), wait_until="load")
    themed.mouse.move(1, 1)
    assert set(themed.evaluate(MARKS).values()) == {"bright"}
    name = f"of these {word}" if word == "weak" else f"\\d+ {word}"
    entry = themed.locator(".rp-wall-legend li").filter(has_text=re.compile(name))
    assert entry.count() == 1
    getattr(entry, way)()
    marks = themed.evaluate(MARKS)
    assert {mark for mark, seen in marks.items() if seen == "bright"} == SHOWN[
        word
    ] & set(marks)
    assert "mixed" not in marks.values()


def test_the_first_picture_stands_above_its_code_and_its_papers_side_by_side(
    themed: Page,
) -> None:
    themed.goto((HTML / "index.html").as_uri(), wait_until="load")
    first, second = (
        themed.locator(".rp-walls > div").nth(at).bounding_box() for at in (0, 1)
    )
    code = themed.locator("details.above-input").first.bounding_box()
    assert first
    assert second
    assert code
    assert first["y"] == second["y"]
    assert first["x"] + first["width"] < second["x"]
    assert code["y"] > first["y"] + first["height"]
    heights = themed.locator(".rp-wall svg").evaluate_all(
        "all => all.map(e => e.clientHeight)"
    )
    assert len(set(heights)) == 1
