"""Stored studies: what is written is read, and what was changed is refused."""

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_array_equal

import keep
import recompute
from reproduce.store import studies

NOTE = {"command": "run", "seed": 1, "versions": "none", "share": 0.5}
ARRAYS = {"one": np.arange(6.0).reshape(2, 3), "two": np.array([1, 2])}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder of studies without a study."""
    monkeypatch.setattr(studies, "folder", lambda: tmp_path)
    return tmp_path


def test_the_same_arrays_make_the_same_file(folder):
    for name in ("a", "b"):
        keep.write(name, ARRAYS, NOTE)
    assert (folder / "a.npz").read_bytes() == (folder / "b.npz").read_bytes()


def test_a_missing_study_is_named(folder):
    with pytest.raises(ValueError, match=r"nothing\.npz"):
        studies.read("nothing")


def test_a_note_without_its_command_is_refused(folder):
    with pytest.raises(ValueError, match="command"):
        keep.write("small", ARRAYS, {"seed": 1, "versions": "none"})


TABLE = pd.DataFrame(
    {
        "cell": ["a#b", 'c "d"'],
        "text": ["1.50", "é"],
        "seen": [True, False],
        "size": [0.5, np.nan],
    }
)


def test_a_table_changed_by_hand_is_refused(folder):
    keep.write_table("small", TABLE, {"command": "run"})
    path = folder / "small.toml"
    path.write_text(path.read_text("utf-8").replace("1.50", "1.51"), "utf-8")
    with pytest.raises(ValueError, match="SHA-256"):
        studies.table("small")
    with pytest.raises(ValueError, match=r"other\.toml"):
        studies.table("other")
    with pytest.raises(ValueError, match="command"):
        keep.write_table("small", TABLE, {})


def test_every_study_that_can_be_recomputed_is_whole():
    assert recompute.STUDIES
    for name in recompute.STUDIES:
        arrays, note = studies.read(name)
        assert arrays
        assert note["command"] == f"python tools/evidence/recompute.py {name}"


def test_a_recomputed_study_is_stored_with_its_note(folder, monkeypatch):
    def small(executor):
        return {"numbers": np.arange(3.0)}, {"seed": 7, "replicates": 3}

    monkeypatch.setattr(recompute, "STUDIES", {"small": small})
    recompute.main(["small"])
    arrays, note = studies.read("small")
    assert_array_equal(arrays["numbers"], [0, 1, 2])
    assert (note["seed"], note["replicates"]) == (7, 3)
    assert note["processor_seconds"] >= 0
