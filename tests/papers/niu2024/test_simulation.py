"""The simulation of niu2024 against answers that do not come from it."""

from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from reproduce.papers.catalogue import catalogue
from reproduce.papers.niu2024 import simulation
from reproduce.physics.registration import calibrate, fit_registration, starting_values
from reproduce.printed.cells import find
from reproduce.printed.inputs import load_inputs

INPUTS = load_inputs(simulation.calibrated_parameters.inputs)
LITERAL = simulation._Bench(INPUTS, "square", "every-channel", "one", "table-1")
TABLE = simulation.arrangement(INPUTS)
[ZERO] = np.flatnonzero(np.isclose(TABLE, 0).all(axis=1))
TRUE = simulation.instrument(INPUTS).imaged(TABLE)
PLACES = list(enumerate(simulation.REGISTERED, start=1))


def run(computation, replicates, **choices):
    """Return the results of one reading."""
    return computation.with_options(choices)(
        load_inputs(computation.inputs), replicates
    )


def generator():
    return np.random.default_rng(99)


@pytest.fixture(scope="module")
def prediction():
    """The parameters under the literal reading."""
    return run(simulation.calibrated_parameters, 1000)


def test_the_arrangement_is_the_printed_one_and_is_drawn_in_figure_4():
    """The count by hand: lattice points in a circle of radius 6/0.9."""
    steps = np.degrees(np.diff(np.unique(TABLE[:, 0].round(12))))
    np.testing.assert_allclose(steps, 0.9, atol=1e-9)
    side = range(-9, 10)
    inside = [(i, j) for i in side for j in side if i * i + j * j <= (6 / 0.9) ** 2]
    assert len(TABLE) == len(inside) == 137
    figure = Figure()
    catalogue()["niu2024/fig-4"].draw(figure, {})
    points = figure.axes[0].lines[0].get_xydata()
    np.testing.assert_array_equal(points, np.degrees(LITERAL.table))


def test_a_count_without_an_arrangement_is_rejected():
    changed = INPUTS.changed({"niu2024/text-simulation#angle-count": 136})
    with pytest.raises(ValueError, match="angles"):
        simulation.arrangement(changed)


def test_the_translations_of_table_2_carry_the_whole_calibration_along():
    """Both readings calibrate alike; the translations differ by the principal points' shift."""
    ways = ("table-1", "table-2")
    first, second = (
        replace(LITERAL, translations=way).calibrated(generator(), 3) for way in ways
    )
    for place, _ in PLACES:
        before, after = (
            simulation.instrument(INPUTS, way).cameras[place].principal_point
            for way in ways
        )
        moved = np.array([0, 0, *(after - before)])
        expected = first.parameters[:, place - 1] + moved
        np.testing.assert_allclose(second.parameters[:, place - 1], expected, atol=1e-9)


def test_the_iteration_ends_at_the_closed_form():
    still = np.isclose(TABLE[:, 1], 0)
    noisy = LITERAL.measured(generator(), 20, TABLE)
    found = LITERAL.calibrated(generator(), 20)
    green = noisy[:, 0]
    for place, _ in PLACES:
        source = noisy[:, place]
        zeros = source[:, ZERO], green[:, ZERO]
        start = starting_values(source[:, still], green[:, still], *zeros)
        end = calibrate(source, green, source[:, ZERO], start)
        np.testing.assert_allclose(
            found.parameters[:, place - 1], end.parameters, rtol=0, atol=2e-9
        )


def test_the_predictions_have_the_centre_and_the_width_of_linear_theory(prediction):
    """Distortion biases the scale; noise adds no bias, and k^2 + 1 times its variance."""
    for place, channel in PLACES:
        clean = fit_registration(TRUE[place], TRUE[0], TRUE[place, ZERO]).parameters
        points = TRUE[place] - TRUE[place].mean(axis=0)
        width = 0.05 * np.sqrt(2) / np.sqrt((points**2).sum())
        for row, value in zip(simulation.ROWS, clean, strict=True):
            draws = prediction[f"{row}.{channel}"].draws
            assert abs(draws.mean() - value) < 4.5 * draws.std() / np.sqrt(draws.size)
            if not row.startswith("translation"):
                assert draws.std() == pytest.approx(width, rel=0.08), row


def test_both_channels_share_the_noise_of_green(prediction):
    """Two fits against the same green centroids correlate by about one half."""
    red, blue = (prediction[f"scale.{channel}"].draws for channel in ("red", "blue"))
    assert np.corrcoef(red, blue)[0, 1] == pytest.approx(0.5, abs=0.08)


