"""The states of a stage that moves the lasers, jointly: focal length and stage scale from spots.

Conventions are those of `misalignment`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reproduce.inference.lasers import Platform, SpotStatistics
from reproduce.inference.misalignment import SpotLikelihood, spots_model
from reproduce.inference.model import Derived, Model, Parameter
from reproduce.inference.priors import LogNormal, Normal, Prior
from reproduce.inference.quest import Quest, none
from reproduce.physics.attitude.misalignment import stage_angles
from reproduce.physics.validate import FloatArray


@dataclass(frozen=True, eq=False)
class StageLikelihood(SpotLikelihood):
    """Groups at known stage positions; parameters 3 and 4: camera focal length, stage scale.

    Parameters
    ----------
    motions : ndarray, shape (groups, 2)
        Motion of the lasers since the first group, in metres.
    """

    motions: FloatArray

    def turns(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """The angles that the motions stand for."""
        motions = parameters[:, 4, None, None] * self.motions
        turn = stage_angles(motions, np.broadcast_to(parameters[:, 3, None], motions.shape[:2]))
        return turn, turn

    def focal(self, parameters: FloatArray) -> FloatArray:
        """Focal length of the camera, in metres."""
        return parameters[:, 3]

    def middle(self) -> tuple[FloatArray, FloatArray]:
        """As designed, give or take a few per cent."""
        focal = self.platform.camera_focal_length
        return np.array([focal, 1.0]), np.array([0.03 * focal, 0.01])

    def by_quest(self, found: Quest) -> list[FloatArray]:
        """Zero attitude, and the focal length that holds if the stage moves as told."""
        return [found.mount, found.focal(self.motions), none(2)]


def states_model(
    platform: Platform,
    statistics: SpotStatistics,
    motions: FloatArray,
    *,
    priors: Mapping[str, Prior] | None = None,
    derived: Derived | None = None,
) -> Model:
    """States of a stage that moves the lasers, jointly: focal length and stage scale are free.

    Parameters
    ----------
    platform, statistics, priors, derived
        As for `misalignment_model`; one group per state.
    motions : ndarray, shape (groups, 2)
        Motion of the stage since the first state, in metres.

    Returns
    -------
    Model
        Parameters mount-x..z (rad), focal-length (m), stage-scale, laser-scale, noise (px).
    """
    focal = platform.camera_focal_length
    middle = (
        Parameter("focal-length", "f", "mm", LogNormal(focal, 0.02, "a nominal focal length "
                  "holds to a few per cent"), 1e3),
        Parameter("stage-scale", "c", "1", Normal(1.0, 0.002, "a closed-loop piezo stage is "
                  "calibrated to a few parts in a thousand")),
    )  # fmt: skip
    likelihood = StageLikelihood(platform, statistics, motions)
    title = "Five states of the stage, jointly"
    return spots_model("misalignment-states", title, middle, likelihood, priors, derived)
