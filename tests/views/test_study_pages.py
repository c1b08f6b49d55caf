"""Drawings and tables of the studies: shown once, following the theme, complete."""

import re
from pathlib import Path

import pytest

from reproduce.papers.niu2024 import study
from reproduce.printed.given import given
from reproduce.views import cost_pages, drawings, study_pages

BOOK = Path(__file__).parents[2] / "book"
TEXTS = [p.read_text(encoding="utf-8") for p in BOOK.rglob("*.md") if "_build" not in p.parts]


def test_every_drawing_is_shown_exactly_once():
    shown = [
        name for text in TEXTS for name in re.findall(r"(?<!\.)drawing\(\s*\"([^\"]+)\"", text)
    ]
    assert sorted(shown) == sorted(drawings.DRAWINGS)


@pytest.mark.parametrize("name", drawings.DRAWINGS)
def test_drawings_follow_the_theme(name):
    html = drawings.drawing(name, 'a "quoted" text').text
    assert 'aria-label="a &quot;quoted&quot; text"' in html
    assert "currentColor" in html
    assert "#000000" not in html
    assert "<text" in html


@pytest.mark.parametrize("name", drawings.DRAWINGS)
def test_every_axis_has_its_unit_or_counts(name):
    for axes in drawings.paint(name).axes:
        labels = [axes.get_xlabel(), axes.get_ylabel()]
        assert all("(" in label or label == "step" for label in filter(None, labels)), labels


def test_unknown_drawings_are_refused():
    with pytest.raises(KeyError, match="niu2024-convergence"):
        drawings.paint("nothing")


def test_every_reading_has_its_row_and_every_cell_its_probability():
    html = study_pages.readings().text
    rows = [row for row in html.split("<tr") if "<td>" in row]
    readings = study.readings(given(study.READS))
    assert len(rows) == len(readings) * len(study.COUNTED)
    assert {row.count("<td>") for row in rows} == {5 + 12 + 4 + 1}
    assert html.count("(the ledger&#39;s)") + html.count("(the ledger's)") == 1
    assert html.count("rp-used") == 1


def test_the_precision_table_has_a_row_for_every_parameter():
    html = study_pages.precision_table().text
    assert html.count("<tr>") == 1 + 8
    efficiencies = [float(e) for e in re.findall(r"<td>([\d.]+) ± 0.014</td>", html)]
    assert len(efficiencies) == 8
    assert all(abs(e - 1) < 5 * 0.0145 for e in efficiencies)


def test_the_cost_tables_have_a_row_for_every_effect():
    assert cost_pages.errors().text.count("<tr>") == 1 + 20
    assert cost_pages.biases().text.count("<tr>") == 1 + 20


def test_what_the_pages_say_is_said():
    """Labels used in the book that belong to the studies exist."""
    known = study_pages.sayings() | cost_pages.sayings()
    used = {
        label
        for text in TEXTS
        for label in re.findall(r"\{glue:text\}`(niu2024-(?:study|cost)-[^`]+)`", text)
    }
    assert used
    assert used <= set(known)
