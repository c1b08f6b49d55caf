"""Focal length, angle bias and noise from the printed stage test: Table V of chen2023 as data.

The table has two blocks: the stage moves along X (angles about Y), and along Y (angles about X).
Two hypotheses about its angle columns, equally probable beforehand: they stand in the blocks they
belong to, or the two blocks' angle columns are interchanged. The indicator is summed out.
Positions are rounded too: those of the moved states are integrated out in closed form, that of the
zero state, which all differences of a block share, by Gauss-Legendre quadrature. Lengths in metres,
angles in radians; arrays of the moved states have shape (states, blocks).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.random import Generator
from scipy.special import logsumexp, ndtr

from reproduce.inference.model import Model, Parameter
from reproduce.inference.priors import LogNormal, LogUniform, Normal, Uniform
from reproduce.physics.validate import FloatArray

ARCSEC = 206264.80624709636
HYPOTHESES = ("as printed", "interchanged")
SMALLEST = 1e-300
# Nodes and weights over the rounding interval of the zero position, in half widths.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


def log_rounded(
    distance: FloatArray, half_angle: float, half_shift: FloatArray, noise: FloatArray
) -> FloatArray:
    """Log probability that a noisy value prints so, its mean uniform over a rounding interval.

    Parameters
    ----------
    distance : ndarray
        Printed value less the middle of the mean's interval.
    half_angle : float
        Half the last printed digit.
    half_shift : ndarray
        Half the width of the mean's interval.
    noise : ndarray
        Standard deviation of the Gaussian noise.

    Returns
    -------
    ndarray
        Log of the mean probability of the printed interval.

    Examples
    --------
    >>> wide = log_rounded(np.zeros(1), 9.0, np.ones(1), np.ones(1))
    >>> float(np.exp(wide).round(6)[0])
    1.0
    """
    below = -np.abs(distance)  # the tail where small numbers are not lost beside one
    total = np.zeros(np.broadcast_shapes(below.shape, noise.shape, half_shift.shape))
    for angle in (1, -1):
        for shift in (1, -1):
            reach = (below + angle * half_angle + shift * half_shift) / noise
            total += angle * shift * _integrated(reach)
    return np.asarray(np.log(np.maximum(total * noise / (2 * half_shift), SMALLEST)))


def _integrated(values: FloatArray) -> FloatArray:
    """Integral of the normal distribution function from minus infinity."""
    return np.asarray(values * ndtr(values) + np.exp(-0.5 * values**2) / np.sqrt(2 * np.pi))


@dataclass(frozen=True, eq=False)
class ReferenceAngles:
    """The printed reference angles.

    Parameters
    ----------
    positions : ndarray, shape (states + 1, blocks)
        Printed stage positions, the zero state first, in metres.
    angles : ndarray, shape (states, blocks)
        Printed reference angles, in radians.
    half_position, half_angle : float
        Half the last printed digits.
    """

    positions: FloatArray
    angles: FloatArray
    half_position: float
    half_angle: float

    def predicted(self, focal: FloatArray) -> FloatArray:
        """Angles of the moved states by (10), shape (n, nodes, states, blocks)."""
        zero = self.positions[0] + self.half_position * NODES[:, None, None]
        motions = self.positions[1:] - zero
        return np.asarray(-np.arctan2(motions, focal[:, None, None, None]))

    def log_density(
        self, angles: FloatArray, predicted: FloatArray, focal: FloatArray, noise: FloatArray
    ) -> FloatArray:
        """Log probability of printed angles, shape (n, 2 hypotheses, nodes, blocks)."""
        half_shift = (self.half_position / focal)[:, None, None, None]
        return np.stack(
            [
                log_rounded(
                    angles[..., order] - predicted, self.half_angle, half_shift,
                    noise[:, None, None, None],
                ).sum(axis=-2)
                for order in ([0, 1], [1, 0])
            ],
            axis=1,
        )  # fmt: skip

    @staticmethod
    def over_zero(densities: FloatArray) -> FloatArray:
        """Integrate the zero positions out and multiply the blocks, shape (n, 2 hypotheses)."""
        weighted = densities + np.log(WEIGHTS / 2)[:, None]
        return np.asarray(logsumexp(weighted, axis=-2).sum(axis=-1))

    def draw(
        self, focal: float, scatter: float, hypothesis: int, generator: Generator
    ) -> tuple[FloatArray, FloatArray]:
        """True angles in the blocks of the motions, and reference angles where they are printed."""
        rounding = generator.uniform(-1, 1, self.positions.shape) * self.half_position
        positions = self.positions + rounding
        true = -np.arctan2(positions[1:] - positions[0], focal)
        noisy = true + scatter * generator.normal(size=true.shape)
        return true, self.rounded(noisy[:, ::-1] if hypothesis else noisy)

    def rounded(self, angles: FloatArray) -> FloatArray:
        """Angles as printed."""
        unit = 2 * self.half_angle
        return np.asarray(np.round(angles / unit) * unit)

    def fitted(self) -> tuple[int, float, float]:
        """The better hypothesis, its focal length, and what it leaves over (rms)."""
        motions = self.positions[1:] - self.positions[0]
        found = []
        for hypothesis, order in enumerate(([0, 1], [1, 0])):
            angles = self.angles[:, order]
            focal = -float((motions * motions).sum() / (motions * angles).sum())
            left = float(np.sqrt(np.square(angles + np.arctan2(motions, focal)).mean()))
            found.append((left, hypothesis, focal))
        left, hypothesis, focal = min(found)
        return hypothesis, focal, left


@dataclass(frozen=True, eq=False)
class StageTableLikelihood:
    """Parameters: focal length, noise, bias about X and Y, log10 of the reference scatter (arcsec).

    Parameters
    ----------
    reference : ReferenceAngles
        Positions and reference angles.
    monitored : ndarray, shape (states, blocks)
        Printed monitored angles, in radians.
    hypothesis : int, optional
        0: as printed, 1: interchanged, None: both, summed with equal weights.
    """

    reference: ReferenceAngles
    monitored: FloatArray
    hypothesis: int | None = None

    def both(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood under both hypotheses, shape (n, 2)."""
        focal, noise, scatter = parameters[:, 0], parameters[:, 1], in_radians(parameters[:, 4])
        predicted = self.reference.predicted(focal)
        total = self.reference.log_density(self.reference.angles, predicted, focal, scatter)
        # Motion along X turns about Y: the bias belongs to the angle of the block.
        shifted = predicted + parameters[:, None, None, [3, 2]]
        total = total + self.reference.log_density(self.monitored, shifted, focal, noise)
        return self.reference.over_zero(total)

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,), the indicator summed out."""
        both = self.both(parameters)
        if self.hypothesis is not None:
            return np.asarray(both[:, self.hypothesis])
        return np.asarray(np.logaddexp(both[:, 0], both[:, 1]) - np.log(2))

    def interchanged(self, parameters: FloatArray) -> FloatArray:
        """Probability of the interchange for each parameter vector, shape (n,)."""
        both = self.both(parameters)
        return np.asarray(1 / (1 + np.exp(np.clip(both[:, 0] - both[:, 1], -700, 700))))

    def simulate(
        self, parameters: FloatArray, generator: Generator
    ) -> tuple[FloatArray, FloatArray]:
        """Reference and monitored angles as they would be printed."""
        which = int(generator.integers(2)) if self.hypothesis is None else self.hypothesis
        focal, noise, scatter = parameters[0], parameters[1], float(in_radians(parameters[4]))
        true, reference = self.reference.draw(focal, scatter, which, generator)
        noisy = true + parameters[[3, 2]] + noise * generator.normal(size=true.shape)
        return reference, self.reference.rounded(noisy[:, ::-1] if which else noisy)

    def given(self, data: tuple[FloatArray, FloatArray]) -> Self:
        """The same positions with other angles."""
        return replace(self, reference=replace(self.reference, angles=data[0]), monitored=data[1])

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Least squares under the better hypothesis, and its standard errors."""
        which, focal, left = self.reference.fitted()
        left = max(left, self.reference.half_angle / 2)
        motions = self.reference.positions[1:] - self.reference.positions[0]
        errors = self.monitored[:, [1, 0] if which else [0, 1]] + np.arctan2(motions, focal)
        noise = max(float((errors - errors.mean(axis=0)).std()), self.reference.half_angle)
        focal_error = focal * left / np.abs(self.reference.angles).max() / 2
        bias = errors.mean(axis=0)[::-1]
        centre = np.array([focal, noise, *bias, np.log10(left * ARCSEC)])
        return centre, np.array([focal_error, noise / 4, noise / 2, noise / 2, 0.1])

    def checks(self, data: tuple[FloatArray, FloatArray] | None = None) -> dict[str, float]:
        """Misfit of the reference angles under both hypotheses, and of the monitored ones."""
        angles, monitored = (self.reference.angles, self.monitored) if data is None else data
        motions = self.reference.positions[1:] - self.reference.positions[0]
        found = {}
        for name, order in zip(HYPOTHESES, ([0, 1], [1, 0]), strict=True):
            ordered = angles[:, order]
            slope = (motions * ordered).sum() / (motions * motions).sum()
            rms = np.sqrt(np.square(ordered - slope * motions).mean())
            found[f"reference off a line, {name} (arcsec)"] = float(rms * ARCSEC)
        differences = (monitored - angles) * ARCSEC
        found["monitored less reference, rms (arcsec)"] = float(np.sqrt((differences**2).mean()))
        return found


