"""Drawings and tables of the studies: shown once, following the theme, complete."""

import re
from pathlib import Path

import numpy as np
import pytest

from reproduce.papers.niu2024 import counting, figures_distributions, fusion, study
from reproduce.printed.given import given
from reproduce.store import studies
from reproduce.views import cost_pages, distribution_pages, drawings, fusion_pages, study_pages

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
    assert len(rows) == len(readings) * len(counting.COUNTED)
    assert {row.count("<td>") for row in rows} == {5 + 12 + 5 + 1}
    assert html.count("(the literal one)") == 1
    assert html.count("rp-used") == 1


def test_the_closest_readings_are_shown_with_their_distance():
    rows = re.findall(r"<tr>.*?</tr>", study_pages.closest().text, re.DOTALL)
    assert len(rows) == 1 + 2 + 4
    for row in rows[1:]:
        distances = [float(d) for d in re.findall(r"\(([\d.]+)\u202fσ\)", row)]
        assert len(distances) == 4
        assert distances[-1] >= max(distances) - 0.5, "all cells are farther out than any part"


@pytest.mark.parametrize(
    ("counted", "law", "text"),
    [
        (0.4312, -0.4, "0.43"),
        (0.0001, -7.6, "10⁻⁸"),
        (0.0, -300.0, "<\u202f10⁻¹²"),
        (0.0021, -2.0, "0.002"),
        (0.0, -2.6, "0.003"),
    ],
)
def test_small_probabilities_are_powers_of_ten(counted, law, text):
    assert study_pages.chance(counted, law, 10_000) == text


def test_the_distribution_of_every_number_is_shown_for_every_reading():
    html = distribution_pages.distributions().text
    readings = study.readings(given(study.READS))
    rows = [row for row in html.split("<tr") if "<td>" in row]
    assert len(rows) == len(readings)
    assert {row.count("±") for row in rows} == {2 * len(counting.SUMMARISED)}
    assert html.count("<details") == 9


def test_the_drawing_of_the_distributions_shows_the_stored_quantiles_and_the_print():
    figure = drawings.paint("niu2024-distributions")
    levels = studies.read("niu2024-readings").arrays["quantiles"]
    chosen = list(figures_distributions.chosen().values())
    assert len(set(chosen)) == len(chosen) == 10
    for place, axes in enumerate(figure.axes):
        cell, channel = divmod(place, 2)
        bars, dashed = axes.lines[:-1:2], axes.lines[-1]
        for bar, (number, way) in zip(bars, chosen, strict=True):
            expected = counting.quantiles_counted(levels[number], way)[[0, -1], channel, cell]
            np.testing.assert_allclose(bar.get_xdata(), expected * (1e3 if cell == 1 else 1))
        printed = distribution_pages.printed_values()[channel * 6 + cell]
        np.testing.assert_allclose(dashed.get_xdata(), printed * (1e3 if cell == 1 else 1))
    assert distribution_pages.printed_values()[:2] == pytest.approx([0.9973, np.radians(0.0698)])


def test_what_the_book_says_of_the_distributions():
    """Which bars hold the print, by the quantiles: scales none, rotations nearly all, and so on."""
    levels = studies.read("niu2024-readings").arrays["quantiles"]
    chosen = figures_distributions.chosen()
    print_, inside = np.reshape(distribution_pages.printed_values(), (2, 6)), {}
    for name, (number, way) in chosen.items():
        bars = counting.quantiles_counted(levels[number], way)
        inside[name] = (bars[0] <= print_) & (print_ <= bars[-1])
    held = np.array(list(inside.values()))
    shifted = ["Table 2" in name for name in chosen]
    assert not held[..., 0].any(), "scales"
    assert held[..., 1].mean() > 0.8, "rotations"
    np.testing.assert_array_equal(held[..., 2:4].all(axis=(1, 2)), shifted)
    one_axis = [n for n, (_, way) in chosen.items() if way != "both axes"]
    assert [n for n in chosen if inside[n][:, 5].all()] == one_axis


def test_the_precision_table_has_a_row_for_every_parameter():
    html = study_pages.precision_table().text
    assert html.count("<tr>") == 1 + 8
    efficiencies = [float(e) for e in re.findall(r"<td>([\d.]+) ± 0.014</td>", html)]
    assert len(efficiencies) == 8
    assert all(abs(e - 1) < 5 * 0.0145 for e in efficiencies)


def test_the_cost_tables_have_a_row_for_every_effect():
    assert cost_pages.errors().text.count("<tr>") == 1 + 20
    assert cost_pages.biases().text.count("<tr>") == 1 + 20


def test_the_tables_of_the_images_have_a_row_for_every_star():
    stars, magnitudes = len(fusion.STARS), len(fusion.MAGNITUDES)
    html = fusion_pages.centroids().text
    assert html.count("<details") == html.count("<table") == stars
    assert html.count("<tr>") == stars * (1 + len(fusion.PLACES) * magnitudes * len(fusion.MADE))
    assert fusion_pages.colours().text.count("<tr>") == 1 + stars * magnitudes
    for star in fusion.STARS:
        assert fusion_pages.named(star) in html
