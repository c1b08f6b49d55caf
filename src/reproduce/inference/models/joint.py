"""Both channels at once: they share the green noise, which belongs in the covariance.

A true green position z gives green = z + noise, red and blue = z carried back by their transforms
+ noise. Given the red points, and with a flat prior on z, the two residuals of a star (green minus
transformed red, green minus transformed blue) are Gaussian per axis with covariance
noise^2 [[1 + k_red^2, 1], [1, 1 + k_blue^2]]; blue itself being random adds the Jacobian k_blue^2
per star. Conventions and units are those of `registration`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from reproduce.inference import Derived, Model
from reproduce.inference.models.registration import (
    GaussianRegistration,
    fit_checks,
    registration_parameters,
    triangular,
    with_priors,
)
from reproduce.physics.registration import Registration, as_complex, fit_registration
from reproduce.physics.validate import FloatArray

CHANNELS = ("red", "blue")
ComplexArray = NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class JointRegistration:
    """Parameters: (k, theta, shift x, shift y) of red, the same of blue, noise.

    - `sources`, (n, 2): red and blue points, in px.
    - `target`, (n, 2): green points, in px.
    - `pivots`, (2,): principal points of red and blue, in px.
    """

    sources: tuple[FloatArray, FloatArray]
    target: FloatArray
    pivots: tuple[FloatArray, FloatArray]

    @cached_property
    def columns(self) -> ComplexArray:
        """The columns (red, blue, one, green), red and blue about their pivots, shape (n, 4)."""
        origin = as_complex(self.pivots[0])
        offsets = [
            as_complex(s) - as_complex(p) for s, p in zip(self.sources, self.pivots, strict=True)
        ]
        one = np.ones(len(self.target), dtype=np.complex128)
        return np.stack([*offsets, one, as_complex(self.target) - origin], axis=-1)

    @cached_property
    def root(self) -> ComplexArray:
        """Triangular factor of the columns, shape (4, 4)."""
        return triangular(self.columns)

    def weights(self, parameters: FloatArray) -> tuple[ComplexArray, ComplexArray]:
        """Coefficients of the columns in the two residuals, each of shape (n, 4)."""
        found = []
        for channel in (0, 1):
            k, theta, x, y = parameters[:, 4 * channel : 4 * channel + 4].T
            weights = np.zeros((len(parameters), 4), dtype=np.complex128)
            weights[:, channel] = -k * np.exp(1j * theta)
            weights[:, 2] = (
                x + 1j * y - (as_complex(self.pivots[channel]) - as_complex(self.pivots[0]))
            )
            weights[:, 3] = 1
            found.append(weights)
        return found[0], found[1]

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        left, right = (weights @ self.root.T for weights in self.weights(parameters))
        red, blue = (1 + parameters[:, i] ** 2 for i in (0, 4))
        determinant = red * blue - 1
        squares = blue * _product(left, left) + red * _product(right, right)
        squares -= 2 * _product(left, right)
        noise, count = parameters[:, 8], len(self.target)
        # Per star: two axes of a pair of residuals, and the Jacobian of the blue transform.
        constant = -np.log(determinant) - 4 * np.log(noise) - 2 * np.log(2 * np.pi)
        constant += 2 * np.log(parameters[:, 4])
        return np.asarray(count * constant - squares / (2 * noise**2 * determinant))

    def simulate(
        self, parameters: FloatArray, generator: Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Blue and green points for one parameter vector, given the red ones; in px."""
        red, blue = (
            Registration.similarity(u[0], u[1], u[2:4], pivot)
            for u, pivot in zip((parameters[:4], parameters[4:8]), self.pivots, strict=True)
        )
        noise = parameters[8] * generator.normal(size=(3, *self.target.shape))
        true = red.apply(self.sources[0] + noise[0])
        return blue.inverse().apply(true) + noise[1], true + noise[2]

    def given(self, data: tuple[FloatArray, FloatArray]) -> Self:
        """The same red points with other blue and green ones."""
        return replace(self, sources=(self.sources[0], data[0]), target=data[1])

    def single(self, channel: int) -> GaussianRegistration:
        """One channel alone, red (0) or blue (1), the noise of both its channels in it."""
        return GaussianRegistration(self.sources[channel], self.target, self.pivots[channel], True)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """The least-squares fits of both channels and their standard errors."""
        starts = [self.single(channel).start() for channel in (0, 1)]
        centre = np.concatenate([c[:4] for c, _ in starts] + [[np.mean([c[4] for c, _ in starts])]])
        spread = np.concatenate([s[:4] for _, s in starts] + [[starts[0][1][4]]])
        return centre, spread

    def estimate(self) -> tuple[FloatArray, FloatArray]:
        """The least-squares fit of each channel by itself, and the mean of their noises.

        The residuals of the channels share the green noise: their correlation is
        1 / sqrt((1 + k_red^2) (1 + k_blue^2)), and that of the noises its square.
        """
        (red, red_errors), (blue, blue_errors) = (self.single(i).estimate() for i in (0, 1))
        shared = 1 / ((1 + red[0] ** 2) * (1 + blue[0] ** 2))
        squares = red_errors[4] ** 2 + blue_errors[4] ** 2
        error = 0.5 * np.sqrt(squares + 2 * shared * red_errors[4] * blue_errors[4])
        centre = np.concatenate([red[:4], blue[:4], [0.5 * (red[4] + blue[4])]])
        return centre, np.concatenate([red_errors[:4], blue_errors[:4], [error]])

    def checks(self, data: tuple[FloatArray, FloatArray] | None = None) -> dict[str, float]:
        """Those of each channel, and the correlation of the two channels' residuals."""
        blue, green = (self.sources[1], self.target) if data is None else data
        found = {}
        for name, source, pivot in zip(CHANNELS, (self.sources[0], blue), self.pivots, strict=True):
            checks = fit_checks(source, green, pivot)
            found.update({f"{name}: {key}": value for key, value in checks.items()})
        left = [
            fit_registration(source, green, pivot).residuals.ravel()
            for source, pivot in zip((self.sources[0], blue), self.pivots, strict=True)
        ]
        found["correlation of both residuals"] = float(np.asarray(np.corrcoef(left))[0, 1])
        return found


def _product(left: ComplexArray, right: ComplexArray) -> FloatArray:
    return np.asarray((left.real * right.real + left.imag * right.imag).sum(axis=-1))


def joint_model(
    sources: tuple[FloatArray, FloatArray],
    target: FloatArray,
    pivots: tuple[FloatArray, FloatArray],
    derived: Derived | None = None,
) -> Model:
    """Registration of red and blue over green, with one noise in all channels: nine parameters."""
    likelihood = JointRegistration(sources, target, pivots)
    parameters = []
    for channel, source in zip(CHANNELS, sources, strict=True):
        for one in registration_parameters(source, target)[:4]:
            label = f"{one.label}_\\mathrm{{{channel[0]}}}"
            parameters.append(replace(one, name=f"{channel}-{one.name}", label=label))
    noise = registration_parameters(sources[0], target)[4]
    names = [p.name for p in parameters]
    estimate = dict(zip(names, likelihood.start()[0].tolist(), strict=False))
    return Model(
        "registration-joint",
        with_priors((*parameters, noise), None),
        likelihood,
        estimate,
        derived,
    )
