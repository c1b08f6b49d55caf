"""Table IV against answers that do not come from it, and floors that are put under it."""

import numpy as np
import pytest
from numpy.random import SeedSequence
from scipy.stats import ks_2samp

from reproduce.papers.chen2023 import accuracy
from reproduce.papers.chen2023.platform import scatter
from reproduce.physics.attitude import attitude_accuracy
from reproduce.printed.given import given

ARCSEC = np.pi / 180 / 3600
DOOR = given(accuracy.READS)
COUNTS = [1, 4, 16, 25, 49, 100]


@pytest.fixture(scope="module")
def predicted():
    return accuracy.frame_averaging(DOOR, 400)


def test_a_single_frame_agrees_with_the_papers_formula(predicted):
    """(11) with the mean scatter of Table III, per axis: about X the error is that along Y."""
    pixel = np.arctan2(13e-6, 60e-3)
    for group, matrix in ((1, "transform"), (2, "misalignment")):
        spots = scatter(DOOR, group)
        for axis, across in (("x", 1), ("y", 0)):
            delta = 3 * np.sqrt((spots[:, across] ** 2).mean())
            formula = float(attitude_accuracy(delta, 4, pixel))
            draws = predicted[f"1.{matrix}-{axis}"].draws
            assert np.median(draws) == pytest.approx(formula, rel=0.02)


def test_averages_fall_with_the_root_of_their_length(predicted):
    single = np.median(predicted["1.transform-x"].draws)
    for count in (4, 16, 25):
        average = np.median(predicted[f"{count}.transform-x"].draws)
        assert average == pytest.approx(single / np.sqrt(count), rel=0.04)


def test_long_averages_are_uncertain_by_themselves(predicted):
    """Few averages over 100 of 800 frames are independent: scatter of the scatter."""
    for count, low, high in ((1, 0.02, 0.03), (49, 0.12, 0.19), (100, 0.17, 0.28)):
        draws = predicted[f"{count}.transform-x"].draws
        assert low < draws.std() / draws.mean() < high


def test_averages_of_the_same_frames_are_correlated(predicted):
    near = [predicted[f"{count}.transform-x"].draws for count in (49, 100)]
    assert np.corrcoef(near)[0, 1] > 0.6


@pytest.fixture(scope="module")
def tables():
    """Tables IV without floors, shape (replicates, columns, counts)."""
    door = given(accuracy.READS)
    drawn = accuracy.simulated_accuracies(door, SeedSequence(9), 800, COUNTS)
    return drawn.transpose(0, 1, 3, 2).reshape(len(drawn), 4, len(COUNTS))


def test_a_floor_is_found_in_the_column_that_has_one_and_in_no_other(tables):
    floor = 0.3 * ARCSEC
    raised = tables[0].copy()
    raised[2] = np.hypot(raised[2], floor)
    found = accuracy.fit(raised, tables[1:], 0.01 * ARCSEC)
    assert found["among"][2] < 0.01
    assert found["single"][-1] < 0.01
    assert found["without"] < 0.01
    assert found["floors"][2] == pytest.approx(floor, rel=0.3)
    assert found["upper"][2] > floor
    others = [0, 1, 3]
    assert (found["single"][others] > 0.02).all()
    assert (found["upper"][others] < floor).all()


def test_fresh_tables_without_floors_prefer_them_as_strongly_as_the_others(tables):
    """So a probability among the replicates that made the law is one for a table that did not."""
    model = accuracy.joint_model(tables[200:], 0.01 * ARCSEC)
    fresh, used = (accuracy.preferences(some, model) for some in (tables[:200], tables[200:]))
    assert ks_2samp(fresh[0], used[0]).pvalue > 1e-3
    assert (fresh[1] >= -1e-9).all()
    for column in range(5):
        assert ks_2samp(fresh[1][:, column], used[1][:, column]).pvalue > 1e-3


def test_the_joint_law_with_floors_is_that_of_tables_with_floors(tables):
    """Means, spreads and covariance of logarithms, against floors put under the replicates."""
    model = accuracy.joint_model(tables, 0.0)
    place = 40
    under = np.log(np.hypot(tables, model.floors[:, place][:, np.newaxis])).reshape(800, -1)
    np.testing.assert_allclose(under.mean(axis=0), model.means[:, place].ravel(), atol=1e-12)
    size = len(COUNTS) * 4
    covariance = np.linalg.inv(model.weight.reshape(size, size))
    spreads = model.spreads[:, place].ravel()
    found = np.cov(under.T)
    scale = np.sqrt(np.outer(found.diagonal(), found.diagonal()))
    assert (np.abs(covariance * np.outer(spreads, spreads) - found) < 0.08 * scale).all()


def test_the_four_columns_know_nothing_of_each_other_and_the_rows_much(tables):
    """So the joint fit is nearly four fits; averages of the same frames are another matter."""
    together = np.corrcoef(np.log(tables).reshape(800, -1).T).reshape(4, 6, 4, 6)
    for one in range(4):
        for other in range(one):
            assert np.abs(together[one, :, other]).max() < 4.5 / np.sqrt(800)
        assert together[one, 4, one, 5] > 0.6


def test_table_4_as_printed_needs_no_floor():
    frame = accuracy.floors()
    assert frame.attrs["without"] > 0.05
    *columns, together = frame["probability"]
    assert together > 0.05
    assert (frame["in any of four columns"][: len(columns)] > 0.05).all()
