"""The built book is dropped exactly when its inputs change."""

from pathlib import Path

import pytest

from drop_stale_pages import drop_stale_pages


@pytest.fixture
def checkout(tmp_path: Path) -> Path:
    """A checkout with one file of each kind, built once."""
    (tmp_path / "src").mkdir()
    (tmp_path / "data").mkdir()
    (tmp_path / "src/module.py").write_text("ANSWER = 42\n")
    (tmp_path / "data/table.toml").write_text('value = "42"\n')
    (tmp_path / "environment.txt").write_text("numpy==2\n")
    assert drop_stale_pages(tmp_path)
    for name in ("html/index.html", ".jupyter_cache/notebook"):
        path = tmp_path / "book/_build" / name
        path.parent.mkdir()
        path.write_text("made before")
    return tmp_path


def cached(checkout: Path) -> bool:
    return (checkout / "book/_build/.jupyter_cache/notebook").exists()


def test_executed_notebooks_stay_and_pages_go_while_nothing_changes(checkout: Path) -> None:
    assert not drop_stale_pages(checkout)
    assert cached(checkout)
    assert not (checkout / "book/_build/html").exists()


@pytest.mark.parametrize("name", ["src/module.py", "data/table.toml", "environment.txt"])
def test_a_changed_input_drops_the_notebooks(checkout: Path, name: str) -> None:
    (checkout / name).write_text("changed")
    assert drop_stale_pages(checkout)
    assert not cached(checkout)
    assert not drop_stale_pages(checkout)


def test_a_renamed_input_drops_the_notebooks(checkout: Path) -> None:
    (checkout / "src/module.py").rename(checkout / "src/other.py")
    assert drop_stale_pages(checkout)


def test_bytecode_is_no_input(checkout: Path) -> None:
    (checkout / "src/__pycache__").mkdir()
    (checkout / "src/__pycache__/module.pyc").write_bytes(b"compiled")
    assert not drop_stale_pages(checkout)
