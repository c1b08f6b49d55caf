"""Exports and citations, read by the readers of other software."""

import io
import json
import re
import runpy
import shutil
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import rispy
from commands import output_of, run
from numpy.testing import assert_allclose
from PIL import Image
from places import ROOT
from pybtex.database import parse_string
from simulated import star_table

import reproduce as rp
from reproduce import version
from reproduce.judge import ledger
from reproduce.judge.ledger import item_ledger, record_of
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import PAPERS, anchor, library
from reproduce.version import RELEASED, __version__
from reproduce.views import verify as verifying
from reproduce.views._export import FORMATS
from reproduce.views.citations import cite, identifiers, mark, statement
from reproduce.views.verify import verify

KEY, STUDY = "chen2023/table-5", "chen2023/heat"
CELLS = (
    "niu2024/table-3#scale.red",
    "chen2023/table-5#2.monitoring-x",
    "niu2024/table-1#focal-length.red",
)
FOCAL = "chen2023/table-2#tracker-focal-length.value"
COMMENTS = {"csv": "# ", "latex": "% ", "markdown": ""}


def read_csv(text, **settings):
    return pd.read_csv(io.StringIO(text), comment="#", **settings)


def rows_of(text):
    """Return the rows of a Markdown table; an empty line follows the comment before it."""
    lines = text.partition("-->\n\n")[2].splitlines()
    return [[part.strip() for part in line.strip("|").split("|")] for line in lines]


def provenance(text, form):
    """Return the software and the citation that an export names, as one text."""
    if form == "json":
        record = json.loads(text)
        return f"software: {record['software']}\ncitation: {record['citation']}"
    lines = text.removeprefix("<!--\n").splitlines()
    return "\n".join(line.removeprefix(COMMENTS[form]) for line in lines)


def first_entry(address):
    return next(iter(parse_string(cite(address, "bibtex"), "bibtex").entries.values()))


def test_json_has_all_values_and_csv_has_the_layout_of_the_paper():
    records, table = item_ledger(KEY).records, rp.table(KEY)
    read = ledger.Ledger.model_validate_json(table.export("json"))
    assert read.records == records
    frame = read_csv(table.export("csv"), dtype=str, keep_default_na=False)
    printed = library()[KEY]
    assert list(frame)[2:] == [column.label for column in printed.columns]
    assert list(dict.fromkeys(frame["row"])) == [row.label for row in printed.rows]
    lines = frame.set_index("value").drop(columns="row")
    for name, texts in (
        ("printed", [record.printed for record in records]),
        ("verdict", [r.verdict if r.unit else "" for r in records]),
    ):
        assert list(lines.loc[name].to_numpy().ravel()) == texts
    found = pd.to_numeric(lines.loc["recomputed"].to_numpy().ravel())
    numbers = [r.computed if r.function else np.nan for r in records]
    assert_allclose(found, numbers, atol=0.005)


def test_markdown_has_the_layout_of_the_table():
    printed = library()[KEY]
    rows = rows_of(rp.table(KEY).export("markdown").rpartition("\n\n")[0])
    assert {len(row) for row in rows} == {2 + len(printed.columns)}
    column = rows[0].index("Difference about Y")
    (state,) = (number for number, row in enumerate(rows) if row[0] == "State 2")
    shown = [row[column] for row in rows[state : state + 4]]
    assert shown == ["-0.040″", "-0.040ᵉ*", "-0.0410", "-0.0390"]


@pytest.mark.parametrize("key", [*library(), *catalogue("studies")])
def test_latex_is_balanced(key):
    """Every row has the columns of the table; braces, mathematics and environments close."""
    text = rp.table(key).export("latex")
    assert text.isascii()
    assert "nan &" not in text
    assert r"\footnotesize \par" not in text
    if key in library():
        results = any(r.computed is not None for r in item_ledger(key).records)
        assert ("recomputed in" in text) is results
    label = rf"\label{{tab:{anchor(key)}}}"
    assert (label in text) is (key in library())
    body = "\n".join(line for line in text.splitlines() if line[:1] != "%")
    bare = re.sub(r"\\[\\&%$#_{}]", "", body.replace("\\\\", ""))
    assert bare.count("{") == bare.count("}")
    assert bare.count("$") % 2 == 0
    assert not re.search(
        r"[#^_~<>]",
        re.sub(
            r"\$[^$]*\$|\\(label|cite){[^}]*}|>(?=[{\\])", "", bare.replace("~", "")
        ),
    )
    begun = re.findall(r"\\begin{(.*?)}", body)
    assert sorted(begun) == sorted(re.findall(r"\\end{(.*?)}", body))
    kinds = re.search(r"\\begin{(?:tabular|longtable)}{(.*)}", body)[1]
    columns = len(re.sub(">?{[^}]*}+", "", kinds))
    rows = body.partition(r"\midrule")[2].partition(r"\bottomrule")[0]
    counts = {len(re.findall(r"(?<!\\)&", r)) for r in rows.splitlines() if "&" in r}
    assert counts == {columns - 1}


