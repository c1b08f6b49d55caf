"""Tests of the commands, outputs and numbers in README."""

import re
import shlex

import pytest
from commands import run
from places import ROOT

from reproduce.judge.verdicts import VERDICTS

README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"```{language}\n(.*?)```", README, re.DOTALL)


def lines(text):
    """Return the lines of a text without spaces at their ends."""
    return [line.rstrip() for line in text.splitlines() if line.strip()]


def test_commands_run_and_show_the_printed_output(tmp_path, monkeypatch):
    targets = re.findall(r"^make \w+", blocks("sh")[0], re.MULTILINE)
    assert targets == ["make book", "make test"]
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"^\.venv/bin/reproduce ([^\n]+)", README, re.MULTILINE)
    assert len(commands) >= 6
    for command in commands:
        result = run(shlex.split(command.partition("  #")[0]))
        assert result.exit_code == 0, f"{command}: {result.output}"
    (example,) = blocks("console")
    command, *expected = lines(example)
    output = lines(run(shlex.split(command.removeprefix("$ reproduce "))).output)
    assert expected.pop() == "..."
    assert output[: len(expected)] == expected


def test_links_are_absolute():
    targets = re.findall(r"\]\(([^)]*)\)", README)
    assert targets
    assert all(target.startswith("https://") for target in targets)


def test_counts_of_verdicts():
    (row,) = re.findall(r"^all +(.*)$", run("check", 200).output, re.MULTILINE)
    *counts, weak = row.split()
    stated = re.findall(r"^\| `(\w+)` \|.*\| (\d+) \|$", README, re.MULTILINE)
    assert stated == list(zip(VERDICTS, counts, strict=True))
    agree = int(counts[0]) + int(counts[1])
    assert f"Of the {agree} numbers that agree, {weak} agree weakly" in README


def test_python_example(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    (code,), (example,), names = blocks("python"), blocks("text"), {}
    exec(compile(code, "README.md", "exec"), names)
    fit = names["fit"]
    assert lines(str(fit))[: len(lines(example))] == lines(example)
    assert fit.remarks == []
    # Both sides and both heights of the square, from target to target.
    scale = fit.frame().loc["scale", "value"]
    assert scale == pytest.approx((100.1 + 100.1 + 100.1 + 99.9) / 400, abs=1e-4)
