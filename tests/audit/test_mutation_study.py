"""A stored study of mutants: read as it was written, and counted right."""

import hashlib

import pytest

from reproduce.audit.mutation import Tally, reasons, stored, tally

ROWS = """\
    ["aa", "physics/a.py", "f", 1, "core/AddNot", "if x:", "if not x:", "killed", "t::a"],
    ["bb", "physics/a.py", "f", 2, "core/AddNot", "if y:", "if not y:", "timeout", ""],
    ["cc", "audit/b.py", "g", 3, "core/NumberReplacer", "a[0]", "a[-1]", "survived", ""],
    ["dd", "audit/b.py", "g", 4, "core/NumberReplacer", "n = 9", "n = 10", "survived", ""],"""
MADE_UP = (
    f'tool = "x"\nsha256 = "{hashlib.sha256(ROWS.encode()).hexdigest()}"\n'
    f"mutants = [\n{ROWS}\n]\n\n[made]\nphysics = 20\naudit = 30\n"
)
WHY = '[cc]\nequivalent = true\nreason = "one long"\n[dd]\nequivalent = false\nreason = "a limit"\n'


def test_a_study_comes_back_as_it_was_written():
    study = stored(MADE_UP)
    assert [one.name for one in study.mutants] == ["aa", "bb", "cc", "dd"]
    assert study.mutants[0].folder == "physics"
    assert study.mutants[2].before == "a[0]"
    assert dict(study.made) == {"physics": 20, "audit": 30}
    assert study.note["tool"] == "x"


def test_a_study_changed_by_hand_is_refused():
    with pytest.raises(ValueError, match="changed by hand"):
        stored(MADE_UP.replace("survived", "killed", 1))


def test_a_timeout_is_a_kill_and_an_equivalent_mutant_still_counts():
    study = stored(MADE_UP)
    found = tally(study.mutants, reasons(WHY, study))
    assert found == Tally(sampled=4, killed=2, timeouts=1, survived=2, equivalent=1)
    assert found.share()[0] == 0.5
    assert found.share_of_killable == pytest.approx(2 / 3)


@pytest.mark.parametrize("text", [WHY.partition("[dd]")[0], WHY.replace("[dd]", "[aa]")])
def test_a_survivor_without_reason_and_a_reason_without_survivor_are_refused(text):
    with pytest.raises(ValueError, match="dd"):
        reasons(text, stored(MADE_UP))


def test_the_interval_is_that_of_clopper_and_pearson():
    """None of ten killed: the upper end is where ten survivors have a chance of one in forty."""
    share, low, high = Tally(10, 0, 0, 10, 0).share()
    assert (share, low) == (0.0, 0.0)
    assert (1 - high) ** 10 == pytest.approx(0.025)
