"""Wrong input on the command line: a message and exit code 2, no traceback."""

import os
import pty
import re
import subprocess
import sys
import time

import pytest
from click.testing import CliRunner
from hypothesis import assume, given, settings, strategies

import reproduce as rp
from reproduce.papers.catalogue import catalogue
from reproduce.views.cli import main

INCOMPLETE = (
    "show|export niu2024/table-1|export niu2024/table-1 --format xls|figure niu2024/fig-4"
    "|cite niu2024/table-1 --format apa|nothing|check --nothing|show niu2024/table-3#"
    "|posterior registration --data /dev/zero"
)


def invoke(*arguments, columns=80):
    environment = {"COLUMNS": str(columns), "TERM": "dumb"}
    return CliRunner(env=environment).invoke(main, arguments)


@settings(max_examples=60, deadline=None, derandomize=True, database=None)
@given(
    strategies.sampled_from(["check", "show", "cite"]),
    strategies.text(min_size=1, max_size=30),
)
def test_any_key_is_known_or_rejected(command, key):
    assume(key not in catalogue())
    result = invoke(command, "--", key)
    assert (result.exit_code, type(result.exception)) == (2, SystemExit)
    assert "key: expected" in " ".join(result.stderr.split())


def test_incomplete_commands_are_rejected():
    for command in INCOMPLETE.split("|"):
        result = invoke(*command.split())
        assert (result.exit_code, type(result.exception)) == (2, SystemExit)
        assert result.stderr.splitlines()[-1].startswith("Error: ")


def test_a_terminal_shows_the_progress_on_standard_error():
    ours, process_end = pty.openpty()
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "80"}
    command = [sys.executable, "-m", "reproduce", "check", "--json"]
    with subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=process_end, env=environment
    ) as process:
        os.close(process_end)
        shown = b""
        while True:
            try:
                shown += os.read(ours, 4096)
            except OSError:  # the process has ended
                break
    os.close(ours)
    assert process.returncode == 0
    assert b"recomputing" in shown or b"done " in shown


def test_output_is_utf_8_for_any_encoding_of_the_stream():
    for encoding, command in (
        ("ascii", "show niu2024/table-3"),
        ("cp1252", "audit chen2023"),
    ):
        environment = os.environ | {"PYTHONIOENCODING": encoding, "COLUMNS": "80"}
        arguments = [sys.executable, "-m", "reproduce", *command.split()]
        result = subprocess.run(
            arguments, capture_output=True, env=environment, check=True
        )
        assert result.stderr == b""
        assert re.search(r"−\d+\.\d", result.stdout.decode("utf-8"))


def test_a_narrow_terminal_names_every_cell():
    names = [
        cell.partition("#")[2] for cell in rp.table("niu2024/table-3").cells()["cell"]
    ]
    for columns in (24, 40, 60):
        lines = invoke("show", "niu2024/table-3", columns=columns).stdout.splitlines()
        assert max(map(len, lines)) <= columns
        assert all(any(line.startswith(name) for line in lines) for name in names)


def test_infinite_values_and_devices_are_rejected():
    address = "niu2024/text-simulation#noise"
    for value in (10**400, -(10**400), float("inf"), float("nan"), True, "1e999"):
        with pytest.raises(ValueError, match=address):
            rp.table("niu2024/table-3").rerun({address: value})
    with pytest.raises(ValueError, match=r"^/dev/zero: expected"):
        rp.register("/dev/zero")


def test_the_time_to_read_a_wide_table_is_linear(tmp_path):
    sizes, rows = (2_000, 20_000), ("0,0,1,2", "9,0,10,2.1", "0,9,1,11.1", "9,9,10,11")
    times = {size: [] for size in sizes}
    for columns in sizes:
        names = ",".join(f"c{index}" for index in range(columns))
        lines = [f"x,y,x_reference,y_reference,{names}"]
        lines += [row + ",1" * columns for row in rows]
        (tmp_path / f"{columns}.csv").write_text("\n".join(lines))
    for columns in sizes * 4:
        begin = time.process_time()
        rp.register(tmp_path / f"{columns}.csv")
        times[columns].append(time.process_time() - begin)
    small, large = (min(times[size]) for size in sizes)
    assert large < 30 * small
