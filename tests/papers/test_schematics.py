"""Drawn frames, angles and signs against the functions that they illustrate."""

import re
from xml.etree import ElementTree

import erfa
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reproduce.papers.declare import Schematic, drawing
from reproduce.physics import ground
from reproduce.physics.attitude import (
    emitted_directions,
    misalignment,
    misalignment_angles,
    rotation_from_vector,
    unit,
)
from reproduce.physics.optics import starlight
from reproduce.physics.raytrace import mirror_train
from reproduce.physics.registration import fit_registration
from reproduce.printed.cells import find
from reproduce.views.figure import Figure, drawable

SVG = "{http://www.w3.org/2000/svg}"
LASERS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]) * 0.1
DRAWN = {key: one for key in drawable() if isinstance(one := drawing(key), Schematic)}


def tree(key):
    return ElementTree.fromstring(DRAWN[key].svg)


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
    assert len(DRAWN) >= 15
    for key, one in DRAWN.items():
        root = tree(key)
        assert one.title, key
        drawn = ElementTree.fromstring(Figure(key).compute())
        assert drawn.find(f"{SVG}style") is not None, key
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


def named(key):
    """Return the paths with an identifier, by it."""
    paths = tree(key).iter(f"{SVG}path")
    return {path.get("id"): points(path) for path in paths if path.get("id")}


def test_the_drawn_axes_and_senses_of_the_rotary_table_are_those_of_its_matrix():
    paths, page = named("niu2024/fig-3"), view(52, 20)[:, [1, 2, 0]].T  # y upwards
    for name, axis in zip("xyz", page, strict=True):
        [step] = np.diff(paths[f"axis-{name}"], axis=0)
        assert step / np.hypot(*step) == pytest.approx(axis / np.hypot(*axis), abs=0.01)
    for index, angles in enumerate(([0.1, 0.0], [0.0, 0.1])):
        turn = Rotation.from_rotvec(0.1 * np.eye(3)[index])
        assert starlight(*angles) == pytest.approx(turn.inv().apply([0.0, 0.0, 1.0]))
        steps = np.diff(paths[f"sense-{'xy'[index]}"], axis=0)
        drawn = np.linalg.det(np.stack([steps[:-1], steps[1:]], axis=1))
        right = np.linalg.det(np.roll(page, -index - 1, axis=0)[:2])
        assert (drawn * right > 0).all()


def test_the_section_of_the_camera_is_to_scale():
    paths, text = named("niu2024/fig-5"), "niu2024/text-optics#"
    width = printed(f"{text}pixels-x") * printed(f"{text}pixel-pitch-x") * 1e-3
    scale = np.ptp(paths["focal-length"][:, 0]) / printed(f"{text}focal-length")
    for name in ("red", "green", "blue"):
        length = np.hypot(*np.ptp(paths[name], axis=0))
        assert length == pytest.approx(scale * width, rel=0.01)
    lens = paths["focal-length"][0, 0]
    across, up = paths["red"].mean(axis=0) - [lens, paths["green"][:, 1].mean()]
    assert across + up == pytest.approx(np.ptp(paths["focal-length"][:, 0]), abs=0.1)


def test_the_drawn_rotations_are_the_measured_misalignments():
    root, page = tree("chen2023/drawing-misalignment"), view(-62.0, 26.0) * 58
    camera = emitted_directions(LASERS, 1.0)
    for index, axis in enumerate(np.eye(3)):
        rotation = rotation_from_vector(np.radians(28.0) * axis).mT
        moved = misalignment(camera, camera @ rotation, np.eye(3))
        assert misalignment_angles(moved) == pytest.approx(np.radians(28.0) * axis)
        group = root.find(f".//{SVG}g[@id='about-{'XYZ'[index]}']")
        ends = np.delete(rotation, index, axis=0) @ page.T
        for path, end in zip(marked(group, "thick"), ends, strict=True):
            assert path[1] - path[0] == pytest.approx(end, abs=0.06)
        # The arc and the label show the motion of the boresight, or of X.
        watched = 0 if index == 2 else 2
        [arc] = [path for path in marked(group, "thin") if len(path) > 2]
        assert arc[-1] == pytest.approx(0.75 * rotation[watched] @ page.T, abs=0.06)
        step = rotation[watched] - np.eye(3)[watched]
        place = int(np.abs(step).argmax())
        end = f"to {'+' if step[place] > 0 else '−'}{'XYZ'[place]}"
        assert labels(root)[5 * index + 4].endswith(end)


