"""Wrong input on the command line: a message and exit code 2, no traceback."""

import os
import pty
import re
import subprocess
import sys

import pytest

import reproduce as rp


def test_a_terminal_shows_the_progress_on_standard_error():
    ours, process_end = pty.openpty()
    environment = os.environ | {"TERM": "xterm", "COLUMNS": "80"}
    command = [sys.executable, "-m", "reproduce", "posterior", "averaging-x"]
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
    assert re.search(b"sampling.* 100%", shown)


def test_output_is_utf_8_for_any_encoding_of_the_stream():
    environment = os.environ | {"PYTHONIOENCODING": "cp1252", "COLUMNS": "80"}
    arguments = [sys.executable, "-m", "reproduce", "show", "niu2024/table-3"]
    result = subprocess.run(arguments, capture_output=True, env=environment, check=True)
    assert result.stderr == b""
    assert re.search(r"−\d+\.\d", result.stdout.decode("utf-8"))


def test_infinite_values_and_devices_are_rejected():
    address = "niu2024/text-simulation#noise"
    for value in (10**400, float("inf"), float("nan"), True, "1e999"):
        with pytest.raises(ValueError, match=address):
            rp.table("niu2024/table-3").rerun({address: value})
    with pytest.raises(ValueError, match=r"^/dev/zero: expected"):
        rp.register("/dev/zero")
