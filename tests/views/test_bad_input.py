"""Nonsense on the command line ends in a message and exit code two, never in a traceback."""

import json
import os
import pty
import re
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner
from hypothesis import assume, given, settings, strategies

import reproduce as rp
from reproduce.papers.catalogue import catalogue
from reproduce.views.cli import main

COMMANDS = ["check", "show", "cite"]


@settings(max_examples=60, deadline=None, derandomize=True, database=None)
@given(strategies.sampled_from(COMMANDS), strategies.text(min_size=1, max_size=30))
def test_arbitrary_keys_are_refused_with_a_message(command, key):
    assume(key not in catalogue())
    result = CliRunner().invoke(main, [command, "--", key])
    assert result.exit_code == 2
    assert isinstance(result.exception, SystemExit)
    assert "key: expected" in " ".join(result.stderr.split())


@pytest.mark.parametrize(
    "arguments",
    [
        ["show"],
        ["export", "niu2024/table-1"],
        ["export", "niu2024/table-1", "--format", "xls"],
        ["cite", "niu2024/table-1", "--format", "apa"],
        ["figure", "niu2024/fig-4"],
        ["nothing"],
        ["check", "--nothing"],
        ["show", ""],
        ["show", "niu2024/table-3#scale.green"],
        ["show", "niu2024/table-3#"],
    ],
)
def test_incomplete_commands_are_refused(arguments):
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 2
    assert isinstance(result.exception, SystemExit)
    assert result.stderr.splitlines()[-1].startswith("Error: ")


def test_a_terminal_sees_the_progress():
    """On a terminal the bar appears on standard error."""
    ours, theirs = pty.openpty()
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "80"}
    with subprocess.Popen(
        [sys.executable, "-m", "reproduce", "check", "--json"],
        stdout=subprocess.DEVNULL,
        stderr=theirs,
        env=environment,
    ) as process:
        os.close(theirs)
        shown = b""
        while True:
            try:
                part = os.read(ours, 4096)
            except OSError:  # the other end is closed: the program has ended
                break
            shown += part
    os.close(ours)
    assert process.returncode == 0
    assert b"recomputing" in shown or b"done " in shown


@pytest.mark.parametrize("encoding", ["ascii", "cp1252"])
@pytest.mark.parametrize(
    "command", [["show", "niu2024/table-3"], ["audit", "chen2023"]]
)
def test_output_is_utf_8_for_any_encoding_of_the_stream(encoding, command):
    environment = os.environ | {"PYTHONIOENCODING": encoding, "COLUMNS": "80"}
    arguments = [sys.executable, "-m", "reproduce", *command]
    result = subprocess.run(arguments, capture_output=True, env=environment, check=True)
    assert result.stderr == b""
    assert re.search(r"−\d+\.\d", result.stdout.decode("utf-8"))


def test_a_stream_without_room_is_one_line():
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "reproduce", "show", "niu2024/table-1"]
        result = subprocess.run(
            command, stdout=full, stderr=subprocess.PIPE, check=False
        )
    assert result.returncode == 1
    assert result.stderr.decode().splitlines() == [
        "reproduce: cannot write: No space left on device"
    ]


@pytest.mark.parametrize("columns", [24, 40, 60])
def test_a_narrow_terminal_names_every_cell(columns):
    environment = {"COLUMNS": str(columns), "TERM": "dumb"}
    shown = CliRunner(env=environment).invoke(main, ["show", "niu2024/table-3"]).stdout
    lines = shown.splitlines()
    assert max(map(len, lines)) <= columns
    for cell in rp.table("niu2024/table-3").cells()["cell"]:
        assert any(line.startswith(cell.partition("#")[2]) for line in lines)


def test_a_deeply_nested_platform_is_refused(tmp_path):
    """The parser of TOML calls itself for each list in a list."""
    path = tmp_path / "deep.toml"
    path.write_text(f"a={'[' * 5000}{']' * 5000}")
    with pytest.raises(ValueError, match=r"deep\.toml: expected TOML"):
        rp.misalignment("-", platform=path)
    result = CliRunner().invoke(
        main, ["misalignment", "-", "--platform", str(path), "--json"]
    )
    assert result.exit_code == 2
    assert "deep.toml" in json.loads(result.stdout)["error"]


@pytest.mark.parametrize(
    "value", [10**400, -(10**400), float("inf"), float("nan"), True, "1e999"]
)
def test_a_value_beyond_all_numbers_is_refused(value):
    table = rp.table("niu2024/table-3")
    address = "niu2024/text-simulation#noise"
    with pytest.raises(ValueError, match=address):
        table.rerun({address: value})


@pytest.mark.parametrize("start", ["x", 5, (1, 0, 0)])
def test_a_start_that_is_no_registration_is_refused(start):
    stars = np.random.default_rng(1).uniform(0, 500, (20, 2))
    with pytest.raises((TypeError, ValueError), match=r"start: expected"):
        rp.match(stars, stars + 3, start=start)


def test_a_device_without_an_end_is_refused():
    with pytest.raises(ValueError, match=r"^/dev/zero: expected a"):
        rp.register("/dev/zero")
    assert (
        CliRunner()
        .invoke(main, ["posterior", "registration", "--data", "/dev/zero"])
        .exit_code
        == 2
    )


def test_a_wide_table_takes_linear_time(tmp_path):
    """A column that is not used costs as much as any other."""
    times = []
    for columns in (5_000, 100_000):
        names = ",".join(f"c{i}" for i in range(columns))
        numbers = ",1" * columns
        stars = ("0,0,1,2", "9,0,10,2.1", "0,9,1,11.1", "9,9,10,11")
        path = tmp_path / f"{columns}.csv"
        path.write_text(
            "\n".join(
                [f"x,y,x_reference,y_reference,{names}", *(s + numbers for s in stars)]
            )
        )
        begin = time.process_time()
        rp.register(path)
        times.append(time.process_time() - begin)
    assert times[1] < 60 * times[0]
