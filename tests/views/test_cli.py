"""The command line: what it prints, and with which exit code it ends."""

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
from click.testing import CliRunner

import reproduce as rp
from reproduce.judge import ledger
from reproduce.locate import data_folder
from reproduce.papers.catalogue import catalogue, studies
from reproduce.printed import cells
from reproduce.printed.cells import library
from reproduce.store.files import write_text
from reproduce.views import figure as figures
from reproduce.views import posteriors
from reproduce.views import register as registers
from reproduce.views.blocks import Grid, plain
from reproduce.views.cli import main
from reproduce.views.export import FORMATS

RANGE = "niu2024/text-simulation#range-x-high"
FIELDS = (
    "key cell printed unit role computed verdict flags tolerance share probability mcse why "
    "function equations seed"
).split()


def run(*arguments, columns=80):
    return CliRunner(env={"COLUMNS": str(columns), "TERM": "dumb"}).invoke(
        main, arguments
    )


def test_list_names_every_item_in_order_of_print():
    result = run("list")
    assert result.exit_code == 0
    shown = [
        line.split()[0]
        for line in result.stdout.splitlines()
        if re.search(r"(2024|2023)/", line)
    ]
    assert shown == [*catalogue(), *studies()]
    told = next(line for line in result.stdout.splitlines() if "chen2023/heat" in line)
    assert "supplementary table" in told


def test_check_of_everything_ends_with_zero():
    result = run("check")
    assert result.exit_code == 0, result.output
    assert "All 343 verdicts are as frozen." in result.stdout
    heads = "key exact cons. differs ambig. unpub. input weak".split()
    assert any(line.split() == heads for line in result.stdout.splitlines())


def test_check_of_one_item_as_json():
    result = run("check", "niu2024/table-2", "--json")
    records = json.loads(result.stdout)["records"]
    assert result.exit_code == 0
    assert len(records) == 8
    assert all(set(FIELDS) <= set(record) for record in records)
    first = records[0]
    assert (first["cell"], first["printed"], first["verdict"]) == (
        "niu2024/table-2#scale.red",
        "0.9976",
        "exact",
    )


def test_check_ends_with_one_and_names_the_cells_that_differ(monkeypatch):
    other = {
        "niu2024/table-2#scale.red": ledger.Expectation(
            verdict="differs", reason="for the test"
        )
    }
    real = ledger.frozen
    monkeypatch.setattr(ledger, "frozen", lambda: real() | other)
    result = run("check", "niu2024/table-2", "niu2024/table-1")
    assert result.exit_code == 1
    assert "niu2024/table-2#scale.red: expected differs, found exact" in result.stdout
    assert "Not as in data/verdicts.toml: 1 of 20; find the cause" in result.stdout
    assert result.stdout.count("expected") == 1


def test_check_names_the_file_with_a_changed_input(tmp_path, monkeypatch):
    """An input: no verdict notices such a digit."""
    shutil.copytree(data_folder() / "printed", tmp_path / "printed")
    path = tmp_path / "printed/niu2024/table-4.toml"
    content = path.read_text(encoding="utf-8").replace('"25.0304"', '"25.0305"', 1)
    path.write_text(content, encoding="utf-8")
    monkeypatch.setattr(cells, "data_folders", lambda: (tmp_path,))
    result = run("check", "niu2024/table-2")
    assert result.exit_code == 1
    assert "data/printed/niu2024/table-4.toml" in "".join(result.stdout.split())
    as_json = run("check", "niu2024/table-2", "--json")
    assert as_json.exit_code == 1
    assert json.loads(as_json.stdout)["altered"] == ["niu2024/table-4.toml"]


def test_check_takes_the_name_of_a_paper():
    found = rp.check("niu2024", "chen2023/table-5").ledger
    own = [key for key in catalogue() if key.startswith("niu2024/")]
    assert found.records == rp.check(*own, "chen2023/table-5").ledger.records
    assert {record.key for record in found.records} == {*own, "chen2023/table-5"} & set(
        library()
    )


def test_check_counts_weak_agreement_apart():
    """Table V's motions are differences of the positions beside them, its first less itself."""
    output = run("check", "chen2023/table-5").stdout
    (line,) = re.findall("^chen2023/table-5 +(.*)", output, re.MULTILINE)
    assert line.split()[-1] == "17"


def test_unknown_keys_get_suggestions_and_exit_code_two():
    for command in ("check", "show", "export --format csv", "cite"):
        result = run(*command.split(), "niu2024/tabel-3")
        assert result.exit_code == 2
        assert "niu2024/table-3" in result.stderr


