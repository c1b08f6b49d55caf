"""Nothing that is not ours is deleted: every place that deletes, and what it may delete."""

import ast
import re
from pathlib import Path

import pytest

from reproduce.views import computed

ROOT = Path(__file__).parent.parent
CALLS = {"rmtree", "unlink", "rmdir", "remove", "removedirs"}
PLACES = {
    "tools/evidence/recompute.py run": "a folder of its own among temporary ones",
    "book/_ext/notebook_downloads.py write": "book/_build/notebooks, which only a build writes",
    "tools/drop_stale_pages.py drop_stale": "book/_build, which only a build writes",
    "tools/evidence/mutant_runs.py _pytest": "a note in a copy of the tree",
    "tools/release.py release": "a folder of dist, which only a release writes",
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
            if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute)):
                continue
            owner = ast.unparse(call.func.value)
            if call.func.attr in CALLS and (call.func.attr != "remove" or owner == "os"):
                yield f"{path.relative_to(ROOT).as_posix()} {function.name}"


def test_all_places_that_delete_are_known():
    folders = ("src", "tools", "book/_ext")
    files = [path for folder in folders for path in (ROOT / folder).rglob("*.py")]
    assert {place for path in files for place in deleting(path)} == set(PLACES)
    lines = (ROOT / "Makefile").read_text(encoding="utf-8").splitlines()
    assert sorted(one.strip() for one in lines if re.search(r"\brm -", one)) == sorted(
        [*MAKE, "@find src tests tools benchmarks book -name __pycache__ -prune -exec rm -rf {} +"]
    )


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv(computed.FOLDER, str(tmp_path))
    computed.kept.cache_clear()
    yield tmp_path
    computed.kept.cache_clear()


@pytest.mark.parametrize("content", [b"", b"half", b"\x80\x04K\x01."], ids=["empty", "no", "int"])
def test_what_is_kept_and_broken_or_of_another_kind_is_computed_again(folder, content):
    assert computed.once("numbers", list, lambda: [1]) == [1]
    assert computed.once("numbers", list, lambda: [2]) == [1]
    (file,) = folder.rglob("*.pickle")
    file.write_bytes(content)
    assert computed.once("numbers", list, lambda: [3]) == [3]
    assert computed.once("numbers", list, lambda: [4]) == [3]


def test_other_packages_give_another_fingerprint(monkeypatch):
    before = computed.fingerprint()
    monkeypatch.setattr("numpy.__version__", "0")
    assert computed.fingerprint() != before