def test_supplementary_tables_read_back_equal():
    for key in (STUDY, "niu2024/scale-errors", "chen2023/dichroic"):
        table = rp.table(key)
        frame = table.frame()
        text = dict.fromkeys(frame.select_dtypes(exclude="number"), str)
        read = read_csv(table.export("csv"), dtype=text)
        pd.testing.assert_frame_equal(read, frame, check_dtype=False, rtol=1e-15)
        rows = json.loads(table.export("json"), parse_constant=pytest.fail)["rows"]
        read = pd.DataFrame(rows).astype(frame.dtypes)
        pd.testing.assert_frame_equal(read, frame, check_dtype=False, check_exact=True)
        assert len(rows_of(table.export("markdown"))) == 2 + len(frame)
    assert "across it & 2.000 & 0.075 & 0.36 " in table.export("latex"), "as displayed"


def test_unknown_formats_are_named():
    for call, named in (
        (lambda: rp.table(KEY).export("xls"), "markdown, covariance, got 'xls'"),
        (lambda: rp.table(STUDY).export("xls"), "markdown, got 'xls'"),
        (lambda: rp.table("niu2024/table-2").export("covariance"), "got 'covariance'"),
        (lambda: cite(KEY, "apa"), "'apa'"),
    ):
        with pytest.raises(ValueError, match=f"^format: .*{named}"):
            call()
    for call, argument in (
        (rp.cite, "address"),
        (rp.verify, "citation"),
        (rp.table, "address"),
        (rp.table(KEY).__getitem__, "name"),
        (rp.posterior, "name"),
        (rp.figure, "key"),
        (rp.figure("niu2024/fig-4").save, "path"),
        (rp.figure("chen2023/fig-11").save, "path"),
    ):
        with pytest.raises(TypeError, match=f"^{argument}: "):
            call(["niu2024/table-3"])
    for address in ("chen2023/heat#x", "niu2024/fig-4#x", f"{KEY}#"):
        with pytest.raises(
            KeyError, match=f"^'key: .*'{address}'|^\"key: .*'{address}'"
        ):
            cite(address)


def test_exports_and_citations_are_plain_text():
    """An addition to HTML would be escaped."""
    texts = [rp.table(KEY).export(form) for form in FORMATS]
    texts += [cite(KEY, "ris"), cite(CELLS[0], "text"), cite(KEY, "sentence")]
    assert {type(text) for text in texts} == {str}


def test_citations_name_item_paper_and_authors():
    for key in catalogue():
        paper = key.split("/")[0]
        parsed = parse_string(cite(key, "bibtex"), "bibtex").entries
        assert list(parsed) == [f"reproduce-{key.replace('/', '-')}", paper]
        listed = json.loads(cite(key, "csl"))
        assert [entry["id"] for entry in listed] == list(parsed)
    assert "Table 3 of Niu et al. (2024)" in cite("niu2024/table-3", "text")


def test_the_sentence_of_a_cell_has_place_numbers_and_verdict():
    for address, parts in {
        f"{KEY}#4.motion-y": (
            "Table V, state 4, motion along Y, of",
            "60.66 µm",
            "“differs”",
        ),
        "chen2023/table-4#1.transform-x": ("1.16″ (3σ)", "gives 1.14", "99 %"),
        "niu2024/text-simulation#noise": ("Section 4.1, standard", "It is an input"),
        f"{KEY}#4.monitoring-y": ("The literal reading of the text gives",),
    }.items():
        sentence = rp.cite(address, "sentence")
        assert all(part in sentence for part in parts), sentence
        assert "(The reproduce-pointing developers, 2026;" in sentence
    # The numbers of the table are three standard deviations, also in the table of one cell.
    assert "1.16″ (3σ)" in str(rp.table("chen2023/table-4#1.transform-x"))


