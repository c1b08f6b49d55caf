"""Our studies of the light path and of positions on the ground, against independent answers."""

import numpy as np
import pytest

from reproduce.papers.chen2023 import ground_study, light_study, orbit_study, twin_study
from reproduce.physics.errors_on_ground import circular_error
from reproduce.physics.imaging_jacobian import ground_jacobian
from reproduce.printed.given import given

ARCSEC = np.pi / 180 / 3600
DOOR = given(ground_study.READS)


@pytest.mark.parametrize(("name", "tilt", "off"), ground_study.LOOKS)
def test_the_budget_by_formula_and_by_draws_agree(name, tilt, off):
    view = ground_study.look(DOOR, tilt, off)
    jacobian = ground_jacobian(view.vectors, view.satellite, view.chain)
    for term in ground_study.terms(DOOR):
        exact = ground_study.analytic(jacobian, term)
        drawn = ground_study.simulated(view, term, name)
        error = 5 * np.sqrt(2 / ground_study.DRAWS) * np.trace(exact)
        np.testing.assert_allclose(drawn, exact, atol=max(error, 1e-8))


def test_at_nadir_an_angle_is_worth_the_altitude():
    view = ground_study.look(DOOR, 0.0, 0.0)
    jacobian = ground_jacobian(view.vectors, view.satellite, view.chain)
    attitude = ground_study.terms(DOOR)[0]
    found = float(circular_error(ground_study.analytic(jacobian, attitude)))
    # Geodetic up and the radius part by a fifth of a degree: a few parts in a million.
    assert found == pytest.approx(2.14597 * 500e3 * ARCSEC / 3, rel=2e-3)


def test_the_roll_moves_the_ground_by_its_arm():
    view = ground_study.look(DOOR, 0.0, 5e3)
    jacobian = ground_jacobian(view.vectors, view.satellite, view.chain)
    roll = ground_study.terms(DOOR)[3]
    found = np.sqrt(np.trace(ground_study.analytic(jacobian, roll)))
    assert found == pytest.approx(5e3 * roll.sigma[2], rel=1e-3)


def test_the_altitude_is_that_of_table_1():
    assert twin_study.altitude(DOOR) == pytest.approx(14 / 7e-6 * 0.25)


def test_a_plane_mirror_feigns_twice_its_turn_across_the_plane_of_the_light():
    response = light_study.dichroic_response(np.radians(120.0))
    sizes = np.linalg.norm(response, axis=0)
    # In that plane the light meets the mirror under 30 degrees: twice the cosine.
    np.testing.assert_allclose(sizes, [np.sqrt(3.0), 2.0, 0.0], atol=1e-12)


def test_patterns_obey_the_laws_of_their_size():
    one = light_study.pattern_sigma(4, 5e-3, 1e-6)
    twice = light_study.pattern_sigma(4, 1e-2, 1e-6)
    more = light_study.pattern_sigma(16, 5e-3, 1e-6)
    np.testing.assert_allclose(one[:2], 0.5e-6, rtol=1e-3)
    assert one[2] == pytest.approx(1e-6 / (2 * 5e-3), rel=1e-3)
    assert one[2] / twice[2] == pytest.approx(2.0, rel=1e-3)
    np.testing.assert_allclose(one / more, 2.0, rtol=1e-3)


def test_monitoring_leaves_its_own_noise_when_nothing_bends():
    errors = orbit_study.residuals(1e-6 * ARCSEC)[orbit_study.NAMES[-1]]
    expected = ground_study.monitoring_sigma(DOOR, 100)[:2]
    np.testing.assert_allclose(errors.std(axis=0), expected, rtol=0.01)


def test_monitoring_lags_by_half_an_average():
    """At large amplitude what is left is the rate of change times five seconds."""
    times, unit, _ = orbit_study.year()
    amplitude = 500 * ARCSEC
    errors = orbit_study.residuals(amplitude)[orbit_study.NAMES[-1]]
    true = amplitude * unit[-len(errors) :]
    rate = np.gradient(true, times[-len(errors) :] * 86400.0, axis=0)
    assert np.median(np.abs(errors)) == pytest.approx(np.median(np.abs(5.0 * rate)), rel=0.15)


def test_without_correction_the_errors_are_the_misalignment():
    errors = orbit_study.residuals(ARCSEC)[orbit_study.NAMES[0]]
    np.testing.assert_array_equal(errors, ARCSEC * orbit_study.year()[1][-len(errors) :])


def test_the_strategies_keep_their_order():
    rows = {row[0]: np.array(row[1:], float) for row in orbit_study.strategies().rows}
    _, single, trend, recent, laser = (rows[name] for name in orbit_study.NAMES)
    assert (laser < recent).all()
    assert (recent < trend).all()
    assert (trend < single).all()
