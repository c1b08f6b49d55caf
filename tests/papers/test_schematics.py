"""Drawn frames, angles and signs against the functions that they illustrate."""

import re
from xml.etree import ElementTree

import erfa
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reproduce.papers.catalogue import catalogue, drawings
from reproduce.papers.declare import Schematic
from reproduce.physics import ground
from reproduce.physics.attitude import (
    emitted_directions,
    misalignment,
    misalignment_angles,
    rotation_from_vector,
    unit,
)
from reproduce.physics.raytrace import fold_mirror_tilt, mirror_train
from reproduce.physics.registration import fit_registration
from reproduce.printed.cells import find

SVG = "{http://www.w3.org/2000/svg}"
LASERS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]) * 0.1
DRAWN = {
    key: one
    for key, one in (
        *((key, item.draw) for key, item in catalogue().items()),
        *drawings().items(),
    )
    if isinstance(one, Schematic)
}


def tree(key):
    return ElementTree.fromstring(DRAWN[key].text)


def numbers(text):
    return np.array([float(one) for one in re.findall(r"-?\d+\.?\d*", text)])


def points(path):
    """Return the places of a path of straight lines, y upwards, shape (n, 2)."""
    assert not set(path.get("d")) & set("QACZHV"), path.get("d")
    return numbers(path.get("d")).reshape(-1, 2) * [1, -1]


def marked(root, kind):
    """Return the paths of one class."""
    return [points(p) for p in root.iter(f"{SVG}path") if p.get("class") == kind]


def labels(root):
    return ["".join(one.itertext()) for one in root.iter(f"{SVG}text")]


def angle(path):
    """Return the angle of a line with the horizontal, in degrees."""
    return np.degrees(np.arctan2(*np.diff(path, axis=0)[0][::-1]))


def view(azimuth, elevation):
    """Return the two rows that project onto the page, seen from a direction, Z upwards."""
    seen = Rotation.from_euler("ZY", [azimuth, -elevation], degrees=True).as_matrix()
    return seen[:, 1:].T


def printed(address):
    return find(address)[0].number.value


# Names with a number, and the sign of an angle. All other numbers are printed cells.
NAMES = re.compile(r"\{(\S+) printed\}|3CMOS|WGS84|J2000|> 0|^[vw][12]$")


def test_schematics_have_a_title_a_style_and_printed_cells_in_place_of_numbers():
    assert len(DRAWN) == 15
    for key, one in DRAWN.items():
        root = tree(key)
        assert one.title, key
        assert root.find(f"{SVG}style") is not None, key
        for text in labels(root):
            assert not re.search(r"\d", NAMES.sub("", text)), (key, text)
            addresses = filter(None, NAMES.findall(text))
            assert all(find(address)[0].is_number for address in addresses)


def test_a_fit_returns_the_angle_and_the_shift_of_the_drawn_planes():
    """Points fixed to the drawn green axes, as the drawn blue detector sees them."""
    groups = tree("niu2024/fig-2").iter(f"{SVG}g")
    planes = {g.get("id"): numbers(g.get("transform")) for g in groups}
    green, blue = (planes[name][:2] * [1, -1] for name in ("green", "blue"))
    turn = np.radians(-planes["blue"][2])
    fixed = np.array([[1.0, 0.0], [0.0, 1.0], [2.0, 3.0]])
    back = Rotation.from_euler("z", -turn).as_matrix()[:2, :2]
    found = fit_registration(fixed @ back.T + blue, fixed + green, pivot=blue)
    assert found.parameters == pytest.approx([1.0, turn, *(blue - green)])
    assert turn > 0


@pytest.mark.parametrize("index", range(3))
def test_the_drawn_turn_is_the_misalignment_that_is_measured(index):
    root, axis = tree("chen2023/drawing-misalignment"), np.eye(3)[index]
    turn, page = np.radians(28.0), view(-62.0, 26.0)
    now = rotation_from_vector(turn * axis).mT
    camera = emitted_directions(LASERS, 1.0)
    measured = misalignment_angles(misalignment(camera, camera @ now, np.eye(3)))
    assert measured == pytest.approx(turn * axis, abs=1e-9)
    group = next(
        g for g in root.iter(f"{SVG}g") if g.get("id") == f"about-{'XYZ'[index]}"
    )
    moved = np.delete(now, index, axis=0) @ page.T * 58
    for path, tip in zip(marked(group, "thick"), moved, strict=True):
        assert path[1] - path[0] == pytest.approx(tip, abs=0.06)
    watched = 0 if index == 2 else 2
    [sense] = [path for path in marked(group, "thin") if len(path) > 2]
    swept = Rotation.from_rotvec(np.linspace(0, turn, 9)[:, None] * axis)
    expected = swept.apply(0.75 * np.eye(3)[watched]) @ page.T * 58
    assert sense == pytest.approx(expected, abs=0.06)
    away = now[watched] - np.eye(3)[watched]
    place = int(np.abs(away).argmax())
    sign = "+" if away[place] > 0 else "−"
    name = "X" if index == 2 else "boresight"
    assert f"{name} to {sign}{'XYZ'[place]}" == labels(root)[5 * index + 4]