def test_tables_fit_80_columns_uncut():
    for command in (["list"], ["check"], *(["show", key] for key in catalogue())):
        result = run(*command)
        assert result.exit_code == 0
        assert max(len(line) for line in result.stdout.splitlines()) <= 80, command
        assert "…" not in result.stdout


def test_show_puts_computed_beside_printed():
    lines = run("show", "niu2024/table-3").stdout.splitlines()
    row = next(line for line in lines if line.startswith("rotation.red "))
    assert row.split() == ["rotation.red", "0.0698°", "0.0700", "consistent"]


def test_figures_are_written(tmp_path):
    for ending, start in ((".svg", b"<?xml"), (".pdf", b"%PDF"), (".png", b"\x89PNG")):
        out = tmp_path / f"figure{ending}"
        result = run("figure", "niu2024/fig-4", "--out", str(out))
        assert result.exit_code == 0, result.output
        assert out.read_bytes().startswith(start)


LINES = "x,y,x_reference,y_reference\n0,0,1,2\n9,0,10,2\n0,9,1,11.1\n9,9,10,11\n"
SKY = np.random.default_rng(4)
STARS = SKY.uniform(0, 500, (20, 2)).round(2)


@pytest.fixture
def lists(tmp_path):
    """Two lists of stars, of which the second is shifted, and a table of matched stars."""
    for name, points in (
        ("a.csv", STARS),
        ("b.csv", STARS + SKY.normal((3, -4), 0.01, (20, 2))),
    ):
        rows = (f"{x},{y},{1e4 - i}" for i, (x, y) in enumerate(points))
        (tmp_path / name).write_text("\n".join(["x,y,flux", *rows]))
    (tmp_path / "matched.csv").write_text(LINES)
    return tmp_path


# Commands with an output, without the name of the file or folder.
OUTPUTS = {
    "figure": ["figure", "niu2024/fig-4", "--out"],
    "posterior": ["posterior", "registration", "--json", "--out"],
}
UNWRITABLE = ("missing/x", "a.csv/x", "folder", "locked/x")
REFUSED = [
    *(("figure", f"{place}.svg") for place in UNWRITABLE),
    *(("posterior", f"{place}.csv") for place in UNWRITABLE),
    *((command, "x.bmp") for command in ("figure", "posterior")),
]


@pytest.mark.parametrize(("command", "place"), REFUSED)
def test_an_output_is_checked_before_the_computation(
    lists, monkeypatch, command, place
):
    monkeypatch.chdir(lists)
    for name in ("folder.svg", "folder.csv", "locked"):
        (lists / name).mkdir()

    def access(path, mode):
        return "locked" not in str(path)

    monkeypatch.setattr(os, "access", access)  # root may write everywhere

    def computed(*_, **__):
        pytest.fail("computed")

    for module, name in (
        (figures, "Figure"),
        (registers, "register"),
        (posteriors, "posterior"),
    ):
        monkeypatch.setattr(module, name, computed)
    before = sorted(lists.rglob("*"))
    result = run(*OUTPUTS[command], place)
    assert result.exit_code == 2, result.output
    assert OUTPUTS[command][-1] in result.stderr
    assert sorted(lists.rglob("*")) == before
    if "--json" in OUTPUTS[command]:
        assert set(json.loads(result.stdout)) == {"error"}


def test_json_stays_one_document_if_the_disk_is_full(lists, monkeypatch):
    """The result is printed, the error goes to standard error, and an older file stays."""
    monkeypatch.chdir(lists)
    old = lists / "old.csv"
    old.write_text("old")

    def full(*_, **__):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    class Saved:
        """A posterior that is sampled at once."""

        check_file = staticmethod(lambda path: path)

        def sample(self, progress):
            progress(1, 1)

        def record(self):
            return {"parameters": []}

        print = None

        def save(self, path):
            write_text(path, "new")

    monkeypatch.setattr(posteriors, "posterior", lambda *_, **__: Saved())
    monkeypatch.setattr(Path, "replace", full)
    result = run(*OUTPUTS["posterior"], old.name)
    assert result.exit_code == 1
    assert "parameters" in json.loads(result.stdout)
    assert f"cannot write {old.name}: No space left" in result.stderr
    assert old.read_text() == "old"
    assert len(list(lists.iterdir())) == 4


