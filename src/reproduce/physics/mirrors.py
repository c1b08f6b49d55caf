"""Plane mirrors that fold a light path.

Angles are in radians.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.validate import FloatArray, finite_array


def fold_mirror_tilt(boresight_angle: ArrayLike) -> FloatArray:
    """The tilt of a mirror that sends the retro-reflected light of one instrument into another.

    Light leaves the first instrument along its boresight, comes back along the same line, and a
    plane mirror in front of the second instrument turns it onto that one's boresight. The mirror's
    normal halves the angle between the returning and the turned direction.

    Parameters
    ----------
    boresight_angle : array_like
        Angle between the two boresights, both pointing outwards, from 0 (excluded) to pi.

    Returns
    -------
    ndarray
        Dihedral angle between the mirror and the plane across the second boresight:
        pi/2 - boresight_angle/2.

    Raises
    ------
    ValueError
        If the angle is not finite or not between 0 and pi.

    Examples
    --------
    Opposite instruments look straight at each other through an untilted mirror.

    >>> float(fold_mirror_tilt(np.pi))
    0.0
    """
    angle = finite_array("boresight_angle", boresight_angle)
    if ((angle <= 0) | (angle > np.pi)).any():
        raise ValueError(
            f"boresight_angle: expected above 0 and at most pi, got {angle.min():g} to "
            f"{angle.max():g} rad; angles are in radians, not degrees"
        )
    return np.asarray(np.pi / 2 - angle / 2)
