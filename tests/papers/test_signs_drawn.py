"""The drawn frames and signs say what the functions do: read off the drawings, part by part."""

import erfa
import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from scipy.spatial.transform import Rotation

from reproduce.papers import sketch
from reproduce.papers.catalogue import catalogue
from reproduce.papers.chen2023 import attitude, positioning
from reproduce.papers.chen2023 import platform_twin as platform
from reproduce.papers.niu2024 import registration
from reproduce.physics.attitude import (
    emitted_directions,
    misalignment,
    misalignment_angles,
)
from reproduce.physics.light import mirror_train
from reproduce.physics.registration import fit_registration
from reproduce.printed.given import given

LASERS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]]) * 0.1
STILL = np.eye(3)


def painted(draw, *printed):
    figure = Figure()
    draw(figure, *printed)
    return figure.axes[0]


def ends(axes):
    """Return start and end of every arrow, shape (n, 2, 2)."""
    arrows = [patch for patch in axes.patches if isinstance(patch, FancyArrowPatch)]
    return np.array([patch._posA_posB for patch in arrows], dtype=float)


def curves(axes):
    """Return the curved arrows: lines of sixty points in ink."""
    return [line.get_xydata() for line in axes.lines if len(line.get_xydata()) == 60]


def holds_arrow(axes, start, end):
    """Tell whether an arrow runs from one place to another."""
    return bool(np.isclose(ends(axes), [start, end], atol=1e-9).all(axis=(1, 2)).any())


def words(axes):
    return [text.get_text() for text in axes.texts]


def measured(camera, arrives):
    """Return the misalignment that equation (7) finds from light in the zero camera's frame."""
    return misalignment_angles(misalignment(camera, arrives, STILL))


@pytest.mark.parametrize("index", range(3))
def test_the_drawn_turn_is_the_misalignment_that_is_measured(index):
    angles = attitude._TURN * np.eye(3)[index]
    axes_now = attitude._turned_camera(angles)
    camera = emitted_directions(LASERS, 1.0)
    assert measured(camera, camera @ axes_now) == pytest.approx(angles, abs=1e-9)


@pytest.mark.parametrize("index", range(3))
def test_the_curved_arrow_turns_right_handed(index):
    axes = painted(attitude._draw_misalignment)
    view = sketch.seen_from(-62.0, 26.0, ((2.0, 6.6, 11.2)[index], 2.7), 2.2)
    start = 0.75 * np.eye(3)[0 if index == 2 else 2]
    for share, point in zip(np.linspace(0, 1, 60), curves(axes)[index], strict=True):
        turned = Rotation.from_rotvec(share * attitude._TURN * np.eye(3)[index]).apply(
            start
        )
        assert point == pytest.approx(view.point(turned))
    for axis in np.delete(np.eye(3), index, axis=0):
        now = Rotation.from_rotvec(attitude._TURN * np.eye(3)[index]).apply(axis)
        assert holds_arrow(axes, view.point(np.zeros(3)), view.point(now))


def test_the_words_under_the_turns_say_where_the_axes_go():
    said = words(painted(attitude._draw_misalignment))
    assert r"$\theta_X > 0$: boresight towards −Y" in said
    assert r"$\theta_Y > 0$: boresight towards +X" in said
    assert r"$\theta_Z > 0$: X towards +Y" in said


def test_x_y_and_z_are_drawn_right_handed():
    """Seen from outside, X, Y and Z of a right-handed frame follow each other anticlockwise."""
    for view in (sketch.seen_from(36.0, 20.0), sketch.seen_from(-62.0, 200.0)):
        viewer = np.cross(*view.matrix)
        x, y = view.point(np.eye(3)[:2])
        assert np.sign(x[0] * y[1] - x[1] * y[0]) == np.sign(viewer[2])


