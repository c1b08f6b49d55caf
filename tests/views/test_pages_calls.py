"""Tables, counts and files of the book: anchors, facts, CSV, Parquet and schemas."""

import io
import json
import re
from zipfile import ZipFile

import duckdb
import jsonschema
import pandas as pd
import pytest
import yaml
from bs4 import BeautifulSoup

import reproduce as rp
from book_facts import Register, of_ledger, register, write_tables
from reproduce.judge.ledger import expected
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Column
from reproduce.printed.cells import PAPERS, anchor, library
from reproduce.printed.number import powers
from reproduce.views import _numbers as numbers
from reproduce.views import _verdicts as verdicts
from reproduce.views._computed import whole_ledger
from reproduce.views._export import provenance_of, table_files
from reproduce.views.citations import cite
from reproduce.views.consistency import errata_register

SPARSE = """computed error tolerance share probability mcse stands_for_low stands_for_high
interval_low interval_high function line readings agreeing closest_computed
closest_probability""".split()


def test_every_cell_has_a_unique_anchor_its_printed_number_and_its_verdict():
    ids = []
    for key, table in library().items():
        html = rp.table(key)._repr_html_()
        page = BeautifulSoup(html, "html.parser")
        found = [tag["id"] for tag in page.select("[id]")]
        assert {cell.anchor for cell in table.cells} <= set(found)
        printed = [tag.text for tag in page.select(".rp-printed")]
        assert printed == [powers(cell.shown) for cell in table.cells]
        closed = [tag for tag in page.find_all() if not tag.is_empty_element]
        assert len(closed) == html.count("</"), key
        ids += found
    assert len(ids) == len(set(ids))
    html = rp.table("niu2024/table-2")._repr_html_()
    pattern = r'<td id="niu2024-table-2-translation-x-red".*?</td>'
    (cell,) = re.findall(pattern, html, re.DOTALL)
    assert all(text in cell for text in ("0.3\u202fpx", "1.90", ">differs<"))


def test_the_index_adds_up():
    """A row for each paper, for each item, and for all."""
    page, found = BeautifulSoup(rp.contents().index._repr_html_(), "html.parser"), {}
    keys = {f"#{anchor(key)}": key for key in catalogue()}
    for row in page.select("tbody tr"):
        head, *cells = row.find_all(["th", "td"])
        address = head.a["href"].replace("figure-", "") if head.a else head.text
        counts = [cell.text.replace("·", "0") for cell in cells]
        name = keys.get(address, head.text.split()[0])
        found[name] = [int(count) for count in counts if count.isdecimal()]
    frame = rp.contents().frame()
    for name, counts in found.items():
        records = [
            record
            for record in whole_ledger().records
            if name == "all" or f"{record.key}/".startswith(f"{name}/")
        ]
        expected = [*verdicts.tally(records).values()]
        assert counts == (expected if records else [])
        if name in library():
            assert frame.loc[name, [*verdicts.VERDICTS]].tolist() == counts[:-1]
    assert set(found) >= {*PAPERS, *library(), "all"}
    numbers = rp.contents("niu2024").numbers._repr_html_()
    names = re.findall(r'<th scope="row"><a href="#([^"]+)"', numbers)
    assert names == [anchor(cell) for cell in rp.contents("niu2024").cells()["cell"]]


def test_facts_of_cells_items_and_papers():
    """A count of agreement is never given without its weak part."""
    facts = of_ledger()
    assert facts["niu2024/table-3#rotation.red printed"] == "0.0698°"
    assert facts["niu2024/table-3#rotation.red verdict"] == "consistent"
    assert facts["niu2024/table-3 joint"] == "below 1/2,000"
    for name in ("all", *PAPERS, *library()):
        records = whole_ledger().records
        records = [r for r in records if name in {"all", r.key, r.key.split("/")[0]}]
        agree = [r for r in records if r.verdict in {"exact", "consistent"}]
        weak = sum(bool({*r.flags} & {*verdicts.WEAK}) for r in agree)
        fraction = "all" if weak == len(agree) else weak
        remark = f" ({fraction} of them weakly)" if weak else ""
        assert facts[f"{name} agree"] == f"{len(agree)}{remark}"
        assert facts[f"{name} strong"] == f"{len(agree) - weak}"
        assert facts[f"{name} weak"] == f"{weak}"


