"""The misalignment with the direction of every laser free, in place of one scale for all.

The calibration group measures the directions: a laser that sits askew moves its spot in both groups
alike, and its error is in the posterior of the misalignment. The camera's axes are those of the
design laid over the rough spots (`Platform.reference`): a turn of the whole pattern against them is
a part of the directions, and no mount is left to tell. Conventions are those of `misalignment`.
"""

from __future__ import annotations

import numpy as np

from reproduce.inference.lasers import Platform, SpotStatistics
from reproduce.inference.misalignment import AXES, SpotLikelihood, misalignment_model
from reproduce.inference.model import Derived, Model, Parameter
from reproduce.inference.priors import Normal
from reproduce.inference.quest import Quest, none
from reproduce.physics.validate import FloatArray
from reproduce.units import ARCSEC_PER_RADIAN

# As the prior of the common scale: the pattern is set to a tenth or so of its size.
PLACED = 0.1


class DirectionsLikelihood(SpotLikelihood):
    """Two groups; parameters: misalignment (3), errors of directions (2 per laser), noise (px).

    The errors stand laser by laser, X before Y: what is added to the slopes of a laser's ray
    against the camera's axis.
    """

    def turns(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """No turn in the first group, the misalignment in the second."""
        turn = np.stack([np.zeros_like(parameters[:, :3]), parameters[:, :3]], axis=1)
        return turn, turn

    def landed(self, parameters: FloatArray, turn: FloatArray) -> FloatArray:
        """Spots after turns of shape (n, groups, 3), in px."""
        focal = self.platform.camera_focal_length
        errors = parameters[:, 3:-1].reshape(len(parameters), -1, 2)
        lasers = self.platform.lasers - focal * errors
        return self.platform.landed(np.zeros_like(parameters[:, :3]), turn, lasers, focal)

    def middle(self) -> tuple[FloatArray, FloatArray]:
        """No misalignment, give or take some arc minutes; the directions as designed."""
        count = self.platform.lasers.size
        scales = np.append(np.full(3, 1e-2), np.full(count, 3 * placed(self.platform)))
        return np.zeros(3 + count), scales

    def by_quest(self, found: Quest) -> list[FloatArray]:
        """The misalignment, the directions taken for those of the design."""
        return [found.turned(1), none(self.platform.lasers.size)]

    def rough(self) -> tuple[FloatArray, FloatArray]:
        """The same: there is neither mount nor scale."""
        return self.middle()


def placed(platform: Platform) -> float:
    """Standard deviation of a laser's direction beforehand, in radians."""
    size = np.hypot(*(platform.lasers - platform.lasers.mean(axis=0)).T).mean()
    return float(PLACED * size / platform.camera_focal_length)


def directions_model(
    platform: Platform, statistics: SpotStatistics, *, derived: Derived | None = None
) -> Model:
    """A constant misalignment from two groups of images, every laser with its own direction.

    Parameters
    ----------
    platform : Platform
        The instrument.
    statistics : SpotStatistics
        Two groups, the first at the zero point.
    derived : Derived, optional
        Consequences.

    Returns
    -------
    Model
        Parameters angle-x..z, direction-1-x..n-y (rad), noise (px).
    """
    base = misalignment_model(platform, statistics)
    prior = Normal(0.0, placed(platform), "each laser within a tenth or so of the pattern's size "
                   "of its design; the printed spots lie a twentieth off")  # fmt: skip
    directions = tuple(
        Parameter(
            f"direction-{i + 1}-{a}", rf"\delta_{{{i + 1}{a}}}", "arcsec", prior, ARCSEC_PER_RADIAN
        )
        for i in range(len(platform.lasers))
        for a in AXES[:2]
    )
    return Model(
        "misalignment-directions",
        "Constant misalignment, the direction of every laser free",
        (*base.parameters[3:6], *directions, base.parameters[-1]),
        DirectionsLikelihood(platform, statistics),
        {},
        derived,
    )
