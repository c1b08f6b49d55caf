"""Use of the pages with a keyboard, with a pointer and without a script."""

import re

import pytest
from reading import DESKTOP, PHONE

pytestmark = pytest.mark.browser
# One page of each kind: menu, wall, tables, figures, sliders, folds, intervals, errata, a form.
PAGES = (
    "index.html",
    "find.html",
    "run.html",
    "niu2024/simulation.html",
    "chen2023/effectiveness.html",
    "posteriors/registration.html",
    "audit/errata.html",
)
# Elements for a pointer. A focus ring may be drawn around a part of the focused element.
POINTED = """() => {
    const open = e => e.checkVisibility({visibilityProperty: true}) && !e.disabled &&
        e.tabIndex >= 0 && e.getClientRects().length;
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
    // A box that scrolls is in use too if an element inside it has the focus.
    for (let up = e; up; up = up.parentElement) delete up.dataset.awaited;
    return {
        what: e.outerHTML.slice(0, 120),
        ringed: ring(e) || [...e.querySelectorAll('*')].some(ring),
        in_sight: box.bottom > 0 && box.top < innerHeight,
    };
}"""
# Classes of the marks of the wall, and whether their marks are bright.
MARKS = """() => {
    const found = {};
    for (const mark of document.querySelectorAll('.rp-wall [class^="rp-mark"]')) {
        const bright = getComputedStyle(mark).opacity === '1';
        (found[mark.getAttribute('class')] ??= new Set()).add(bright);
    }
    return Object.entries(found).map(([name, all]) => [name, [...all]]);
}"""
WEAK = " rp-mark-weak"
SHOWN = {
    "differs": {"rp-mark-differs", f"rp-mark-differs{WEAK}"},
    "weak": {f"rp-mark-exact{WEAK}", f"rp-mark-consistent{WEAK}"},
}


def stops(page):
    """Press Tab until the page is left, and yield each focused element."""
    for _ in range(2000):
        page.keyboard.press("Tab")
        stop = page.evaluate(FOCUSED)
        if stop is None:
            return
        yield stop
    raise AssertionError("the Tab key never leaves the page")


@pytest.mark.parametrize("size", [DESKTOP, PHONE], ids=["desktop", "phone"])
@pytest.mark.parametrize("address", PAGES)
def test_the_tab_key_reaches_every_control_with_a_ring(open_page, address, size):
    page = open_page(address, viewport=size)
    page.add_style_tag(content="* { transition: none !important; }")
    page.evaluate(POINTED)
    awaited = len(page.evaluate(LEFT))
    seen = list(stops(page))
    assert page.evaluate(LEFT) == []
    assert len(seen) >= awaited / 2 > 10
    faults = [stop for stop in seen if not (stop["ringed"] and stop["in_sight"])]
    assert faults == []


def test_folds_and_the_menu_open_with_the_keyboard(open_page):
    page, opened = open_page("niu2024/simulation.html", viewport=DESKTOP), 0
    for fold in page.locator(
        "article details:has(> summary), nav.bd-links details"
    ).all():
        summary = fold.locator("> summary")
        if summary.is_visible():
            before = fold.evaluate("e => e.open")
            summary.focus()
            page.keyboard.press("Enter")
            assert fold.evaluate("e => e.open") is not before
            opened += 1
    assert opened >= 5


def test_a_slider_moves_with_the_keyboard(open_page):
    page = open_page("run.html", viewport=DESKTOP)
    output = page.locator(".rp-sweep output").first
    before = output.text_content()
    page.locator(".rp-sweep input").first.focus()
    page.keyboard.press("ArrowRight")
    assert output.text_content() != before
    assert page.locator(".rp-sweep tbody tr:visible").count() == 1


def test_without_a_script_a_slider_is_a_table(open_page):
    page = open_page("run.html", viewport=DESKTOP, java_script_enabled=False)
    assert page.locator(".rp-sweep tbody tr:visible").count() > 1
    assert page.locator(".rp-dial:visible").count() == 0


def test_an_entry_of_the_legend_highlights_its_marks(open_page):
    page = open_page("index.html", viewport=DESKTOP)
    for action in ("hover", "focus"):
        for word, names in SHOWN.items():
            page.mouse.move(1, 1)
            page.evaluate("() => document.activeElement.blur()")
            assert [
                bright for _, bright in page.evaluate(MARKS) if bright != [True]
            ] == []
            label = f"of these {word}" if word == "weak" else f"\\d+ {word}"
            entry = page.locator(".rp-wall-legend li").filter(
                has_text=re.compile(label)
            )
            assert entry.count() == 1
            getattr(entry, action)()
            marks = dict(page.evaluate(MARKS))
            assert marks == {name: [name in names] for name in marks}
