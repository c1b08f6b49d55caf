"""What the tests would notice: the study that is stored, and the page that shows it."""

import tomllib

from reproduce.audit.mutation import reasons, stored, tally
from reproduce.locate import data_folder
from reproduce.views import mutants

FOLDER = data_folder() / "studies"
STUDY = stored((FOLDER / "mutants.toml").read_text(encoding="utf-8"))
REASONS = (FOLDER / "mutants-survivors.toml").read_text(encoding="utf-8")


def test_the_sample_is_large_enough_and_most_of_it_is_killed():
    found = tally(STUDY.mutants, reasons(REASONS, STUDY))
    assert found.sampled >= 300
    assert found.share()[0] >= 0.85
    assert len({one.name for one in STUDY.mutants}) == found.sampled
    assert set(STUDY.made) == {one.folder for one in STUDY.mutants}


def test_every_survivor_has_a_reason_in_the_order_of_the_study():
    survivors = [one.name for one in STUDY.mutants if one.outcome == "survived"]
    assert list(tomllib.loads(REASONS)) == survivors
    assert all(len(why.text) > 30 for why in reasons(REASONS, STUDY).values())


def test_the_page_shows_the_numbers_of_the_study():
    survivors = [one for one in STUDY.mutants if one.outcome == "survived"]
    said = mutants.numbers()
    assert (said["drawn"], said["survived"]) == (str(len(STUDY.mutants)), str(len(survivors)))
    assert float(said["low"].split()[0].rstrip("\u202f%")) < float(said["share"].rstrip("\u202f%"))
    assert mutants.survivors().text.count("becomes") == len(survivors)
    score = mutants.score().text
    for folder, made in STUDY.made.items():
        assert folder in score
        assert f"<td>{made}</td>" in score


def test_the_page_counts_each_drawn_mutant_under_one_operator():
    rows = mutants.operators().text.split("<tr")[2:]
    drawn = [int(row.split("<td>")[1].split("<")[0]) for row in rows]
    assert sum(drawn) == len(STUDY.mutants)


def test_files_that_have_changed_since_are_told(monkeypatch):
    sources = dict(STUDY.note["sources"])
    now = len(mutants.stale())
    file = next(file for file in sources if file not in mutants.stale())
    changed = STUDY.__class__(
        STUDY.mutants, STUDY.made, {**STUDY.note, "sources": {**sources, file: "0"}}
    )
    monkeypatch.setattr(mutants, "_study", lambda: (changed, {}))
    assert file in mutants.stale()
    assert len(mutants.stale()) == now + 1
