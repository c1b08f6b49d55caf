"""Places that delete files, and results of a build that are damaged."""

import ast
import json
import pickle
import re
from dataclasses import replace

import pytest
from places import ROOT

from reproduce.inference import sampling
from reproduce.papers.posteriors import posteriors
from reproduce.views import _computed as computed
from reproduce.views import figure
from reproduce.views.posterior import book_posterior

DELETE = re.compile(r"\.(rmtree|unlink|rmdir|removedirs)\(|\bos\.remove\(")
PICKLE = re.compile(r"\b(pickle|joblib|shelve|dill|marshal|allow_pickle=True)\b")
# All delete below book/_build, which only a build writes.
DELETING = {
    ("book/_ext/notebook_downloads.py", "write"),
    ("tools/build_book.py", "drop_stale"),
    ("tools/pack_book.py", "build_wheel"),
}
DELETED = {
    "$(STAMP)",
    "$(TESTS)",
    "book/_build book/_extra/* .coverage .pytest_cache .mypy_cache .ruff_cache .hypothesis dist",
    "{} +",  # of the folders __pycache__
}


def test_all_places_that_delete_are_known():
    found, folders = set(), ("src", "tools", "book/_ext")
    for path in (path for name in folders for path in (ROOT / name).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            # A list has a method `remove` too.
            if isinstance(node, ast.FunctionDef) and DELETE.search(ast.unparse(node)):
                found.add((path.relative_to(ROOT).as_posix(), node.name))
    assert found == DELETING
    makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
    assert set(re.findall(r"\brm -r?f (.*?)(?:  #.*)?$", makefile, re.M)) == DELETED


def test_no_code_reads_pickles():
    """Sphinx reads those in `book/_build`, which the build makes."""
    folders = ("src", "tools", "book/_ext", "benchmarks", ".binder")
    for path in (path for name in folders for path in (ROOT / name).rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        assert not PICKLE.search(text), path
        assert text.count("np.load(") <= text.count("allow_pickle=False)"), path


class Planted:
    """An object whose pickle runs code."""

    def __reduce__(self):
        return pytest.fail, ("code of a file was run",)


MADE = {
    "numbers": lambda: computed.cached(
        "numbers.json", lambda: [1], json.dumps, json.loads
    ),
    "posterior": lambda: book_posterior.__wrapped__("registration").chain.tolist(),
    "ledger": computed.whole_ledger.__wrapped__,
    "figure": lambda: figure.Figure("niu2024/fig-4").vectors(),
}


@pytest.mark.parametrize("name", MADE)
def test_a_damaged_or_planted_file_is_computed_again(tmp_path, monkeypatch, name):
    monkeypatch.setenv(computed.FOLDER, str(tmp_path))
    make, short = MADE[name], sampling.Plan(seed=1, steps=400, warmup=100, walkers=40)
    if name == "posterior":
        declared = replace(posteriors()["registration"], plan=short)
        monkeypatch.setitem(posteriors(), "registration", declared)
    first = make()
    (file,) = (path for path in tmp_path.rglob("*") if path.is_file())
    assert file.suffix in {".json", ".npz"}
    contents = (b"", b"[1", pickle.dumps(Planted()))
    for content in contents if name == "numbers" else contents[2:]:
        file.write_bytes(content)
        assert make() == first
    for module, function in (
        (sampling, "sample"),
        (computed.ledger, "build"),
        (figure.Figure, "compute"),
    ):
        monkeypatch.setattr(module, function, None)
    assert make() == first
