"""Commands of the package and of other programs, and the texts that they show."""

import subprocess

from click.testing import CliRunner

from reproduce.views.cli import main


def run(command, columns=80, **settings):
    """Run a command of the package, given as one text or as a list of its words."""
    arguments = command.split() if isinstance(command, str) else command
    environment = {"COLUMNS": str(columns), "TERM": "dumb"}
    return CliRunner(env=environment).invoke(main, [*map(str, arguments)], **settings)


def output_of(*command, **settings):
    """Return the output of another program, which must succeed."""
    settings |= {"check": True, "capture_output": True, "text": True}
    return subprocess.run(command, **settings).stdout


def words(text):
    """Return a text with single spaces, without the lines of a frame."""
    return " ".join(text.replace("│", " ").split())


def width(text):
    """Return the length of the longest line."""
    return max(map(len, text.splitlines()))
