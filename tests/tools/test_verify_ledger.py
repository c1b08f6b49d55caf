"""The script that derives every verdict again, without the package."""

import json

import pytest

import verify_ledger
from book_facts import readings_frame
from reproduce.judge.verdicts import VERDICTS
from reproduce.views._computed import whole_ledger
from reproduce.views._export import export_frame

FAR = {"computed": 1e9, "interval": (1e9, 1e9), "probability": None}


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Return the files of the ledger and of the readings."""
    folder = tmp_path_factory.mktemp("ledger")
    texts = {"ledger.json": whole_ledger().model_dump_json()}
    texts["readings.csv"] = export_frame(readings_frame(), "csv", {"software": "test"})
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    return [folder / name for name in texts]


@pytest.fixture(scope="module")
def records(files):
    return json.loads(files[0].read_text(encoding="utf-8"))["records"]


@pytest.fixture(scope="module")
def readings(files):
    return verify_ledger.listed(files[1])


def test_every_verdict_follows_and_no_other(files, records, readings, capsys):
    assert verify_ledger.main(*files) == 0
    assert capsys.readouterr().out.startswith("343 of 343 verdicts follow")
    assert {record["verdict"] for record in records} == set(VERDICTS)
    for record in (one for one in records if one["role"] == "result"):
        listed = readings.get(record["cell"], [])
        for word in {*VERDICTS} - {record["verdict"], "input"}:
            other = record | {"verdict": word}
            assert not verify_ledger.follows(other, listed), record["cell"]


def test_other_numbers_do_not_lead_to_the_verdict(files, records, tmp_path, capsys):
    moved = [dict(record) for record in records]
    exact = next(
        r for r in moved if r["verdict"] == "exact" and "bound" not in r["flags"]
    )
    exact |= FAR
    path = tmp_path / "ledger.json"
    path.write_text(json.dumps({"records": moved}), encoding="utf-8")
    assert verify_ledger.main(path, files[1]) == 1
    assert exact["cell"] in capsys.readouterr().out


def test_a_missing_or_changed_reading_is_found(records, readings):
    """The counts of an ambiguous cell are those of the list."""
    ambiguous = [record for record in records if record["verdict"] == "ambiguous"]
    assert ambiguous
    for record in ambiguous:
        listed, follows = readings[record["cell"]], verify_ledger.follows
        judged = [verify_ledger.judged(r, record["stands_for"]) for r in listed]
        index = next(i for i, word in enumerate(judged) if word != "differs")
        assert follows(record, listed)
        assert not follows(record, listed[1:])
        assert not follows(record, [*listed[:index], FAR, *listed[index + 1 :]])