def test_noise_has_the_sigma_of_its_channel_over_the_root_of_the_draws():
    for noise, factors in simulation._NOISE_FACTORS.items():
        for repeats, count in (("one", 1), ("ten", 10)):
            bench = replace(LITERAL, noise=noise, repeats=repeats)
            errors = bench.measured(generator(), 200, TABLE) - TRUE
            sigma = 0.05 * np.array(factors) / np.sqrt(count)
            np.testing.assert_allclose(errors.std(axis=(0, 2, 3)), sigma, rtol=0.02)


def test_test_points_fill_the_range_or_are_different_angles():
    half = np.tan(simulation.half_ranges(INPUTS)) * 25e-3 / 3.45e-6
    inputs = load_inputs(simulation.registration_rmse.inputs)
    bench = replace(LITERAL, inputs=inputs)
    drawn = bench.tested(generator(), 300, "range")[:, 0] - TRUE[0, ZERO]
    assert (np.abs(drawn).max(axis=(0, 1)) < 1.02 * half).all()
    assert (np.abs(drawn).max(axis=(0, 1)) > 0.99 * half).all()
    quiet = replace(bench, noise="red-and-blue")
    for green in quiet.tested(generator(), 3, "angles")[:, 0]:
        near = np.linalg.norm(green[:, None] - TRUE[0], axis=-1)
        assert near.min(axis=1).max() < 1e-9
        assert len(set(near.argmin(axis=1))) == len(green)


def median_rmse(name, **choices):
    """Return the median of an RMSE under one reading."""
    return np.median(run(simulation.registration_rmse, 400, **choices)[name].draws)


@pytest.mark.parametrize("channel", ["red", "blue"])
def test_the_residual_after_registration_adds_up(channel):
    """Noisy channels times axes, in variances of a coordinate; distortion adds its part."""
    for choices, variances in (
        ({}, 4),
        ({"noise": "red-and-blue"}, 2),
        ({"rmse": "one"}, 2),
        ({"repeats": "ten"}, 0.4),
    ):
        left = (0.05 if "rmse" in choices else 0.07) ** 2
        median = median_rmse(f"rmse-after-{channel}", **choices)
        assert variances * 0.05**2 < median**2 < variances * 0.05**2 + left


@pytest.mark.parametrize(
    ("channel", "table_1", "table_2", "slope"),
    [
        ("red", (1.9, 2.3), (0.3, 0.5), (0.0024, 0.07)),
        ("blue", (-1.4, -1.6), (-0.4, -0.6), (0.0020, -0.05)),
    ],
)
def test_the_residual_before_registration_is_the_one_by_hand(
    channel, table_1, table_2, slope
):
    """Shift, and scale and rotation over the mean squared radius; noise and distortion add less."""
    wide, high = np.radians([8, 6])
    over = (np.tan(wide) / wide - 1) + (np.tan(high) / high - 1)
    among = np.square(np.tan(TABLE)).sum(axis=1).mean()
    per_radius = (slope[0] ** 2 + np.radians(slope[1]) ** 2) * (25e-3 / 3.45e-6) ** 2
    name = f"rmse-before-{channel}"
    for translations, tests, shift, field in (
        ("table-1", "range", table_1, over),
        ("table-2", "range", table_2, over),
        ("table-2", "angles", table_2, among),
    ):
        value = np.hypot(np.hypot(*shift), np.sqrt(per_radius * field))
        choices = {"translations": translations, "tests": tests}
        assert median_rmse(name, **choices) == pytest.approx(value, rel=0.05)
        one = median_rmse(name, **choices, rmse="one")
        assert one == pytest.approx(value / np.sqrt(2), rel=0.05)


def test_the_residual_before_does_not_depend_on_the_calibration():
    """The test points are drawn first, so readings that differ after them share their draws."""
    name = "rmse-before-red"
    medians = {median_rmse(name, angles=way) for way in ("square", "rectangle")}
    assert len(medians | {median_rmse(name, parameters="table-3")}) == 1


def test_no_green_point_reconciles_tables_1_and_2():
    """The reason of the verdict: red minus blue does not depend on it."""
    for axis in "xy":
        apart = []
        for cell in (f"table-1#principal-point-{axis}", f"table-2#translation-{axis}"):
            red, blue = (find(f"niu2024/{cell}.{c}")[0] for c in ("red", "blue"))
            apart.append(red.number.value - blue.number.value)
        assert abs(np.subtract(*apart)) > 4 * 0.05