@pytest.mark.parametrize("commit", ["", "0123456789abcdef0123456789abcdef01234567"])
def test_formats_agree_and_have_version_commit_day_and_identifiers(commit, monkeypatch):
    monkeypatch.setattr(version, "commit", lambda *_: commit)
    for address in ("all", KEY, CELLS[0], STUDY):
        papers = list(PAPERS) if address == "all" else [address.split("/")[0]]
        read = rispy.loads(cite(address, "ris"))
        kinds = [entry["type_of_reference"] for entry in read]
        assert kinds == ["COMP", *["JOUR"] * len(papers)]
        entries = parse_string(cite(address, "bibtex"), "bibtex").entries
        assert list(entries)[1:] == papers
        for ris, entry in zip(read, entries.values(), strict=True):
            assert ris["title"] == re.sub(r"[{}\\]", "", entry.fields["title"])
            assert ris["year"] == entry.fields["year"]
            assert ris.get("doi") == entry.fields.get("doi")
        own, csl = read[0], json.loads(cite(address, "csl"))[0]
        assert own["edition"] == csl["version"] == __version__
        assert own["date"] == RELEASED.replace("-", "/")
        issued = "-".join(f"{part:02}" for part in csl["issued"]["date-parts"][0])
        assert issued == RELEASED
        known = ", ".join(identifiers(address).values())
        assert (known or None) == own.get("accession_number")
        assert (known or None) == csl.get("archive_location")
        assert (commit in known) is (
            f"commit {commit}" == own.get("custom1", "commit ")
        )
        assert csl.get("custom", {"commit": ""})["commit"] == commit


def test_bibtex_needs_no_sign_that_latex_does_not_know():
    for address in (
        "chen2023/table-5#2.reference-y",  # minus sign, seconds of arc
        "chen2023/table-3#1-1.x",  # standard deviations
        "chen2023/text-platform#sd-low",
        "niu2024/table-1#radial-distortion.red",  # powers
        "niu2024/text-approximations#cube-approximation",
    ):
        assert cite(address, "bibtex").isascii()
        title = first_entry(address).fields["title"]
        assert not re.search(r"[_^%&]", re.sub(r"\$[^$]*\$|\\.", "", title)), title


def test_identifiers_are_the_hashes_of_git():
    def identifier(path):
        return f"swh:1:cnt:{output_of('git', 'hash-object', path).strip()}"

    found = identifiers(CELLS[0])
    assert found["data"] == identifier(ROOT / "data/printed/niu2024/table-3.toml")
    file, _, line = record_of(CELLS[0]).line.rpartition(":")
    content, _, lines = found["function"].partition(";lines=")
    (path,) = (ROOT / "src").rglob(Path(file).name)
    assert content == identifier(path)
    first, last = map(int, lines.split("-"))
    assert first <= int(line) < last
    assert path.read_text("utf-8").splitlines()[first - 1].startswith("@reproduces")


def test_address_and_doi_are_those_of_the_environment_or_of_the_wheel(
    tmp_path, monkeypatch
):
    file = shutil.copy(version.__file__, tmp_path)
    for name in ("ADDRESS", "DOI"):
        monkeypatch.delenv(f"REPRODUCE_{name}", raising=False)
    assert runpy.run_path(file)["ADDRESS"] == ""
    monkeypatch.setenv("REPRODUCE_ADDRESS", "https://example.org/book/")
    monkeypatch.setenv("REPRODUCE_DOI", "10.1234/x")
    built = runpy.run_path(file)
    assert (built["ADDRESS"], built["DOI"]) == ("https://example.org/book", "10.1234/x")
    (tmp_path / "_commit").write_text(built["build_record"](ROOT), encoding="utf-8")
    monkeypatch.delenv("REPRODUCE_ADDRESS")
    monkeypatch.setenv("REPRODUCE_DOI", "10.1234/y")
    installed = runpy.run_path(file)
    assert installed["ADDRESS"] == "https://example.org/book"
    assert installed["DOI"] == "10.1234/y"
    assert installed["commit"]() == version.commit(ROOT)


def test_figures_are_drawn_equal_and_mark_every_printed_value(tmp_path):
    figure = rp.figure("niu2024/drawing-table-3")
    data = figure.data
    first, again = (figure.save(tmp_path / f"{i}.svg").read_bytes() for i in "ab")
    assert first == again
    assert figure.data.equals(data)
    across = data.query("panel == 1 and curve == 'curve 8'")
    assert_allclose(across["y"], [-0.5, 2.5])  # with margins of a quarter of 2
    lines = [
        line for axes in rp.figure("chen2023/table-4").drawn.axes for line in axes.lines
    ]
    marked = [line for line in lines if line.get_label().startswith("printed")]
    records = [r for r in item_ledger("chen2023/table-4").records if r.unit == "arcsec"]
    found = np.sort(np.concatenate([line.get_ydata() for line in marked]))
    ratios = sorted(float(r.printed) / r.computed for r in records)
    assert_allclose(found, ratios)


