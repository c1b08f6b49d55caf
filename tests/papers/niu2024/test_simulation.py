"""The simulation of niu2024 against answers that do not come from it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from reproduce.judge import readings
from reproduce.papers.niu2024 import simulation
from reproduce.physics.optics import channel_centroids
from reproduce.physics.registration import fit_registration
from reproduce.printed.inputs import load_inputs
from reproduce.views.figure import Figure

INPUTS = load_inputs(simulation.calibrated_parameters.inputs)
TABLE = simulation.arrangement(INPUTS)
[ZERO] = np.flatnonzero(np.isclose(TABLE, 0).all(axis=1))
TRUE = channel_centroids(simulation.instrument(INPUTS), TABLE)
PLACES = list(enumerate(simulation.REGISTERED, start=1))


def run(computation, replicates, **choices):
    """Return the results of one reading."""
    return computation.with_options(choices)(
        load_inputs(computation.inputs), replicates
    )


def test_printed_parameters_stay_when_an_input_changes():
    change = {"niu2024/table-2#rotation.red": "0.09°"}
    panel = Figure("niu2024/drawing-table-3", change).compute().axes[2]
    assert panel.lines[6].get_xydata()[0] == pytest.approx((0.0698, 2))


def generator():
    return np.random.default_rng(99)


@pytest.fixture(scope="module")
def prediction():
    """The parameters under the literal reading."""
    return run(simulation.calibrated_parameters, 1000)


def test_the_literal_arrangement_is_the_printed_one_by_hand():
    """Lattice points in a circle of radius 6/0.9."""
    steps = np.degrees(np.diff(np.unique(TABLE[:, 0].round(12))))
    assert_allclose(steps, 0.9, atol=1e-9)
    side = range(-9, 10)
    inside = [(i, j) for i in side for j in side if i * i + j * j <= (6 / 0.9) ** 2]
    assert len(TABLE) == len(inside) == 137


def test_figure_4_has_every_arrangement():
    drawn = [
        one.lines[0].get_xydata() for one in Figure("niu2024/fig-4").compute().axes
    ]
    assert_array_equal(drawn[0], np.degrees(TABLE))
    assert len(drawn) == len({one.round(6).tobytes() for one in drawn}) == 9
    assert all(len(one) == 137 for one in drawn)


def test_the_drawing_of_table_3_has_the_verdicts_of_the_ledger():
    """None, one or both of the two readings agree, as the ledger found for each of them."""
    found = readings.evaluate(simulation.calibrated_parameters)
    literal = found.computation.literal
    both = [literal, literal | {"translations": "table-2"}]
    places = [found.computation.readings.index(reading) for reading in both]
    axes = iter(Figure("niu2024/drawing-table-3").compute().axes)
    for row in simulation.ROWS:
        for channel in simulation.REGISTERED:
            panel, cells = next(axes), found.cells[f"{row}.{channel}"]
            agreeing = sum(cells[place].agrees for place in places)
            assert panel.get_title("left").startswith(f"{row}, {channel}")
            word = panel.get_title("right").partition(" ")[0]
            assert word == ("none", "one", "both")[agreeing], (row, channel)


def test_a_count_without_an_arrangement_is_rejected():
    changed = INPUTS.changed({"niu2024/text-simulation#angle-count": 136})
    with pytest.raises(ValueError, match="angles"):
        simulation.arrangement(changed)


def test_the_predictions_have_the_centre_and_the_width_of_linear_theory(prediction):
    """Distortion biases the scale; noise adds no bias, and k^2 + 1 times its variance."""
    for place, channel in PLACES:
        clean = fit_registration(TRUE[place], TRUE[0], TRUE[place, ZERO]).parameters
        points = TRUE[place] - TRUE[place].mean(axis=0)
        width = 0.05 * np.sqrt(2) / np.sqrt((points**2).sum())
        for row, value in zip(simulation.ROWS, clean, strict=True):
            draws = prediction[f"{row}.{channel}"]
            assert abs(draws.mean() - value) < 4.5 * draws.std() / np.sqrt(draws.size)
            if not row.startswith("translation"):
                assert draws.std() == pytest.approx(width, rel=0.08), row


def test_both_channels_share_the_noise_of_green(prediction):
    """Two fits against the same green centroids correlate by about one half."""
    red, blue = (prediction[f"scale.{channel}"] for channel in ("red", "blue"))
    assert np.corrcoef(red, blue)[0, 1] == pytest.approx(0.5, abs=0.08)


def test_noise_has_the_sigma_of_its_channel_over_the_root_of_the_draws():
    for noise, factors in simulation._NOISE_FACTORS.items():
        for repeats, count in (("one", 1), ("ten", 10)):
            reading = noise, repeats, "table-1"
            measured = simulation._measuring(INPUTS, generator(), 200, *reading)
            errors = measured(TABLE) - TRUE
            sigma = 0.05 * np.array(factors) / np.sqrt(count)
            assert_allclose(errors.std(axis=(0, 2, 3)), sigma, rtol=0.02)


def test_test_points_fill_the_range_or_are_different_angles():
    inputs = load_inputs(simulation.registration_rmse.inputs)
    arguments = inputs, generator(), 300, TABLE
    drawn = simulation._test_angles(*arguments, "range")
    assert_allclose(np.abs(drawn).max((0, 1)), np.radians((8, 6)), rtol=0.01)
    for angles in simulation._test_angles(*arguments, "angles")[:3]:
        distances = np.linalg.norm(angles[:, None] - TABLE, axis=-1)
        assert distances.min(axis=1).max() == 0
        assert len(set(distances.argmin(axis=1))) == len(angles)


def median_rmse(name, **choices):
    """Return the median of an RMSE under one reading."""
    return np.median(run(simulation.registration_rmse, 400, **choices)[name])


def test_the_residual_after_registration_adds_up():
    """Noisy channels times axes, in variances of a coordinate; distortion adds its part."""
    for choices, variances in (
        ({}, 4),
        ({"noise": "red-and-blue"}, 2),
        ({"rmse": "one"}, 2),
        ({"repeats": "ten"}, 0.4),
    ):
        distortion = (0.05 if "rmse" in choices else 0.07) ** 2
        for channel in ("red", "blue"):
            square = median_rmse(f"rmse-after-{channel}", **choices) ** 2
            assert 0 < square - variances * 0.05**2 < distortion


def test_the_residual_before_registration_is_the_one_by_hand():
    """Shift, and scale and rotation over the mean squared radius; noise and distortion add less."""
    half = np.radians([8, 6])
    fields = {
        "range": (np.tan(half) / half - 1).sum(),
        "angles": np.square(np.tan(TABLE)).sum(axis=1).mean(),
    }
    for channel, table_1, table_2, scale, rotation in (
        ("red", (1.9, 2.3), (0.3, 0.5), 0.0024, 0.07),
        ("blue", (-1.4, -1.6), (-0.4, -0.6), 0.0020, -0.05),
    ):
        slope = np.hypot(scale, np.radians(rotation)) * 25e-3 / 3.45e-6
        for shift, tests, translations in (
            (table_1, "range", "table-1"),
            (table_2, "range", "table-2"),
            (table_2, "angles", "table-2"),
        ):
            value = np.hypot(np.hypot(*shift), slope * np.sqrt(fields[tests]))
            choices = {"translations": translations, "tests": tests}
            for rmse, factor in (("both", 1.0), ("one", np.sqrt(2))):
                found = median_rmse(f"rmse-before-{channel}", **choices, rmse=rmse)
                assert found == pytest.approx(value / factor, rel=0.05)


def test_the_residual_before_does_not_depend_on_the_calibration():
    """The test points are drawn first, so readings that differ after them share their draws."""
    name = "rmse-before-red"
    medians = {median_rmse(name, angles=way) for way in ("square", "rectangle")}
    assert len(medians | {median_rmse(name, parameters="table-3")}) == 1
