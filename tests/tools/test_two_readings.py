"""Capture and recapture of relations: the estimate by hand, and the stored counts."""

import math

import pandas as pd
import pytest

from reproduce.store import studies
from two_readings import NAME, by_the_third, missed, study


def test_the_chapman_estimate_by_hand():
    estimate, error = missed(first=3, second=5, both=11)
    assert estimate == pytest.approx(15 * 17 / 12 - 1 - 19)
    assert error == pytest.approx(math.sqrt(15 * 17 * 3 * 5 / (12**2 * 13)))
    assert missed(first=0, second=4, both=9)[0] == pytest.approx(0)


def test_the_counts_are_those_of_the_relations_and_the_errata():
    stored = studies.table(NAME)
    pd.testing.assert_frame_equal(study(), stored)
    assert (stored["both"] > 0).all()


def test_a_relation_that_no_reading_found_is_refused(monkeypatch):
    monkeypatch.setattr("two_readings.lines", lambda relations: ["both", ""])
    with pytest.raises(ValueError, match="expected one of"):
        study()


def test_the_third_reading_is_counted_against_all_others():
    assert by_the_third("third", again=False) == "second"
    assert {
        by_the_third(name, again=True) for name in ("first", "both", "merging")
    } == {"both"}
    assert by_the_third("merging", again=False) == "first"
    row = studies.table(NAME).set_index("what").loc["third"]
    assert (row[["first", "second", "both"]] > 0).all()
    assert row["merging"] == 0
