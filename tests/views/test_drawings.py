"""Drawings of our own: shown once, following the theme, with units."""

import re
from pathlib import Path

import pytest

from reproduce.views import drawings

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
