"""Costs of the approximations with the printed parameters."""

import numpy as np
import pytest
from matplotlib.figure import Figure

from reproduce.papers.niu2024 import approximations
from reproduce.papers.niu2024.figures import approximations as drawings
from reproduce.printed.given import given

DOOR = given(approximations.READS)
EFFECTS = {title: effect for effect, title in approximations.TITLES.items()}
COSTS = {
    (table, channel, EFFECTS[title]): cost
    for cost in approximations.costs(DOOR, 80)
    for title, table, channel in [cost.labels]
}


@pytest.mark.parametrize("cost", COSTS.values(), ids=lambda c: "-".join(c.labels))
def test_analytic_and_simulated_bias_agree(cost):
    size = np.array([1e-3, 1e-3, 1.0, 1.0])
    largest = np.abs(cost.analytic / size).max()
    assert (np.abs(cost.simulated - cost.analytic) < 0.02 * largest * size).all()


def test_the_corner_of_the_unequal_coefficients_by_hand():
    """Table 1, blue: half a diagonal of 1288.8 px at 3.45 um, k = 25/24.95."""
    # The middle of the outermost of 80 cells is an eightieth short of the corner.
    corner = np.hypot(1032, 772) * 3.45e-6 * (1 - 1 / 80)
    expected = (25 / 24.95) ** 3 * (49 - 36) * corner**3 / 3.45e-6
    assert COSTS["Table 1", "blue", "coefficients"].peak == pytest.approx(expected, rel=1e-6)


def test_the_pivot_errs_by_the_printed_difference_of_principal_points_by_hand():
    """Table 1, red: 1.9 and 2.3 px apart; k = 25/25.0601, theta = 0.07 degrees."""
    factor = 25 / 25.0601 * np.exp(1j * np.radians(0.07)) - 1
    expected = abs(factor * (1.9 + 2.3j))
    assert COSTS["Table 1", "red", "pivot"].peak == pytest.approx(expected, rel=1e-6)
    # Table 4, blue: the printed translations; k = 25.0237/25.0134, theta = -0.0351 degrees.
    factor = 25.0237 / 25.0134 * np.exp(1j * np.radians(-0.0351)) - 1
    expected = abs(factor * (-0.9256 + 1.0961j))
    assert COSTS["Table 4", "blue", "pivot"].peak == pytest.approx(expected, rel=1e-6)


def test_the_drawing_has_every_cost_and_the_printed_noise():
    figure = Figure()
    drawings.draw_costs(figure, {approximations.NOISE: 0.05})
    costs = approximations.costs(DOOR)
    for axes, table in zip(figure.axes, approximations.TABLES, strict=True):
        lines = {line.get_label(): line.get_xdata() for line in axes.lines}
        np.testing.assert_allclose(lines.pop("noise, both axes"), 0.05 * np.sqrt(2))
        for channel in ("red", "blue"):
            own = [c for c in costs if c.labels[1:] == (table, channel)]
            np.testing.assert_array_equal(lines[channel], [c.rms for c in own])
            left = [c.left for c in own if c.labels[0] != approximations.TITLES["pivot"]]
            np.testing.assert_array_equal(lines[f"{channel}, after a fit"], left)


def test_a_fit_takes_up_the_pivot_whole_and_the_radial_terms_in_part():
    for (_, _, effect), cost in COSTS.items():
        assert cost.left <= cost.rms
        if effect == "pivot":
            assert cost.left < 1e-9
        else:
            assert cost.left > 0.2 * cost.rms


def test_the_tables_hold_every_cost():
    errors, biases = (table(DOOR) for table in (approximations.errors, approximations.biases))
    assert len(errors) == len(biases) == len(COSTS) == 20
    for row, bias in zip(errors.to_numpy(), biases.to_numpy(), strict=True):
        cost = COSTS[row[1], row[2], EFFECTS[row[0]]]
        # Maps of other fineness: the corner is nearer by a hundredth, and so are the means.
        assert row[3:5] == pytest.approx([cost.peak, cost.rms], rel=0.05)
        assert tuple(bias[:3]) == tuple(row[:3])
        assert bias[3::2] == pytest.approx(cost.analytic)
