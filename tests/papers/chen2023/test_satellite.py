"""The satellite, its light path and what heat and stray light may do, by independent answers."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reproduce.judge.ledger import build
from reproduce.judge.readings import evaluate
from reproduce.papers.chen2023 import satellite
from reproduce.papers.chen2023.platform import lasers
from reproduce.physics.raytrace import CORNER, ROOF, LightPath, mirror_train
from reproduce.printed.inputs import load_inputs

ARCSEC = np.pi / 180 / 3600


def by_name(frame):
    """Return a study with its first column as the names of its rows."""
    return frame.set_index(frame.columns[0])


def test_the_altitude_is_that_of_table_1():
    assert satellite.altitude(load_inputs(satellite.CAMERA)) == pytest.approx(
        14 / 7e-6 * 0.25
    )


def test_a_plane_mirror_feigns_twice_its_turn_across_the_plane_of_the_light():
    response = satellite._dichroic_response(np.radians(120.0))
    sizes = np.linalg.norm(response, axis=0)
    # In that plane the light meets the mirror under 30 degrees: twice the cosine.
    np.testing.assert_allclose(sizes, [np.sqrt(3.0), 2.0, 0.0], atol=1e-12)


def test_the_claim_about_the_retroreflector_holds_for_a_corner_cube_alone():
    rows = by_name(satellite._retro_reflectors())
    # Tilt and roll about X, Y, Z; roll from a tilt of the camera; blur.
    assert rows.loc["corner cube"].to_list()[:8] == pytest.approx([0.0] * 8, abs=5e-3)
    mirrors = rows.loc["two mirrors at a right angle"].to_list()[:8]
    assert mirrors == pytest.approx([2, 0, 0, 0, 0, 2, 0, 0], abs=5e-3)
    tilt, roll, *others, tilted, blur = rows.loc["conical mirror"].to_list()[:8]
    assert [tilt, *others] == pytest.approx([0.0] * 5, abs=5e-3)
    assert roll > 3
    assert roll == pytest.approx(tilted, abs=5e-3)
    assert blur > 0.05
    assert rows["image"].to_dict() == {
        "corner cube": "mirrored",
        "two mirrors at a right angle": "upright",
        "conical mirror": "mirrored",
    }


def test_280_belongs_to_a_tracker_with_the_field_of_table_1():
    """Fourteen metres over 280 are fifty millimetres; Table II's are sixty, and see less."""
    flight, mixed, bench = by_name(satellite._heat()).to_numpy(float)
    factors = [flight[0], mixed[0], bench[0]]
    assert factors == pytest.approx([280, 14 / 0.06, 2 / 0.06])
    assert flight[1] == pytest.approx(50)
    assert flight[2] == pytest.approx(15.0, abs=0.3)
    assert mixed[2] == pytest.approx(
        2 * np.degrees(np.arctan(512 * 13e-6 / 0.06)), abs=0.01
    )
    # A micrometre at fourteen metres, and the accuracy of 0.15 arcsec at two.
    assert flight[3] == mixed[3] == pytest.approx(1e-6 / 14 / ARCSEC)
    assert bench[4] == pytest.approx(0.15 * ARCSEC * 2 * 1e6)


def test_how_far_heat_may_move_lasers_and_turn_the_mirror_by_hand():
    accuracy = 0.15 * ARCSEC
    *_, motion, kelvin = by_name(satellite._heat()).loc["flight, as printed"]
    assert motion == pytest.approx(accuracy * 14 * 1e6, rel=1e-3)
    assert kelvin == pytest.approx(accuracy * 14 / (1e-6 * 22e-3), rel=1e-3)
    factor, _, kelvin = by_name(satellite._dichroic()).loc["across it"]
    assert factor == pytest.approx(2.0)
    assert kelvin == pytest.approx(accuracy / 2 / 1e-6)


@pytest.mark.parametrize(
    ("kind", "factor"),
    [("two mirrors at a right angle", 2.0), ("corner cube", np.sqrt(8 / 3))],
)
def test_an_angle_of_the_reflector_that_opens_mimics_a_tilt(kind, factor):
    """A roof prism deviates by twice the error of its angle, a corner by the root of 8/3 times."""
    inputs, opened = (
        load_inputs((*satellite._retro_reflectors.inputs, *satellite.CAMERA)),
        1e-5,
    )
    normals = {"corner cube": CORNER, "two mirrors at a right angle": ROOF}[kind]
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    rest = LightPath(14.0, 0.06, inputs[satellite.BORESIGHT], mirror_train(normals))
    normals[0] += opened * normals[1]
    angles = satellite._reported(
        rest,
        kind == "corner cube",
        lasers(inputs),
        retroreflector=mirror_train(normals),
    )
    assert np.hypot(*angles[:2]) / opened == pytest.approx(factor, rel=1e-3)


def test_the_table_angle_is_the_height_of_a_boresight_that_is_rolled_out_of_the_table():
    """By rotations: 120° from a level camera, then an eighth of a circle about the camera."""
    away = Rotation.from_euler("z", 120, degrees=True).apply([1.0, 0.0, 0.0])
    height = Rotation.from_euler("x", 45, degrees=True).apply(away)[2]
    found = satellite.table_angle(load_inputs([satellite.BORESIGHT]))["table-angle"]
    assert found == pytest.approx(np.arcsin(height))


def test_the_focal_ratio_agrees_for_the_field_of_table_1_only():
    """A detector of 1024 px of 13 um behind 15 degrees: 50.6 mm; the tracker of Table II: 60 mm."""
    lengths = {"table-2": 60e-3, "table-1-field": 512 * 13e-6 / np.tan(np.radians(7.5))}
    found = evaluate(satellite.focal_ratio)
    pairs = zip(found.computation.readings, found.cells["focal-ratio"], strict=True)
    for choices, reading in pairs:
        assert reading.computed == pytest.approx(
            14 / lengths[choices["tracker"]], rel=1e-9
        )
        assert reading.agrees == (choices["tracker"] == "table-1-field")
    record = build(["chen2023/text-satellite"]).cell(
        "chen2023/text-satellite#focal-ratio"
    )
    assert record.verdict == "ambiguous"
