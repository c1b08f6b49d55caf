"""Everything on a page that can be pressed, moved or scrolled is reached with the Tab key."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Browser, Page
from reading import DESKTOP, HTML, PHONE

pytestmark = pytest.mark.browser
# One page of each kind: menu, wall, tables, figures, sliders, folds, corner plots, errata, a form.
PAGES = (
    "index.html",
    "find.html",
    "run.html",
    "niu2024/simulation.html",
    "chen2023/effectiveness.html",
    "posteriors/registration.html",
    "audit/errata.html",
)
# What a pointer can use. A ring may lie on a part of what has the focus.
POINTED = """() => {
    const open = e => e.checkVisibility({visibilityProperty: true}) && !e.disabled &&
        (e.tagName === 'SUMMARY' || !e.closest('details:not([open])'));
    const scrolls = e => /auto|scroll/.test(getComputedStyle(e).overflowX) &&
        e.scrollWidth > e.clientWidth + 1 && e.closest('article');
    // The wall's marks, one for each printed number, are for pointers; its tables have links.
    const used = [...document.querySelectorAll('a[href], button, input, select, summary')]
        .filter(e => !e.closest('.rp-wall svg'));
    const boxes = [...document.querySelectorAll('article *')].filter(scrolls);
    for (const e of [...used, ...boxes]) {
        if (open(e)) e.dataset.awaited = e.outerHTML.slice(0, 120);
    }
}"""
LEFT = (
    "() => [...document.querySelectorAll('[data-awaited]')].map(e => e.dataset.awaited)"
)
FOCUSED = """() => {
    const e = document.activeElement;
    if (e === document.body || e === null) return null;
    const ring = one => getComputedStyle(one).outlineStyle !== 'none' ||
        getComputedStyle(one).boxShadow !== 'none';
    const box = e.getBoundingClientRect();
    // A box that scrolls is in use too when something in it has the focus.
    for (let up = e; up; up = up.parentElement) delete up.dataset.awaited;
    return {
        what: e.outerHTML.slice(0, 120),
        ringed: ring(e) || [...e.querySelectorAll('*')].some(ring),
        in_sight: box.bottom > 0 && box.top < innerHeight,
    };
}"""


@pytest.fixture(scope="module", params=[DESKTOP, PHONE], ids=["wide", "phone"])
def keyed(request: pytest.FixtureRequest, browser: Browser) -> Iterator[Page]:
    context = browser.new_context(viewport=request.param, reduced_motion="reduce")
    yield context.new_page()
    context.close()


def stops(page: Page) -> Iterator[dict[str, Any]]:
    """Press Tab until the page is left, and yield what has the focus each time."""
    for _ in range(2000):
        page.keyboard.press("Tab")
        stop = page.evaluate(FOCUSED)
        if stop is None:
            return
        yield stop
    raise AssertionError("the Tab key never leaves the page")


@pytest.mark.parametrize("address", PAGES)
def test_the_tab_key_reaches_all_in_sight_with_a_ring(
    keyed: Page, address: str
) -> None:
    keyed.goto((HTML / address).as_uri(), wait_until="load")
    keyed.add_style_tag(content="* { transition: none !important; }")
    keyed.evaluate(POINTED)
    awaited = len(keyed.evaluate(LEFT))
    seen = list(stops(keyed))
    assert keyed.evaluate(LEFT) == []
    assert len(seen) >= awaited / 2 > 10
    assert [one["what"] for one in seen if not one["ringed"]] == []
    assert [one["what"] for one in seen if not one["in_sight"]] == []


def test_folds_and_the_menu_open_with_the_keyboard(keyed: Page) -> None:
    keyed.goto((HTML / "niu2024/simulation.html").as_uri(), wait_until="load")
    folds = "article details:has(> summary), nav.bd-links details"
    opened = 0
    for number in range(keyed.locator(folds).count()):
        fold = keyed.locator(folds).nth(number)
        if not fold.locator("> summary").is_visible():
            continue
        before = fold.evaluate("e => e.open")
        fold.locator("> summary").focus()
        keyed.keyboard.press("Enter")
        assert fold.evaluate("e => e.open") is not before
        opened += 1
    assert opened >= 5
