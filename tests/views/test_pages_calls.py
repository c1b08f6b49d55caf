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
from reproduce.printed.cells import PAPERS, anchor, library
from reproduce.views import numbers, verdicts
from reproduce.views.computed import whole_ledger
from reproduce.views.consistency import errata_register
from reproduce.views.export import citation, provenance_of, table_files, with_provenance
from reproduce.views.figure import drawable
from reproduce.views.verdicts import facts_of

CHANCE = Column("p", "chance", 1e-12)
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


def test_every_cell_has_its_anchor_and_its_print():
    """An anchor is unique over all tables."""
    ids = []
    for key, table in library().items():
        reader = Reader(rp.table(key)._repr_html_())
        assert {cell.anchor for cell in table.cells} <= set(reader.ids)
        assert reader.printed == [numbers.powers(cell.shown) for cell in table.cells]
        assert reader.open == []
        ids += reader.ids
    assert len(ids) == len(set(ids))


def test_computed_and_verdict_stand_beside_the_print():
    html = rp.table("niu2024/table-2")._repr_html_()
    pattern = r'<td id="niu2024-table-2-translation-x-red".*?</td>'
    (cell,) = re.findall(pattern, html, re.DOTALL)
    for text in ("0.3\u202fpx", "1.90", ">differs<"):
        assert text in cell
    assert "title=" not in html, "what a tooltip would say stands in the text"
    judged = html[html.index("How each cell was judged") :]
    assert "calculated according to Table 1" in judged
    with pytest.raises(KeyError, match="niu2024/table-3"):
        rp.table("niu2024/tabel-3")


def test_figures_follow_the_theme_and_have_alternative_text():
    """Text stays text and takes its colour from the page; no two figures share an id."""
    seen = set()
    for key in drawable():
        figure = rp.figure(key)
        figure.alternative = 'a "quoted" text'
        html = figure._repr_html_()
        first = html.partition("</svg>")[0]
        for text in ('role="img"', "currentColor", "<text"):
            assert text in first
        assert 'aria-label="a &quot;quoted&quot; text"' in first
        assert "#000000" not in first
        (root,) = re.findall(r"<svg [^>]*>", first)
        assert 'fill="currentColor"' in root
        assert not re.search(r"<g [^>]*fill[^>]*>\s*<text>", first)
        used = re.findall(r'(?:url\(#|xlink:href="#)([^)"]+)', first)
        assert set(used) <= set(re.findall(r'\bid="([^"]+)"', first))
        ids = re.findall(r'\bid="([^"]+)"', html)
        assert len(ids) == len(set(ids))
        assert seen.isdisjoint(ids)
        seen |= set(ids)


def test_the_index_adds_up():
    """A row for each paper, for each of its items, and for all."""
    html = rp.contents().index._repr_html_()
    rows = re.findall(r'<tr><th scope="row">(.*?)</tr>', html, re.DOTALL)
    found = {}
    for row in rows:
        counts = re.findall(r"<td[^>]*>([\d·]+)<", row)
        name = re.findall(r"<code>(.*?)</code>|^(\w+)<", row)[0]
        found["".join(name)] = [int(count.replace("·", "0")) for count in counts]
    records = whole_ledger().records
    for name, counts in found.items():
        own = [
            r for r in records if name == "all" or f"{r.key}/".startswith(f"{name}/")
        ]
        expected = [*verdicts.tally(own).values(), verdicts.weak(own)]
        assert counts == (expected if own else [])
    assert set(found) >= {*PAPERS, *library(), "all"}


def test_facts_of_a_cell_an_item_and_a_paper():
    cell = facts_of("niu2024/table-3#rotation.red")
    assert (cell["printed"], cell["verdict"]) == ("0.0698°", "consistent")
    assert facts_of("niu2024/table-3")["joint"] == "below 1/2,000"
    everything = facts_of("all")
    assert everything["cells"] == "343"
    kinds = ("exact", "consistent", "differs")
    judged = sum(int(everything[kind].split()[0]) for kind in kinds)
    assert int(everything["judged"]) == judged
    for name in ("nobody1999", "niu2024/table-3#scale.green"):
        with pytest.raises(KeyError):
            facts_of(name)


def test_no_count_of_agreement_stands_without_its_weak_part():
    for name in ("all", *PAPERS, *library()):
        records = whole_ledger().records
        found = [r for r in records if name in {"all", r.key, r.key.split("/")[0]}]
        facts = facts_of(name)
        for count in ("exact", "consistent", "agree"):
            kinds = {"exact", "consistent"} if count == "agree" else {count}
            agreeing = [r for r in found if r.verdict in kinds]
            weak = len([r for r in agreeing if set(r.flags) & set(verdicts.WEAK)])
            share = "all" if weak == len(agreeing) else weak
            remark = f" ({share} of them weakly)" if weak else ""
            assert facts[count] == f"{len(agreeing)}{remark}"
        agree = int(facts["agree"].split()[0])
        assert int(facts["strong"]) + int(facts["weak"]) == agree


@pytest.mark.parametrize(
    ("write", "arguments", "text"),
    [
        (numbers.chance, (0.4321, 0.01), "0.43"),
        (numbers.chance, (0.4321, 0.04), "0.43"),
        (numbers.chance, (0.05, 0.01), "0.05"),
        (numbers.chance, (0.0, 0.0004), "<\u00a00.0008"),
        (numbers.chance, (1.0, 0.02), "1.00"),
        (numbers.entry, (0.4312, CHANCE), "0.4"),
        (numbers.entry, (10**-7.6, CHANCE), "10⁻⁸"),
        (numbers.entry, (0.0, CHANCE), "<\u202f10⁻¹²"),
        (numbers.entry, (0.0021, CHANCE), "0.002"),
        (numbers.entry, (10**-2.6, CHANCE), "0.003"),
        (numbers.entry, (0.0012, CHANCE), "0.001"),
        (numbers.fact, (Fact(0.0432, ".3f", "px"),), "0.043\u202fpx"),
        (numbers.fact, (Fact(-4e-10, ".2g", "px", 1e-9),), "0\u202fpx"),
        (numbers.fact, (Fact(10_000, ","),), "10,000"),
        (numbers.fact, (Fact("Table 2"),), "Table 2"),
        (numbers.fact, (Fact(3e-13, "chance", zero=1e-9),), "<\u202f10⁻⁹"),
    ],
)
def test_numbers_have_the_digits_that_their_errors_allow(write, arguments, text):
    """Small probabilities are powers of ten; facts are written as entries of tables."""
    assert write(*arguments) == text


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
    assert read == with_provenance(whole_ledger())
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
    assert told == provenance_of(citation("all", "text"))
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
    for contents in (rp.contents(), rp.contents("niu2024")):
        text, cells = contents.numbers._repr_html_(), contents.cells()
        found = re.findall(r'<th scope="row"><a href="#([^"]+)"', text)
        assert found == [anchor(cell) for cell in cells["cell"]]
        assert text.count("<tr>") == 1 + len(cells)
