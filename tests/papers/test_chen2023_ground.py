"""Our studies of the light path and of positions on the ground, against independent answers."""

import re

import numpy as np
import pytest

from reproduce.papers.chen2023 import (
    ground_study,
    heat_study,
    light_study,
    orbit_study,
    stray_study,
    twin_study,
)
from reproduce.physics.ground.errors import circular_error
from reproduce.physics.ground.imaging import ground_jacobian
from reproduce.physics.images.centroids import centre_of_gravity
from reproduce.physics.images.spots import spot_windows
from reproduce.printed.given import given

ARCSEC = np.pi / 180 / 3600
DOOR = given(ground_study.READS)


BUDGET = {term.name: (term,) for term in ground_study.terms(DOOR)} | ground_study.together(DOOR)


@pytest.mark.parametrize(("name", "tilt", "off"), ground_study.LOOKS)
@pytest.mark.parametrize("line", BUDGET)
def test_the_budget_by_formula_and_by_draws_agree(line, name, tilt, off):
    view = ground_study.look(DOOR, tilt, off)
    jacobian = ground_jacobian(view.vectors, view.satellite, view.chain)
    exact = sum(ground_study.analytic(jacobian, term) for term in BUDGET[line])
    drawn = ground_study.simulated(view, BUDGET[line], name)
    spread = np.sqrt(np.outer(exact.diagonal(), exact.diagonal()) + exact**2)
    error = 4.5 * spread / np.sqrt(ground_study.DRAWS) + 1e-6
    assert (np.abs(np.cov(drawn.T) - exact) < error).all()
    assert (np.abs(drawn.mean(axis=0)) < 4.5 * np.sqrt(exact.diagonal() / 20_000) + 1e-3).all()
    inside = np.linalg.norm(drawn, axis=1) < circular_error(exact)
    if np.trace(exact) > 1e-4:
        assert inside.mean() == pytest.approx(0.9, abs=4.5 * 0.3 / np.sqrt(ground_study.DRAWS))


def test_the_budget_holds_every_term_of_the_model_once():
    names = [term.name for term in ground_study.terms(DOOR)]
    assert len(set(names)) == len(names) == 9
    for errors in ground_study.together(DOOR).values():
        assert len(errors) == 6
        assert {term.kind for term in errors} == {"turn", "satellite", "image"}
        turned = sum(term.sigma[:3] > 0 for term in errors if "misalignment" in term.name)
        np.testing.assert_array_equal(turned, [1, 1, 1])


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
    roll = BUDGET["misalignment about Z (roll), one frame"][0]
    found = np.sqrt(np.trace(ground_study.analytic(jacobian, roll)))
    assert found == pytest.approx(5e3 * roll.sigma[2], rel=1e-3)


def test_the_altitude_is_that_of_table_1():
    assert twin_study.altitude(DOOR) == pytest.approx(14 / 7e-6 * 0.25)


def test_a_plane_mirror_feigns_twice_its_turn_across_the_plane_of_the_light():
    response = light_study.dichroic_response(np.radians(120.0))
    sizes = np.linalg.norm(response, axis=0)
    # In that plane the light meets the mirror under 30 degrees: twice the cosine.
    np.testing.assert_allclose(sizes, [np.sqrt(3.0), 2.0, 0.0], atol=1e-12)


def entries(study, row):
    """Numbers of a row of a study, in order, whatever stands between them."""
    (found,) = [line for line in study.rows if line[0] == row]
    return [[float(n) for n in re.findall(r"\d+(?:\.\d+)?(?:e[+-]\d+)?", e)] for e in found[1:]]


def test_the_claim_about_the_retroreflector_holds_for_a_corner_cube_alone():
    study = light_study.retro_reflectors()
    assert entries(study, "corner cube")[:5] == [[0, 0], [0, 0], [0, 0], [0], [0]]
    across, along, beam, tilted, blur = entries(study, "two mirrors at a right angle")[:5]
    assert (across, along, beam, tilted, blur) == ([2, 0], [0, 0], [0, 2], [0], [0])
    across, along, beam, tilted, blur = entries(study, "conical mirror")[:5]
    assert (along, beam) == ([0, 0], [0, 0])
    assert across[0] == 0
    assert across[1] > 3
    assert across[1] == tilted[0]
    assert blur[0] > 0
    images = {row[0]: row[-1] for row in study.rows}
    assert images == {
        "corner cube": "mirrored",
        "two mirrors at a right angle": "upright",
        "conical mirror": "mirrored",
    }


