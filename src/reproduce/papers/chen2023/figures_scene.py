"""Figure 1a: the imaging model in space, computed as equation (1) computes it.

The orbit is far too high and the date and the target are our choice; all directions, the turn of
the Earth between the two frames and the place where the line of sight meets the ground come from
the library. Drawn from the caption and the text, not from the paper's picture.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from reproduce.papers.chen2023.sketch import SCENE, STAR
from reproduce.papers.declare import draws
from reproduce.papers.sketch import INK, Look, arrow, beside, diagram, key, label, line, path
from reproduce.papers.space import View, seen_from, sense, triad
from reproduce.physics.attitude.rotations import rotation_from_vector, transpose, unit
from reproduce.physics.ground.earth import EarthOrientation, earth_fixed, earth_from_inertial
from reproduce.physics.ground.imaging import WGS84, image_vectors, imaged_position, imaging_chain
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given

if TYPE_CHECKING:
    from matplotlib.axes import Axes

INSTALLED = "chen2023/text-satellite#boresight-angle"
INERTIAL = Look("J2000", INK, "--")
DATE = "2023-09-22T03:30:00"
RADIUS = WGS84.equatorial_radius
ABOVE = np.array([np.radians(104.0), np.radians(24.0), 1.25 * RADIUS])
TARGET = np.array([np.radians(66.0), np.radians(50.0), 0.0])
VIEW = seen_from(36.0, 20.0, (4.6, 3.2), 2.8 / RADIUS)


@dataclass(frozen=True, eq=False)
class Scene:
    """What Figure 1a shows, Earth-fixed, in metres.

    Attributes
    ----------
    satellite, target : ndarray, shape (3,)
        Positions; the target is where equation (1) puts the middle of the image.
    earth_from_camera, earth_from_tracker, earth_from_inertial : ndarray, shape (3, 3)
        Their columns are the axes of the three frames.
    """

    satellite: FloatArray
    target: FloatArray
    earth_from_camera: FloatArray
    earth_from_tracker: FloatArray
    earth_from_inertial: FloatArray


def scene(door: Given) -> Scene:
    """Return a satellite that looks at a target, and what the imaging model makes of it."""
    turning = earth_from_inertial(DATE, EarthOrientation(ut1_utc=0.0))
    satellite = earth_fixed(ABOVE)
    looking = _frame(earth_fixed(TARGET) - satellite)
    angle = door[INSTALLED]
    # The tracker looks away from the Earth: the camera, turned about the X that both share.
    tracker_from_camera = rotation_from_vector([angle, 0.0, 0.0])
    inertial_from_tracker = transpose(turning) @ looking @ transpose(tracker_from_camera)
    chain = imaging_chain(turning, inertial_from_tracker, np.eye(3), tracker_from_camera)
    centre = image_vectors([(0.0, 0.0)], focal_length=1.0)
    return Scene(
        satellite=satellite,
        target=imaged_position(centre, satellite, chain).position[0],
        earth_from_camera=chain,
        earth_from_tracker=turning @ inertial_from_tracker,
        earth_from_inertial=turning,
    )


def _frame(boresight: ArrayLike) -> FloatArray:
    """Return a frame, its axes as columns, with Z along the boresight and X level."""
    z = unit("boresight", boresight)
    x = unit("level", np.cross([0.0, 0.0, 1.0], z))
    return np.stack([x, np.cross(z, x), z], axis=-1)


@draws("chen2023/fig-1a", given=[INSTALLED])
@diagram(14.0, 9.6, 6.6)
def draw(axes: Axes, door: Given) -> None:
    """Frames of the imaging model, from a point of the image to a place on the Earth."""
    content, view = scene(door), VIEW
    _globe(axes, view)
    _earth_frames(axes, view, content)
    place, target = view.point(content.satellite), view.point(content.target)
    arrow(axes, view.point(np.zeros(3)), place, width=0.8)
    path(axes, [target, place], SCENE)
    axes.plot(*target, SCENE.marker, color=SCENE.colour, markersize=7)
    # Beside the camera's frame on the paper, so that both can be read.
    tracker = content.satellite + RADIUS * np.array([0.35, 0.75]) @ view.matrix
    size = 0.42 * RADIUS
    for columns, name, origin in (
        (content.earth_from_camera, "c", content.satellite),
        (content.earth_from_tracker, "s", tracker),
    ):
        names = [f"$X_{name}$", f"$Y_{name}$", "$Z_s$" if name == "s" else ""]
        triad(axes, view, origin, size * columns.T, names, width=1.8)
    # The line of sight runs along the camera's boresight: its name stands above.
    tip = view.point(content.satellite + size * content.earth_from_camera[:, 2])
    label(axes, beside(tip, -0.1, 0.35), "$Z_c$")
    boresight = RADIUS * content.earth_from_tracker[:, 2]
    path(axes, [view.point(tracker + s * boresight) for s in (1.25, 0.7)], STAR)
    label(axes, beside(place, 0.7, 0.2), "camera", ha="left")
    label(axes, beside(view.point(tracker), -0.35, 0.1), "tracker", ha="right")
    label(axes, beside(target, 0.3, 0.4), "target")
    label(axes, beside((place + np.asarray(view.centre)) / 2, 1.3, -0.35), "$(X_S, Y_S, Z_S)$")
    key(axes, (SCENE, STAR, INERTIAL), (0.0, 1.0))


def _globe(axes: Axes, view: View) -> None:
    """Draw the outline, the equator, dotted where it lies behind, and the zero meridian."""
    around = np.linspace(0, 2 * np.pi, 240)
    outline = view.scale * RADIUS * np.stack([np.cos(around), np.sin(around)], axis=-1)
    line(axes, np.asarray(view.centre) + outline, 1.3)
    viewer = np.cross(*view.matrix)
    flat = np.stack([np.cos(around), np.sin(around), 0 * around], axis=-1)
    upright = flat[:, [0, 2, 1]]
    for circle, style, shown in (
        (flat, "-", flat @ viewer >= 0),
        (flat, ":", flat @ viewer < 0),
        (upright, "-", upright @ viewer >= 0),
    ):
        seen = view.point(RADIUS * circle)
        seen[~shown] = np.nan
        line(axes, seen, 0.7, style)


def _earth_frames(axes: Axes, view: View, content: Scene) -> None:
    """Draw the frame of the stars, the turning one, and the turn between their X axes."""
    length = 1.6 * RADIUS
    fixed = np.diag([length, length, 1.3 * RADIUS])
    triad(
        axes,
        view,
        np.zeros(3),
        fixed[:2],
        ["$X_\\mathrm{WGS84}$", "$Y_\\mathrm{WGS84}$"],
        width=1.8,
    )
    triad(axes, view, np.zeros(3), fixed[2:], ["$Z$ of both"], width=1.8)
    inertial = length * content.earth_from_inertial.T[:2]
    triad(
        axes,
        view,
        np.zeros(3),
        inertial,
        ["$X_\\mathrm{J2000}$", "$Y_\\mathrm{J2000}$"],
        look=INERTIAL,
    )
    x = content.earth_from_inertial[:, 0]
    turn = float(-np.arctan2(x[1], x[0]))
    sense(axes, view, np.zeros(3), [0.0, 0.0, 1.0], 0.6 * RADIUS * x, turn)
