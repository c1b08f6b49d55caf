"""What a browser sees on one built page."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from playwright.sync_api import Page

HTML = Path(__file__).resolve().parents[2] / "book" / "_build" / "html"
PHONE = {"width": 390, "height": 844}
SHEET = {"width": 718, "height": 1047}  # A4 within margins of 1 cm
DESKTOP = {"width": 1280, "height": 900}
SETTLED = "() => window.MathJax?.startup?.promise.then(() => true) ?? true"
# MathJax draws a macro that it does not know in red.
RAW_MATHEMATICS = """() => [...document.querySelectorAll('.math')]
    .filter(e => !e.querySelector('mjx-container')
        || e.querySelector('[data-mjx-error], [data-mml-node="merror"], [fill="red"]'))
    .map(e => e.textContent.trim().slice(0, 80))"""
# Label and number of every numbered equation, and of every reference to one.
SHOWN_NUMBERS = """() => [...document.querySelectorAll('.eqno')].map(e => [
    e.querySelector('a.headerlink').hash.replace('#equation-', ''),
    e.firstChild.textContent.trim()])"""
REFERRED_NUMBERS = """() => [...document.querySelectorAll('article a.reference.internal')]
    .filter(a => a.hash.startsWith('#equation-'))
    .map(a => [a.hash.replace('#equation-', ''), a.textContent.trim()])"""
# What sticks out of the column of text, unless a box inside the article scrolls.
OVERFLOWING = """() => {
    const scrolls = e => e.tagName !== 'ARTICLE' &&
        (/auto|scroll/.test(getComputedStyle(e).overflowX) || scrolls(e.parentElement));
    const column = document.querySelector('article')?.parentElement ?? document.body;
    const edge = Math.min(innerWidth, column.getBoundingClientRect().right) + 1;
    const out = [...document.querySelectorAll('article *')].filter(e => {
        const box = e.getBoundingClientRect();
        return box.width && box.right > edge && !scrolls(e);
    }).map(e => e.tagName.toLowerCase() + ' ' + e.className);
    const root = document.documentElement;
    return root.scrollWidth > root.clientWidth ? ['page is wider than the window', ...out] : out;
}"""


# Double precision holds sixteen digits: what a reader would take for a result is rounding noise.
NOISE = """() => {
    const copy = document.querySelector('article')?.cloneNode(true);
    copy?.querySelectorAll('pre, code, svg, .math').forEach(e => e.remove());
    return copy?.textContent.match(/.{0,40}(\\d[eE][-−]1[3-9]|10⁻¹[⁵-⁹]).{0,20}/g) ?? [];
}"""

# Tables that a sheet of paper would cut, or that it hides.
# The list of all readings is a file, and too large for paper.
CUT_IN_PRINT = """() => [...document.querySelectorAll('article table:not(.rp-readings-all)')]
    .filter(e => !e.closest('.rp-bar'))
    .filter(e => !e.checkVisibility({contentVisibilityAuto: true})
        || e.getBoundingClientRect().right > innerWidth)
    .map(e => e.id || e.className)"""

# pandas cuts long words in a notebook's table.
CUT = """() => [...document.querySelectorAll('article td')]
    .map(e => e.textContent.trim()).filter(text => text.endsWith('...'))"""


@dataclass
class Visit:
    """What one page did and holds."""

    console: list[str] = field(default_factory=list)
    requests: list[str] = field(default_factory=list)
    raw_mathematics: list[str] = field(default_factory=list)
    noise: list[str] = field(default_factory=list)
    cut: list[str] = field(default_factory=list)
    cut_in_print: list[str] = field(default_factory=list)
    shown_numbers: list[list[str]] = field(default_factory=list)
    referred_numbers: list[list[str]] = field(default_factory=list)
    overflowing: dict[int, list[str]] = field(default_factory=dict)
    ids: set[str] = field(default_factory=set)
    references: list[str] = field(default_factory=list)


def built_pages() -> list[str]:
    """Return the addresses of all built pages below the site's root, without those that lead on."""
    found = (path.relative_to(HTML) for path in HTML.rglob("*.html"))
    pages = (path for path in found if path.parts[0] != "_static")
    text = "data-content_root"  # what every page of Sphinx has
    return sorted(
        one.as_posix() for one in pages if text in (HTML / one).read_text("utf-8")
    )


def note_console(visit: Visit, message: Any) -> None:
    if message.type in ("error", "warning"):
        visit.console.append(message.text)


def read(page: Page, url: str, visit: Visit) -> None:
    """Load a page and write down what it holds, on a phone and on a desk."""
    page.goto(url, wait_until="load")
    page.evaluate(SETTLED)
    visit.raw_mathematics = page.evaluate(RAW_MATHEMATICS)
    visit.noise = page.evaluate(NOISE)
    visit.cut = page.evaluate(CUT)
    visit.shown_numbers = page.evaluate(SHOWN_NUMBERS)
    visit.referred_numbers = page.evaluate(REFERRED_NUMBERS)
    visit.ids = set(
        page.evaluate("() => [...document.querySelectorAll('[id]')].map(e => e.id)")
    )
    visit.references = page.evaluate(
        "() => [...document.querySelectorAll('[href], [src]')]"
        ".map(e => e.getAttribute('href') ?? e.getAttribute('src'))"
    )
    for size in (PHONE, DESKTOP):
        page.set_viewport_size(size)
        visit.overflowing[size["width"]] = page.evaluate(OVERFLOWING)
    page.set_viewport_size(SHEET)
    page.emulate_media(media="print")
    page.evaluate(
        "() => new Promise(done => requestAnimationFrame(() => requestAnimationFrame(done)))"
    )
    visit.cut_in_print = page.evaluate(CUT_IN_PRINT)
    page.emulate_media(media="screen")
    page.set_viewport_size(PHONE)
