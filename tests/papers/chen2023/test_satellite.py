"""The satellite, its light path and what heat and stray light may do, by independent answers."""

import numpy as np
import pytest
from bench import ARCSEC
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import reproduce as rp
from book_facts import of_study
from reproduce.papers.chen2023 import satellite
from reproduce.printed.inputs import load_inputs


def by_name(frame):
    """Return a study with its first column as the names of its rows."""
    return frame.set_index(frame.columns[0])


def test_the_claim_about_the_retroreflector_holds_for_a_corner_cube_alone():
    rows = by_name(rp.table("chen2023/retro-reflectors").frame())
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


def test_the_table_angle_is_the_height_of_a_boresight_that_is_rolled_out_of_the_table():
    """By rotations: 120° from a level camera, then an eighth of a circle about the camera."""
    away = Rotation.from_euler("z", 120, degrees=True).apply([1.0, 0.0, 0.0])
    height = Rotation.from_euler("x", 45, degrees=True).apply(away)[2]
    found = satellite.table_angle(load_inputs([satellite.BORESIGHT]))["table-angle"]
    assert found == pytest.approx(np.arcsin(height))


def test_the_effects_of_heat_by_hand():
    """14 m over the printed ratio of 280 are 50 mm; the tracker of Table II has 60 mm."""
    rows = by_name(rp.table("chen2023/heat").frame()).to_numpy(float)
    focal, accuracy = np.array([14.0, 14.0, 2.0]), 0.15 * ARCSEC
    tracker = np.array([50e-3, 60e-3, 60e-3])
    columns = [
        focal / tracker,
        tracker * 1e3,
        2 * np.degrees(np.arctan(512 * 13e-6 / tracker)),
        1e-6 / focal / ARCSEC,
        accuracy * focal * 1e6,
        accuracy * focal / (1e-6 * 22e-3),
    ]
    assert_allclose(rows.T, columns, rtol=1e-6)
    heat, mirror = of_study("chen2023/heat"), of_study("chen2023/dichroic")
    assert heat["flight"] == pytest.approx(accuracy * 14.0 / 22e-9)
    assert heat["bench"] == pytest.approx(accuracy * 2.0 / 22e-9)
    assert mirror["tolerance"] == pytest.approx(0.15 / 2)
    rows = by_name(rp.table("chen2023/dichroic").frame())
    # In the plane of the light, it meets the mirror under 30 degrees: twice the cosine.
    factors = rows.iloc[:, 0].tolist()
    assert factors == pytest.approx([np.sqrt(3.0), 2.0, 0.0])
    assert factors[-1] == 0.0, "no rounding noise"
    assert rows.loc["across it"].iloc[2] == pytest.approx(accuracy / 2 / 1e-6)
