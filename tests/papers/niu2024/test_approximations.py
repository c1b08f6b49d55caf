"""Costs of the approximations with the printed parameters."""

import numpy as np
import pytest

from reproduce.papers.niu2024 import approximations
from reproduce.printed.inputs import load_inputs

INPUTS = load_inputs(approximations.INPUTS)
COSTS = {tuple(row[:3]): row[3:] for row in approximations._errors(INPUTS).to_numpy()}
PEAK, RMS, LEFT = 0, 1, 2


def test_the_corner_of_the_unequal_coefficients_by_hand():
    """Table 1, blue: half a diagonal of 1288.8 px at 3.45 um, k = 25/24.95."""
    # The middle of the outermost of 200 cells is a two-hundredth short of the corner.
    corner = np.hypot(1032, 772) * 3.45e-6 * (1 - 1 / 200)
    expected = (25 / 24.95) ** 3 * (49 - 36) * corner**3 / 3.45e-6
    assert COSTS["unequal coefficients", "Table 1", "blue"][PEAK] == pytest.approx(
        expected, rel=1e-6
    )


def test_the_pivot_errs_by_the_printed_difference_of_principal_points_by_hand():
    """Table 1, red: 1.9 and 2.3 px apart; k = 25/25.0601, theta = 0.07 degrees."""
    factor = 25 / 25.0601 * np.exp(1j * np.radians(0.07)) - 1
    expected = abs(factor * (1.9 + 2.3j))
    assert COSTS["green's pivot", "Table 1", "red"][PEAK] == pytest.approx(
        expected, rel=1e-6
    )
    # Table 4, blue: the printed translations; k = 25.0237/25.0134, theta = -0.0351 degrees.
    factor = 25.0237 / 25.0134 * np.exp(1j * np.radians(-0.0351)) - 1
    expected = abs(factor * (-0.9256 + 1.0961j))
    assert COSTS["green's pivot", "Table 4", "blue"][PEAK] == pytest.approx(
        expected, rel=1e-6
    )


def test_a_fit_takes_up_the_pivot_whole_and_the_radial_terms_in_part():
    assert len(COSTS) == 20
    for (effect, *_), cost in COSTS.items():
        assert cost[LEFT] <= cost[RMS]
        if effect == "green's pivot":
            assert cost[LEFT] < 1e-9
        else:
            assert cost[LEFT] > 0.2 * cost[RMS]


def test_effects_on_the_scales_by_hand():
    """The circle of radius 6 degrees is nearly filled: mean squares R²/2 and R⁴/3."""
    facts = approximations._facts(load_inputs(approximations._errors.inputs))
    radius = np.tan(np.radians(6)) * 25e-3 / 3.45e-6
    assert facts["outermost"] == pytest.approx(radius, rel=0.05)
    scatter = 0.05 * np.sqrt(2 / (137 * radius**2 / 2))
    assert facts["distance"] == pytest.approx((0.00026 - 0.00005) / scatter, rel=0.1)
    assert facts["rounding"] == pytest.approx(100 / 3)
    for name, apart in (("bias-least", 57 - 49), ("bias-most", 49 - 36)):
        kappa = 2 / 3 * apart * (radius * 3.45e-6) ** 2
        assert facts[name] == pytest.approx(kappa / scatter, rel=0.1), name
