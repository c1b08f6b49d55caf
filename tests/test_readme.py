"""Tests of the commands, outputs and numbers in README."""

import re
import shlex
from pathlib import Path

import pytest
from click.testing import CliRunner

from reproduce.judge.verdicts import VERDICTS
from reproduce.views.cli import main

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


@pytest.fixture(scope="module")
def namespace() -> dict:
    (code,) = blocks("python")
    names: dict[str, object] = {}
    exec(compile(code, "README.md", "exec"), names)
    return names


def shown(text: str) -> list[str]:
    """Return the lines of a text without blanks at their ends."""
    return [line.rstrip() for line in text.splitlines() if line.strip()]


def test_first_commands_are_make_book_and_make_test():
    assert re.findall(r"^make \w+", blocks("sh")[0], re.MULTILINE) == [
        "make book",
        "make test",
    ]


def test_commands_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"^\.venv/bin/reproduce ([^\n]+)", README, re.MULTILINE)
    assert len(commands) >= 6
    for command in commands:
        result = CliRunner().invoke(main, shlex.split(command.partition("  #")[0]))
        assert result.exit_code == 0, f"{command}: {result.output}"


def test_console_example_shows_its_output(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    (example,) = blocks("console")
    command, *expected = shown(example)
    arguments = shlex.split(command.removeprefix("$ reproduce "))
    output = shown(CliRunner().invoke(main, arguments).output)
    assert expected.pop() == "..."
    assert output[: len(expected)] == expected


def test_counts_of_verdicts(monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    output = CliRunner().invoke(main, ["check"]).output
    *row, weak = re.search(r"^all +(.*)$", output, re.M)[1].split()
    stated = re.findall(r"^\| `(\w+)` \|.*\| (\d+) \|$", README, re.MULTILINE)
    assert stated == list(zip(VERDICTS, row, strict=True))
    agree = int(row[0]) + int(row[1])
    assert f"Of the {agree} numbers that agree, {weak} agree weakly" in README


def test_python_example(namespace):
    fit = namespace["fit"]
    assert fit.remarks == []
    scale, deviation = fit.frame().loc["scale", ["value", "standard deviation"]]
    # Both sides of the square, and both its heights, from target to target.
    assert abs(scale - (100.1 + 100.1 + 100.1 + 99.9) / 400) < 1e-4
    assert 1e-5 < deviation < 1e-2
    assert namespace["table"]["scale.red"].printed == "0.9973"


def test_printed_fit(namespace, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    (example,) = blocks("text")
    assert shown(str(namespace["fit"]))[: len(shown(example))] == shown(example)