def test_the_commit_of_an_unchanged_checkout_is_named(tmp_path):
    """No commit is named if a file differs, or outside of a checkout."""

    def git(*words):
        user = ("-c", "user.name=A", "-c", "user.email=a@example.org")
        return output_of("git", *user, *words, cwd=tmp_path).strip()

    commit = version.commit.__wrapped__
    file = tmp_path / "file"
    file.write_text("as committed", encoding="utf-8")
    assert commit(tmp_path) == ""
    git("init", "--quiet")
    git("add", "file")
    assert commit(tmp_path) == "", "no commit yet"
    git("commit", "--quiet", "--message", "First")
    assert commit(tmp_path) == git("rev-parse", "HEAD") != ""
    file.write_text("changed", encoding="utf-8")
    assert commit(tmp_path) == ""


@pytest.mark.parametrize("commit", ["", "0123456789"])
def test_an_export_names_version_commit_and_citation(commit, monkeypatch):
    monkeypatch.setattr(version, "commit", lambda *_: commit)
    source = f"reproduce-pointing {__version__}, {RELEASED}, commit {commit or 'not recorded'}"
    assert version.software() == source
    for address in (KEY, CELLS[0], STUDY):
        for form in FORMATS:
            text = rp.table(address).export(form)
            stated = f"software: {source}\ncitation: {cite(address, 'text')}"
            assert provenance(text, form).startswith(stated)
    assert verify(cite(CELLS[0], "text").splitlines()[0]) == "current"


def test_a_user_setting_is_named_in_the_file():
    changed = rp.table(STUDY).rerun({FOCAL: "70 mm"})
    (setting,) = re.findall("^# setting: (.*)$", changed.export("csv"), re.MULTILINE)
    assert f"{FOCAL} = 70 mm" in setting
    assert json.loads(changed.export("json"))["setting"] == setting
    assert "# setting" not in rp.table(STUDY).export("csv")
    count = "niu2024/text-simulation#angle-count"
    figure = rp.figure("niu2024/fig-4").rerun({count: "41"})
    for view, named in (
        (changed, f"{FOCAL} = 70 mm"),
        (figure, f"{count} = 41"),
        (rp.posterior("registration", seed=5), "seed = 5"),
        (rp.table("niu2024/text-optics").rerun(centre="third"), "centre = third"),
    ):
        assert f" (changed: {named})." in view.cite("text")
        assert " (changed: " in view.cite()
    stars = rp.posterior("registration", star_table(), priors={"scale": (0.9, 1.1)})
    assert ", with other data (changed: prior of scale)." in stars.cite("text")


def test_panels_are_saved_cited_and_changed_together(tmp_path):
    panels = rp.figure("chen2023/fig-11")
    text = cite(panels.key, "text")
    assert panels.cite("text") == text
    assert re.search(r"Figure 11 of Chen et al\. .*; Monitoring accuracy", text)
    cell = panels[0].inputs[0]
    assert [cell in panel.changes for panel in panels.rerun({cell: "8 um"})] == [
        cell in panel.inputs for panel in panels
    ]
    paths = [tmp_path / f"fig-11{panel}.svg" for panel in "ab"]
    assert panels.save(tmp_path / "fig-11.svg") == paths == sorted(tmp_path.iterdir())
    written = run(f"figure {panels.key} --out {tmp_path / 'f.svg'}")
    assert written.output.split()[1:] == [
        f"{tmp_path / name}.svg" for name in ("fa", "fb")
    ]
    with pytest.raises(ValueError, match=r"^nothing: .*fig-11"):
        panels.rerun({"nothing": "1"})


def test_fits_and_figures_name_the_software(tmp_path):
    fit = rp.register([[0, 0], [99, 0], [0, 99]], [[3, 0], [102.00001, 0], [3, 99]])
    assert f"scale & 1 & {fit.parameters[0]:.12g} &" in fit.export("latex")
    text = fit.export("csv")
    software, cited = version.software(), cite("all", "text").splitlines()[0]
    assert text.startswith(f"# software: {software}\n# citation: {cited}\n")
    assert [*read_csv(text)["parameter"]] == [*fit.frame().index]
    figure = rp.figure("niu2024/fig-4")
    cited = figure.cite("text").splitlines()[1]
    svg, png, pdf = (figure.save(tmp_path / f"a.{e}") for e in ("svg", "png", "pdf"))
    with Image.open(png) as image:
        described = image.info["Description"]
    for text in (svg.read_text(encoding="utf-8"), described):
        assert cited in text
        assert software in text
    assert b"reproduce-pointing" in pdf.read_bytes()


