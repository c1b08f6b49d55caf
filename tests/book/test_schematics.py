"""Schematics in a browser: labels that are whole, apart and large enough."""

import itertools

import pytest

from reproduce.papers.declare import Schematic, drawing
from reproduce.views.figure import Figure, drawable

pytestmark = pytest.mark.browser
# Width that a phone of 390 CSS pixels leaves for a figure, and the smallest label.
PHONE, MIN_LABEL = 358, 11.0
STYLE = "<style>body { margin: 0 } svg { max-width: 100%; height: auto }</style>"
BOXES = """() => [...document.querySelectorAll('svg, text')].map(e => {
    const box = e.getBoundingClientRect();
    const scale = document.querySelector('svg').getBoundingClientRect().width
        / document.querySelector('svg').viewBox.baseVal.width;
    return [e.textContent, box.left, box.right, box.top, box.bottom,
            scale * parseFloat(getComputedStyle(e).fontSize)];
})"""


def test_labels_are_whole_apart_and_large_enough(open_page):
    page = open_page(viewport={"width": PHONE, "height": 900})
    for key in (key for key in drawable() if isinstance(drawing(key), Schematic)):
        page.set_content(STYLE + str(Figure(key).drawn))
        (_, left, right, top, bottom, _), *labels = page.evaluate(BOXES)
        assert labels
        for text, x0, x1, y0, y1, size in labels:
            assert left - 1 < x0 < x1 < right + 1, text
            assert top - 2 < y0 < y1 < bottom + 2, text
            assert size >= MIN_LABEL, text
        for pair in itertools.combinations(labels, 2):
            names, lefts, rights, tops, bottoms, _ = zip(*pair, strict=True)
            across, down = min(rights) - max(lefts), min(bottoms) - max(tops)
            assert across < 2 or down < 5, names
