"""The command line: outputs, errors and exit codes."""

import errno
import json
import os
import re
import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from commands import run, width, words

import reproduce as rp
from reproduce.judge import ledger
from reproduce.locate import data_folder
from reproduce.papers.catalogue import catalogue
from reproduce.printed import cells
from reproduce.printed.cells import library
from reproduce.store.files import write_text
from reproduce.views import figure as figures
from reproduce.views import posteriors
from reproduce.views import register as registers
from reproduce.views._blocks import Grid, plain

TABLE, FIGURE, NOISE = (
    "niu2024/table-3",
    "niu2024/fig-4",
    "niu2024/text-simulation#noise",
)


def output(command, columns=80):
    result = run(command, columns)
    assert result.exit_code == 0, result.output
    return result.stdout


def test_list_names_every_item_in_the_order_of_print():
    lines = [line.split() for line in output("contents").splitlines() if line]
    shown = [line[0] for line in lines if re.match(r"(niu2024|chen2023)/", line[0])]
    assert shown == [*catalogue(), *catalogue("studies")]


def test_check_selects_items_and_papers():
    records = json.loads(output("check niu2024/table-2 --json"))["records"]
    assert {record["key"] for record in records} == {"niu2024/table-2"}
    found = rp.check("niu2024", "chen2023/table-5").ledger
    keys = {key for key in library() if key.startswith("niu2024/")}
    assert {r.key for r in found.records} == keys | {"chen2023/table-5"}


def test_check_ends_with_one_and_names_changed_verdicts_and_inputs(
    tmp_path, monkeypatch
):
    cell, frozen = "niu2024/table-2#scale.red", ledger.frozen()
    wrong = frozen | {cell: ledger.Expectation(verdict="differs", reason="a test")}
    with monkeypatch.context() as patch:
        patch.setattr(ledger, "frozen", lambda: wrong)
        assert rp.check("niu2024/table-2").frame()["cell"].tolist() == [cell]
        result = run("check niu2024/table-2 niu2024/table-1")
    assert result.exit_code == 1
    assert f"{cell}: expected differs, found exact" in result.stdout
    assert result.stdout.count("expected") == 1
    # No verdict depends on this digit.
    shutil.copytree(data_folder() / "printed", tmp_path / "printed")
    path = tmp_path / "printed/niu2024/table-4.toml"
    text = path.read_text(encoding="utf-8").replace('"25.0304"', '"25.0305"', 1)
    path.write_text(text, encoding="utf-8")
    monkeypatch.setattr(cells, "data_folders", lambda: (tmp_path,))
    for option, file in (
        ("", "niu2024/table-4.toml"),
        (" --json", '"niu2024/table-4.toml"'),
    ):
        result = run(f"check niu2024/table-2{option}")
        assert result.exit_code == 1
        assert file in "".join(result.stdout.split())


# The messages of `rp.table` are tested there.
REJECTED = {
    "niu2024/table-3": ["check niu2024/tabel-3", "cite niu2024/tabel-3"],
    "--set": [f"show {TABLE} --set noise"],
    "--option": [f"show {TABLE} --option noise", f"show {TABLE} --option changes=1"],
    "seed": [f"figure {FIGURE} --seed 1 --out x.svg"],
    "angle": [f"show {TABLE} --option angle=square"],
    "only once": [
        f"show {TABLE} --option noise=green --option noise=green",
        f"show {TABLE} --set {NOISE}=0.1px --set {NOISE}=0.2px",
    ],
    "100,000 at most": [f"show {TABLE} --replicates 100001"],
    "chen2023/heat": ["show chen2023/heat --replicates 9"],
    "supplementary table": ["check chen2023/heat"],
}


def test_wrong_addresses_and_options_are_named():
    for named, commands in REJECTED.items():
        for command in commands:
            result = run(command)
            assert result.exit_code == 2, command
            assert named in words(result.output), command


def test_tables_fit_80_columns_and_lose_no_word():
    # Tables are tested with their objects.
    figures = (f"show {key}" for key in catalogue() if key not in library())
    for command in ("contents", "check", *figures):
        text = output(command)
        assert width(text) <= 80, command
        assert "…" not in text
    for address in ("chen2023/table-5#3.monitoring-x", "chen2023/table-4"):
        grids = (one for one in rp.table(address).blocks() if isinstance(one, Grid))
        entries = [plain(entry) for grid in grids for row in grid.rows for entry in row]
        every = set(" ".join(entries).split())
        for columns in (80, 60, 40):
            text = output(f"show {address}", columns)
            # A word that is longer than the terminal continues on the next line.
            joined = re.sub(r"\s+", "", text)
            assert {w for w in every if w not in text and w not in joined} == set()
            assert width(text) <= columns
    for columns in ("0", "1", "text", "-4", str(10**9)):
        for command in ("contents", f"show {TABLE}", "--help"):
            assert 200 < len(output(command, columns)) < 300_000


LINES = "x,y,x_reference,y_reference\n0,0,1,2\n9,0,10,2\n0,9,1,11.1\n9,9,10,11\n"
SKY = np.random.default_rng(4)
STARS = SKY.uniform(0, 500, (20, 2)).round(2)


@pytest.fixture
def lists(tmp_path, monkeypatch):
    """Change to a folder with two lists of stars and a table of matched stars."""
    shifted = STARS + SKY.normal((3, -4), 0.01, (20, 2))
    for name, points in (("a.csv", STARS), ("b.csv", shifted)):
        rows = (f"{x},{y},{1e4 - i}" for i, (x, y) in enumerate(points))
        (tmp_path / name).write_text("\n".join(["x,y,flux", *rows]))
    (tmp_path / "matched.csv").write_text(LINES)
    monkeypatch.chdir(tmp_path)
    return tmp_path


