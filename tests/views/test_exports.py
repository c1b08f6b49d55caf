"""Exports and citations are read back by other programs' readers."""

import io
import itertools
import json
import re
import subprocess
import time
from itertools import takewhile

import numpy as np
import pandas as pd
import pytest
import rispy
from PIL import Image
from pybtex.database import Entry, Person, parse_string

import reproduce as rp
from reproduce import version
from reproduce.judge import ledger
from reproduce.papers.catalogue import catalogue, studies
from reproduce.printed.cells import PAPERS, library
from reproduce.version import RELEASED, __version__
from reproduce.views import export as exporting
from reproduce.views.export import FORMATS, _mark, _statement_of, citation, verify
from reproduce.views.figure import draw, drawable, save

KEY = "chen2023/table-5"
CELLS = (
    "niu2024/table-3#scale.red",
    "chen2023/table-5#2.monitoring-x",
    "niu2024/table-1#focal-length.red",
)


@pytest.fixture(scope="module")
def table():
    return ledger.build([KEY])


def read_csv(text, **how):
    return pd.read_csv(io.StringIO(text), comment="#", **how)


def markdown(text):
    """Return the lines of a table; the comment before it ends in an empty line."""
    return text.partition("-->\n\n")[2].splitlines()


def test_csv_carries_every_field_at_full_precision(table):
    frame = read_csv(rp.table(KEY).export("csv"), dtype={"printed": str})
    records = table.of(KEY)
    assert list(frame["cell"]) == [record.cell for record in records]
    assert list(frame["printed"]) == [record.printed for record in records]
    for record, value in zip(records, frame["computed"], strict=True):
        assert (record.computed is None) == bool(np.isnan(value))
        assert record.computed is None or value == record.computed


def test_json_reads_back_as_a_ledger_with_its_reasons(table):
    read = ledger.Ledger.model_validate_json(rp.table(KEY).export("json"))
    assert [r.model_copy(update={"reason": ""}) for r in read.records] == list(
        table.records
    )
    frame = read_csv(rp.table(KEY).export("csv"), keep_default_na=False)
    assert [one.reason for one in read.records] == list(frame["reason"])
    assert read.cell(f"{KEY}#2.reference-x").reason.startswith(
        "Four significant digits"
    )
    assert read.software == version.software()
    assert read.citation == citation(KEY, "text")


def test_markdown_and_latex_keep_the_shape_of_the_table(table):
    printed = library()[KEY]
    lines = markdown(rp.table(KEY).export("markdown"))
    assert len(lines) == 2 + len(printed.rows)
    rows = [[part.strip() for part in line.strip("|").split("|")] for line in lines]
    assert all(len(row) == 1 + len(printed.columns) for row in rows)
    column = rows[0].index("Difference about Y")
    assert rows[3][column] == "-0.040″, -0.040, exact difference"
    text = rp.table(KEY).export("latex")
    assert r"\label{tab:chen2023-table-5}" in text
    assert text.count(r"\\") == 1 + len(printed.rows)
    assert "In each cell: printed, then computed, then the verdict." in text
    assert r"10.03 \textmu{}m, input" in text
    assert "$-$0.040$''$, $-$0.040, exact difference" in text
    assert r"\begin{tabular}{lrrrrrrrrrr}" in text


def test_latex_is_ascii():
    for key in (*library(), *studies()):
        assert rp.table(key).export("latex").isascii(), key


def test_a_cell_has_a_row_per_property_and_a_group_a_row_per_cell():
    lines = markdown(rp.table(f"{KEY}#2.difference-y").export("markdown"))
    assert lines[0] == f"| Cell | {KEY}#2.difference-y |"
    assert any(line.startswith("| verdict | exact") for line in lines)
    group = "niu2024/text-optics"
    lines = markdown(rp.table(group).export("markdown"))
    assert lines[0] == "| Quantity | Printed | Computed | Verdict | Where |"
    assert len(lines) == 2 + len(library()[group].cells)


