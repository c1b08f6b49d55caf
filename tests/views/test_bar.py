"""The bar below tables and figures: address, citation, data, inputs and function."""

import re

import pytest
from bs4 import BeautifulSoup

import reproduce as rp
from book_facts import write_figure
from reproduce.papers.declare import computations
from reproduce.printed.cells import anchor, library
from reproduce.views import figure as figures
from reproduce.views._base import text_of
from reproduce.views._export import table_files

KEYS = ("niu2024/table-2", "niu2024/table-3", "chen2023/table-5")


@pytest.mark.parametrize("key", KEYS)
def test_a_table_has_address_citation_files_inputs_and_functions(key):
    table, html = rp.table(key), rp.table(key)._repr_html_()
    page = BeautifulSoup(html, "html.parser")
    links = [link["href"].removeprefix("#") for link in page.select("a[href]")]
    assert anchor(key) in links
    assert [link for link in links if link[:7] == "tables/"] == [*table_files(key)]
    assert {anchor(address) for address in table.inputs} <= set(links)
    for one in computations(key):
        (text,) = page.select(f"#function-{anchor(key)}-{one.function.__name__}")
        assert text.text == text_of(one.function)
        paper = key.partition("/")[0]
        assert {f"equation-{paper}-{number}" for number in one.equations} <= set(links)
    for text in (
        *(rp.cite(key, form) for form in ("text", "bibtex")),
        table.rerun_code,
    ):
        assert text in page.text


@pytest.mark.parametrize("key", KEYS)
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


def test_figures_have_caption_citation_and_files(tmp_path, monkeypatch):
    """A schematic and a graph; the files of the tables are tested elsewhere."""
    monkeypatch.setattr(figures.Figure, "caption", "What <is> drawn.")
    for key, endings in (
        ("niu2024/fig-2", ".svg.csv"),
        ("niu2024/fig-4", ".svg.pdf.png.csv"),
    ):
        html, files = rp.figure(key)._repr_html_(), rp.figure(key).files
        assert "</span>What &lt;is&gt; drawn.</figcaption>" in html
        assert re.findall(r'href="#(figures/[^"]+)"', html) == files
        assert anchor(key) in html[html.index("<summary>Cite") :]
        write_figure(key, tmp_path)
        paths = [tmp_path / path for path in files]
        assert "".join(path.suffix for path in paths) == endings
        assert all(path.stat().st_size > 0 for path in paths)
    schematic, table = (tmp_path / path for path in rp.figure("niu2024/fig-2").files)
    assert table.read_text("utf-8") == rp.figure("niu2024/fig-2").export("csv")
    paper = rp.cite("niu2024/fig-2", "text").splitlines()[1]
    assert paper in schematic.read_text("utf-8")
