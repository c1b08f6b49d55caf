"""What each approximation of the four-parameter model costs, in pixels.

The model lays a source channel over the reference by scale, rotation and shift. Five things are
left out: that the distortions differ, that k^3 is not k, that the pivot may not be the principal
point, that a detector may be tilted, and that there is a second radial term. For each there is the
*error field*, reference point minus modelled point at the true parameters.

Positions have shape (n, 2), in metres on the source's focal plane, x before y, from the principal
point; error fields have shape (n, 2), in px of the reference; angles are in radians.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.optics import Camera
from reproduce.physics.optics.camera import _turned
from reproduce.physics.registration.transforms import similarity_between
from reproduce.physics.validate import FloatArray, Points, checked, positive

_NONE = np.zeros(())
EFFECTS = ("coefficients", "cube", "pivot", "tilt", "second term")


@dataclass(frozen=True, eq=False)
class Channels:
    """A source channel and the reference, with what the model leaves out.

    Attributes
    ----------
    source, reference : Camera
        Their imaging parameters; single cameras.
    rotation : float
        Angle of the source detector against the reference, in radians.
    pivot_error : tuple of float
        How far the assumed pivot lies from the source's principal point, in px.
    tilt : tuple of float
        Slopes of the source detector along x and y: the tangents of its tilt. A positive one
        leans that side away from the lens, where the light has spread further.
    second_term : tuple of float
        Second radial coefficients of source and reference, in m^-4.
    """

    source: Camera
    reference: Camera
    rotation: float = 0.0
    pivot_error: tuple[float, float] = (0.0, 0.0)
    tilt: tuple[float, float] = (0.0, 0.0)
    second_term: tuple[float, float] = (0.0, 0.0)

    @property
    def scale(self) -> float:
        """The scale factor k."""
        return float(self.reference.focal_length / self.source.focal_length)

    def only(self, effect: str) -> Channels:
        """Return the same channels with a single effect left, all others taken away.

        Parameters
        ----------
        effect : str
            One of `EFFECTS`. For "coefficients" the source's distortion is kept and the difference
            alone counts; for "cube" both channels get the source's.

        Returns
        -------
        Channels

        """
        if effect not in EFFECTS:
            raise ValueError(f"effect: expected one of {EFFECTS}, got {effect!r}")
        m = self.source.radial_distortion if effect in EFFECTS[:2] else _NONE
        shared = {"coefficients": self.reference.radial_distortion, "cube": m}.get(effect, _NONE)
        return Channels(
            replace(self.source, radial_distortion=m),
            replace(self.reference, radial_distortion=shared),
            self.rotation,
            self.pivot_error if effect == "pivot" else (0.0, 0.0),
            self.tilt if effect == "tilt" else (0.0, 0.0),
            self.second_term if effect == "second term" else (0.0, 0.0),
        )


def error_field(channels: Channels, positions: ArrayLike) -> FloatArray:
    """Reference points minus modelled points, at the true parameters and imaged exactly.

    Parameters
    ----------
    channels : Channels
    positions : array_like, shape (n, 2)
        Ideal positions in the source channel, in metres.

    Returns
    -------
    ndarray, shape (n, 2), in px

    Examples
    --------
    Alike channels without distortion leave nothing to err about.

    >>> camera = Camera(25e-3, (1000, 700), 0, 1e-5)
    >>> error_field(Channels(camera, camera), [[1e-3, 2e-3]])
    array([[0., 0.]])
    """
    source, reference = _imaged(channels, positions)
    truth = similarity_between(channels.source, channels.rotation, channels.reference)
    # True parameters, but about the pivot that is assumed.
    pivot = channels.source.principal_point + np.asarray(channels.pivot_error)
    turned = _turned(source - pivot, -truth.rotation)
    return reference - (truth.scale * turned + pivot - truth.shift)


def even_positions(half_size: ArrayLike, across: int = 200) -> FloatArray:
    """Cover a detector evenly with positions.

    Parameters
    ----------
    half_size : array_like, shape (2,)
        Half the sides of the detector, in metres.
    across : int
        How many along either side.

    Returns
    -------
    ndarray, shape (across * across, 2)
        The middles of equal cells, in metres, rows from the smallest y.

    Examples
    --------
    >>> even_positions((2.0, 1.0), 2)
    array([[-1. , -0.5],
           [ 1. , -0.5],
           [-1. ,  0.5],
           [ 1. ,  0.5]])
    """
    sides = positive("half_size", half_size, shape=(2,))
    steps = (np.arange(across) + 0.5) / across * 2 - 1
    x, y = np.meshgrid(sides[0] * steps, sides[1] * steps)
    return np.stack([x.ravel(), y.ravel()], axis=-1)


@checked
def _imaged(channels: Channels, positions: Points) -> tuple[FloatArray, FloatArray]:
    """Image the same stars in both channels, in px, with tilt and second radial terms."""
    source = _displaced(positions, channels.source, channels.second_term[0])
    # The ray through a point p of the plane at F meets the tilted plane at p F / (F - p . tilt).
    focal = float(channels.source.focal_length)
    lean = (source @ np.asarray(channels.tilt))[:, None] / focal
    along = np.sqrt(1 + np.square(channels.tilt))
    tilted = source / (1 - lean) * along
    turned = _turned(tilted, np.asarray(channels.rotation))
    reference = _displaced(positions * channels.scale, channels.reference, channels.second_term[1])
    return _in_pixels(turned, channels.source), _in_pixels(reference, channels.reference)


def _displaced(ideal: FloatArray, camera: Camera, second: float) -> FloatArray:
    squared = np.square(ideal).sum(axis=-1, keepdims=True)
    first = float(camera.radial_distortion)
    return ideal * (1 + first * squared + second * squared**2)


def _in_pixels(positions: FloatArray, camera: Camera) -> FloatArray:
    return positions / camera.pixel_pitch + camera.principal_point
