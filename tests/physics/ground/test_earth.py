"""Places and lines of sight against numbers that others published."""

import json
from pathlib import Path

import erfa
import numpy as np
import pytest
from bench import ARCSEC
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

import page_cells
from reproduce.physics.attitude import (
    rotation_from_vector,
)
from reproduce.physics.ground import (
    ground_jacobian,
    image_vectors,
    imaged_position,
    imaging,
    local_axes,
)

DATA = Path(__file__).parents[1] / "data"


def test_the_page_computes_the_matrix_of_the_sofa_cookbook():
    case = json.loads((DATA / "earth_rotation.json").read_text())["sofa_cookbook_5.5"]
    texts = page_cells.cells(page_cells.BOOK / "chen2023" / "positioning.md")
    (cell,) = (text for text in texts if "import erfa" in text)
    variables = {}
    exec(cell, variables)
    found = variables["earth_from_inertial"]
    assert_allclose(found, case["gcrs_to_itrs"], rtol=0, atol=1e-11)


def published():
    """Return the 480 published lines of sight, instrument position, chain and answers."""
    case = json.loads((DATA / "geolocation_case_1.json").read_text())
    elevation, azimuth = np.radians([case["elevation_deg"], case["azimuth_deg"]])
    about_x = Rotation.from_euler("x", elevation).as_matrix()
    about_y = Rotation.from_euler("y", azimuth).as_matrix()
    earth_from_iss = np.array(case["earth_from_inertial"]) @ case["inertial_from_iss"]
    chain = (
        earth_from_iss
        @ np.array(case["iss_from_base"])
        @ np.array(case["base_from_base_azimuth"])
        @ about_y
        @ np.array(case["yoke_azimuth_from_yoke_elevation"])
        @ about_x
        @ np.array(case["cradle_from_point"])
    )
    place = 1e3 * (
        np.array(case["iss_position_km"])
        + earth_from_iss @ case["instrument_in_iss_km"]
    )
    radii = 1e3 * np.array([case["equatorial_radius_km"], case["polar_radius_km"]])
    answers = np.radians(case["latitude_longitude_deg"])[:, ::-1]
    shape = radii[0], 1.0 - radii[1] / radii[0]
    expected = erfa.gd2gce(*shape, *answers.T, np.zeros(480))
    return np.array(case["pixels"]), place, chain, radii[[0, 0, 1]], expected


@pytest.mark.parametrize(("turn", "low", "high"), [(0.0, 0.0, 1e-6), (1e-3, 1e-4, 1.0)])
def test_the_480_published_answers(monkeypatch, turn, low, high):
    """To a micrometre; a milliarcsecond is noticed.

    The published matrices are rounded and not quite rotations; the authors multiply them as they
    are, so the product is applied first and the model gets lines in Earth-fixed axes.
    """
    pixels, place, chain, axes, expected = published()
    monkeypatch.setattr(imaging, "EARTH_AXES", axes)
    sights = pixels @ chain.T @ rotation_from_vector([turn * ARCSEC, 0, 0])
    # The image vector points into the camera, against the line of sight.
    found = imaged_position(-sights, place, np.eye(3))
    assert low <= np.linalg.norm(found - expected, axis=-1).max() < high


def at(*coordinates):
    return erfa.gd2gc(erfa.WGS84, *coordinates)


def test_local_axes_are_east_north_up():
    place = at(0.4, 0.7, 0.0)
    east, north, up = local_axes(place)
    step = 1e-6
    moved = [at(0.4 + step, 0.7, 0.0), at(0.4, 0.7 + step, 0.0)]
    for axis, end in zip((east, north), moved, strict=True):
        along = (end - place) / np.linalg.norm(end - place)
        assert_allclose(axis, along, atol=1e-6)
    assert_allclose(up, at(0.4, 0.7, 1.0) - place, atol=1e-8)


def looking(tilt):
    """A satellite over some place, its camera turned off the nadir; off-centre image points."""
    satellite = at(0.3, 0.8, 5e5)
    east, north, up = local_axes(satellite)
    chain = np.stack([north, east, -up], axis=-1) @ rotation_from_vector(tilt)
    return image_vectors([[0.0, 0.0], [0.1, -0.2]], 14.0), satellite, chain


def difference(function, step):
    return (function(step) - function(-step)) / (2 * step)


@pytest.mark.parametrize("tilt", [[0.0, 0.0, 0.0], [0.3, -0.2, 0.5]])
def test_the_jacobian_is_the_derivative(tilt):
    vectors, satellite, chain = looking(tilt)
    _, found = ground_jacobian(vectors, satellite, chain)
    for axis, unit in enumerate(np.eye(3)):

        def seen(satellite_step=0.0, turn=0.0, image=0.0, unit=unit):
            turned = chain @ rotation_from_vector(turn * unit)
            moved = satellite + satellite_step * unit
            return imaged_position(vectors + image * unit, moved, turned)

        moved = difference(lambda s, seen=seen: seen(satellite_step=s), 10.0)
        assert_allclose(found["satellite"][..., axis], moved, atol=1e-6)
        turned = difference(lambda s, seen=seen: seen(turn=s), 1e-6)
        assert_allclose(found["turn"][..., axis], turned, rtol=1e-6, atol=0.5)
        shifted = difference(lambda s, seen=seen: seen(image=s), 1e-5)
        assert_allclose(found["image"][..., axis], shifted, rtol=1e-6, atol=0.05)