def test_a_citation_names_the_authors_of_a_paper(monkeypatch):
    for names, told in (("A", "A"), ("AB", "A and B"), ("ABC", "A et al.")):
        people = {"author": [Person(last=name) for name in names]}
        paper = Entry("article", {"year": "1776"}, people)
        monkeypatch.setattr(exporting, "_paper", lambda _, paper=paper: paper)
        assert exporting._et_al("any") == f"{told} (1776)"


def test_unknown_formats_are_refused():
    with pytest.raises(ValueError, match=r"format: .*'xls'"):
        rp.table(KEY).export("xls")
    with pytest.raises(ValueError, match=r"format: .*'apa'"):
        citation(KEY, "apa")


def test_citations_name_item_and_paper():
    for key in catalogue():
        paper = key.split("/")[0]
        parsed = parse_string(citation(key, "bibtex"), "bibtex").entries
        assert list(parsed) == [f"reproduce-{key.replace('/', '-')}", paper]
        listed = json.loads(citation(key, "csl"))
        assert [entry["id"] for entry in listed] == list(parsed)
        assert listed[1]["DOI"] == parsed[paper].fields["doi"]
        text = citation(key, "text")
        assert key in text
        assert len(text.splitlines()) == 2
    assert "Table 3 of Niu et al. (2024)" in citation("niu2024/table-3", "text")


def test_figures_are_the_same_at_every_drawing(tmp_path):
    key = drawable()[0]
    for name in ("a.svg", "b.svg"):
        save(draw(key), tmp_path / name)
    assert (tmp_path / "a.svg").read_bytes() == (tmp_path / "b.svg").read_bytes()


# Labels of pure counts, which have no unit; "per" joins two.
COUNTED = {"frames averaged", "frame", "state", "electrons per frame"}


def test_every_axis_names_its_quantity_and_unit():
    figures = [figure for key in drawable() if not isinstance(figure := draw(key), str)]
    for axes in (axes for figure in figures for axes in figure.axes):
        if axes.axison:  # a diagram has no scale
            labels = {axes.get_xlabel(), axes.get_ylabel()} - {""}
            assert labels
            assert all("(" in label or label in COUNTED for label in labels), labels


def test_the_frame_averaging_figure_marks_every_printed_value():
    """24 printed accuracies, at the values of the table."""
    printed = []
    for axes in draw("chen2023/table-4").axes:
        for line in axes.lines:
            if line.get_label().startswith("printed"):
                printed += list(line.get_ydata())
    cells = [
        r for r in ledger.build(["chen2023/table-4"]).records if r.unit == "arcsec"
    ]
    np.testing.assert_allclose(sorted(printed), sorted(float(r.printed) for r in cells))


def test_the_commit_of_an_unchanged_checkout_is_named(tmp_path):
    """Where a file differs, or nothing is known of commits, none is claimed."""

    def git(*words):
        me = ("-c", "user.name=A", "-c", "user.email=a@example.org")
        done = subprocess.run(
            ["git", *me, *words],
            cwd=tmp_path,
            check=True,
            capture_output=True,
            text=True,
        )
        return done.stdout.strip()

    named = version.commit.__wrapped__
    (tmp_path / "file").write_text("as committed", encoding="utf-8")
    assert named(tmp_path) == ""
    git("init", "--quiet")
    git("add", "file")
    assert named(tmp_path) == "", "no commit yet"
    git("commit", "--quiet", "--message", "First")
    assert named(tmp_path) == git("rev-parse", "HEAD")[:10] != ""
    (tmp_path / "file").write_text("changed", encoding="utf-8")
    assert named(tmp_path) == ""


def test_citation_and_export_name_the_same_software(table):
    name = version.software()
    assert name.startswith(f"reproduce-pointing {__version__}, {RELEASED}")
    assert name in citation(KEY, "bibtex")
    assert json.loads(rp.table(KEY).export("json"))["software"] == name


# What each form begins a line with that says something of the file.
COMMENTS = {"csv": "# ", "latex": "% ", "markdown": ""}
STUDY, FOCAL = "chen2023/heat", "chen2023/table-2#tracker-focal-length.value"


