"""What a registration leaves at stars that it was not fitted to: posterior predictive RMSE.

The transform in use is the least-squares one; the true one and the noise are those of the model.
Conventions and units are those of `registration`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, Self

import numpy as np
from numpy.random import PCG64, Generator
from numpy.typing import NDArray

from reproduce.inference import Consequence
from reproduce.physics.registration import as_complex, as_points
from reproduce.physics.validate import FloatArray

# Parameter vectors that are worked on at once: bounds the memory.
CHUNK = 10_000
SEED = 52


class StarModel(Protocol):
    """What is needed of a registration's likelihood at other stars."""

    @property
    def source(self) -> FloatArray:
        """Places of the stars in the channel, shape (points, 2), in px."""

    @property
    def target(self) -> FloatArray:
        """Places of the stars in the reference channel: not known, any numbers."""

    def residuals(self, parameters: FloatArray) -> NDArray[np.complex128]:
        """Target minus transformed source, shape (n, points)."""

    def scatter(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Noise of residuals, shape (n, points, 2), in px."""

    def elsewhere(self, source: FloatArray) -> Self:
        """The same model of other stars."""


def true_places(stars: StarModel, parameters: FloatArray) -> FloatArray:
    """Return where the stars lie in the reference channel without noise, (n, points, 2)."""
    return as_points(as_complex(stars.target) - stars.residuals(parameters))


def rmse_at(
    stars: StarModel, registered: FloatArray, parameters: FloatArray, generator: Generator
) -> FloatArray:
    """Root mean square distance between registered and measured stars, as niu2024 (26), (n,).

    In px, both axes together; the transform in use puts the stars at `registered`, (points, 2).
    """
    measured = true_places(stars, parameters) + stars.scatter(parameters, generator)
    return np.asarray(np.sqrt(np.square(measured - registered).sum(axis=-1).mean(axis=-1)))


@dataclass(frozen=True, eq=False)
class NewStars:
    """Consequences of a registration at new stars.

    - `stars`: the model at the new stars.
    - `registered`, (points, 2): where the least-squares transform puts them, in px.
    - `arcsec_per_px`: of the reference channel.
    - `columns`: which parameters the model of the stars takes; empty for all, as they stand.
    - `prefix`: stands before the names, where there is more than one channel.
    """

    stars: StarModel
    registered: FloatArray
    arcsec_per_px: float
    columns: tuple[int, ...] = ()
    prefix: str = ""

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """RMSE, the same as an angle, and the error of the transform at the outermost star."""
        generator = Generator(PCG64(SEED))
        parameters = parameters[:, self.columns] if self.columns else parameters
        outermost = np.hypot(*(self.stars.source - self.stars.source.mean(axis=0)).T).argmax()
        errors, moved = [], []
        for rows in _chunks(parameters):
            errors.append(rmse_at(self.stars, self.registered, rows, generator))
            off = (true_places(self.stars, rows) - self.registered)[:, outermost]
            moved.append(np.hypot(*off.T))
        rmse, misplaced = np.concatenate(errors), np.concatenate(moved)
        angle = rmse * self.arcsec_per_px
        return {
            f"{self.prefix}test points, RMSE": Consequence(
                rmse, "px", "as (26), both axes together"
            ),
            f"{self.prefix}test points, pointing error": Consequence(
                angle, "arcsec", "the same as an angle"
            ),
            f"{self.prefix}outermost star, misregistration": Consequence(
                misplaced, "px", "from the error of the transform alone"
            ),
        }


@dataclass(frozen=True, eq=False)
class Together:
    """Consequences of several channels.

    - `parts`: one for each channel.
    """

    parts: tuple[NewStars, ...]

    def __call__(self, parameters: FloatArray) -> dict[str, Consequence]:
        """The consequences of all, one after the other."""
        return {name: found for part in self.parts for name, found in part(parameters).items()}


def _chunks(parameters: FloatArray) -> Iterator[FloatArray]:
    for first in range(0, len(parameters), CHUNK):
        yield parameters[first : first + CHUNK]
