"""The bar below tables and figures: address, citation, data and function."""

import re
from html import unescape

import pandas as pd
import pytest
from markupsafe import escape

import reproduce as rp
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import anchor, library
from reproduce.views import computed, export
from reproduce.views import figure as figures
from reproduce.views.base import text_of
from reproduce.views.export import table_files

KEY = "niu2024/table-2"


def test_a_table_can_be_cited_taken_away_and_followed_to_its_function():
    html = rp.table(KEY)._repr_html_()
    bar = html[html.index('<div class="rp-bar">') :]
    assert f'<a href="#niu2024-table-2" aria-label="Permalink: {KEY}">' in bar
    assert "@misc" in bar
    assert "10.3390/s24010259" in bar
    assert re.findall(r'href="#(tables/[^"]+)"', bar) == list(table_files(KEY))
    assert "def true_registrations" in bar or "@reproduces" in bar


def test_a_terminal_is_not_kept_waiting_for_citations(monkeypatch):
    written = []
    monkeypatch.setattr(export, "citation", lambda *_: written.append(1) or "cited")
    table = rp.table("niu2024/table-1")
    assert "25.0601" in str(table)
    assert not written
    assert "cited" in table._repr_html_()


def test_a_table_that_is_only_quoted_has_no_function_and_no_inputs():
    html = rp.table("niu2024/table-1")._repr_html_()
    assert "<summary>Function" not in html
    assert "<summary>Inputs" not in html


@pytest.mark.parametrize("key", [KEY, "niu2024/table-3", "chen2023/table-5"])
def test_a_table_can_be_followed_to_its_inputs_its_seed_and_its_place(key):
    html = rp.table(key)._repr_html_()
    (inputs,) = re.findall(r"<summary>Inputs</summary>(.*?)</details>", html)
    reads = {anchor(address) for address in rp.table(key).inputs}
    linked = re.findall(r'<a href="#([^"]+)">', inputs)
    assert len(linked) == len(reads)
    assert set(linked) == reads
    assert f"Printed in {library()[key].place}." in inputs
    assert str(escape(rp.table(key).rerun_code)) in inputs


@pytest.mark.parametrize("key", [KEY, "niu2024/table-3", "chen2023/table-5"])
def test_a_page_holds_what_cards_say_without_a_script(key):
    html = rp.table(key)._repr_html_()
    (made,) = re.findall(r"<caption>What computes .*?</table>", html, re.DOTALL)
    for one in catalogue()[key].computations:
        place = f"function-{anchor(key)}-{one.function.__name__}"
        assert f'<a href="#{place}">{one.name}</a> ({one.line})' in made
        assert f'id="{place}">{escape(text_of(one.function))}</pre>' in html
        for number in one.equations:
            assert (
                f'href="#equation-{key.partition("/")[0]}-{number}">({number})</a>'
                in made
            )
        seed = (
            f"{one.entropy[1]} of this function; {one.replicates:,}"
            if one.replicates
            else ""
        )
        assert seed in made
    said = unescape(html)
    for cell in library()[key].cells:
        assert rp.cite(cell.address, "text").partition("\n")[0] in said


def test_a_card_offers_the_line_that_computes_its_cell_again():
    for address in ("niu2024/table-3#scale.red", "niu2024/table-1#focal-length.red"):
        again = eval(rp.table(address).rerun_code, {"rp": rp})
        assert address.partition("#")[2] in repr(again)


@pytest.mark.parametrize("key", ["niu2024/fig-2", "chen2023/drawing-misalignment"])
def test_a_figure_has_its_pictures_data_caption_and_citation(key, monkeypatch):
    figure = rp.figure(key)
    monkeypatch.setattr(type(figure), "caption", "What <is> drawn.")
    html = figure._repr_html_()
    assert "</span>What &lt;is&gt; drawn.</figcaption>" in html
    assert re.findall(r'href="#(figures/[^"]+)"', html) == figures._figure_files(key)
    assert "<summary>Cite" in html
    assert key in html[html.index("<summary>Cite") :]


def test_the_book_carries_what_the_bars_offer(tmp_path):
    """Of a schematic and a graph; the files of all tables are written in another test."""
    for key, endings in (
        ("niu2024/fig-2", ".svg.csv"),
        ("niu2024/fig-4", ".svg.pdf.png.csv"),
    ):
        figures.write_figure(key, tmp_path)
        paths = [tmp_path / path for path in figures._figure_files(key)]
        assert "".join(path.suffix for path in paths) == endings
        assert all(path.stat().st_size > 0 for path in paths)
    table = tmp_path / "figures" / "niu2024-fig-2.csv"
    assert list(pd.read_csv(table, comment="#")) == ["panel", "curve", "x", "y"]
    cited = rp.cite("niu2024/fig-2", "text").splitlines()
    assert (
        table.read_text(encoding="utf-8").splitlines()[1] == f"# citation: {cited[0]}"
    )
    assert cited[1] in table.with_suffix(".svg").read_text(encoding="utf-8")


def test_a_build_draws_a_figure_once(tmp_path, monkeypatch):
    monkeypatch.setenv(computed.FOLDER, str(tmp_path / "computed"))
    computed.kept.cache_clear()
    try:
        figures.write_figure("niu2024/fig-4", tmp_path)
        monkeypatch.setattr(
            figures, "_styled_figure", lambda paint, **_: pytest.fail("drawn again")
        )
        shown = figures._page_vectors("niu2024/fig-4")
        assert shown[1].startswith("<svg")
        file = tmp_path / "figures" / "niu2024-fig-4.svg"
        assert file.read_text(encoding="utf-8") == figures._XML + shown[0]
    finally:
        monkeypatch.delenv(computed.FOLDER)
        computed.kept.cache_clear()
