"""Figures as a browser shows them: whole, legible and numbered, on a phone and on a desk."""

import re

import pytest
from playwright.sync_api import Browser, Page
from reading import HTML, SETTLED, built_pages

pytestmark = pytest.mark.browser
WITH_FIGURES = [
    page
    for page in built_pages()
    if '<figure class="rp-figure"' in (HTML / page).read_text("utf-8")
]
LEAST = 8 * 96 / 72 - 0.1  # CSS pixels: eight points
NUMBER = re.compile(r'<a class="rp-number" href="#([^"]+)">Figure B(\d+)\.</a>')
UNFOLDED = (
    "() => document.querySelectorAll('article details').forEach(d => d.open = true)"
)
# Of each figure: how many drawings are seen, whether it scrolls, and its smallest label. An index
# belongs to its label.
SEEN = """() => [...document.querySelectorAll('.rp-figure')].map(figure => {
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
})"""
# What scrolls sideways, and out of a keyboard's reach or without a name.
UNREACHED = """() => [...document.querySelectorAll('article *')].filter(e =>
    /auto|scroll/.test(getComputedStyle(e).overflowX) && e.scrollWidth > e.clientWidth + 1
    && (e.tabIndex < 0 || !e.ariaLabel)).map(e => e.tagName + ' ' + e.className)"""


@pytest.fixture(scope="module", params=[390, 1400])
def window(request: pytest.FixtureRequest, browser: Browser) -> Page:
    context = browser.new_context(viewport={"width": request.param, "height": 900})
    return context.new_page()


def opened(window: Page, address: str) -> None:
    window.goto((HTML / address).as_uri(), wait_until="load")
    window.evaluate(SETTLED)
    window.evaluate(UNFOLDED)
    window.wait_for_timeout(50)


@pytest.mark.parametrize("address", WITH_FIGURES)
def test_a_figure_is_seen_once_and_whole_with_no_label_too_small(
    window: Page, address: str
) -> None:
    opened(window, address)
    found = window.evaluate(SEEN)
    assert found
    poor = [one for one in found if one[1] != 1 or one[2] or not one[3] >= LEAST]
    assert poor == []


def test_a_figure_that_is_poor_is_seen(window: Page) -> None:
    window.set_content(
        '<figure class="rp-figure" id="x" style="width:100px;overflow-x:auto">'
        '<svg style="width:200px" viewBox="0 0 100 9"><text style="font-size:4px">x</text></svg>'
    )
    assert window.evaluate(SEEN) == [["x", 1, True, 8]]


@pytest.mark.parametrize("address", built_pages())
def test_what_scrolls_is_reached_and_named(window: Page, address: str) -> None:
    opened(window, address)
    assert window.evaluate(UNREACHED) == []


def test_our_figures_are_numbered_once_each_in_the_order_of_reading() -> None:
    """A figure of a paper keeps its number there, which stands in its caption, and has no other."""
    numbers, of_papers = {}, []
    for address in WITH_FIGURES:
        text = (HTML / address).read_text("utf-8")
        names = re.findall(r'<figure class="rp-figure" id="([^"]+)"', text)
        found = NUMBER.findall(text)
        assert [name for name, _ in found] == [
            name for name in names if "-fig-" not in name
        ]
        of_papers += re.findall(
            r'id="figure-\w+-fig-(\w+)".*?<figcaption><span class="rp-number"></span>Figure (\w+):',
            text,
            flags=re.DOTALL,
        )
        if found:
            numbers[address] = [int(number) for _, number in found]
    assert len(of_papers) > len(numbers)
    assert [ours for ours, theirs in of_papers if ours != theirs] == []
    every = sorted(number for one in numbers.values() for number in one)
    assert every == list(range(1, len(every) + 1))
    assert all(
        one == list(range(one[0], one[0] + len(one))) for one in numbers.values()
    )
    assert numbers["niu2024/images.html"] < numbers["chen2023/effectiveness.html"]
    assert numbers["chen2023/effectiveness.html"] < numbers["posteriors/index.html"]


@pytest.mark.parametrize("address", WITH_FIGURES)
def test_what_the_bars_of_figures_offer_is_there(address: str) -> None:
    page = HTML / address
    offered = re.findall(
        r'href="((?:\.\./)*figures/[^"]+)" download', page.read_text("utf-8")
    )
    # Pictures of posteriors are in no file of the book: `save` writes their draws.
    assert offered or address.startswith("posteriors/")
    assert [one for one in offered if not (page.parent / one).stat().st_size] == []
