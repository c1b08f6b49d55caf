"""What the pages call: tables with anchors, figures that follow the theme, words for sentences."""

import re
from html.parser import HTMLParser

import pytest

import reproduce as rp
from book_facts import write_tables
from reproduce.judge.rerun import studies
from reproduce.papers.declare import Column, Fact
from reproduce.printed.cells import PAPERS, library
from reproduce.views import numbers, verdicts
from reproduce.views.computed import whole_ledger
from reproduce.views.export import signed, table_files
from reproduce.views.figure import drawable
from reproduce.views.verdicts import facts_of

TABLES = list(library())


class Reader(HTMLParser):
    """Collects ids and the text of the printed numbers."""

    def __init__(self, text):
        super().__init__()
        self.ids, self.printed, self.open = [], [], []
        self.inside = False
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        attributes = dict(attrs)
        if "id" in attributes:
            self.ids.append(attributes["id"])
        self.inside = attributes.get("class") == "rp-printed"
        if tag not in {"br", "meta", "path", "use"}:
            self.open.append(tag)

    def handle_endtag(self, tag):
        self.inside = False
        while self.open and self.open.pop() != tag:
            pass

    def handle_data(self, data):
        if self.inside:
            self.printed.append(data)


@pytest.mark.parametrize("key", TABLES)
def test_every_cell_has_its_anchor_and_its_print(key):
    reader = Reader(rp.table(key)._repr_html_())
    for cell in library()[key].cells:
        assert reader.ids.count(cell.anchor) == 1
    assert reader.printed == [numbers.powers(cell.shown) for cell in library()[key].cells]
    assert reader.open == []


def test_anchors_are_unique_over_all_tables():
    ids = [name for key in TABLES for name in Reader(rp.table(key)._repr_html_()).ids]
    assert len(ids) == len(set(ids))


def test_computed_and_verdict_stand_beside_the_print():
    html = rp.table("niu2024/table-2")._repr_html_()
    (cell,) = re.findall(r'<td id="niu2024-table-2-translation-x-red".*?</td>', html, re.DOTALL)
    assert "0.3\u202fpx" in cell
    assert "1.90" in cell
    assert ">differs<" in cell
    assert "title=" not in html, "what a tooltip would say stands in the text"
    assert "calculated according to Table 1" in html[html.index("How each cell was judged") :]


def test_unknown_keys_are_refused():
    with pytest.raises(KeyError, match="did you mean niu2024/table-3"):
        rp.table("niu2024/tabel-3")


@pytest.mark.parametrize("key", drawable())
def test_figures_follow_the_theme_and_have_alternative_text(key):
    figure = rp.figure(key)
    figure.alternative = 'a "quoted" text'
    html = figure._repr_html_().partition("</svg>")[0]
    assert 'role="img"' in html
    assert 'aria-label="a &quot;quoted&quot; text"' in html
    assert "currentColor" in html
    assert "#000000" not in html
    assert "<text" in html, "text stays text"
    (root,) = re.findall(r"<svg [^>]*>", html)
    assert 'fill="currentColor"' in root, "text of formulas has no colour of its own and takes this"
    assert not re.search(r"<g [^>]*fill[^>]*>\s*<text>", html), "nor does what it stands in"
    ids = re.findall(r'\bid="([^"]+)"', html)
    for used in re.findall(r'(?:url\(#|xlink:href="#)([^)"]+)', html):
        assert used in ids


def test_figures_of_one_page_share_no_name():
    """A drawing, its narrow twin and another figure: each link within one leads to its own part."""
    shown = [rp.figure(key)._repr_html_() for key in ("niu2024/fig-2", "chen2023/fig-10a")]
    ids = re.findall(r'\bid="([^"]+)"', "".join(shown))
    assert len(ids) == len(set(ids)) > 4


def test_the_index_adds_up():
    html = rp.contents().index._repr_html_()
    rows = [
        re.findall(r"<td(?: class=\"rp-zero\")?>([\d·]+)<", row) for row in html.split("<tr>")[2:]
    ]
    *counts, whole = [[int(n.replace("·", "0")) for n in row] for row in rows if row]
    assert len(counts) == len(library())
    tally = verdicts.tally(whole_ledger().records)
    sums = [sum(column) for column in zip(*counts, strict=True)]
    assert sums == whole
    assert sums[:-1] == list(tally.values())