def test_a_moved_laser_has_the_effect_of_the_written_rotation():
    at_rest = emitted_directions(LASERS, 1.0)
    for axis, move in zip("XY", 1e-4 * np.eye(2), strict=True):
        moved = emitted_directions(LASERS + move, 1.0)
        angles = misalignment_angles(misalignment(at_rest, moved, np.eye(3)))
        about = int(np.abs(angles).argmax())
        sense = f"{'+' if angles[about] > 0 else '−'}{'XYZ'[about]}"
        texts = labels(tree("chen2023/fig-6a"))
        effect = texts[texts.index(f"to {axis}: camera") + 1]
        assert effect == f"as if about {sense}"


def test_the_scene_is_the_one_of_the_imaging_model():
    """Camera and target of equation (1), as drawn in Figure 1a."""
    paths, degree = named("chen2023/fig-1a"), np.pi / 180
    page = view(36.0, 20.0) * 2.8 * 27 / ground.EARTH_RADIUS
    high = 1.25 * ground.EARTH_RADIUS
    above = erfa.gd2gc(erfa.WGS84, 104.0 * degree, 24.0 * degree, high)
    target = erfa.gd2gc(erfa.WGS84, 66.0 * degree, 50.0 * degree, 0.0)
    z = unit("boresight", target - above)
    x = unit("level", np.cross([0.0, 0.0, 1.0], z))
    length = 0.42 * ground.EARTH_RADIUS
    for name, vector in (
        ("sight", above - target),
        ("camera-x", length * x),
        ("camera-z", length * z),
    ):
        start, end = paths[name]
        assert end - start == pytest.approx(page @ vector, abs=0.11), name


def reflected(step, mirrors):
    """Return the direction of a step after drawn mirrors."""
    normals = [[*(np.diff(path, axis=0)[0][::-1] * [1, -1]), 0.0] for path in mirrors]
    direction = (mirror_train(np.array(normals)) @ [*step, 0.0])[:2]
    return direction / np.hypot(*direction)


def test_drawn_light_obeys_the_mirrors_and_meets_in_one_point():
    """Two rays of each laser, from the direction before the first mirror to the last."""
    for name, count in (("1b", 3), ("2a", 3), ("3b", 1), ("6b", 3)):
        root = tree(f"chen2023/fig-{name}")
        mirrors, rays = marked(root, "mirror"), marked(root, "laser")
        assert 2 * len(mirrors) == count * len(rays)
        for place, ray in enumerate(rays):
            steps, first = np.diff(ray, axis=0), count * (place // 2)
            folded = steps[-2] / np.hypot(*steps[-2])
            expected = reflected(steps[-2 - count], mirrors[first : first + count])
            assert folded == pytest.approx(expected, abs=0.01), name
        for one, other in zip(rays[::2], rays[1::2], strict=True):
            assert one[-1] == pytest.approx(other[-1], abs=0.2), name


def test_the_drawn_instruments_have_the_printed_angles():
    between = printed("chen2023/text-satellite#boresight-angle")
    tilt = printed("chen2023/text-satellite#dihedral-angle")
    for key in ("chen2023/fig-3a", "chen2023/fig-3b"):
        assert angle(marked(tree(key), "mirror")[0]) == pytest.approx(tilt, abs=0.1)
    for name in ("2a", "6b"):
        steps = np.diff(marked(tree(f"chen2023/fig-{name}"), "laser")[0], axis=0)
        cosine = steps[1] @ -steps[-2] / np.hypot(*steps[1]) / np.hypot(*steps[-2])
        assert np.degrees(np.arccos(cosine)) == pytest.approx(between, abs=0.5)
