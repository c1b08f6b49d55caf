"""The bar below tables and figures: address, citation, data, inputs and function."""

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

KEYS = ("niu2024/table-2", "niu2024/table-3", "chen2023/table-5")


@pytest.mark.parametrize("key", KEYS)
def test_a_table_has_address_citation_files_inputs_and_functions(key):
    table, html = rp.table(key), rp.table(key)._repr_html_()
    bar = html[html.index('<div class="rp-bar">') :]
    assert f'<a href="#{anchor(key)}" aria-label="Permalink: {key}">' in bar
    assert "@misc" in bar
    assert re.findall(r'href="#(tables/[^"]+)"', bar) == list(table_files(key))
    (inputs,) = re.findall(r"<summary>Inputs</summary>(.*?)</details>", html)
    links = re.findall(r'<a href="#([^"]+)">', inputs)
    assert sorted(links) == sorted({anchor(address) for address in table.inputs})
    for text in (library()[key].place, str(escape(table.rerun_code))):
        assert text in inputs
    (rows,) = re.findall(r"<caption>What computes .*?</table>", html, re.DOTALL)
    for one in catalogue()[key].computations:
        place = f"function-{anchor(key)}-{one.function.__name__}"
        assert f'<a href="#{place}">{one.name}</a> ({one.line})' in rows
        assert f'id="{place}">{escape(text_of(one.function))}</pre>' in html
        for number in one.equations:
            name = f"equation-{key.partition('/')[0]}-{number}"
            assert f'href="#{name}">({number})</a>' in rows
        if one.replicates:
            assert f"{one.entropy[1]} of this function; {one.replicates:,}" in rows
    for form in ("text", "bibtex"):
        assert rp.cite(key, form) in unescape(bar)


def test_a_quoted_table_has_no_function_and_a_terminal_needs_no_citation(monkeypatch):
    calls, table = [], rp.table("niu2024/table-1")
    monkeypatch.setattr(export, "citation", lambda *_: calls.append(1) or "cited")
    assert "25.0601" in str(table)
    assert not calls
    html = table._repr_html_()
    assert "cited" in html
    assert not re.search("<summary>(Function|Inputs)", html)


@pytest.mark.parametrize(
    "key", ["niu2024/table-2", "niu2024/table-3", "chen2023/table-5"]
)
def test_the_code_of_a_card_changes_its_cell(key):
    """A count of states or a difference of nothing does not depend on a number."""
    constant = {f"chen2023/table-5#1.motion-{axis}" for axis in "xy"}
    for cell in library()[key].cells:
        code = rp.table(cell.address).rerun_code
        result = rp.table(cell.address).record.role == "result"
        assert (".rerun(" in code) is (result and cell.address not in constant)
    for name in ("scale.red", "4.motion-y"):
        if name in library()[key].by_name:
            again = eval(rp.table(f"{key}#{name}").rerun_code, {"rp": rp}).frame()
            assert again.loc[name, "changed"] != again.loc[name, "unchanged"]
            (changed,) = eval(
                rp.table(f"{key}#{name}").rerun_code, {"rp": rp}
            ).changes.items()
            assert changed[1] != rp.table(changed[0]).printed


def test_figures_have_caption_citation_and_files(tmp_path, monkeypatch):
    """A schematic and a graph; the files of the tables are tested elsewhere."""
    for key, endings in (
        ("niu2024/fig-2", ".svg.csv"),
        ("niu2024/fig-4", ".svg.pdf.png.csv"),
    ):
        figure, files = rp.figure(key), figures._figure_files(key)
        with monkeypatch.context() as patch:
            patch.setattr(type(figure), "caption", "What <is> drawn.")
            html = figure._repr_html_()
        assert "</span>What &lt;is&gt; drawn.</figcaption>" in html
        assert re.findall(r'href="#(figures/[^"]+)"', html) == files
        assert anchor(key) in html[html.index("<summary>Cite") :]
        figures.write_figure(key, tmp_path)
        paths = [tmp_path / path for path in files]
        assert "".join(path.suffix for path in paths) == endings
        assert all(path.stat().st_size > 0 for path in paths)
    table = tmp_path / "figures" / "niu2024-fig-2.csv"
    assert list(pd.read_csv(table, comment="#")) == ["panel", "curve", "x", "y"]
    cited, paper = rp.cite("niu2024/fig-2", "text").splitlines()
    assert f"# citation: {cited}" in table.read_text(encoding="utf-8")
    assert paper in table.with_suffix(".svg").read_text(encoding="utf-8")


def test_a_build_draws_a_figure_once(tmp_path, monkeypatch):
    monkeypatch.setenv(computed.FOLDER, str(tmp_path / "computed"))
    computed.kept.cache_clear()
    figures.write_figure("niu2024/fig-4", tmp_path)
    monkeypatch.setattr(figures, "_styled_figure", None)
    shown = figures._page_vectors("niu2024/fig-4")
    assert shown[1].startswith("<svg")
    file = tmp_path / "figures" / "niu2024-fig-4.svg"
    assert file.read_text(encoding="utf-8") == figures._XML + shown[0]
    monkeypatch.undo()
    computed.kept.cache_clear()