def cited(text, source):
    """Return a citation as version 0.2.0 wrote it."""
    return f"{text}. {version.NAME} {source}. {mark(text)}"


@pytest.mark.parametrize("address", CELLS)
def test_a_citation_is_current_moved_or_unknown(address, monkeypatch):
    text, record = cite(address, "text"), record_of(address)
    line = text.splitlines()[0]
    assert f", {record.verdict}. reproduce-pointing " in line
    assert first_entry(address).fields["note"][-15:] == line[-15:]
    assert verify(text) == verify(line) == verify(line.replace(" ", "\n")) == "current"
    for wrong in (text.replace("printed ", "printed 1"), cite(address), "some words"):
        assert verify(wrong).startswith("unknown: its words")
        assert verify(wrong).endswith("not the citation of a cell as text")
    now, older = statement(record), f"{address}: printed 1, exact"
    gone, source = older.replace("#", "#no-"), "0.0.1, 2026-01-01, x"
    for unknown in (older, gone, now):
        assert verify(cited(unknown, source)).startswith("unknown: not stated")
    later = "0.0.2, 2026-01-02, y"
    known = {source: [mark(older), mark(gone)], later: [mark(now)]}
    monkeypatch.setattr(verifying, "released", lambda: known)
    moved = verify(cited(older, source))
    assert moved.startswith(f"moved since {source}: now {now}, for ")
    assert verify(cited(gone, source)).startswith(f"moved since {source}: now ")
    assert verify(cited(now, later)) == "current"


def test_a_citation_of_a_release_is_current_if_value_and_verdict_are(monkeypatch):
    """Version 0.2.0 stated addresses, units of the data files and six digits."""
    ((source, marks),) = verifying.released().items()
    start = f"{CELLS[0]}: printed 0.9973, recomputed 0.99756"
    found = {
        text: verify(cited(text, source)).partition(" ")[0]
        for text in (
            f"{start}3 [0.997538, 0.997587], differs",
            "niu2024/table-1#focal-length.red: printed 25.0601 mm, input",
        )
    }
    assert set(found.values()) == {"unknown:", "current"}
    assert len(marks) == len(set(marks))
    for digit, verdict, word in (
        (4, "differs", "current"),
        (9, "differs", "moved"),
        (4, "exact", "moved"),
    ):
        text = f"{start}{digit} [0, 1], {verdict}"
        monkeypatch.setattr(verifying, "released", lambda t=text: {source: [mark(t)]})
        assert verify(cited(text, source)).partition(" ")[0] == word


def test_a_citation_of_an_unknown_source_is_not_current(monkeypatch):
    monkeypatch.setattr(version, "commit", lambda *_: "0123456789")
    text = cite(CELLS[0], "text")
    claim = f"{CELLS[0]}: printed 0.9973, recomputed 0.9973 [0.9972, 0.9974], exact"
    wrong = [cited(claim, version.version())]
    for true in (f" {__version__},", RELEASED, "commit 0123456789"):
        assert true in text
        wrong.append(text.replace(true, true.replace("0", "9")))
    assert all(verify(one).startswith("unknown: not stated") for one in wrong)


def test_the_time_to_verify_is_linear():
    sizes = (8_000, 128_000)
    for text in ("a", "#", "a#", "(2026). ", "[a#b]: ", ". reproduce-pointing ", "rp:"):
        times = {size: [] for size in sizes}
        for size in sizes * 3:
            begin = time.process_time()
            assert verify(text * (size // len(text))).startswith("unknown: ")
            times[size].append(time.process_time() - begin)
        small, large = (min(times[size]) for size in sizes)
        assert large < 60 * max(small, 0.002), text


def test_citations_have_the_address_and_the_doi_of_a_published_book(monkeypatch):
    assert "url" not in cite(KEY, "bibtex")
    monkeypatch.setattr(version, "ADDRESS", "https://example.org/book")
    monkeypatch.setattr(version, "DOI", "10.1234/x")
    for address in (KEY, CELLS[0]):
        fields = first_entry(address).fields
        url = fields["url"].replace("\\#", "#")
        assert fields["doi"] == "10.1234/x"
        assert url.startswith("https://example.org/book/goto.html#")
        assert url in cite(address, "text")
        assert f"UR  - {url}" in cite(address, "ris")
        assert "swh:" not in cite(address, "text")
    for view in (
        rp.table(STUDY),
        rp.figure("niu2024/fig-2"),
        rp.figure("niu2024/drawing-channels"),
        rp.posterior("averaging-x"),
    ):
        anchor = json.loads(view.cite("csl"))[0]["URL"].partition("#")[2]
        assert f' id="{anchor}"' in view._repr_html_()