def test_numbers_have_the_digits_that_their_errors_allow():
    for text, value, error in (
        ("0.43", 0.4321, 0.01),
        ("0.05", 0.05, 0.01),
        ("<\u00a00.0008", 0.0, 0.0004),
        ("1.00", 1.0, 0.02),
    ):
        assert verdicts.chance(value, error) == text
    for text, value, form, zero in (
        ("0.043", 0.0432, ".3f", 0.0),
        ("0", -4e-10, ".2g", 1e-9),
        ("10,000", 10_000, ",", 0.0),
        ("Table 2", "Table 2", "", 0.0),
    ):
        assert numbers.entry(value, Column(name="", form=form, zero=zero)) == text


@pytest.fixture(scope="module")
def shipped(tmp_path_factory):
    """Return the folder with the files of all tables."""
    folder = tmp_path_factory.mktemp("shipped")
    write_tables(folder)
    return folder


def test_all_files_are_written_and_equal_each_time(shipped):
    ends = ("csv", "json", "parquet", "schema.json")
    names = {f"{name}.{end}" for name in ("ledger", "errata") for end in ends}
    names |= {
        path for key in (*library(), *catalogue("studies")) for path in table_files(key)
    }
    files = {
        p.relative_to(shipped).as_posix() for p in shipped.rglob("*") if p.is_file()
    }
    names |= {f"{paper}-reports.zip" for paper in PAPERS}
    assert files == names | {"verify_ledger.py", "readings.csv", "readings.parquet"}
    read = whole_ledger().model_validate_json((shipped / "ledger.json").read_text())
    assert read == whole_ledger().model_copy(update=provenance_of())
    assert all(record.reason for record in read.records if record.verdict == "differs")
    for paper in PAPERS:
        with ZipFile(shipped / f"{paper}-reports.zip") as packed:
            inside = {name.partition("/")[2] for name in packed.namelist()}
            stated = yaml.safe_load(packed.read(f"{paper}-reports/codecheck.yml"))
        assert {one["file"] for one in stated["manifest"]} < inside
    kinds = ("*.parquet", "*.zip")
    first = {path: path.read_bytes() for kind in kinds for path in shipped.glob(kind)}
    write_tables(shipped)
    assert first == {path: path.read_bytes() for path in first}


def test_csv_and_parquet_are_equal_and_have_a_provenance(shipped):
    settings = {"dtype": {"printed": str, "equations": str}, "keep_default_na": False}
    settings["na_values"] = {name: [""] for name in SPARSE}
    about = provenance_of()
    head = "".join(f"{name}: {value}\n" for name, value in about.items()).splitlines()
    metadata = "SELECT decode(key), decode(value) FROM parquet_kv_metadata(?)"
    for name in ("ledger", "errata", "readings"):
        text = (shipped / f"{name}.csv").read_text(encoding="utf-8")
        frame = pd.read_csv(io.StringIO(text), comment="#", **settings)
        path = [str(shipped / f"{name}.parquet")]
        with duckdb.connect() as base:
            read = base.execute("FROM read_parquet(?)", path).df()
            assert dict(base.execute(metadata, path).fetchall()) == about
        read = read.fillna(dict.fromkeys(("agrees_if", "closest"), ""))
        pd.testing.assert_frame_equal(read, frame, check_dtype=False, check_exact=True)
        assert text.splitlines()[: len(head)] == [f"# {line}" for line in head]


def test_the_files_have_the_records_of_ledger_and_register(shipped):
    cells = pd.read_csv(shipped / "ledger.csv", comment="#", dtype={"printed": str})
    records, entries = whole_ledger().records, {e.id for e in errata_register()}
    for name in ("cell", "printed"):
        assert list(cells[name]) == [getattr(record, name) for record in records]
    errata = pd.read_csv(shipped / "errata.csv", comment="#").set_index("id")
    assert set(errata.index) == entries
    named = {(expected(record.cell).erratum, record.cell) for record in records}
    listed = errata["results"].dropna().str.split().explode()
    assert {pair for pair in named if pair[0]} <= {*listed.items()}
    stored = json.loads(register().model_dump_json())
    jsonschema.validate(stored, Register.model_json_schema())
    assert stored["citation"] == cite("all", "text")
