"""Output files are checked first, and replaced as a whole or not at all."""

import os
import subprocess
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest

from reproduce.store.files import check_target, replacing


def test_a_file_is_replaced_as_a_whole(tmp_path):
    old, link = tmp_path / "old.csv", tmp_path / "link.csv"
    old.write_text("old")
    old.chmod(0o640)
    link.symlink_to(old)
    with replacing(link) as part:
        part.write_text("new")
        assert old.read_text() == "old"
    assert old.read_text() == "new"
    assert link.is_symlink()
    assert old.stat().st_mode & 0o777 == 0o640
    assert sorted(tmp_path.iterdir()) == [link, old]


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt, MemoryError])
def test_an_error_leaves_the_old_file(tmp_path, error):
    old = tmp_path / "old.csv"
    old.write_text("old")

    def write():
        with replacing(old) as part:
            part.write_text("half of the ne")
            raise error

    with pytest.raises(error):
        write()
    assert old.read_text() == "old"
    assert list(tmp_path.iterdir()) == [old]


def test_a_target_is_checked(tmp_path):
    assert check_target(str(tmp_path / "a.CSV"), (".csv",)) == tmp_path / "a.CSV"
    (tmp_path / "folder.csv").mkdir()
    for name in ("a.txt", "a", "none/a.csv", "folder.csv", "a.CSV/b.csv"):
        (tmp_path / "a.CSV").touch()
        with pytest.raises(ValueError, match=r"^out: expected"):
            check_target(tmp_path / name, (".csv",), "out")


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may change its user")
def test_a_folder_of_another_user_is_refused():
    code = (
        "import os\nfrom reproduce.store.files import check_target\n"
        "os.setuid(65534)\ncheck_target('a.csv', ['.csv'])"
    )
    with TemporaryDirectory() as folder:
        Path(folder).chmod(0o755)
        command = [sys.executable, "-c", code]
        done = subprocess.run(
            command, capture_output=True, text=True, check=False, cwd=folder
        )
    assert "ValueError: path: expected a file in a writable folder" in done.stderr
