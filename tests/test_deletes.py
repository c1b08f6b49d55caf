"""Nothing that is not ours is deleted: every place that deletes, and what it may delete."""

import ast
import json
import pickle
import re
from pathlib import Path

import pytest

from reproduce.inference import sampling
from reproduce.papers.posteriors import posteriors
from reproduce.views import computed, figure
from reproduce.views.posterior import book_posterior

ROOT = Path(__file__).parent.parent
CALLS = {"rmtree", "unlink", "rmdir", "remove", "removedirs"}
PLACES = {
    "book/_ext/notebook_downloads.py write": "book/_build/notebooks, which only a build writes",
    "tools/build_book.py drop_stale": "book/_build, which only a build writes",
    "tools/pack_book.py build_wheel": "book/_build/wheel, which only a build writes",
}
MAKE = [
    "@rm -f $(STAMP)  # so that an installation that is cut short is begun again",
    "@rm -f $(TESTS)",
    "@rm -rf book/_build book/_extra/* .coverage .pytest_cache .mypy_cache .ruff_cache "
    ".hypothesis dist",
]


def deleting(path):
    """Yield the functions of a file that delete: lists have a `remove` too, but no path in it."""
    for function in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if not isinstance(function, ast.FunctionDef):
            continue
        for call in ast.walk(function):
            if not (
                isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute)
            ):
                continue
            owner = ast.unparse(call.func.value)
            if call.func.attr in CALLS and (
                call.func.attr != "remove" or owner == "os"
            ):
                yield f"{path.relative_to(ROOT).as_posix()} {function.name}"


def test_all_places_that_delete_are_known():
    folders = ("src", "tools", "book/_ext")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    assert {place for path in files for place in deleting(path)} == set(PLACES)
    lines = (ROOT / "Makefile").read_text(encoding="utf-8").splitlines()
    assert sorted(one.strip() for one in lines if re.search(r"\brm -", one)) == sorted(
        [
            *MAKE,
            "@find src tests tools benchmarks book -name __pycache__ -prune -exec rm -rf {} +",
        ]
    )


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(computed.FOLDER, str(tmp_path))
    computed.kept.cache_clear()
    yield tmp_path
    computed.kept.cache_clear()


class Planted:
    """An object whose pickle runs code."""

    def __reduce__(self):
        return pytest.fail, ("code of a file was run",)


@pytest.mark.parametrize(
    "content", [b"", b"[1", pickle.dumps(Planted())], ids=["empty", "half", "pickle"]
)
@pytest.mark.parametrize("kept", ["numbers", "posterior", "ledger", "figure"])
def test_a_damaged_or_planted_file_is_computed_again(
    folder, monkeypatch, content, kept
):
    made = {
        "numbers": lambda: computed.cached(
            "numbers.json", lambda: [1], json.dumps, json.loads
        ),
        "posterior": lambda: book_posterior.__wrapped__("registration").chain.tolist(),
        "ledger": computed.whole_ledger.__wrapped__,
        "figure": lambda: figure._page_vectors("niu2024/fig-4"),
    }[kept]
    if kept == "posterior":
        short = sampling.Plan(seed=1, steps=400, warmup=100, walkers=40)
        monkeypatch.setattr(
            type(posteriors()["registration"]), "plan", lambda self: short
        )
    first = made()
    (file,) = (path for path in folder.rglob("*") if path.is_file())
    assert file.suffix in {".json", ".npz"}
    file.write_bytes(content)
    assert made() == first
    for module, name in (
        (sampling, "sample"),
        (computed.ledger, "build"),
        (figure, "draw"),
    ):
        monkeypatch.setattr(module, name, None)
    assert made() == first


def test_other_packages_give_another_fingerprint(monkeypatch):
    before = computed._fingerprint()
    monkeypatch.setattr("numpy.__version__", "0")
    assert computed._fingerprint() != before
