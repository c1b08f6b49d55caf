"""The archive holds what its own words ask for, and is equal for equal files."""

from pathlib import Path
from zipfile import ZipFile

import pytest

from pack_book import ARCHIVE, INSTALL, LOCK, OPEN, pack, readme


@pytest.fixture
def root(tmp_path: Path) -> Path:
    for name in (
        LOCK,
        "book/_build/wheel/reproduce_pointing-1.0-py3-none-any.whl",
        "book/_build/notebooks/niu2024/simulation.ipynb",
    ):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    return tmp_path


def test_archive_holds_wheel_lock_notebooks_and_how_to_install_them(root: Path) -> None:
    with ZipFile(pack(root)) as file:
        assert file.namelist() == [
            "reproduce-book/README.txt",
            "reproduce-book/environment.txt",
            "reproduce-book/reproduce_pointing-1.0-py3-none-any.whl",
            "reproduce-book/notebooks/niu2024/simulation.ipynb",
        ]
        assert file.read("reproduce-book/environment.txt") == LOCK.encode()


def test_equal_files_give_an_equal_archive(root: Path) -> None:
    first = pack(root).read_bytes()
    assert pack(root).read_bytes() == first
    (root / LOCK).write_text("other")
    assert pack(root).read_bytes() != first


def test_readme_gives_the_lines_that_are_tested() -> None:
    assert all(f"    {line}\n" in readme() for line in INSTALL)


def test_the_page_gives_the_same_lines() -> None:
    page = (Path(__file__).parents[2] / "book" / "run.md").read_text(encoding="utf-8")
    assert "\n".join((*INSTALL, OPEN)) in page
    assert f'href="{ARCHIVE}"' in page


def test_two_wheels_are_refused(root: Path) -> None:
    (root / "book/_build/wheel/reproduce_pointing-2.0-py3-none-any.whl").touch()
    with pytest.raises(ValueError, match="too many values"):
        pack(root)
