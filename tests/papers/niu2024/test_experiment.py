"""The twin of the laboratory against answers that do not come from it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import reproduce as rp
from reproduce.consistency.report import audit_paper
from reproduce.judge.readings import evaluate
from reproduce.papers.niu2024 import experiment, simulation
from reproduce.physics.optics import channel_centroids
from reproduce.physics.registration import (
    Registration,
    fit_registration,
    similarity_between,
)
from reproduce.printed.inputs import load_inputs
from reproduce.views.figure import Figure

INPUTS = load_inputs([*experiment.rmse_before.inputs, *experiment.INSTRUMENT])
BEFORE_RED = (1.4027, 1.3986)
RESIDUAL = {"red": (0.2135, 0.2089), "blue": (0.2146, 0.2097)}


def by_hand(scale, rotation, shift):
    """Mean squared difference over a uniform field: shift, scale and rotation, and no distortion.

    A table angle of a about one axis is a slope of tan(a); the mean square of tan over (-h, h)
    is tan(h)/h - 1. The slope along y is the tangent divided by a cosine that averages to 1.
    """
    half = np.radians([8.0, 6.0])
    spread = (np.tan(half) / half - 1) * (25.0237e-3 / 3.45e-6) ** 2
    x = shift[0] ** 2 + (1 / scale - 1) ** 2 * spread[0] + rotation**2 * spread[1]
    y = shift[1] ** 2 + (1 / scale - 1) ** 2 * spread[1] + rotation**2 * spread[0]
    return np.array([x, y])


def test_the_prediction_is_that_of_pencil_and_paper():
    draws = experiment.rmse_before(INPUTS, 3000)
    for channel, scale, rotation, shift in (
        ("red", 0.9996, 0.0219, (-0.9178, 0.9364)),
        ("blue", 1.0012, -0.0351, (-0.9256, 1.0961)),
    ):
        squares = by_hand(scale, np.radians(rotation), shift)
        expected = squares + np.square(RESIDUAL[channel])
        for axis, square in zip("xy", expected, strict=True):
            values = draws[f"rmse-before-{channel}-{axis}"]
            # The distortion adds its part to the mean square: a few hundredths of a pixel.
            assert (values**2).mean() == pytest.approx(square, rel=0.03)


def test_the_errors_add_up_to_the_printed_residuals():
    """Green has half of the mean squared residual; red and blue have the remainders."""
    green, *others = np.square(experiment._centroid_errors(INPUTS)[:, 0])
    squares = np.square(list(RESIDUAL.values()))
    assert_allclose(green, squares.mean(axis=0) / 2, rtol=1e-12)
    assert_allclose(green + others, squares, rtol=1e-12)
    with pytest.raises(ValueError, match="rmse-after"):
        experiment._centroid_errors(
            INPUTS.changed({"niu2024/text-experiment#rmse-after-red-x": 0.5})
        )


def test_red_is_laid_over_green_by_the_printed_similarity():
    """Scale about the red principal point, which lies at the shift, and subtract the shift."""
    angles = np.radians([[3.0, 1.0], [-2.0, 0.5]])
    green, red, _ = experiment._registered_points(INPUTS, angles)
    shift, turn = -0.9178 + 0.9364j, np.exp(1j * np.radians(0.0219))
    laid = 0.9996 * turn * (red @ [1, 1j] - shift) + shift - shift
    assert_allclose(laid, green @ [1, 1j], atol=1e-9)


def field(across):
    """Table angles evenly over the field."""
    x, y = np.meshgrid(
        *(np.linspace(-h, h, across) for h in experiment.half_field(INPUTS))
    )
    return np.stack([x, y], axis=-1).reshape(-1, 2)


def test_only_positions_in_corners_bring_red_to_the_printed_values():
    """For the printed scale, and for the end of its rounding interval."""
    needed = np.square(BEFORE_RED).sum() - np.square(RESIDUAL["red"]).sum()
    positions = field(41)
    for scale, most in ((0.9996, 0.0), (0.99955, 0.01)):
        changed = INPUTS.changed({"niu2024/table-4#scale.red": scale})
        true = experiment._registered_points(changed, positions)
        far = np.square(true[1] - true[0]).sum(axis=-1) >= needed
        assert far.mean() <= most
        assert far.any() == (most > 0)
    assert (np.abs(positions[far]) > (0.9, 0.6) * experiment.half_field(INPUTS)).all()


def test_the_printed_residual_rules_out_the_focal_lengths_for_blue():
    """Registered with the printed scale, spots by the focal lengths leave over too much."""
    true = channel_centroids(experiment.instrument(INPUTS), field(41))
    shift = (-0.9256, 1.0961)
    registered = Registration.similarity(
        1.0012, np.radians(-0.0351), shift, shift
    ).apply(true[2])
    left = np.sqrt(np.square(registered - true[0]).mean(axis=0))
    assert (left > 1.5 * np.array(RESIDUAL["blue"])).all()


def test_blue_agrees_per_axis_and_red_with_both_axes_together():
    """No reading agrees with both channels."""
    found = evaluate(experiment.rmse_before)
    agreeing = {}
    for place, choices in enumerate(found.computation.readings):
        names = [name for name, cells in found.cells.items() if cells[place].agrees]
        agreeing[tuple(choices.values())] = {
            channel
            for channel in ("red", "blue")
            if sum(channel in name for name in names) == 2
        }
    assert agreeing["factors", "one"] == {"blue"}
    assert agreeing["factors", "both"] == {"red"}
    assert not agreeing["focal-lengths", "one"]
    assert all(len(channels) < 2 for channels in agreeing.values())
    # The drawing shows the same ranges, and the printed values between their ends.
    axes = Figure("niu2024/drawing-laboratory").compute().axes[0]
    bars = [group.lines[2][0].get_segments() for group in axes.containers]
    printed = axes.lines[-4].get_xdata()
    assert axes.lines[-4].get_label() == "printed before"
    inside = [
        [
            one[0, 0] <= value <= one[1, 0]
            for one, value in zip(bar, printed, strict=True)
        ]
        for bar in bars
    ]
    assert inside == [[False, False, True, True], [True, True, False, False]]


def test_the_tolerance_of_the_register_is_four_standard_deviations_of_the_twin():
    frame = rp.table("niu2024/scale-errors").frame()
    largest = frame["Standard deviation on the simulated bench"].max()
    findings = audit_paper("niu2024").findings
    tolerance = next(
        f for f in findings if f.relation.name == "scale-blue"
    ).relation.tolerance
    assert tolerance.size == pytest.approx(4 * largest, rel=0.05)
    away = frame.set_index("Channel")["Distance (σ)"]
    assert away["red"].max() < 1
    assert away["blue"].min() > 4


def test_the_stand_in_is_the_noise_of_two_channels():
    found = experiment.rmse_after(load_inputs(experiment.rmse_after.inputs))
    for result in found.values():
        # Equal distortions add less than 0.001 px to the noise.
        assert result == pytest.approx(np.sqrt(2) * 0.05, rel=1e-3)


def test_channels_calibrated_alone_differ_far_more_than_the_printed_ones():
    """Even with ten repeats averaged of the noise that the simulation has."""
    inputs = load_inputs([*experiment.INSTRUMENT, *simulation.INPUTS])
    seed, error = np.random.SeedSequence(6), 0.05 / np.sqrt(10)
    draws = experiment.twin_fits(inputs, seed, 2000, error)[0].radial_distortion
    off = np.abs(draws.mean(axis=0) - [34.152, 34.166, 34.147])
    assert (off < 4 * draws.std(axis=0) / np.sqrt(2000)).all()
    apart = np.ptp(draws, axis=1)
    assert (apart < 34.166 - 34.147).mean() < 0.01


def test_the_registration_of_the_twin_finds_what_the_cameras_imply():
    """With the precision of the bound; so the printed scales contradict the focal lengths."""
    inputs = load_inputs(
        [*experiment.INSTRUMENT, *simulation.INPUTS, "niu2024/table-4#scale.*"]
    )
    error, replicates = 0.05 / np.sqrt(10), 400
    _, fit = experiment.twin_fits(inputs, np.random.SeedSequence(3), replicates, error)
    cameras = experiment.instrument(inputs)
    true = channel_centroids(cameras, simulation.arrangement(inputs))
    for place, channel in enumerate(("red", "blue"), start=1):
        implied = similarity_between(cameras[place], cameras[0])
        bound = fit_registration(
            true[place],
            implied.apply(true[place]),
            implied.pivot,
            source_covariance=error**2 * np.eye(2),
            target_covariance=error**2 * np.eye(2),
        ).standard_errors
        found = fit.parameters[:, place - 1]
        tolerance = 5 / np.sqrt(2 * replicates)
        assert_allclose(found.std(axis=0), bound, rtol=tolerance)
        # Distortion, and the scatter of the mean.
        misses = (found.mean(axis=0) - implied.parameters) / bound
        assert np.abs(misses).max() < 0.5
        printed = inputs[f"niu2024/table-4#scale.{channel}"]
        assert abs(printed - implied.scale) > 10 * bound[0]