def said(text, form):
    """Return what an export says of itself."""
    if form == "json":
        found = json.loads(text)
        return {name: found[name] for name in ("software", "citation")}
    lead = COMMENTS[form]
    lines = text.splitlines()
    if form == "markdown":
        assert lines[0] == "<!--"
        lines = lines[1 : lines.index("-->")]
    head = [
        line.removeprefix(lead)
        for line in takewhile(lambda line: line.startswith(lead), lines)
    ]
    software, citation, *papers = head
    assert software.startswith("software: ")
    assert citation.startswith("citation: ")
    cited = "\n".join((citation.removeprefix("citation: "), *papers))
    return {"software": software.removeprefix("software: "), "citation": cited}


@pytest.mark.parametrize("commit", ["", "0123456789"])
def test_an_export_names_version_commit_and_citation(commit, monkeypatch):
    monkeypatch.setattr(version, "commit", lambda root: commit)
    source = f" {__version__}, {RELEASED}, commit {commit or 'not recorded'}"
    for address, form in itertools.product((KEY, CELLS[0], STUDY), FORMATS):
        found = said(rp.table(address).export(form), form)
        assert found["software"].endswith(source)
        assert found["citation"] == citation(address, "text")
    cell = citation(CELLS[0], "text")
    assert verify(cell.splitlines()[0]) == "unchanged"


@pytest.mark.parametrize("key", [STUDY, "niu2024/scale-errors"])
def test_a_table_of_our_own_reads_back_equal(key):
    table = rp.table(key)
    frame = table.frame()
    words = {name: str for name in frame if pd.api.types.is_string_dtype(frame[name])}
    read = read_csv(table.export("csv"), dtype=words)
    pd.testing.assert_frame_equal(read, frame, check_dtype=False, rtol=1e-15)
    rows = json.loads(table.export("json"))["rows"]
    pd.testing.assert_frame_equal(
        pd.DataFrame(rows), frame, check_dtype=False, check_exact=True
    )
    lines = markdown(table.export("markdown"))
    assert len(lines) == 2 + len(frame)


def test_a_readers_own_setting_is_named_in_the_file():
    changed = rp.table(STUDY).rerun({FOCAL: "70 mm"})
    text = changed.export("csv")
    setting = next(line for line in text.splitlines() if line.startswith("# setting: "))
    assert f"{FOCAL} = 70 mm" in setting
    assert json.loads(changed.export("json"))["setting"] == setting.removeprefix(
        "# setting: "
    )
    assert "# setting" not in rp.table(STUDY).export("csv")


def test_a_fit_of_ones_own_stars_says_what_made_it():
    fit = rp.register([[0, 0], [99, 0], [0, 99]], [[3, 0], [102, 0], [3, 99]])
    found = said(fit.export("csv"), "csv")
    assert found == {
        "software": version.software(),
        "citation": citation("all", "text"),
    }
    assert len(read_csv(fit.export("csv"))) == len(fit.frame())


def test_pictures_say_what_made_them(tmp_path):
    figure = rp.figure("niu2024/fig-4")
    cited = figure.cite("text").splitlines()[1]
    assert cited in (figure.save(tmp_path / "a.svg")).read_text(encoding="utf-8")
    with Image.open(figure.save(tmp_path / "a.png")) as picture:
        assert version.software() in picture.info["Description"]
        assert cited in picture.info["Description"]
    assert b"reproduce-pointing" in (figure.save(tmp_path / "a.pdf")).read_bytes()
    assert "<metadata>" not in figure._repr_html_()


@pytest.mark.parametrize("address", ["all", KEY, CELLS[0], STUDY])
def test_ris_and_bibtex_are_read_by_others(address):
    papers = list(PAPERS) if address == "all" else [address.split("/")[0]]
    read = rispy.loads(citation(address, "ris"))
    assert [one["type_of_reference"] for one in read] == [
        "COMP",
        *["JOUR"] * len(papers),
    ]
    entries = parse_string(citation(address, "bibtex"), "bibtex").entries
    assert list(entries)[1:] == papers
    for one, entry in zip(read, entries.values(), strict=True):
        assert one["title"] == re.sub(r"[{}\\]", "", entry.fields["title"])
        assert one["year"] == entry.fields["year"]
        assert one.get("doi") == entry.fields.get("doi")


