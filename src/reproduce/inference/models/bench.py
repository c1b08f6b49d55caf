"""Posteriors of the printed tests of a laser bench: averaged noise, and angles of a moving stage.

Angles and noise are in rad, motions and focal lengths in m.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from typing import Self

import numpy as np
from numpy.random import Generator
from scipy.special import expit

from reproduce.inference import Estimate, Likelihood, Quantity
from reproduce.physics.attitude import (
    moving_average,
    scatter_of_averages,
    shared_zero_chi_square,
    stage_angle,
)
from reproduce.physics.validate import FloatArray


def _drift(images: int) -> FloatArray:
    """Return a linear drift of unit standard deviation, shape (images,)."""
    drift = np.linspace(-1, 1, images)
    return drift / drift.std(ddof=1)


@cache
def _averaging_moments(images: int, counts: tuple[int, ...]) -> tuple[FloatArray, ...]:
    """Return the moments of the variances of running averages over some of all images.

    Means for unit white noise and for a unit floor, (m,), and traces of products for the white part
    and for the mixed part of their covariances, (m, m).
    """
    drift = _drift(images)
    every = np.eye(images)
    # Quadratic forms of the images, whose values are the variances.
    forms = np.stack([np.cov(moving_average(every, count)) for count in counts])
    bent = forms @ drift
    pairs = np.tensordot(forms, forms, axes=([1, 2], [2, 1]))
    return np.trace(forms, axis1=1, axis2=2), bent @ drift, pairs, bent @ bent.T


@dataclass(frozen=True, eq=False)
class AveragedNoise(Likelihood):
    """Likelihood of the scatter of running averages over images with white noise and a floor.

    Parameter vectors are the white noise of one image and the floor, which drifts linearly through
    the series and which no average removes. The averages share images, so their variances are
    correlated quadratic forms of Gaussian numbers, with exact mean and covariance. Their square
    roots are nearly Gaussian. Rounding adds the variance of a uniform distribution.

    - `scatter`, (m,): printed standard deviations of the averages.
    - `half_unit`: half a unit of their last digit.
    - `counts`: number of images in each average.
    - `images`: number of images of the series.
    """

    observables = ("scatter",)
    scatter: FloatArray
    half_unit: float
    counts: tuple[int, ...]
    images: int

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood, shape (n,)."""
        ones, drifts, pairs, bent = _averaging_moments(self.images, self.counts)
        white, floor = np.square(parameters.T)[..., None, None]
        mean = white * ones + floor * drifts
        covariance = 2 * white**2 * pairs + 4 * white * floor * bent
        root = np.sqrt(mean)
        variance = np.diagonal(covariance, axis1=1, axis2=2)
        rounding = self.half_unit**2 / 3 * np.eye(len(self.counts))
        total = covariance / (4 * root.mT * root) + rounding
        residual = self.scatter - root * (1 - variance[:, None] / mean**2 / 8)
        squares = residual @ np.linalg.solve(total, residual.mT)
        return -(np.linalg.slogdet(total)[1] + squares[:, 0, 0]) / 2

    def simulate(self, parameters: FloatArray, generator: Generator) -> Self:
        """Return the likelihood of standard deviations drawn for one parameter vector."""
        white, floor = parameters
        noise = generator.normal(size=self.images)
        series = white * noise + floor * _drift(self.images)
        scatter = scatter_of_averages(series, self.counts)
        unit = 2 * self.half_unit
        return replace(self, scatter=np.round(scatter / unit) * unit)

    def start(self) -> Estimate:
        """Return the noise of one image and a small floor, with their errors, shape (2,) each."""
        white = self.scatter[0]
        return white * np.array([1.0, 0.05]), white * np.array([0.05, 0.03])


@dataclass(frozen=True, eq=False)
class StageAngles(Likelihood):
    """Likelihood of monitored angles of a moving stage, if the order of two columns is unknown.

    Parameter vectors are the focal length of the telescope and the noise of the mean of one state.
    All angles share the noise of the zero state. Both orders of the columns of motions have the
    same prior probability.

    - `angles`, (2, states): monitored angles about both axes, relative to the zero state.
    - `motions`, (2, states): motions of the stage that rotate the camera about these axes in the
      printed order.
    """

    observables = ("angles",)
    angles: FloatArray
    motions: FloatArray

    @property
    def _both(self) -> FloatArray:
        """Motions in the printed and in the interchanged order, shape (2, 2, states)."""
        return np.stack([self.motions, self.motions[::-1]])

    def orders(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood of the printed and of the interchanged order, (2, n)."""
        focal_length, noise = parameters.T[..., None, None, None]
        scaled = (self.angles - stage_angle(self._both, focal_length)) / noise
        squares = shared_zero_chi_square(scaled).sum(axis=-1)
        return -squares.T / 2 - self.angles.size * np.log(parameters[:, 1])

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Return the log likelihood, shape (n,)."""
        return np.logaddexp(*self.orders(parameters)) - np.log(2)

    def interchanged(self, parameters: FloatArray) -> dict[str, Quantity]:
        """Return the probability that the columns of motions are interchanged."""
        printed, interchanged = self.orders(parameters)
        return {"columns interchanged": Quantity(expit(interchanged - printed), "1")}

    def simulate(self, parameters: FloatArray, generator: Generator) -> Self:
        """Return the likelihood of monitored angles drawn for one parameter vector."""
        focal_length, noise = parameters
        motions = self.motions[:: generator.choice([1, -1])]
        zero = generator.normal(size=(len(motions), 1))
        errors = generator.normal(size=motions.shape) - zero
        angles = stage_angle(motions, focal_length) + noise * errors
        return replace(self, angles=angles)

    def start(self) -> Estimate:
        """Return least-squares estimates for the better order, with their errors, (2,) each."""
        both = self._both.reshape(2, -1)
        angles = self.angles.ravel()
        squares = np.square(self.motions).sum()
        # A small angle is minus the motion over the focal length.
        slopes = -both @ angles / squares
        rms = np.sqrt(np.square(angles + slopes[:, None] * both).mean(axis=1))
        noise, slope = min(zip(rms, slopes, strict=True))
        # The noise of the zero state adds to the error.
        spread = noise * np.sqrt((1 + self.angles.shape[1]) / squares)
        return np.array([1 / slope, noise]), np.array([spread / slope**2, noise / 3])
