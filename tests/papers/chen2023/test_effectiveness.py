"""Table V under every reading, by hand, and the focal lengths that it implies."""

import numpy as np
import pytest
from bench import ARCSEC

import reproduce as rp
from book_facts import of_study
from reproduce.judge.readings import evaluate
from reproduce.papers.chen2023 import effectiveness
from reproduce.papers.chen2023.platform import scatter
from reproduce.physics.attitude import shared_zero_chi_square
from reproduce.printed.cells import library
from reproduce.printed.inputs import load_inputs


def test_the_zero_state_is_shared_by_all_monitored_angles():
    computed = effectiveness.monitored_angle
    found = computed(load_inputs(computed.inputs))
    one, two = found["2.monitoring-x"], found["3.monitoring-x"]
    assert np.corrcoef(one, two)[0, 1] == pytest.approx(0.5, abs=0.05)
    noise = np.sqrt((scatter(load_inputs(["chen2023/table-3"]), 2)[:, 1] ** 2).mean())
    expected = np.sqrt(2) * noise / 2 / 20 * np.arctan2(13e-6, 60e-3)
    assert one.std() == pytest.approx(expected, rel=0.05)


def test_a_monitored_angle_goes_with_the_motion_that_the_reading_gives_it():
    def drawn(**choices):
        made = effectiveness.monitored_angle.with_options(choices)
        return made(load_inputs(made.inputs), 400)["3.monitoring-y"]

    length = 79.91e-6 / np.tan(8.017 * ARCSEC)
    spread = drawn().std()
    for columns, telescope, angle in (
        ("printed", "quoted", 40.29e-6 / 2.0),
        ("motions", "common", 40.38e-6 / length),
        ("references", "common", 40.29e-6 / length),
    ):
        middle = drawn(columns=columns, telescope=telescope).mean()
        assert middle == pytest.approx(-angle, abs=4 * spread / 20)
    assert drawn(images="smoothed").std() == pytest.approx(2 * spread, rel=1e-6), (
        "400 or 100"
    )
    nominal = drawn(telescope="nominal").std()
    wide = 0.05 / np.sqrt(3) * 40.29e-6 / 2.0
    assert nominal == pytest.approx(np.hypot(spread, wide), rel=0.1), (
        "uniform within 5 %"
    )


def test_with_the_noise_of_100_images_and_columns_interchanged_angles_agree_alone_not_together():
    found = evaluate(effectiveness.monitored_angle)
    for columns in ("motions", "references"):
        choices = {"columns": columns, "telescope": "common", "images": "smoothed"}
        place = found.computation.readings.index(choices)
        assert all(readings[place].agrees for readings in found.cells.values())
        assert found.joint[place, 0] < 0.01


def test_the_differences_are_tested_together_with_the_shared_zero_state():
    """Against the explicit covariance."""
    printed = np.array([-0.040, 0.073, 0.024, -0.072])
    covariance = 0.02**2 * (np.eye(4) + 1)
    by_hand = printed @ np.linalg.solve(covariance, printed)
    assert shared_zero_chi_square(printed / 0.02) == pytest.approx(by_hand)


def test_the_differences_of_table_v_are_no_white_noise_of_means_over_a_state():
    """85.8 with a frame of Table IV over 20, 21.5 over 10, 16.8 with its row of 100 frames."""
    frame = rp.table("chen2023/differences").frame()
    assert frame["χ²"].tolist() == pytest.approx([85.85, 21.46, 16.83], abs=0.01)
    assert (frame["Degrees of freedom"] == 8).all()
    assert frame["Probability"].tolist() == pytest.approx(
        [3.2e-15, 0.0060, 0.0319], rel=0.02
    )


def test_a_mean_with_the_ramp_would_lag_by_more_than_any_difference():
    """A stage in steps, smoothed and averaged image by image."""
    stage = np.repeat(np.array([0.0, -2.006, -4.046, -6.053, -8.0155]), 400)
    smoothed = np.convolve(stage, np.full(100, 0.01))[: stage.size]
    lags = smoothed.reshape(5, 400).mean(axis=1) - stage[::400]
    facts = of_study("chen2023/differences")
    assert facts["ramp-lag"] == pytest.approx(lags[1:].mean(), rel=1e-6)
    assert facts["mean"] == pytest.approx(0.003 / 8)
    assert facts["largest"] == pytest.approx(0.091)
    assert facts["largest"] < facts["ramp-lag"]


def test_the_implied_focal_lengths_by_hand():
    """Extremes of eight quotients, their common interval, and the largest differences."""
    facts = of_study("chen2023/focal-lengths")
    for name, motion, angle in (
        ("printed-least", 19.99, 2.034),
        ("printed-most", 20.27, 2.006),
    ):
        length = motion * 1e-3 / np.tan(angle * ARCSEC)
        assert facts[name] == pytest.approx(length, abs=0.05), name
    # The intervals of all eight lengths with the other motions overlap.
    least = 19.99e-3 / np.tan(2.006 * ARCSEC)
    assert least < facts["shared-low"] < facts["shared-high"] < least + 1.0
    # Both positions of a motion and the angle are rounded.
    error = rp.table("chen2023/focal-lengths").frame()["error with the other (mm)"][0]
    expected = least * (0.01 / 19.99 + 0.0005 / 2.006)
    assert error == pytest.approx(expected, rel=1e-5)
    nominal, common = (
        motion / length / ARCSEC
        for motion, length in ((79.91e-6, 2.0), (19.99e-6, 2.05597))
    )
    assert facts["nominal-difference"] == pytest.approx(nominal - 7.955, abs=1e-4)
    assert facts["common-difference"] == pytest.approx(2.125 - common, abs=1e-4)
    assert facts["needed"] == pytest.approx(100 * 0.1 / 8.017)
    assert facts["largest-difference"] == pytest.approx(2.125 - 2.006)
    bound = library()["chen2023/text-effectiveness"]["difference-bound"]
    assert facts["largest-difference"] > bound.number.interval()[1]
