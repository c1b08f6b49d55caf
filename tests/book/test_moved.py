"""The page of what moved since the last release shows exactly the cells whose verdict did."""

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


def test_exactly_the_cells_that_moved_are_found():
    """Not what is the same, what is gone, or what has come since."""
    wanted = {"a#2": ("differs", "ambiguous"), "a#3": ("exact", "differs")}
    assert moved(state("a#3", "a#2"), NOW) == wanted
    assert moved({"verdicts": {word: [] for word in THEN}}, NOW) == {}


@pytest.mark.parametrize(
    "named", [("a#2",), ("a#1", "a#2", "a#3"), ("a#2", "a#3", "gone#1")]
)
def test_each_needs_its_reason_and_nothing_else_has_one(named):
    with pytest.raises(ValueError, match=r"look at \['(a#3|a#1|gone#1)'\]$"):
        moved(state(*named), NOW)


def test_what_moved_since_the_last_release_is_told():
    text = (data_folder() / "last-release.toml").read_text(encoding="utf-8")
    release = tomllib.loads(text)
    moved(release, {cell: one.verdict for cell, one in frozen().items()})
    cells = [cell for listed in release["verdicts"].values() for cell in listed]
    assert set(release["verdicts"]) <= {*VERDICTS, "blocked"}, (
        "an old word of a release"
    )
    assert set(cells) <= set(frozen()), "a cell that goes, goes here too"
    assert len(cells) == len(set(cells))
    for entry in release.get("moved", ()):
        assert entry["because"]
        assert release["released"] <= entry["day"]
