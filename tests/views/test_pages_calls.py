"""What the pages call: tables with anchors, figures that follow the theme, words for sentences."""

import io
import json
import math
import re
from html.parser import HTMLParser

import duckdb
import jsonschema
import pandas as pd
import pytest

import reproduce as rp
from book_facts import Register, register, write_tables, write_whole
from reproduce.judge.ledger import erratum
from reproduce.papers.catalogue import studies
from reproduce.papers.declare import Column, Fact
from reproduce.printed.cells import PAPERS, library
from reproduce.views import numbers, verdicts
from reproduce.views.computed import whole_ledger
from reproduce.views.contradictions import errata_register
from reproduce.views.export import citation, provenance, signed, table_files
from reproduce.views.figure import drawable
from reproduce.views.verdicts import facts_of

TABLES = list(library())
ENDS = ("csv", "json", "parquet", "schema.json")
SPARSE = "computed error tolerance share probability mcse stands_for_low stands_for_high".split()
SPARSE += ["interval_low", "interval_high", "function", "line", "readings", "agreeing"]
SPARSE += ["closest_computed", "closest_probability"]


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
    assert reader.printed == [
        numbers.powers(cell.shown) for cell in library()[key].cells
    ]
    assert reader.open == []


def test_anchors_are_unique_over_all_tables():
    ids = [name for key in TABLES for name in Reader(rp.table(key)._repr_html_()).ids]
    assert len(ids) == len(set(ids))


def test_computed_and_verdict_stand_beside_the_print():
    html = rp.table("niu2024/table-2")._repr_html_()
    (cell,) = re.findall(
        r'<td id="niu2024-table-2-translation-x-red".*?</td>', html, re.DOTALL
    )
    assert "0.3\u202fpx" in cell
    assert "1.90" in cell
    assert ">differs<" in cell
    assert "title=" not in html, "what a tooltip would say stands in the text"
    assert (
        "calculated according to Table 1"
        in html[html.index("How each cell was judged") :]
    )


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
    assert 'fill="currentColor"' in root, (
        "text of formulas has no colour of its own and takes this"
    )
    assert not re.search(r"<g [^>]*fill[^>]*>\s*<text>", html), (
        "nor does what it stands in"
    )
    ids = re.findall(r'\bid="([^"]+)"', html)
    for used in re.findall(r'(?:url\(#|xlink:href="#)([^)"]+)', html):
        assert used in ids


def test_figures_of_one_page_share_no_name():
    """A drawing, its narrow twin and another figure: each link within one leads to its own part."""
    shown = [
        rp.figure(key)._repr_html_() for key in ("niu2024/fig-2", "chen2023/fig-10a")
    ]
    ids = re.findall(r'\bid="([^"]+)"', "".join(shown))
    assert len(ids) == len(set(ids)) > 4


def test_the_index_adds_up():
    html = rp.contents().index._repr_html_()
    rows = [
        re.findall(r"<td(?: class=\"rp-zero\")?>([\d·]+)<", row)
        for row in html.split("<tr>")[2:]
    ]
    *found, whole = [[int(n.replace("·", "0")) for n in row] for row in rows if row]
    first = len([key for key in library() if key.startswith(PAPERS[0])])
    counts = [*found[1 : first + 1], *found[first + 2 :]]
    assert len(counts) == len(library())
    parts = [found[0], found[first + 1]]
    assert [sum(column) for column in zip(*parts, strict=True)] == whole, (
        "a row for each paper"
    )
    tally = verdicts.tally(whole_ledger().records)
    sums = [sum(column) for column in zip(*counts, strict=True)]
    assert sums == whole
    assert sums[:-1] == list(tally.values())


def test_facts_of_a_cell_an_item_and_a_paper():
    cell = facts_of("niu2024/table-3#rotation.red")
    assert cell["printed"] == "0.0698°"
    assert cell["verdict"] == "consistent"
    assert facts_of("niu2024/table-3")["joint"] == "below 1/2,000"
    everything = facts_of("all")
    assert everything["cells"] == "343"
    judged = sum(
        int(everything[v].split()[0]) for v in ("exact", "consistent", "differs")
    )
    assert int(everything["judged"]) == judged