def test_every_width_of_a_terminal_shows_something():
    for columns in ("0", "1", "text", "-4", str(10**9)):
        for command in (["list"], ["show", "niu2024/table-3"], ["--help"]):
            result = run(*command, columns=columns)
            assert result.exit_code == 0, result.output
            assert 200 < len(result.stdout) < 300_000


def closed(stream, *command, **settings):
    """Run a command with a closed standard stream."""
    line = shlex.join([sys.executable, "-m", "reproduce", *command])
    return subprocess.run(
        f"{line} {stream}&-",
        shell=True,
        capture_output=True,
        text=True,
        check=False,
        **settings,
    )


def test_a_closed_stream_is_no_traceback():
    for stream, command, code in (
        (">", ["list"], 0),
        ("<", ["register", "-"], 2),
        ("2>", ["check", "niu2024/table-2"], 0),
    ):
        result = closed(stream, *command)
        assert result.returncode == code
        assert "Traceback" not in result.stderr


def test_an_interrupt_during_the_imports_is_one_line():
    """The module that is imported first raises what Ctrl-C raises."""
    code = (
        "import sys, runpy\n"
        "class Stop:\n"
        "    def find_spec(self, name, *_):\n"
        "        if name == 'numpy': raise KeyboardInterrupt\n"
        "sys.meta_path.insert(0, Stop())\n"
        "runpy.run_module('reproduce', run_name='__main__')\n"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=False
    )
    assert (result.returncode, result.stdout, result.stderr) == (1, "", "Aborted!\n")


def test_memory_that_does_not_suffice_is_one_line(monkeypatch):
    def full(*_, **__):
        raise MemoryError

    monkeypatch.setattr(registers, "register", full)
    result = run("register", "a.csv", "--json")
    assert result.exit_code == 1
    assert "memory" in json.loads(result.stdout)["error"]


@pytest.mark.parametrize(
    "name", ["a\x1b[31mRED.fits", "a\x1b[31mRED.csv", "a\x9b2J.csv", "a\rb.csv"]
)
def test_control_characters_of_a_file_name_are_escaped(lists, monkeypatch, name):
    monkeypatch.chdir(lists)
    missing = run("register", name, "b.csv")
    assert missing.exit_code == 2
    (lists / "a.csv").rename(lists / name.replace("fits", "csv"))
    shown = run("register", name.replace("fits", "csv"), "b.csv")
    assert shown.exit_code == 0, shown.output
    for text in (missing.stderr, shown.stdout):
        assert not re.search(r"[\x00-\x09\x0b-\x1f\x7f-\x9f]", text)
        assert repr(name[1])[1:-1] in text


def test_exporting_a_figure_writes_its_data():
    text = run("export", "niu2024/fig-4", "--format", "csv").stdout.strip()
    comments = "".join(
        f"{name}: {said}\n"
        for name, said in rp.figure("niu2024/fig-4").provenance.items()
    )
    assert text.startswith("".join(f"# {line}\n" for line in comments.splitlines()))
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    assert lines[0] == '"panel","curve","x","y"'
    assert len(lines) == 1 + len(rp.figure("niu2024/fig-4").data)


def test_show_takes_a_cell():
    result = run("show", "niu2024/table-2#scale.red")
    assert result.exit_code == 0
    assert re.search("printed +0.9976 *\n", result.output)
    assert re.search("verdict +exact", result.output)


def test_show_reruns_under_a_change():
    noise = "niu2024/text-simulation#noise=0.2 px"
    result = run(
        "show", "niu2024/table-3", "--set", noise, "--seed", "7", "--replicates", "50"
    )
    assert result.exit_code == 0, result.output
    assert "noise = 0.2 px, seed = 7, replicates = 50" in " ".join(
        result.output.split()
    )
    assert max(map(len, result.output.splitlines())) <= 80
    for verdict in ("differs", "consistent"):
        assert verdict not in result.output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["show", "niu2024/table-3#scale.green"], "has no cell 'scale.green'"),
        (
            ["show", "niu2024/table-3", "--set", "noise"],
            "--set noise: expected CELL=VALUE",
        ),
        (["show", "niu2024/table-3", "--option", "noise"], "expected NAME=ALTERNATIVE"),
        (["show", "niu2024/table-3", "--set", "noise=1"], "noise: expected"),
        (["show", "niu2024/fig-4", "--seed", "1"], "seed: expected"),
        (["show", "niu2024/table-2", "--seed", "1"], "seed: expected"),
        (
            ["figure", "niu2024/fig-4", "--seed", "1", "--out", "x.svg"],
            "seed: expected",
        ),
        (
            ["show", "niu2024/table-3", "--option", "angle=square"],
            "angle: expected",
        ),
        (
            ["show", "niu2024/table-3", "--option", "angles=round"],
            "angles: expected",
        ),
        (
            ["show", "niu2024/table-3", "--replicates", "100001"],
            "from 2 to 100,000, got 100001",
        ),
        (["export", "niu2024/table-3#x", "--format", "csv"], "has no cell 'x'"),
        (
            ["audit", "nobody2000"],
            "paper: expected one of niu2024",
        ),
    ],
)
def test_slips_in_addresses_and_changes_are_told(arguments, message):
    result = run(*arguments)
    assert result.exit_code == 2
    assert message in " ".join(result.output.split())


