"""Drawings of our own: shown once, following the theme, with units."""

from pathlib import Path

import pytest

import reproduce as rp
from reproduce.locate import schematic_files
from reproduce.papers.catalogue import drawings
from reproduce.views import figure as figures

BOOK = Path(__file__).parents[2] / "book"
TEXTS = [
    p.read_text(encoding="utf-8") for p in BOOK.rglob("*.md") if "_build" not in p.parts
]


@pytest.mark.parametrize("name", drawings())
def test_drawings_follow_the_theme(name):
    figure = rp.figure(name)
    figure.alternative = 'a "quoted" text'
    html = figure._repr_html_().partition("</svg>")[0]
    assert 'aria-label="a &quot;quoted&quot; text"' in html
    assert "currentColor" in html
    assert "#000000" not in html
    assert "<text" in html


@pytest.mark.parametrize("name", drawings())
def test_every_axis_has_its_unit_or_counts(name):
    if schematic_files(name):
        return
    for axes in figures.draw(name).axes:
        labels = [axes.get_xlabel(), axes.get_ylabel()]
        assert all("(" in label or label == "step" for label in filter(None, labels)), (
            labels
        )


def test_unknown_drawings_are_refused():
    with pytest.raises(KeyError, match="such as niu2024/drawing-fusion-star"):
        figures.draw("niu2024/drawing-fusion-sta")
    with pytest.raises(
        ValueError, match="niu2024/table-3 has no figure; these have one: niu2024/fig-1"
    ):
        figures.draw("niu2024/table-3")
