"""Drawings by hand as a browser shows them: no label cut, crossed by another, or too small."""

import pytest
from playwright.sync_api import Browser, Page

from reproduce.papers.catalogue import catalogue, drawings
from reproduce.papers.declare import Schematic
from reproduce.views.figure import draw

pytestmark = pytest.mark.browser
DRAWN = [
    key
    for key, one in (
        *((key, item.draw) for key, item in catalogue().items()),
        *drawings().items(),
    )
    if isinstance(one, Schematic)
]
# Width that a phone of 390 CSS pixels leaves for a figure, and the smallest label.
PHONE, MIN_LABEL = 358, 11.0
BOXES = """() => [...document.querySelectorAll('text')].map(text => {
    const box = text.getBoundingClientRect();
    return [text.textContent, box.left, box.right, box.top, box.bottom,
            parseFloat(getComputedStyle(text).fontSize)];
})"""
FRAME = """() => {
    const drawing = document.querySelector('svg'), box = drawing.getBoundingClientRect();
    const scale = box.width / drawing.viewBox.baseVal.width;
    return [box.left, box.right, box.top, box.bottom, scale];
}"""


@pytest.fixture(scope="module")
def window(browser: Browser) -> Page:
    return browser.new_page(viewport={"width": PHONE, "height": 900})


@pytest.mark.parametrize("key", DRAWN)
def test_labels_are_whole_apart_and_large_enough(window: Page, key: str) -> None:
    style = "<style>body { margin: 0 } svg { max-width: 100%; height: auto }</style>"
    window.set_content(style + str(draw(key)))
    left, right, top, bottom, scale = window.evaluate(FRAME)
    labels = window.evaluate(BOXES)
    assert labels
    for number, (text, x0, x1, y0, y1, size) in enumerate(labels):
        assert left - 1 < x0 < x1 < right + 1, text
        assert top - 2 < y0 < y1 < bottom + 2, text
        assert size * scale >= MIN_LABEL, text
        for other, u0, u1, v0, v1, _ in labels[:number]:
            across = min(x1, u1) - max(x0, u0)
            down = min(y1, v1) - max(y0, v0)
            assert across < 2 or down < 5, f"{text!r} on {other!r}"