def test_a_figure_is_drawn_under_a_change(tmp_path):
    drawn = []
    for name, change in (("plain", []), ("wider", ["--set", f"{RANGE}=10 deg"])):
        out = tmp_path / f"{name}.svg"
        result = run("figure", "niu2024/fig-4", *change, "--out", str(out))
        assert result.exit_code == 0, result.output
        drawn.append(out.read_text(encoding="utf-8"))
    assert drawn[0] != drawn[1]


def test_a_figure_is_drawn_with_a_seed_and_says_how(tmp_path):
    drawn = []
    for seed in ("7", "7", "8"):
        out = tmp_path / "drawn.svg"
        result = run("figure", "chen2023/fig-8", "--seed", seed, "--out", str(out))
        assert result.exit_code == 0, result.output
        drawn.append(out.read_text(encoding="utf-8"))
    assert drawn[0] == drawn[1] != drawn[2]
    shown = " ".join(run("show", "chen2023/fig-8", "--seed", "7").output.split())
    assert "With seed = 7: your setting" in shown
    assert "`reproduce figure chen2023/fig-8 --out FILE.svg`" in shown


def test_one_cell_is_exported():
    for form in FORMATS:
        result = run("export", "niu2024/table-2#scale.red", "--format", form)
        assert result.exit_code == 0
        assert "0.9976" in result.output
        assert "scale.blue" not in result.output


def test_a_study_and_a_figure_have_no_replicates_and_no_options():
    for key in ("chen2023/heat", "niu2024/fig-4"):
        for option in (("--replicates", "9"), ("--option", "a=b")):
            result = run("show", key, *option)
            assert result.exit_code == 2
            assert key in result.output


def test_a_table_of_our_own_is_cited_beside_its_paper():
    for form in ("bibtex", "csl", "text"):
        result = run("cite", "chen2023/heat", "--format", form)
        assert result.exit_code == 0, result.output
        assert "Study beside Chen et al. (2023)" in result.stdout


def test_a_table_of_our_own_is_not_judged():
    result = run("check", "chen2023/heat")
    assert result.exit_code == 2
    assert "supplementary table chen2023/heat" in " ".join(
        result.stderr.replace("│", " ").split()
    )


def test_terminals_lose_no_word():
    """Every word of every entry appears at 80, 60 and 40 columns."""
    cells = [f"niu2024/table-3#{name}" for name in ("scale.red", "rotation.blue")]
    for address in (*cells, "chen2023/table-5#3.monitoring-x", "chen2023/table-4"):
        grids = [b for b in rp.table(address).blocks() if isinstance(b, Grid)]
        entries = [entry for grid in grids for row in grid.rows for entry in row]
        words = {word for entry in entries for word in plain(entry).split()}
        for width in (80, 60, 40):
            shown = run("show", address, columns=width).stdout
            # A word that is longer than the terminal continues on the next line.
            joined = re.sub(r"\s+", "", shown)
            lost = {word for word in words if word not in shown and word not in joined}
            assert lost == set(), (address, width)
            assert max(map(len, shown.splitlines())) <= width


@pytest.mark.parametrize("command", ["", "check", "show", "list", "audit", "posterior"])
def test_an_example_of_the_help_has_its_output(command):
    text = run(*command.split(), "--help", columns=100).stdout
    example, expected = re.search(r"\$ reproduce (.*)\n((?: {4}.*\n)+)", text).groups()
    output = run(*shlex.split(example), columns=80).stdout.splitlines()
    lines = [" ".join(line.split()) for line in output]
    told = [" ".join(line.split()) for line in expected.splitlines()]
    told = [line for line in told if line.strip("─") and "..." not in line]
    assert len(told) > 1
    assert set(told) <= set(lines)
