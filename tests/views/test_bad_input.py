"""Nonsense on the command line ends in a message and exit code two, never in a traceback."""

import os
import pty
import subprocess
import sys

import pytest
from click.testing import CliRunner
from hypothesis import assume, given, settings, strategies

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
    assert "unknown key" in result.stderr


@pytest.mark.parametrize(
    "arguments",
    [
        ["show"],
        ["export", "niu2024/table-1"],
        ["export", "niu2024/table-1", "--format", "xls"],
        ["cite", "niu2024/table-1", "--format", "ris"],
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
    assert result.stderr.startswith("Usage")


def test_a_terminal_sees_the_progress():
    """On a terminal the bar appears on standard error and is gone at the end."""
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
