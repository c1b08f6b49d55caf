"""Readings of the simulation: residuals under the options of section 4.2."""

import pytest

from reproduce.judge import readings
from reproduce.papers.niu2024 import simulation


@pytest.fixture(scope="module")
def simulated():
    return readings.evaluate(simulation.registration_rmse)


def among(found, name, **choices):
    """Return the readings of a cell that have some choices."""
    pairs = zip(found.computation.readings, found.cells[name], strict=True)
    return [reading for every, reading in pairs if choices.items() <= every.items()]


def test_with_green_without_noise_and_tests_among_the_angles_both_residuals_agree(
    simulated,
):
    """Against a referee's own computation: 0.0712 (0.059 to 0.084) and 0.0719 (0.060 to 0.085)."""
    choices = {"tests": "angles", "noise": "red-and-blue", "translations": "table-2"}
    literal = simulated.computation.literal | choices
    for channel, median, ends in (
        ("red", 0.0712, (0.059, 0.084)),
        ("blue", 0.0719, (0.060, 0.085)),
    ):
        (reading,) = among(simulated, f"rmse-after-{channel}", **literal)
        assert reading.verdict == "consistent"
        assert reading.computed == pytest.approx(median, abs=0.001)
        assert reading.interval == pytest.approx(ends, abs=0.002)


def test_with_the_parameters_of_table_3_no_residual_over_the_range_agrees(simulated):
    """Against a referee's own computation: 0.195 (0.169 to 0.221) and 0.261 (0.220 to 0.312)."""
    choices = {"tests": "range", "parameters": "table-3"}
    shifted = simulated.computation.literal | choices | {"translations": "table-2"}
    for channel, median, ends in (
        ("red", 0.195, (0.169, 0.221)),
        ("blue", 0.261, (0.220, 0.312)),
    ):
        name = f"rmse-after-{channel}"
        found = among(simulated, name, **choices)
        assert len(found) == 9 * 3 * 2 * 2 * 4
        assert not any(reading.agrees for reading in found)
        (reading,) = among(simulated, name, **shifted)
        assert reading.computed == pytest.approx(median, abs=0.003)
        assert reading.interval == pytest.approx(ends, abs=0.006)


def test_with_angles_over_the_whole_range_the_residual_of_red_before_never_agrees(
    simulated,
):
    found = among(simulated, "rmse-before-red", angles="rectangle")
    assert len(found) == 3 * 2 * 2 * 2 * 2 * 4
    assert not any(reading.agrees for reading in found)
    others = [
        one for one in simulated.computation.options["angles"] if one != "rectangle"
    ]
    for angles in others:
        assert any(
            one.agrees for one in among(simulated, "rmse-before-red", angles=angles)
        )