@pytest.mark.parametrize("index", range(2))
def test_a_moved_laser_stands_for_the_turn_that_is_measured(index):
    shift = np.zeros(2)
    shift[index] = 1e-4
    found = measured(
        emitted_directions(LASERS, 1.0), emitted_directions(LASERS + shift, 1.0)
    )
    turn = int(np.abs(found).argmax())
    sense = f"{'+' if found[turn] > 0 else '−'}{'XYZ'[turn]}"
    text = f"towards {'XY'[index]}: as if the camera turned about {sense}"
    assert text in words(painted(platform._draw_stage, {"laser-diagonal": 22e-3}))


def test_the_earth_turns_by_its_rotation_angle_from_the_stars():
    axes, view = painted(positioning._draw_scene, {}), positioning._VIEW
    dates = erfa.dtf2d("UTC", 2023, 9, 22, 3, 30, 0.0)
    angle = erfa.era00(*dates)
    sweep = curves(axes)[-1]
    share = np.linspace(0, 1, 60)[:, np.newaxis]
    # From the X axis of the stars, which lies so far to the west, eastwards to that of the Earth.
    away = np.squeeze(share * angle - angle)
    expected = (
        0.6 * positioning._EARTH * np.stack([np.cos(away), np.sin(away), 0 * away], -1)
    )
    # Precession since J2000 tilts the axis by a third of a degree at the most.
    size = view.scale * positioning._EARTH
    assert np.abs(sweep - view.point(expected)).max() < np.radians(0.35) * size
    assert angle < np.pi


def test_the_line_of_sight_ends_where_the_camera_looks():
    place, target, frames = positioning._scene(given([positioning.satellite.BORESIGHT]))
    sight, view = target - place, positioning._VIEW
    boresight = frames["camera"] @ [0.0, 0.0, 1.0]
    assert sight / np.linalg.norm(sight) == pytest.approx(boresight, abs=1e-12)
    assert erfa.gc2gd(1, target)[2] == pytest.approx(0.0, abs=1e-3)
    both = frames["tracker"][:, 2] @ boresight
    assert np.degrees(np.arccos(both)) == pytest.approx(120.0)
    axes = painted(positioning._draw_scene, {})
    assert holds_arrow(axes, view.point(target), view.point(place))


def test_the_bench_folds_the_laser_into_the_tracker():
    """Three reflections carry the camera's boresight to the one of the tracker, backwards."""
    angles = dict(zip(platform._ANGLES, np.radians([120.0, 37.76, 30.0]), strict=True))
    axes = painted(platform._draw_bench, angles)
    path = ends(axes)
    ways = (path[:, 1] - path[:, 0]) / np.linalg.norm(path[:, 1] - path[:, 0], axis=1)[
        :, None
    ]
    out, folded = ways[0], ways[5]
    assert np.degrees(np.arccos(out @ -folded)) == pytest.approx(120.0)
    mirrors = [line.get_xydata() for line in axes.lines if line.get_linewidth() == 3]
    normals = [
        np.array([*(np.diff(line, axis=0)[0][::-1] * [1, -1]), 0.0]) for line in mirrors
    ]
    assert (mirror_train(normals) @ [*out, 0.0])[:2] == pytest.approx(folded)


def test_a_fit_returns_the_angle_and_the_shift_of_the_drawn_planes():
    """Points fixed to the drawn green axes, as the drawn blue detector sees them."""
    origin, angle = (
        registration._PRINCIPAL_POINTS,
        np.radians(registration._PLANE_ANGLE),
    )
    axes = painted(catalogue()["niu2024/fig-2"].draw, {})
    arrows = ends(axes)
    across = arrows[2, 1] - arrows[2, 0]
    assert np.arctan2(across[1], across[0]) == pytest.approx(angle)
    points = np.array([[1.0, 0.0], [0.0, 1.0], [2.0, 3.0]])
    back = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    blue, green = points @ back.T + origin["blue"], points + origin["green"]
    found = fit_registration(blue, green, pivot=origin["blue"]).parameters
    drawn_shift = arrows[2, 0] - arrows[0, 0]
    assert found == pytest.approx([1.0, angle, *drawn_shift])
