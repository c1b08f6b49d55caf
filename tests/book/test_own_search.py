"""The first result of a search, from a disk and without a network."""

import json
import re
from urllib.parse import quote, unquote, urldefrag

import pytest
from commands import output_of
from docutils.core import publish_doctree
from myst_parser.docutils_ import Parser
from playwright._impl._driver import compute_driver_executable
from reading import HTML

from own_search import SCRIPT as SOURCE
from own_search import of_items, of_sections, renumbered
from reproduce.printed.cells import library

FOUND = "#rp-found li a"
SPHINX = "#search-results ul.search li a"
FIRST = {
    "Table 3": "niu2024-table-3",
    "table iii": "chen2023-table-3",
    "Table V": "chen2023-table-5",
    "0.9973": "niu2024-table-3-scale-red",
    "niu2024/table-3": "niu2024-table-3",
    "niu2024/table-3#scale.red": "niu2024-table-3-scale-red",
    "niu2024 equation 17": "equation-niu2024-17",
    "chen2023/frames": "study-chen2023-frames",
    "scale.red": "niu2024-table-2-scale-red",
}
# Questions of readers to the page that answers them.
PAGES = {
    "roll": ("posteriors/misalignment", "chen2023/accuracy"),
    "install": ("run",),
    "QUEST": ("chen2023/attitude",),
    "LaTeX": ("data",),
    "sign convention": ("notation",),
    "what is blocked": ("reading",),
    "uncertainty of rotation": ("posteriors/registration",),
    "download data": ("data",),
    "misalignment 95 % interval": ("posteriors/misalignment",),
    "Cramer-Rao": ("chen2023/resolution",),
    "how many stars": ("posteriors/index",),
}


def test_every_printed_number_of_a_shown_table_is_in_the_index():
    cell = "niu2024-table-3-scale-red"
    table, *cells = of_items({"niu2024-table-3": "here", cell: "there"})
    assert table[0] == "here.html#niu2024-table-3"
    assert {"niu2024/table-3", "Table 3", "niu2024 Table 3"} <= set(table[2])
    assert len(cells) == len(library()["niu2024/table-3"].cells)
    (scale,) = (entry for entry in cells if entry[2] == ["niu2024/table-3#scale.red"])
    assert scale[0] == f"there.html#{cell}"
    assert "0.9973" in scale[3]
    assert [*map(renumbered, ("Table IV", "Figure 4"))] == [["Table 4"], []]


INDEX = [
    ["a.html#a", "Uncontrolled installation", ["Uncontrolled installation"], [], ""],
    ["b.html#b", "The question", ["The question"], [], "rolled quaternions"],
    [
        "c.html#c",
        "Attitude",
        ["Attitude", "QUEST"],
        [],
        "wahba roll installing cramér–rao",
    ],
    ["d.html#d", "Table 3 of lamp2025", ["Table 3"], [], ""],
    ["e.html#e", "Table 30 of lamp2025", ["Table 30"], [], ""],
]
SCRIPT = """
globalThis.window = {REPRODUCE_INDEX: %s};
const node = () => ({append(...all) { all.forEach(one => one.href && console.log(one.href)); }});
globalThis.document = {createElement: node, getElementById: () => ({before() {}})};
for (const query of %s) {
    globalThis.location = {search: `?q=${encodeURIComponent(query)}`};
    console.log('?');
    %s
}"""


QUERIES = {
    "roll": "cb",
    "install": "c",
    "QUEST": "c",
    "question": "b",
    "what is the question": "b",
    "Cramer-Rao": "c",
    "Table 3": "de",
}


def test_words_are_found_and_not_their_parts():
    parts = (json.dumps(part) for part in (INDEX, [*QUERIES]))
    node, _ = compute_driver_executable()
    script = SCRIPT % (*parts, SOURCE.read_text(encoding="utf-8"))
    _, *shown = output_of(node, "-e", script).split("?")
    found = [re.findall(r"(\w)\.html", line) for line in shown]
    assert ["".join(names) for names in found] == [*QUERIES.values()]


def test_sections_have_their_words_and_the_subjects_of_their_page():
    source = "# Data\n\nFirst words.\n\n## Files\n\nThe 12 tables."
    settings = {"doctitle_xform": False}
    doctree = publish_doctree(source, parser=Parser(), settings_overrides=settings)
    whole, part = of_sections("data", doctree)
    assert whole[:2] == ("data.html#data", "Data")
    assert part[:2] == ("data.html#files", "Data: Files")
    assert "LaTeX" in whole[2]
    assert part[2] == ["Files"]
    assert (whole[4], part[4]) == (
        "data files first tables the words",
        "files tables the",
    )


@pytest.mark.browser
def test_searches_from_the_disk_log_no_error_and_find_the_place(open_page):
    """Sphinx would fetch a summary of each result, which a browser forbids."""
    page, errors = open_page(), []
    page.on("console", lambda m: errors.append(m.text) if m.type == "error" else None)
    page.on("pageerror", lambda error: errors.append(str(error)))

    def search(query):
        page.goto(f"{(HTML / 'search.html').as_uri()}?q={quote(query)}")
        return page.locator(FOUND)

    def first(query):
        return urldefrag(unquote(search(query).first.get_attribute("href")))

    for query, anchor in FIRST.items():
        assert first(query).fragment == anchor
    for query, places in PAGES.items():
        assert first(query).url.removesuffix(".html") in places, query
    search("simulation")
    page.wait_for_selector(SPHINX, timeout=10_000)
    page.wait_for_timeout(500)
    assert search("xyzzy").count() == 0
    assert errors == []
