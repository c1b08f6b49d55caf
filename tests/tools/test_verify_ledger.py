"""The script with which a referee derives every verdict again."""

import json
from pathlib import Path

import pytest

import verify_ledger
from book_facts import readings_frame
from reproduce.judge.verdicts import VERDICTS
from reproduce.views.computed import whole_ledger
from reproduce.views.export import export_frame


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The ledger and the readings as the book has them; their paths."""
    folder = tmp_path_factory.mktemp("ledger")
    ledger_file, readings_file = folder / "ledger.json", folder / "readings.csv"
    ledger_file.write_text(whole_ledger().model_dump_json(), encoding="utf-8")
    about = {"software": "made here"}
    readings_file.write_text(
        export_frame(readings_frame(), "csv", about), encoding="utf-8"
    )
    return ledger_file, readings_file


@pytest.fixture(scope="module")
def records(written):
    return json.loads(written[0].read_text(encoding="utf-8"))["records"]


@pytest.fixture(scope="module")
def readings(written):
    return verify_ledger.listed(written[1])


def follows(record, readings):
    return verify_ledger.follows(record, readings.get(record["cell"], []))


def test_every_verdict_follows_from_its_record_and_its_readings(
    written, records, capsys
):
    assert verify_ledger.main(*written) == 0
    assert capsys.readouterr().out.startswith("343 of 343 verdicts follow")
    assert {one["verdict"] for one in records} == set(VERDICTS)


@pytest.mark.parametrize(
    "word", ["exact", "consistent", "differs", "ambiguous", "unpublished"]
)
def test_another_verdict_does_not_follow(records, readings, word):
    for one in records:
        if one["role"] == "result" and one["verdict"] != word:
            assert not follows(one | {"verdict": word}, readings), one["cell"]


def test_other_numbers_do_not_lead_to_the_same_verdict(
    written, records, tmp_path, capsys
):
    exact = next(
        r for r in records if r["verdict"] == "exact" and "bound" not in r["flags"]
    )
    far = {"computed": 1e9, "interval": [1e9, 1e9]}
    moved = [exact | far if one is exact else one for one in records]
    (tmp_path / "ledger.json").write_text(
        json.dumps({"records": moved}), encoding="utf-8"
    )
    assert verify_ledger.main(tmp_path / "ledger.json", written[1]) == 1
    assert exact["cell"] in capsys.readouterr().out


def test_a_reading_left_out_or_changed_is_seen(records, readings):
    """The counts of an ambiguous cell are those of the list."""
    ambiguous = [one for one in records if one["verdict"] == "ambiguous"]
    assert ambiguous
    for one in ambiguous:
        every = readings[one["cell"]]
        assert verify_ledger.follows(one, every)
        assert not verify_ledger.follows(one, every[1:])
        far = {"computed": 1e9, "interval": (1e9, 1e9), "probability": None}
        agreeing = next(
            r for r in every if verify_ledger.judged(r, one["stands_for"]) != "differs"
        )
        assert not verify_ledger.follows(
            one, [far if r is agreeing else r for r in every]
        )


def test_it_needs_python_alone():
    text = Path(verify_ledger.__file__).read_text(encoding="utf-8")
    assert "reproduce" not in text
    assert "numpy" not in text
