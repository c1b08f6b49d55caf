"""The script with which a referee derives every verdict again."""

import json
from pathlib import Path

import pytest

import verify_ledger
from reproduce.judge import ledger


@pytest.fixture(scope="module")
def records():
    return json.loads(ledger.build().model_dump_json())["records"]


def test_every_verdict_follows_from_its_record(records):
    assert [one["cell"] for one in records if not verify_ledger.follows(one)] == []
    assert {one["verdict"] for one in records} == set(ledger.VERDICTS)


@pytest.mark.parametrize("word", ["exact", "consistent", "differs", "blocked"])
def test_another_verdict_does_not_follow(records, word):
    for one in records:
        if one["role"] == "result" and one["verdict"] != word:
            assert not verify_ledger.follows(one | {"verdict": word}), one["cell"]


def test_other_numbers_do_not_lead_to_the_same_verdict(records, tmp_path, capsys):
    exact = next(r for r in records if r["verdict"] == "exact" and "bound" not in r["flags"])
    far = {"computed": 1e9, "interval": [1e9, 1e9]}
    moved = [exact | far if one is exact else one for one in records]
    (tmp_path / "ledger.json").write_text(json.dumps({"records": moved}), encoding="utf-8")
    assert verify_ledger.main(tmp_path / "ledger.json") == 1
    assert exact["cell"] in capsys.readouterr().out


def test_it_needs_python_alone():
    text = Path(verify_ledger.__file__).read_text(encoding="utf-8")
    assert "reproduce" not in text
    assert "numpy" not in text