def test_280_belongs_to_a_tracker_with_the_field_of_table_1():
    """Fourteen metres over 280 are fifty millimetres; Table II's are sixty, and see less."""
    study = heat_study.heat()
    flight, mixed, bench = (entries(study, row[0]) for row in study.rows)
    assert [one[0] for one in (flight[0], mixed[0], bench[0])] == [280.0, 233.3, 33.3]
    assert flight[1] == [50]
    assert flight[2][0] == pytest.approx(15.0, abs=0.3)
    assert mixed[2][0] == pytest.approx(2 * np.degrees(np.arctan(512 * 13e-6 / 0.06)), abs=0.06)
    # A micrometre at fourteen metres, and the accuracy of 0.15 arcsec at two.
    assert flight[3][0] == mixed[3][0] == pytest.approx(1e-6 / 14 / ARCSEC, abs=5e-5)
    assert bench[4][0] == pytest.approx(0.15 * ARCSEC * 2 * 1e6, abs=0.05)


def test_thermal_terms_by_hand():
    study = heat_study.thermal()
    accuracy = 0.15
    together = entries(study, "all lasers move together")
    assert together[1][0] == pytest.approx(accuracy * ARCSEC * 14 * 1e6, rel=5e-3)
    assert together[2][0] == pytest.approx(accuracy * ARCSEC * 14 / (1e-6 * 22e-3), rel=5e-3)
    assert entries(study, "one laser of four moves")[1][0] == pytest.approx(4 * 10.18, rel=5e-3)
    assert study.rows[2][2:] == ("any", "any")
    # A roof prism's deviation is twice the error of its angle, a corner's the root of 8/3 times.
    assert entries(study, "the angle of the two mirrors opens")[0] == [2.0]
    assert entries(study, "one angle of a corner cube opens")[0] == [1.63]
    dichroic = entries(study, "the dichroic mirror tilts")
    assert dichroic[0] == [2.0]
    assert dichroic[2][0] == pytest.approx(accuracy / 2 * ARCSEC / 1e-6, rel=5e-3)


def test_stray_light_up_to_its_tolerance_does_what_the_table_says():
    """By simulation: an even background raises the scatter by a tenth, a slope shifts the mean."""
    door = given(stray_study.READS)
    signal, background, slope = stray_study.tolerances(door)
    mean = spot_windows([0.0, 0.0], signal, 7.5 / 13, [-2, -2], 5)
    rng, shape = np.random.default_rng(6), (60_000, 5, 5)
    plain = centre_of_gravity(rng.poisson(mean, shape), [-2, -2])[:, 0]
    # An even background is known and taken off; its shot noise stays.
    lit = centre_of_gravity(rng.poisson(mean + background, shape) - background, [-2, -2])[:, 0]
    assert lit.std() / plain.std() == pytest.approx(1.1, abs=0.015)
    tilted = centre_of_gravity(mean + slope * np.arange(-2, 3), [-2, -2])[0]
    assert tilted * np.arctan2(13e-6, 60e-3) == pytest.approx(0.15 * ARCSEC, rel=1e-3)


def test_shares_of_stray_light_follow_from_table_2():
    rows = {row[0]: row[1] for row in stray_study.stray().rows}
    assert rows["laser light that the mirror loses"] == "2.0%"
    assert rows["starlight that the mirror loses"] == "10.0%"
    # Ten nanometres of the band from 840, where the mirror begins, to 1000, where the sensor ends.
    assert [v for k, v in rows.items() if "filter of 10 nm" in k] == ["6.2%"]


def test_the_limits_of_the_corrections_are_where_their_error_crosses():
    study = orbit_study.suffices()
    # One calibration, the tracker's own error, the first day: by the table of ages.
    name, first = orbit_study.NAMES[2], 2
    row = next(r for r in study.rows if r[0] == name and r[1].startswith("what"))
    limit, amplitude = float(row[1].split()[-1]), float(row[first])
    height = twin_study.altitude(DOOR)
    span = orbit_study._spans()["first day"]
    left = orbit_study.residuals(amplitude * ARCSEC)[name][span]
    found = np.quantile(np.linalg.norm(left, axis=1), 0.9) * height
    assert found == pytest.approx(limit, rel=0.06), "two digits of amplitude are shown"


def test_a_correction_whose_noise_alone_is_too_large_bears_no_amplitude():
    noise = np.full((10, 2), 3.0)
    assert np.isnan(orbit_study.largest_amplitude(np.ones((10, 2)), noise, 4.0))
    found = orbit_study.largest_amplitude(np.ones((10, 2)), 0.0 * noise, np.sqrt(2.0) * 5.0)
    assert found == pytest.approx(5.0)


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