# Commands without the name of their output.
OUTPUTS = {
    "figure": f"figure {FIGURE} --out",
    "posterior": "posterior registration --json --out",
}


def test_outputs_are_checked_before_the_computation(lists, monkeypatch):
    def computed(*_, **__):
        pytest.fail("computed")

    monkeypatch.setattr(figures, "Figure", computed)
    monkeypatch.setattr(posteriors, "posterior", computed)
    before = sorted(lists.rglob("*"))
    for command in OUTPUTS.values():
        # The other targets are tested with `check_target`.
        for target in ("missing/x.svg", "x.bmp"):
            result = run(f"{command} {target}")
            assert result.exit_code == 2, (command, target)
            assert "--out" in result.stderr
            assert sorted(lists.rglob("*")) == before
            if "--json" in command:
                assert set(json.loads(result.stdout)) == {"error"}


def test_a_full_disk_or_memory_leaves_one_json_document_and_the_old_file(
    lists, monkeypatch
):
    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    def exhausted(*_, **__):
        raise MemoryError

    class Saved:
        """A posterior that is sampled at once."""

        check_file = staticmethod(lambda path: path)
        print = None

        def sample(self, progress):
            progress(1, 1)

        def record(self):
            return {"parameters": []}

        def save(self, path):
            write_text(path, "new")

    (lists / "old.csv").write_text("old")
    with monkeypatch.context() as patch:
        patch.setattr(posteriors, "posterior", lambda *_, **__: Saved())
        patch.setattr(Path, "replace", full)
        result = run(f"{OUTPUTS['posterior']} old.csv")
    assert result.exit_code == 1
    assert "parameters" in json.loads(result.stdout)
    assert "old.csv" in result.stderr
    assert (lists / "old.csv").read_text() == "old"
    assert len(list(lists.iterdir())) == 4
    monkeypatch.setattr(registers, "register", exhausted)
    result = run("register a.csv --json")
    assert result.exit_code == 1
    assert "memory" in json.loads(result.stdout)["error"]


def test_closed_streams_and_interrupts_leave_no_traceback():
    for stream, command, code in (
        (">&-", "show niu2024/table-1", 0),
        ("<&-", "register -", 2),
        ("2>&-", "check niu2024/table-2", 0),
        (">/dev/full", "show niu2024/table-1", 1),
    ):
        line = f"{shlex.quote(sys.executable)} -m reproduce {command} {stream}"
        result = subprocess.run(line, shell=True, capture_output=True, text=True)
        assert result.returncode == code, command
        assert "Traceback" not in result.stderr
        assert len(result.stderr.splitlines()) == code or stream != ">/dev/full"
    code = (  # Ctrl-C during the import of NumPy
        "import sys, runpy\n"
        "class Stop:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'numpy': raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Stop())\n"
        "runpy.run_module('reproduce', run_name='__main__')\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True
    )
    assert (result.returncode, result.stdout, result.stderr) == (1, "", "Aborted!\n")


def test_control_characters_of_a_file_name_are_escaped(lists):
    for name in ("a\x1b[31mRED.csv", "a\x9b2J.csv", "a\rb.csv"):
        missing = run(["register", name, "b.csv"])
        (lists / name).write_text((lists / "a.csv").read_text())
        shown = run(["register", name, "b.csv"])
        assert (missing.exit_code, shown.exit_code) == (2, 0)
        for text in (missing.stderr, shown.stdout):
            assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]", text)
            assert repr(name[1])[1:-1] in text


def test_figures_are_written_exported_and_drawn_under_changes(tmp_path):
    path = tmp_path / "wider.svg"
    changed = "--set niu2024/text-simulation#range-x-high=10deg"
    output(f"figure {FIGURE} {changed} --out {path}")
    plain = rp.figure(FIGURE).save(tmp_path / "plain.svg")
    assert path.read_text() != plain.read_text()
    shown = words(output("show chen2023/fig-8 --seed 7"))
    assert "seed = 7" in shown
    assert "`reproduce figure chen2023/fig-8 --out FILE.svg`" in shown
    text = output(f"export {FIGURE} --format csv").strip()
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines[0] == '"panel","curve","x","y"'
    assert len(lines) == 1 + len(rp.figure(FIGURE).data)
    for value in rp.figure(FIGURE).provenance.values():
        assert f": {value}".replace("\n", "\n# ") in text


def test_cells_are_shown_exported_and_rerun():
    text = output("show niu2024/table-2#scale.red")
    assert re.search("printed +0.9976 *\n", text)
    assert re.search("verdict +exact", text)
    assert "0.9976" in output("export niu2024/table-2#scale.red --format csv")
    changes = ["--set", f"{NOISE}=0.2 px", "--seed", "7", "--replicates", "50"]
    text = output(["show", TABLE, *changes])
    assert "noise = 0.2 px, seed = 7, replicates = 50" in words(text)
    assert width(text) <= 80
    assert "Chen et al. (2023)" in output("cite chen2023/heat --format bibtex")


def test_examples_of_the_help_are_real():
    """Each line of the shown output is a line of the output."""
    for command in ("", "check", "show", "contents", "audit", "posterior"):
        text = output(f"{command} --help", 100)
        pattern = r"\$ reproduce (.*)\n((?: {4}.*\n)+)"
        example, expected = re.search(pattern, text).groups()
        lines = {words(line) for line in run(shlex.split(example)).stdout.splitlines()}
        shown = [words(line) for line in expected.splitlines() if line.strip(" ─")]
        shown = [line for line in shown if "..." not in line]
        assert len(shown) > 1, command
        assert set(shown) <= lines, command
