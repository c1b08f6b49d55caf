"""The printed reference angles of a stage test: how probable they are, rounded as they stand.

The table has two blocks: the stage moves along X (angles about Y), and along Y (angles about X).
Two hypotheses about its angle columns: they stand in the blocks they belong to, or the two blocks'
angle columns are interchanged. Positions are rounded too: those of the moved states are integrated
out in closed form, that of the zero state, which all differences of a block share, by
Gauss-Legendre quadrature. Lengths in metres, angles in radians; arrays of the moved states have
shape (states, blocks).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.special import ndtr

from reproduce.inference import LogNormal, Parameter, Uniform
from reproduce.physics.validate import FloatArray
from reproduce.units import ARCSEC_PER_RADIAN

Indices = NDArray[np.int64]

HYPOTHESES = ("as printed", "interchanged")
SMALLEST = 1e-300
# A hypothesis this much less probable than the other does not change a sum of doubles.
NEGLIGIBLE = 1e-26
# Ends and widths of priors: the focal length's, as a share, and log10 of the scatter in arcsec.
FOCAL_SPREAD = 0.05
SCATTER = (-4.0, 0.0)
# Nodes and weights over the rounding interval of the zero position, in half widths.
NODES, WEIGHTS = np.polynomial.legendre.leggauss(8)


def log_rounded(
    distance: FloatArray, half_angle: float, half_shift: FloatArray, noise: FloatArray
) -> FloatArray:
    """Log probability that a noisy value prints so, its mean uniform over a rounding interval.

    `distance` is the printed value less the middle of the mean's interval, `half_angle` half the
    last printed digit, `half_shift` half the width of the mean's interval.

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


def _ordered(angles: FloatArray, which: Indices) -> FloatArray:
    """Printed angles in the blocks they belong to, shape (n, states, blocks)."""
    return np.where(which[:, None, None] == 1, angles[:, ::-1], angles)


@dataclass(frozen=True, eq=False)
class Printed:
    """Printed angles and how they scatter about the true ones; all angles in radians.

    - `angles`, (states, blocks): as printed.
    - `bias`, (n, blocks): added to the true angles of a block.
    - `noise`, (n,): standard deviation.
    """

    angles: FloatArray
    bias: FloatArray
    noise: FloatArray

    def rows(self, chosen: NDArray[np.bool_]) -> Printed:
        """Some of the parameter vectors."""
        return Printed(self.angles, self.bias[chosen], self.noise[chosen])