def test_a_cell_is_cited_with_print_result_verdict_and_mark():
    for address in CELLS:
        record = ledger.build([address.partition("#")[0]]).cell(address)
        ours, paper = citation(address, "text").splitlines()
        assert ours.startswith(f"{address}: printed {record.printed}")
        assert f", {record.verdict}. reproduce-pointing " in ours
        assert "doi:10." in paper
        entries = parse_string(citation(address, "bibtex"), "bibtex").entries
        note = next(iter(entries.values())).fields["note"]
        assert re.search(r"rp:[0-9a-f]{12}$", ours)[0] == note


def cited(said, source):
    return f"{said}. {version.NAME} {source}. {_mark(said)}"


@pytest.mark.parametrize("address", CELLS)
def test_a_citation_checks_itself(address, monkeypatch):
    text = citation(address, "text")
    assert verify(text) == verify(text.partition("\n")[0]) == "unchanged"
    assert verify(text.replace("printed ", "printed 1")).startswith("not confirmed")
    assert verify("some words").startswith("not confirmed")
    record = ledger.build([address.partition("#")[0]]).cell(address)
    now, older, source = (
        _statement_of(record),
        f"{address}: printed 1, exact",
        "0.0.1, 2026-01-01, x",
    )
    gone = older.replace("#", "#no-")
    for said in (older, gone, now):
        assert verify(cited(said, source)).startswith(
            "well-formed, not known to this package"
        )
    known = {source: [_mark(older), _mark(gone)], "0.0.2, 2026-01-02, y": [_mark(now)]}
    monkeypatch.setattr(exporting, "released", lambda: known)
    told = verify(cited(older, source))
    assert told.startswith(f"moved since {source}: now {now}, for ")
    assert told.endswith(ledger.reason(address) or record.why)
    assert verify(cited(gone, source)).startswith(f"moved since {source}: now ")
    assert verify(cited(now, "0.0.2, 2026-01-02, y")) == "unchanged"


def test_a_citation_of_an_unknown_source_is_not_unchanged(monkeypatch):
    monkeypatch.setattr(version, "commit", lambda root: "0123456789")
    text = citation(CELLS[0], "text")
    for own, other in (
        (__version__, "9.9.9"),
        (RELEASED, "1999-01-01"),
        ("0123456789", "deadbeef00"),
    ):
        assert own in text
        assert verify(text.replace(own, other)).startswith("well-formed, not known")
    claim = f"{CELLS[0]}: printed 0.9973, recomputed 0.9973 [0.9972, 0.9974], exact"
    assert verify(cited(claim, version.version())).startswith("well-formed, not known")


def test_to_verify_a_long_text_takes_linear_time():
    for text in ("a", "#", "a#", "a#: printed ", ". reproduce-pointing ", "rp:"):
        times = []
        for size in (8_000, 128_000):
            begin = time.process_time()
            assert verify(text * (size // len(text))).startswith("not confirmed")
            times.append(time.process_time() - begin)
        assert times[1] < 60 * max(times[0], 0.002), text


def test_what_is_no_text_is_refused():
    for wrong in (None, 5, ["niu2024/table-3"], b"niu2024/table-3"):
        with pytest.raises(TypeError, match=r"^address: "):
            rp.cite(wrong)
        with pytest.raises(TypeError, match=r"^citation: "):
            rp.verify(wrong)


def test_address_and_doi_of_a_published_book_stand_in_every_citation(monkeypatch):
    assert "url" not in citation(KEY, "bibtex")
    monkeypatch.setattr(exporting, "ADDRESS", "https://example.org/book")
    monkeypatch.setattr(exporting, "DOI", "10.1234/x")
    for address in (KEY, CELLS[0]):
        entries = parse_string(citation(address, "bibtex"), "bibtex").entries
        fields = next(iter(entries.values())).fields
        url = fields["url"].replace("\\#", "#")
        assert fields["doi"] == "10.1234/x"
        assert url.startswith("https://example.org/book/goto.html#")
        assert url in citation(address, "text")
        assert f"UR  - {url}" in citation(address, "ris")