def test_facts_of_a_cell_an_item_and_a_paper():
    cell = facts_of("niu2024/table-3#rotation.red")
    assert cell["printed"] == "0.0698°"
    assert cell["verdict"] == "consistent"
    assert facts_of("niu2024/table-3")["joint"] == "below 1 in 2,000"
    everything = facts_of("all")
    assert everything["cells"] == "333"
    judged = sum(int(everything[v].split()[0]) for v in ("exact", "consistent", "differs"))
    assert int(everything["judged"]) == judged


@pytest.mark.parametrize("name", ["all", *PAPERS, *library()])
def test_no_count_of_agreement_stands_without_its_weak_part(name):
    found = [
        r
        for r in whole_ledger().records
        if name == "all" or r.cell.startswith((f"{name}#", f"{name}/"))
    ]
    said = facts_of(name)
    for count, kinds in (("exact", {"exact"}), ("consistent", {"consistent"}),
                         ("agree", {"exact", "consistent"})):  # fmt: skip
        agreeing = [r for r in found if r.verdict in kinds]
        weak = len([r for r in agreeing if set(r.flags) & set(verdicts.WEAK)])
        share = "all" if weak == len(agreeing) else weak
        told = f" ({share} of them weakly)" if weak else ""
        assert said[count] == f"{len(agreeing)}{told}"
    assert int(said["strong"]) + int(said["weak"]) == int(said["agree"].split()[0])


@pytest.mark.parametrize("name", ["nobody1999", "niu2024/table-3#scale.green"])
def test_nothing_can_be_said_of_what_does_not_exist(name):
    with pytest.raises(KeyError):
        facts_of(name)


@pytest.mark.parametrize(
    ("value", "mcse", "shown"),
    [
        (0.4321, 0.01, "0.43"),
        (0.05, 0.01, "0.05"),
        (0.0, 0.0004, "<\u00a00.0008"),
        (1.0, 0.02, "1.00"),
    ],
)
def test_probabilities_show_no_more_digits_than_their_error_allows(value, mcse, shown):
    assert numbers.chance(value, mcse) == shown


@pytest.mark.parametrize(
    ("probability", "text"),
    [
        (0.4312, "0.43"),
        (10**-7.6, "10⁻⁸"),
        (0.0, "<\u202f10⁻¹²"),
        (0.0021, "0.002"),
        (10**-2.6, "0.003"),
        (0.0012, "0.001"),
    ],
)
def test_small_probabilities_are_powers_of_ten(probability, text):
    """From 10,000 draws: twenty of them are two in a thousand."""
    column = Column("p", "chance", 1e-12, draws=10_000)
    assert numbers.entry(probability, column) == text


@pytest.mark.parametrize(
    ("quoted", "text"),
    [
        (Fact(0.0432, ".3f", "px"), "0.043\u202fpx"),
        (Fact(-4e-10, ".2g", "px", 1e-9), "0\u202fpx"),
        (Fact(10_000, ","), "10,000"),
        (Fact("Table 2"), "Table 2"),
        (Fact(3e-13, "chance", zero=1e-9), "<\u202f10⁻⁹"),
    ],
)
def test_facts_are_written_like_numbers_of_tables(quoted, text):
    assert numbers.fact(quoted) == text


def test_a_long_table_shows_its_first_part_with_what_is_outside_bold():
    table = rp.table("niu2024/readings")
    html = table._repr_html_()
    assert html.count("<table") == html.count('<details class="rp-details" open>') == 1
    assert len(table.grids) == 9
    first = table.frame().head(96)
    tails = first.filter(regex="^(k|θ|Δx|Δy|before|after), ")
    assert html.count("<strong>") == int((tails < 0.01).to_numpy().sum()) > 0
    assert f">{len(table.frame()) - 96:,} more rows" in html
    assert "#tables/niu2024-readings.csv" in html


def test_shipped_files_are_written(tmp_path):
    write_tables(tmp_path)
    written = {p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file()}
    tables = {path for key in (*library(), *studies()) for path in table_files(key)}
    assert written == {"ledger.json", "ledger.schema.json", "verify_ledger.py", *tables}
    read = whole_ledger().model_validate_json((tmp_path / "ledger.json").read_text())
    assert read == signed(whole_ledger())
    assert all(one.reason for one in read.records if one.verdict == "differs")
