"""The verdicts that changed since the last release."""

import tomllib

import pytest

from moved import moved
from reproduce.judge.ledger import frozen
from reproduce.judge.verdicts import VERDICTS
from reproduce.locate import data_folder

NOW = {"a#1": "exact", "a#2": "ambiguous", "a#3": "differs", "a#4": "input"}
THEN = {"exact": ["a#1", "a#3"], "differs": ["a#2"], "consistent": ["gone#1"]}


def state(*cells):
    return {"verdicts": THEN, "moved": [{"cells": list(cells)}]}


def test_changed_verdicts_are_found_and_each_needs_its_reason():
    """Equal verdicts, removed cells and new cells are not changes."""
    changes = {"a#2": ("differs", "ambiguous"), "a#3": ("exact", "differs")}
    assert moved(state("a#3", "a#2"), NOW) == changes
    for cells in (("a#2",), ("a#1", "a#2", "a#3"), ("a#2", "a#3", "gone#1")):
        (wrong,) = {*cells} ^ {*changes}
        with pytest.raises(ValueError, match=wrong):
            moved(state(*cells), NOW)


def test_the_stored_changes_are_those_of_the_ledger():
    text = (data_folder() / "last-release.toml").read_text(encoding="utf-8")
    release = tomllib.loads(text)
    moved(release, {cell: one.verdict for cell, one in frozen().items()})
    cells = [cell for listed in release["verdicts"].values() for cell in listed]
    # `blocked` is a verdict of an earlier release.
    assert set(release["verdicts"]) <= {*VERDICTS, "blocked"}
    assert len(set(cells) & set(frozen())) == len(cells)
    for entry in release.get("moved", ()):
        assert entry["because"]
        assert release["released"] <= entry["day"]
