"""Effective centroid noise of a simulation from the errors of its printed results.

The calibrated parameters of both channels respond to centroid noise linearly, so they are Gaussian
about what noise-free centroids give, with a covariance proportional to the squared noise. The
printed digits are a box under that distribution.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.random import Generator

from reproduce.inference import LogUniform, Model, Parameter
from reproduce.inference.models.rounded import log_box, quasi_random
from reproduce.physics.validate import FloatArray


@dataclass(frozen=True, eq=False)
class CentroidNoiseLikelihood:
    """One parameter: standard deviation of a centroid coordinate, in px.

    - `expected`, (m,): what noise-free centroids give.
    - `cofactor`, (m, m): covariance of the results per squared noise.
    - `printed`, `half_units`, (m,): the printed results and half their last digits, in the units of
      `expected`.
    """

    expected: FloatArray
    cofactor: FloatArray
    printed: FloatArray
    half_units: FloatArray

    @cached_property
    def _scaled(self) -> tuple[FloatArray, FloatArray, FloatArray]:
        scale = np.sqrt(np.diagonal(self.cofactor))
        root = np.linalg.cholesky(self.cofactor / np.outer(scale, scale))
        return scale, root, quasi_random(len(scale))

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        scale, root, points = self._scaled
        low, high = (
            (self.printed - self.expected + side * self.half_units) / scale for side in (-1, 1)
        )
        mean = np.zeros((len(parameters), len(scale)))
        return log_box(mean, parameters[:, :, None] * root, low, high, points)

    def simulate(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Results as they would be printed, shape (m,)."""
        scale, root, _ = self._scaled
        exact = self.expected + parameters[0] * scale * (root @ generator.normal(size=len(scale)))
        unit = 2 * self.half_units
        return np.asarray(np.round(exact / unit) * unit)

    def given(self, data: FloatArray) -> Self:
        """The same simulation with other results."""
        return replace(self, printed=data)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Root mean square of the scaled errors."""
        scale = self._scaled[0]
        noise = np.sqrt(np.square((self.printed - self.expected) / scale).mean())
        noise = max(float(noise), float((self.half_units / scale).min()))
        return np.array([noise]), np.array([noise / 4])

    def checks(self, data: FloatArray | None = None) -> dict[str, float]:
        """Errors against what one px of noise makes: their size, and how unequal they are."""
        data = self.printed if data is None else data
        scaled = (data - self.expected) / self._scaled[0]
        return {
            "errors, rms (px)": float(np.sqrt(np.square(scaled).mean())),
            "errors, largest (px)": float(np.abs(scaled).max()),
            # Free of the noise, which fits the size of the errors and not how unequal they are.
            "errors, median over largest": float(np.median(np.abs(scaled)) / np.abs(scaled).max()),
        }


def centroid_noise_model(likelihood: CentroidNoiseLikelihood, stated: float) -> Model:
    """Effective centroid noise of a simulation whose text states a noise, in px."""
    prior = LogUniform(1e-4, 10.0, "from a ten-thousandth of a pixel to the size of a spot; no "
                       "scale preferred")  # fmt: skip
    parameter = Parameter("noise", r"\sigma", "px", prior)
    return Model("centroid-noise", (parameter,), likelihood, {"noise": stated})