def table_model(likelihood: StageTableLikelihood, nominal: float) -> Model:
    """Focal length, bias and noise from Table V.

    Parameters
    ----------
    likelihood : StageTableLikelihood
        With the printed numbers.
    nominal : float
        Nominal focal length, in metres.

    Returns
    -------
    Model
        Five parameters, in metres and radians.
    """
    bias = Normal(0.0, 0.2 / ARCSEC, "the zero state is averaged over hundreds of images: its "
                  "error stays well below an arc second")  # fmt: skip
    return Model(
        "table-5",
        "Effective focal length, angle bias and noise from the stage test",
        (
            focal_parameter(nominal),
            Parameter("noise", r"\sigma", "arcsec", LogUniform(1e-3 / ARCSEC, 1 / ARCSEC,
                "from the last printed digit to an arc second, no scale preferred"), ARCSEC),
            Parameter("bias-x", "b_X", "arcsec", bias, ARCSEC),
            Parameter("bias-y", "b_Y", "arcsec", bias, ARCSEC),
            scatter_parameter(),
        ),
        likelihood,
        {"focal-length": nominal},
    )  # fmt: skip


def focal_parameter(nominal: float) -> Parameter:
    """The camera's focal length, about its nominal value."""
    prior = LogNormal(nominal, 0.05, "a nominal focal length of a telescope holds to some per cent")
    return Parameter("focal-length", "f", "mm", prior, 1e3)


def scatter_parameter() -> Parameter:
    """Scatter of the reference angles, as the decimal logarithm of its size in arc seconds."""
    prior = Uniform(-4.0, 0.0, "from a tenth of the last printed digit to an arc second, no scale "
                    "preferred: what the formula leaves unexplained")  # fmt: skip
    return Parameter("log-reference-scatter", r"\log_{10}\tau", "log10 arcsec", prior)


def in_radians(logarithm: FloatArray) -> FloatArray:
    """The angle whose decimal logarithm in arc seconds is given."""
    return np.asarray(10.0**logarithm / ARCSEC)
