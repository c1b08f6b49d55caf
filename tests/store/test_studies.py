"""Stored studies: what is written is read, and what was changed is refused."""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pandas as pd
import pytest

import keep
import recompute as slow
from parts import Store, run_parts
from reproduce.store import studies

NOTE = {"command": "run", "seed": 1, "versions": "none", "share": 0.5}
ARRAYS = {"one": np.arange(6.0).reshape(2, 3), "two": np.array([1, 2])}


def test_what_is_written_is_read(tmp_path):
    keep.write("small", ARRAYS, NOTE, tmp_path)
    found = studies.read("small", tmp_path)
    for key, array in ARRAYS.items():
        np.testing.assert_array_equal(found.arrays[key], array)
    assert {key: found.note[key] for key in NOTE} == NOTE


def test_the_same_arrays_make_the_same_file(tmp_path):
    for name in ("a", "b"):
        keep.write(name, ARRAYS, NOTE, tmp_path)
    assert (tmp_path / "a.npz").read_bytes() == (tmp_path / "b.npz").read_bytes()


def test_changed_arrays_are_refused(tmp_path):
    keep.write("small", ARRAYS, NOTE, tmp_path)
    keep.write("other", {"one": np.zeros(3)}, NOTE, tmp_path)
    (tmp_path / "other.npz").replace(tmp_path / "small.npz")
    with pytest.raises(studies.StudyError, match="SHA-256"):
        studies.read("small", tmp_path)


def test_a_missing_study_is_named(tmp_path):
    with pytest.raises(studies.StudyError, match=r"nothing\.npz"):
        studies.read("nothing", tmp_path)


def test_a_note_without_its_command_is_refused(tmp_path):
    with pytest.raises(studies.StudyError, match="command"):
        keep.write("small", ARRAYS, {"seed": 1, "versions": "none"}, tmp_path)


TABLE = pd.DataFrame(
    {
        "cell": ["a#b", 'c "d"'],
        "text": ["1.50", "é"],
        "seen": [True, False],
        "size": [0.5, np.nan],
    }
)


def test_a_table_comes_back_with_its_note(tmp_path):
    keep.write_table("small", TABLE, {"command": "run", "made": {"x/y": 3}}, tmp_path)
    found = studies.table("small", tmp_path)
    pd.testing.assert_frame_equal(found, TABLE, check_dtype=False)
    assert found["seen"].dtype == bool
    assert (found.attrs["command"], found.attrs["made"]) == ("run", {"x/y": 3})


def test_a_table_changed_by_hand_is_refused(tmp_path):
    keep.write_table("small", TABLE, {"command": "run"}, tmp_path)
    path = tmp_path / "small.toml"
    path.write_text(path.read_text("utf-8").replace("1.50", "1.51"), "utf-8")
    with pytest.raises(studies.StudyError, match="SHA-256"):
        studies.table("small", tmp_path)
    with pytest.raises(studies.StudyError, match=r"other\.toml"):
        studies.table("other", tmp_path)
    with pytest.raises(studies.StudyError, match="command"):
        keep.write_table("small", TABLE, {}, tmp_path)


def test_every_study_of_the_project_is_whole():
    assert slow.SLOW
    for name in slow.SLOW:
        found = studies.read(name)
        assert found.arrays
        assert found.note["command"] == f"python tools/evidence/recompute.py {name}"


def test_a_run_that_was_stopped_goes_on_and_stores_the_same(tmp_path, monkeypatch):
    """The second of three parts fails at first; the one before it is not computed again."""
    computed = []

    def part(number):
        if number == 1 and computed == [0]:
            raise KeyboardInterrupt
        computed.append(number)
        return (np.full(2, number),)

    def recomputed(executor, folder, note):
        parts = run_parts(part, range(3), None, Store(folder, note))
        return {"numbers": np.stack([array for (array,) in parts])}, {"replicates": 3}

    monkeypatch.setattr(slow, "SLOW", {"small": (recomputed, 7)})
    monkeypatch.setattr(slow.tempfile, "gettempdir", lambda: str(tmp_path))
    with ThreadPoolExecutor(1) as pool, pytest.raises(KeyboardInterrupt):
        slow.run("small", tmp_path, pool)
    computed.append(-1)
    with ThreadPoolExecutor(1) as pool:
        slow.run("small", tmp_path, pool)
    assert computed == [0, -1, 1, 2]
    found = studies.read("small", tmp_path)
    np.testing.assert_array_equal(found.arrays["numbers"], [[0, 0], [1, 1], [2, 2]])
    assert (found.note["seed"], found.note["replicates"]) == (7, 3)
    assert not [path for path in tmp_path.iterdir() if path.is_dir()], (
        "finished parts are gone"
    )
    with pytest.raises(KeyError, match="small"):
        slow.run("nothing")
