"""The built pages and the scripts that find their defects in a browser."""

import os
from importlib.util import find_spec
from pathlib import Path

import pytest

HTML = Path(__file__).resolve().parents[2] / "book" / "_build" / "html"
PHONE = {"width": 390, "height": 844}
DESKTOP = {"width": 1280, "height": 900}
SHEET = {"width": 718, "height": 1047}  # A4 with margins of 1 cm
SETTLED = "() => window.MathJax?.startup?.promise.then(() => true) ?? true"
FRAMES = "() => new Promise(f => requestAnimationFrame(() => requestAnimationFrame(f)))"
UNFOLD = (
    "() => document.querySelectorAll('article details').forEach(e => e.open = true)"
)
# MathJax draws an unknown macro in red.
RAW_MATHEMATICS = """() => [...document.querySelectorAll('.math')]
    .filter(e => !e.querySelector('mjx-container')
        || e.querySelector('[data-mjx-error], [data-mml-node="merror"], [fill="red"]'))
    .map(e => e.textContent.trim().slice(0, 80))"""
# Elements that are wider than the column of text, or in a wide table than the window, unless a box
# inside the article scrolls.
OVERFLOWING = """() => {
    const scrolls = e => e.tagName !== 'ARTICLE' &&
        (/auto|scroll/.test(getComputedStyle(e).overflowX) || scrolls(e.parentElement));
    const column = document.querySelector('article')?.parentElement ?? document.body;
    const edge = Math.min(innerWidth, column.getBoundingClientRect().right) + 1;
    const out = [...document.querySelectorAll('article *')].filter(e => {
        const box = e.getBoundingClientRect();
        const last = e.closest('.tag_full-width') ? innerWidth : edge;
        return box.width && box.right > last && !scrolls(e);
    }).map(e => e.tagName.toLowerCase() + ' ' + e.className);
    const root = document.documentElement;
    return root.scrollWidth > root.clientWidth ? ['page is wider than the window', ...out] : out;
}"""
# Rounding noise of double precision (16 digits), which a reader would take for a result.
NOISE = """() => {
    const copy = document.querySelector('article')?.cloneNode(true);
    copy?.querySelectorAll('pre, code, svg, .math').forEach(e => e.remove());
    return copy?.textContent.match(/.{0,40}(\\d[eE][-−]1[3-9]|10⁻¹[⁵-⁹]).{0,20}/g) ?? [];
}"""
# Entries of tables that pandas has shortened.
CUT = """() => [...document.querySelectorAll('article td')]
    .map(e => e.textContent.trim()).filter(text => text.endsWith('...'))"""
# Tables that are hidden or cut on paper. The list of all readings is too large for paper.
CUT_IN_PRINT = """() => [...document.querySelectorAll('article table:not(.rp-readings-all)')]
    .filter(e => !e.closest('.rp-bar'))
    .filter(e => !e.checkVisibility({contentVisibilityAuto: true})
        || e.getBoundingClientRect().right > innerWidth)
    .map(e => e.id || e.className)"""
# Figures that are not shown exactly once, that scroll, or with a label below eight points. An
# index belongs to its label.
POOR_FIGURES = """() => [...document.querySelectorAll('.rp-figure')].map(figure => {
    const drawings = [...figure.querySelectorAll('svg')].filter(d => d.getClientRects().length);
    const sizes = drawings.flatMap(drawing => {
        const scale = drawing.getBoundingClientRect().width / drawing.viewBox.baseVal.width;
        return [...drawing.querySelectorAll('text')].map(text => scale * Math.max(
            ...[text, ...text.querySelectorAll('tspan')]
                .map(part => parseFloat(getComputedStyle(part).fontSize))));
    });
    const box = [figure, ...figure.querySelectorAll('.rp-wide, .rp-narrow')];
    const scrolls = box.some(one => one.scrollWidth > one.clientWidth + 1);
    return [figure.id, drawings.length, scrolls, Math.min(...sizes)];
}).filter(([, count, scrolls, size]) => count !== 1 || scrolls || !(size >= 8 * 96 / 72 - 0.1))"""
# Elements that scroll sideways, without a name or out of the reach of the keyboard.
UNREACHED = """() => [...document.querySelectorAll('article *')].filter(e =>
    /auto|scroll/.test(getComputedStyle(e).overflowX) && e.scrollWidth > e.clientWidth + 1
    && (e.tabIndex < 0 || !e.ariaLabel)).map(e => e.tagName + ' ' + e.className)"""
