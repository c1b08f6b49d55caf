"""What the posteriors of chen2023 mean for pointing, in arcsec, and on the ground, in metres."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from reproduce.inference import Consequence
from reproduce.papers.chen2023.platform import SIGMAS
from reproduce.physics.attitude import averaged_error, stage_angles
from reproduce.physics.ground import ground_error
from reproduce.physics.validate import FloatArray
from reproduce.units import ARCSEC_PER_RADIAN

__all__ = ["Averaged", "OnTheGround", "StageTest"]


@dataclass(frozen=True)
class OnTheGround:
    """What an error of the misalignment costs on the ground, from the satellite's altitude.

    Parameters
    ----------
    altitude : float
        In metres.
    first : int
        Column of the angle about X; that about Y follows.
    """

    altitude: float
    first: int = 3

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Errors about the posterior mean: pointing in arcsec, position in metres."""
        angles = parameters[:, self.first : self.first + 2]
        error = np.hypot(*(angles - angles.mean(axis=0)).T)
        metres = ground_error(self.altitude, error)
        shift = ground_error(self.altitude, np.hypot(*angles.T))
        return {
            "pointing error": Consequence(
                error * ARCSEC_PER_RADIAN, "arcsec", "boresight, both axes together"
            ),
            "position error": Consequence(metres, "m", "on the ground, misalignment corrected"),
            "position error uncorrected": Consequence(
                shift, "m", "if the misalignment were ignored"
            ),
        }


@dataclass(frozen=True, eq=False)
class StageTest:
    """What bias, noise and a focal length other than the nominal one cost, after Table V.

    Parameters
    ----------
    altitude : float
        In metres.
    motion : ndarray, shape (2,)
        Of the stage in its last state, in metres.
    nominal : float
        Nominal focal length of the camera, in metres.
    """

    altitude: float
    motion: FloatArray
    nominal: float

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Error of one monitored state, and of the last state's angle with the nominal length."""
        noise, bias = parameters[:, 1], parameters[:, 2:4]
        # Rms over repeats of the noise about both axes; the bias stays.
        error = np.sqrt(np.square(bias).sum(axis=1) + 2 * noise**2)
        motions = np.broadcast_to(self.motion, (len(parameters), 2))
        true = stage_angles(motions, parameters[:, 0])
        believed = stage_angles(motions, np.full(len(parameters), self.nominal))
        wrong = np.linalg.norm(believed - true, axis=-1)
        return {
            "pointing error": Consequence(
                error * ARCSEC_PER_RADIAN, "arcsec", "one state, rms, both axes"
            ),
            "position error": Consequence(ground_error(self.altitude, error), "m", "on the ground"),
            "last state, nominal focal length": Consequence(
                wrong * ARCSEC_PER_RADIAN,
                "arcsec",
                "error of its angle, were the focal length nominal",
            ),
        }


@dataclass(frozen=True)
class Averaged:
    """Errors of averages over some numbers of frames.

    Parameters
    ----------
    columns : tuple of str
        Whose white noise and floor the parameters are.
    counts : tuple of int
        Frames.
    altitude : float
        In metres.
    """

    columns: tuple[str, ...]
    counts: tuple[int, ...]
    altitude: float

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """Three-sigma errors, as the table prints them: in arcsec, and in metres on the ground."""
        found = {}
        for i, column in enumerate(self.columns):
            white, floor = parameters[:, 2 * i : 2 * i + 2].T
            for count in self.counts:
                error = SIGMAS * averaged_error(count, white, floor)
                name = f"{column}, error of {count} frame{'s' if count > 1 else ''}"
                found[name] = Consequence(error * ARCSEC_PER_RADIAN, "arcsec", "three sigma")
                found[f"{name}, position"] = Consequence(
                    ground_error(self.altitude, error), "m", "three sigma, on the ground"
                )
        return found
