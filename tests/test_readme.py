"""What the README shows works as it stands there."""

import re
import shlex
from pathlib import Path

from click.testing import CliRunner

from reproduce.views.cli import main

README = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")


def test_the_first_commands_are_the_two_that_matter():
    first = re.search(r"```sh\n(.*?)```", README, re.DOTALL).group(1)
    assert re.findall(r"^make \w+", first, re.MULTILINE) == ["make book", "make test"]


def test_the_commands_run(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"^\.venv/bin/reproduce ([^\n]+)", README, re.MULTILINE)
    assert len(commands) >= 6
    for command in commands:
        result = CliRunner().invoke(main, shlex.split(command.partition("  #")[0]))
        assert result.exit_code == 0, f"{command}: {result.output}"


def test_the_python_example_runs():
    (code,) = re.findall(r"```python\n(.*?)```", README, re.DOTALL)
    names: dict[str, object] = {}
    exec(compile(code, "README.md", "exec"), names)
    fit = names["fit"]
    assert fit.remarks == []
    scale, deviation = fit.frame().loc["scale", ["value", "standard deviation"]]
    # Both sides of the square, and both its heights, from target to target.
    assert abs(scale - (100.1 + 100.1 + 100.1 + 99.9) / 400) < 1e-4
    assert 1e-5 < deviation < 1e-2
    assert names["table"]["scale.red"].printed == "0.9973"


def test_the_reason_for_version_one_of_jupyter_book_is_given():
    assert re.search(r"Jupyter Book, version 1\. Version 2 fetches", README)