# Tables of printed numbers that scroll.
SCROLLING = """() => [...document.querySelectorAll('.rp-scroll:has(.rp-cell, .rp-numbers)')]
    .filter(e => e.scrollWidth > e.clientWidth + 1).map(e => e.ariaLabel)"""
# Small print that is not smaller than the text around it.
LARGE_PRINT = """() => [...document.querySelectorAll('article small')].filter(e =>
    parseFloat(getComputedStyle(e).fontSize)
    >= parseFloat(getComputedStyle(e.parentElement).fontSize)).map(e => e.textContent)"""
AXE = """async ([part, options]) => (await axe.run(part, options)).violations.map(
    v => `${v.id}: ${v.nodes.slice(0, 3).map(n => n.target.join(' ')).join()}`)"""
WCAG = {"type": "tag", "values": ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa"]}
CONTRAST = {"type": "rule", "values": ["color-contrast"]}


def skip_or_fail(reason):
    """Skip a test, or fail if the environment requires the browser."""
    if os.environ.get("REPRODUCE_REQUIRE_BROWSER") == "1":
        pytest.fail(f"{reason}, and REPRODUCE_REQUIRE_BROWSER=1 requires it")
    pytest.skip(reason)


def built_pages():
    """Return the addresses of the built pages, without `goto.html`."""
    pages = (path for path in HTML.rglob("*.html") if "_static" not in path.parts)
    return sorted(
        path.relative_to(HTML).as_posix()
        for path in pages
        if "data-content_root" in path.read_text("utf-8")  # attribute of Sphinx pages
    )


def violations(page, rules=WCAG, part="html"):
    """Return the violations of WCAG 2.1, levels A and AA, or of single rules, in a part."""
    (folder,) = find_spec("axe_playwright_python").submodule_search_locations
    if not page.evaluate("() => 'axe' in window"):
        page.evaluate((Path(folder) / "axe.min.js").read_text(encoding="utf-8"))
    options = {"runOnly": rules, "resultTypes": ["violations"], "preload": False}
    return page.evaluate(AXE, [part, options])


def defects(page, url):
    """Load a page once; return its defects in both themes, at all widths, and on paper."""
    found = {"console": [], "requests": []}
    page.on("pageerror", lambda error: found["console"].append(str(error)))
    page.on(
        "console",
        lambda message: (
            message.type in ("error", "warning")
            and found["console"].append(message.text)
        ),
    )
    page.on("request", lambda request: found["requests"].append(request.url))

    def check(**scripts):
        for name, script in scripts.items():
            for _ in range(10):  # the theme responds to a new width after 0.3 s
                found[name] = page.evaluate(script)
                if not found[name]:
                    break
                page.wait_for_timeout(100)

    def resize(size):
        page.set_viewport_size(size)
        page.evaluate(FRAMES)

    resize(DESKTOP)
    page.goto(url, wait_until="load")
    page.evaluate(SETTLED)
    check(
        mathematics=RAW_MATHEMATICS, noise=NOISE, cut=CUT, overflow_desktop=OVERFLOWING
    )
    found["wcag"] = violations(page)
    page.emulate_media(color_scheme="dark")
    page.evaluate(FRAMES)
    found["contrast_dark"] = violations(page, CONTRAST)
    page.emulate_media(color_scheme="light")
    resize(PHONE)
    check(overflow_phone=OVERFLOWING)
    page.emulate_media(media="print")
    resize(SHEET)
    check(print=CUT_IN_PRINT)
    page.emulate_media(media="screen")
    page.evaluate(UNFOLD)
    for size in (PHONE, DESKTOP):
        resize(size)
        width = size["width"]
        check(**{f"figures_{width}": POOR_FIGURES, f"unreached_{width}": UNREACHED})
    local = ("file:", "data:", "blob:")
    found["requests"] = [u for u in found["requests"] if not u.startswith(local)]
    return {name: faults for name, faults in found.items() if faults}
