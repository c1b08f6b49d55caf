"""The archive of the notebooks: its files and its instructions."""

from zipfile import ZipFile

import pytest
from places import ROOT

from pack_book import ARCHIVE, INSTALL, LOCK, OPEN, pack, readme

WHEEL = "reproduce_pointing-1.0-py3-none-any.whl"
NOTEBOOK = "notebooks/niu2024/simulation.ipynb"


def test_the_archive_has_wheel_lock_and_notebooks_and_is_equal_each_time(tmp_path):
    for name in (LOCK, f"book/_build/wheel/{WHEEL}", f"book/_build/{NOTEBOOK}"):
        (tmp_path / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / name).write_text(name)
    names = ("README.txt", "environment.txt", WHEEL, NOTEBOOK)
    archive = pack(tmp_path)
    first = archive.read_bytes()
    with ZipFile(archive) as file:
        assert file.namelist() == [f"reproduce-book/{name}" for name in names]
        assert file.read("reproduce-book/environment.txt") == LOCK.encode()
    assert pack(tmp_path).read_bytes() == first
    (tmp_path / f"book/_build/wheel/{WHEEL.replace('1.0', '2.0')}").touch()
    with pytest.raises(ValueError, match="too many values"):
        pack(tmp_path)


def test_archive_and_page_give_the_tested_commands():
    page = (ROOT / "book/run.md").read_text(encoding="utf-8")
    assert all(f"    {line}\n" in readme() for line in INSTALL)
    assert "\n".join((*INSTALL, OPEN)) in page
    assert f'href="{ARCHIVE}"' in page