@dataclass(frozen=True, eq=False)
class ReferenceAngles:
    """The printed reference angles.

    - `positions`, (states + 1, blocks): printed stage positions, the zero state first, in metres.
    - `angles`, (states, blocks): printed reference angles, in radians.
    - `half_position`, `half_angle`: half the last printed digits.
    - `scatter`: ends of the prior of log10 of the scatter in arcsec.
    """

    positions: FloatArray
    angles: FloatArray
    half_position: float
    half_angle: float
    scatter: tuple[float, float] = SCATTER

    def predicted(self, focal: FloatArray) -> FloatArray:
        """Angles of the moved states by (10), shape (n, nodes, states, blocks)."""
        zero = self.positions[0] + self.half_position * NODES[:, None, None]
        motions = self.positions[1:] - zero
        return np.asarray(-np.arctan2(motions, focal[:, None, None, None]))

    def log_hypotheses(self, focal: FloatArray, printed: tuple[Printed, ...]) -> FloatArray:
        """Log probability of printed angles under both hypotheses, shape (n, 2).

        The less probable one is left out (minus infinity) where a bound shows that it is less
        than `NEGLIGIBLE` beside the other, which is nearly always.
        """
        bounds = self.bounds(focal, printed)
        first = np.argmax(bounds, axis=1)
        found = np.full(bounds.shape, -np.inf)
        rows = np.arange(len(focal))
        found[rows, first] = self.log_hypothesis(focal, printed, first)
        near = bounds[rows, 1 - first] > found[rows, first] + np.log(NEGLIGIBLE)
        if near.any():
            some = tuple(one.rows(near) for one in printed)
            found[rows[near], 1 - first[near]] = self.log_hypothesis(
                focal[near], some, 1 - first[near]
            )
        return found

    def log_hypothesis(
        self, focal: FloatArray, printed: tuple[Printed, ...], which: Indices
    ) -> FloatArray:
        """Log probability of printed angles under one hypothesis each, shape (n,).

        The zero position of each block is integrated out over all angles of the block. The
        rounding of a moved position is integrated out of every angle by itself, though reference
        and monitored angle share it: what that leaves out is the square of that rounding over the
        noise, and counts only where the noise is as small as the last printed digits.
        """
        predicted = self.predicted(focal)
        half_shift = (self.half_position / focal)[:, None, None, None]
        total = np.zeros((len(focal), len(NODES), self.angles.shape[1]))
        for one in printed:
            expected = predicted + one.bias[:, None, None]
            distance = _ordered(one.angles, which)[:, None] - expected
            noise = one.noise[:, None, None, None]
            total += log_rounded(distance, self.half_angle, half_shift, noise).sum(axis=-2)
        largest = total.max(axis=1)
        shares = np.exp(total - largest[:, None]) * (WEIGHTS / 2)[:, None]
        return np.asarray((largest + np.log(shares.sum(axis=1))).sum(axis=-1))

    def bounds(self, focal: FloatArray, printed: tuple[Printed, ...]) -> FloatArray:
        """Upper bounds of the log probabilities under both hypotheses, shape (n, 2).

        An interval D standard deviations off has less than exp(-D^2/2), and less than its width
        times the density at its nearer end; both roundings of the position are granted in full.
        """
        motions = self.positions[1:] - self.positions[0]
        predicted = -np.arctan2(motions, focal[:, None, None])
        reach = self.half_angle + 2 * self.half_position / focal[:, None, None, None]
        total = np.zeros((len(focal), 2))
        for one in printed:
            both = np.stack([one.angles, one.angles[:, ::-1]])
            distance = np.abs(both - (predicted + one.bias[:, None])[:, None])
            noise = one.noise[:, None, None, None]
            far = np.maximum(distance - reach, 0) / noise
            peak = np.minimum(np.log(2 * self.half_angle / (np.sqrt(2 * np.pi) * noise)), 0)
            total += np.maximum(peak - 0.5 * far**2, np.log(SMALLEST)).sum(axis=(-2, -1))
        return total

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

    def fit(self, hypothesis: int) -> tuple[float, float]:
        """Focal length under one hypothesis, and what it leaves over (rms)."""
        motions = self.positions[1:] - self.positions[0]
        angles = self.angles[:, ::-1] if hypothesis else self.angles
        focal = -float((motions * motions).sum() / (motions * angles).sum())
        return focal, float(np.sqrt(np.square(angles + np.arctan2(motions, focal)).mean()))

    def focal_error(self, scatter: FloatArray) -> FloatArray:
        """Relative error of the fitted focal length, shape (n,), for a scatter of the angles."""
        return np.hypot(scatter, self.half_angle) / float(np.sqrt((self.angles**2).sum()))


def focal_parameter(nominal: float) -> Parameter:
    """The camera's focal length, about its nominal value."""
    prior = LogNormal(
        nominal, FOCAL_SPREAD, "a nominal focal length of a telescope holds to some per cent"
    )
    return Parameter("focal-length", "f", "mm", prior, 1e3)


def scatter_parameter(ends: tuple[float, float]) -> Parameter:
    """Scatter of the reference angles, as the decimal logarithm of its size in arc seconds."""
    prior = Uniform(*ends, "from a tenth of the last printed digit to an arc second, no scale "
                    "preferred: what the formula leaves unexplained")  # fmt: skip
    return Parameter("log-reference-scatter", r"\log_{10}\tau", "log10 arcsec", prior)


def in_radians(logarithm: FloatArray) -> FloatArray:
    """The angle whose decimal logarithm in arc seconds is given."""
    return np.asarray(10.0**logarithm / ARCSEC_PER_RADIAN)


def log_same_hypothesis(both: FloatArray) -> FloatArray:
    """Log probability of the same digits again, the hypothesis being the one of the digits.

    Of those under both hypotheses, (n, 2), equally probable beforehand; weighted with what the
    digits say of the hypotheses.
    """
    return np.asarray(np.logaddexp(*(2 * both.T)) - np.logaddexp(*both.T))