def test_a_moved_laser_stands_for_the_turn_that_is_measured():
    written = labels(tree("chen2023/fig-6a"))
    for index, axis in enumerate("XY"):
        moved = emitted_directions(LASERS + 1e-4 * np.eye(2)[index], 1.0)
        at_rest = emitted_directions(LASERS, 1.0)
        found = misalignment_angles(misalignment(at_rest, moved, np.eye(3)))
        turn = int(np.abs(found).argmax())
        sense = f"{'+' if found[turn] > 0 else '−'}{'XYZ'[turn]}"
        assert f"towards {axis}: as if the camera turned about {sense}" in written


def test_the_scene_is_the_one_of_the_imaging_model():
    """Frames, target and rotation of the Earth from equation (1), as drawn in Figure 1a."""
    every = tree("chen2023/fig-1a").iter(f"{SVG}path")
    paths = {one.get("id"): points(one) for one in every if one.get("id")}
    earth = ground.EARTH_RADIUS
    page = view(36.0, 20.0) * 2.8 * 27 / earth
    stars = ground.earth_from_inertial("2023-09-22T03:30:00", ut1_utc=0.0)
    assert 0 < erfa.era00(*erfa.dtf2d("UTC", 2023, 9, 22, 3, 30, 0.0)) < np.pi
    above = ground.earth_fixed([np.radians(104.0), np.radians(24.0), 1.25 * earth])
    target = ground.earth_fixed([np.radians(66.0), np.radians(50.0), 0.0])
    z = unit("boresight", target - above)
    x = unit("level", np.cross([0.0, 0.0, 1.0], z))
    camera = np.stack([x, np.cross(z, x), z], axis=-1)
    boresights = np.radians(printed("chen2023/text-satellite#boresight-angle"))
    tracker = camera @ rotation_from_vector([boresights, 0.0, 0.0]).T
    rays = ground.image_vectors([(0.0, 0.0)], focal_length=1.0)
    assert ground.imaged_position(rays, above, camera)[0] == pytest.approx(target)
    drawn = {"position": above, "sight": above - target}
    for name, axes, length in (
        ("earth", np.diag([1.6, 1.6, 1.3]), 1.0),
        ("stars", stars[:, :2] * [1.5, 1.6], 1.0),
        ("camera", camera, 0.42),
        ("tracker", tracker, 0.42),
    ):
        for letter, axis in zip("xyz", axes.T, strict=False):
            drawn[f"{name}-{letter}"] = length * earth * axis
    for name, vector in drawn.items():
        start, end = paths[name]
        assert end - start == pytest.approx(page @ vector, abs=0.11), name
    ends = paths["turn"][[0, -1]] - paths["position"][0]
    wanted = 0.6 * earth * np.array([stars[:, 0], [1.0, 0.0, 0.0]]) @ page.T
    assert ends == pytest.approx(wanted, abs=0.5)


def test_the_mirrors_of_the_tracker_have_the_printed_tilt():
    tilt = printed("chen2023/text-satellite#dihedral-angle")
    for key in ("chen2023/fig-3a", "chen2023/fig-3b"):
        assert angle(marked(tree(key), "mirror")[0]) == pytest.approx(tilt, abs=0.1)
    [star], [laser] = (
        marked(tree("chen2023/fig-3b"), kind) for kind in ("star", "laser")
    )
    normal = [-np.sin(np.radians(tilt)), np.cos(np.radians(tilt)), 0.0]
    into, folded = np.diff(laser[:3], axis=0)
    expected = (mirror_train([normal]) @ [*into, 0.0])[:2]
    assert folded / np.hypot(*folded) == pytest.approx(
        expected / np.hypot(*expected), abs=0.01
    )
    assert star[-1][1] == pytest.approx(laser[-1][1])


def test_the_bench_folds_the_laser_into_the_tracker():
    """Three reflections carry the camera's boresight to the one of the tracker, backwards."""
    root = tree("chen2023/fig-6b")
    between = printed("chen2023/text-satellite#boresight-angle")
    out, folded = (marked(root, "laser")[i] for i in (0, 1))
    into = folded[1] - folded[0]
    away = out[1] - out[0]
    cosine = away @ -into / np.hypot(*away) / np.hypot(*into)
    assert np.degrees(np.arccos(cosine)) == pytest.approx(between, abs=0.2)
    mirrors = marked(root, "mirror")
    normals = [[*(np.diff(one, axis=0)[0][::-1] * [1, -1]), 0.0] for one in mirrors]
    turned = (mirror_train(np.array(normals)) @ [*away, 0.0])[:2]
    assert angle([[0, 0], turned]) == pytest.approx(angle(folded), abs=0.5)
    tilt = angle(mirrors[2]) - (between - 90)
    assert tilt == pytest.approx(
        np.degrees(fold_mirror_tilt(np.radians(between))), abs=0.3
    )


def test_the_focal_plane_has_the_printed_number_of_detectors():
    boxes = tree("chen2023/fig-2b").iter(f"{SVG}rect")
    detectors = [one for one in boxes if one.get("class").startswith("detector")]
    assert len(detectors) == printed("chen2023/text-hardware#detectors")
