"""The table of all printed numbers: sorting and filtering by mouse, keyboard and touch."""

import json
import re

import pytest
from reading import DESKTOP, HTML, PHONE, violations

from reproduce.printed.cells import anchor
from reproduce.views._computed import whole_ledger

pytestmark = pytest.mark.browser
PAGE = "cells.html"
ROWS = "table.rp-sortable tbody tr"
LINKS = "all => all.map(row => row.querySelector('th a').getAttribute('href'))"
SUPERSCRIPTS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789-")


@pytest.fixture(scope="module")
def records():
    """Return the records of the ledger by the anchor of their cell."""
    return {anchor(record.cell): record for record in whole_ledger().records}


@pytest.fixture
def table(open_page):
    return open_page(PAGE, viewport=DESKTOP)


def links(page):
    return page.locator(f"{ROWS}:visible").evaluate_all(LINKS)


def shown(page):
    """Return the anchors of the visible rows, in order."""
    return [link.partition("#")[2] for link in links(page)]


def orders(page):
    """Return how each column is sorted."""
    heads = page.locator("table.rp-sortable thead th").all()
    return [head.get_attribute("aria-sort") for head in heads]


def test_without_a_script_every_number_is_listed_in_the_order_of_print(
    open_page, records
):
    page = open_page(PAGE, viewport=DESKTOP, java_script_enabled=False)
    assert shown(page) == list(records)
    assert page.locator(".rp-filter").count() == 0
    rows = page.locator(f"{ROWS}:visible").all_inner_texts()
    for row, record in zip(rows, records.values(), strict=True):
        assert record.verdict in row
        assert f"{record.key.partition('/')[0]}, {record.place}" in row
    for link in links(page):
        file, _, name = link.partition("#")
        assert f'id="{name}"' in (HTML / file).read_text(encoding="utf-8"), link


def number(text):
    """Return the number at the start of a text."""
    digits = text.replace("\u202f", "").replace("−", "-").split("×10")
    power = digits[1].translate(SUPERSCRIPTS) if len(digits) > 1 else "0"
    power = re.match(r"-?\d+", power)[0]
    return float(re.match(r"-?[\d.]+", digits[0])[0] + "e" + power)


def test_a_click_sorts_by_number_with_empty_entries_last(table, records):
    before = shown(table)
    column = table.get_by_role("button", name="Computed")
    for order in ("ascending", "descending"):
        column.click()
        assert sorted(shown(table)) == sorted(before)
        texts = table.locator(f"{ROWS} td:nth-child(4)").all_text_contents()
        filled = [text for text in texts if text]
        assert texts[: len(filled)] == filled
        values = [number(text) for text in filled]
        assert values == sorted(values, reverse=order == "descending")
        assert len(set(values)) > 50
        assert [one for one in orders(table) if one] == [order]
    table.get_by_role("button", name="Verdict").click()
    words = [records[name].verdict for name in shown(table)]
    assert words == sorted(words)
    assert [one for one in orders(table) if one] == ["ascending"]


def test_powers_of_ten_and_signs_are_sorted_as_numbers(table):
    texts = ["−7", "2\u202f×\u202f10⁻⁵ m", "10⁻³", "≈\u00a03.5\u202fpx", "12"]
    mixed = json.dumps(texts[::2] + texts[1::2])
    # Before the script of the page.
    table.add_init_script(
        "document.addEventListener('DOMContentLoaded', () => "
        "[...document.querySelectorAll('.rp-sortable tbody tr')].forEach((row, index) => "
        f"{{ row.cells[2].textContent = {mixed}[index] ?? '' }}))"
    )
    table.reload()
    table.get_by_role("button", name="Printed").click()
    column = table.locator(f"{ROWS} td:nth-child(3)").all_text_contents()
    assert column[: len(texts)] == texts


def test_the_keyboard_filters_and_sorts(table, records):
    table.get_by_label("Filter").focus()
    table.keyboard.type("differs niu2024")
    expected = [
        name
        for name, record in records.items()
        if record.verdict == "differs" and record.key.startswith("niu2024")
    ]
    assert shown(table) == expected != []
    count = table.locator(".rp-filter output").inner_text()
    assert count == f"{len(expected)} of {len(records)} shown"
    for _ in range(4):  # the table, which scrolls, and three heads
        table.keyboard.press("Tab")
    assert table.evaluate("document.activeElement.textContent") == "printed"
    for key, order in (("Enter", "ascending"), ("Space", "descending")):
        table.keyboard.press(key)
        assert orders(table)[2] == order
    assert sorted(shown(table)) == sorted(expected)


def test_a_verdict_is_searched_among_verdicts_and_other_words_everywhere(
    table, records
):
    box = table.get_by_label("Filter")
    for word in ("differs", "ambiguous", "unpublished", "input", "exact", "consistent"):
        box.fill(word)
        assert (
            shown(table) == [n for n, r in records.items() if r.verdict == word] != []
        )
    for text, count in (("nothing that exists", 0), ("", len(records))):
        box.fill(text)
        assert len(shown(table)) == count


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_sorts_and_filters_by_touch(open_page, scheme):
    page = open_page(PAGE, has_touch=True, is_mobile=True, color_scheme=scheme)
    page.get_by_label("Filter").tap()
    page.keyboard.type("differs")
    page.get_by_role("button", name="Number").tap()
    assert "ascending" in orders(page)
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    assert violations(page) == []