@pytest.mark.parametrize("name", ["all", *PAPERS, *library()])
def test_no_count_of_agreement_stands_without_its_weak_part(name):
    found = [
        r
        for r in whole_ledger().records
        if name == "all" or r.cell.startswith((f"{name}#", f"{name}/"))
    ]
    said = facts_of(name)
    for count, kinds in (
        ("exact", {"exact"}),
        ("consistent", {"consistent"}),
        ("agree", {"exact", "consistent"}),
    ):
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
        (0.4312, "0.4"),
        (10**-7.6, "10⁻⁸"),
        (0.0, "<\u202f10⁻¹²"),
        (0.0021, "0.002"),
        (10**-2.6, "0.003"),
        (0.0012, "0.001"),
    ],
)
def test_small_probabilities_are_powers_of_ten(probability, text):
    column = Column("p", "chance", 1e-12)
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


def test_shipped_files_are_written(tmp_path):
    write_tables(tmp_path)
    written = {
        p.relative_to(tmp_path).as_posix() for p in tmp_path.rglob("*") if p.is_file()
    }
    tables = {path for key in (*library(), *studies()) for path in table_files(key)}
    whole = {f"{name}.{end}" for name in ("ledger", "errata") for end in ENDS}
    whole |= {"readings.csv", "readings.parquet"}
    assert written == {"verify_ledger.py", *whole, *tables}
    read = whole_ledger().model_validate_json((tmp_path / "ledger.json").read_text())
    assert read == signed(whole_ledger())
    assert all(one.reason for one in read.records if one.verdict == "differs")
    first = {path.name: path.read_bytes() for path in tmp_path.glob("*.parquet")}
    write_tables(tmp_path)
    assert first == {
        path.name: path.read_bytes() for path in tmp_path.glob("*.parquet")
    }


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    write_whole(folder)
    return folder


@pytest.mark.parametrize("name", ["ledger", "errata", "readings"])
def test_csv_and_parquet_hold_the_same_and_say_what_made_them(name, whole):
    text = (whole / f"{name}.csv").read_text(encoding="utf-8")
    path = str(whole / f"{name}.parquet")
    types = {"printed": str, "equations": str}
    frame = pd.read_csv(
        io.StringIO(text),
        comment="#",
        dtype=types,
        keep_default_na=False,
        na_values={one: [""] for one in SPARSE},
    )
    with duckdb.connect() as base:
        read = base.execute("FROM read_parquet(?)", [path]).df()
        read = read.fillna(dict.fromkeys(("agrees_if", "closest"), ""))
        metadata = "SELECT decode(key), decode(value) FROM parquet_kv_metadata(?)"
        told = dict(base.execute(metadata, [path]).fetchall())
    pd.testing.assert_frame_equal(read, frame, check_dtype=False, check_exact=True)
    assert told == provenance(citation("all", "text"))
    lines = "".join(f"{key}: {value}\n" for key, value in told.items()).splitlines()
    assert text.splitlines()[: len(lines)] == [f"# {line}" for line in lines]


def test_the_tables_of_the_whole_hold_the_ledger_and_the_register(whole):
    cells = pd.read_csv(whole / "ledger.csv", comment="#", dtype={"printed": str})
    records = whole_ledger().records
    assert list(cells["cell"]) == [one.cell for one in records]
    assert list(cells["printed"]) == [one.printed for one in records]
    ends = [(one.interval or (None, None))[0] for one in records]
    assert [None if math.isnan(one) else one for one in cells["interval_low"]] == ends
    errata = pd.read_csv(whole / "errata.csv", comment="#").set_index("id")
    assert set(errata.index) == {one.id for one in errata_register()}
    for record in records:
        if named := erratum(record.cell):
            assert record.cell in errata.loc[named, "results"].split()


def test_the_register_fits_its_schema():
    schema, shipped = (
        Register.model_json_schema(),
        json.loads(register().model_dump_json()),
    )
    jsonschema.validate(shipped, schema)
    assert {one["id"] for one in shipped["errata"]} == {
        one.id for one in errata_register()
    }
    assert shipped["citation"] == citation("all", "text")
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({**shipped, "errata": [{"id": "x"}]}, schema)


def test_all_numbers_stand_in_one_table():
    text = rp.contents().numbers._repr_html_()
    cells = [cell for table in library().values() for cell in table.cells]
    assert text.count("<tr>") == 1 + len(cells) == 1 + len(rp.contents().cells())
    assert all(f'href="#{cell.anchor}"' in text for cell in cells)
    alone = rp.contents("niu2024").numbers._repr_html_()
    assert 'href="#niu2024-table-3-scale-red"' in alone
    assert 'href="#chen2023' not in alone
