"""Capture and recapture of relations: the estimate by hand, and the stored counts."""

import math

import pandas as pd
import pytest

from reproduce.store import studies
from two_readings import NAME, missed, study


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
