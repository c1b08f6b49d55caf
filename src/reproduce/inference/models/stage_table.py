"""Focal length, angle bias and noise from the printed stage test: Table V of chen2023 as data.

Reference and monitored angles are taken together, under both hypotheses about the table's columns,
equally probable beforehand: the indicator is summed out.

The table has two blocks: the stage moves along X (angles about Y), and along Y (angles about X).
Two hypotheses about its angle columns: they stand in the blocks they belong to, or the two blocks'
angle columns are interchanged. Positions are rounded too: those of the moved states are integrated
out in closed form, that of the zero state, which all differences of a block share, by
Gauss-Legendre quadrature. Lengths in metres, angles in radians; arrays of the moved states have
shape (states, blocks).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray
from scipy.special import ndtr

from reproduce.inference import (
    LogNormal,
    LogUniform,
    Model,
    Normal,
    Parameter,
    Uniform,
    from_scores,
    log_slope,
    scores,
    weighted,
)
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


def _focal_parameter(nominal: float) -> Parameter:
    """The camera's focal length, about its nominal value."""
    prior = LogNormal(
        nominal, FOCAL_SPREAD, "a nominal focal length of a telescope holds to some per cent"
    )
    return Parameter("focal-length", "f", "mm", prior, 1e3)


def _scatter_parameter(ends: tuple[float, float]) -> Parameter:
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


# Ends of the prior of the noise, and the width of that of the biases, in radians.
NOISE = (1e-3 / ARCSEC_PER_RADIAN, 1 / ARCSEC_PER_RADIAN)
LOG_NOISE = (float(np.log(NOISE[0])), float(np.log(NOISE[1])))
BIAS_SPREAD = 0.2 / ARCSEC_PER_RADIAN


@dataclass(frozen=True, eq=False)
class StageTableLikelihood:
    """Parameters: focal length, noise, bias about X and Y, log10 of the reference scatter (arcsec).

    - `reference`: positions and reference angles.
    - `monitored`, (states, blocks): printed monitored angles, in radians.
    - `hypothesis`, optional: 0: as printed, 1: interchanged, None: both, summed with equal weights.
    - `log_noise`: ends of the prior of the noise, as logarithms of radians.
    """

    reference: ReferenceAngles
    monitored: FloatArray
    hypothesis: int | None = None
    log_noise: tuple[float, float] = LOG_NOISE

    def printed(self, parameters: FloatArray) -> tuple[Printed, Printed]:
        """Reference and monitored angles under these parameters."""
        # Motion along X turns about Y: the bias belongs to the angle of the block.
        bias = parameters[:, [3, 2]]
        scatter = in_radians(parameters[:, 4])
        reference = Printed(self.reference.angles, np.zeros_like(bias), scatter)
        return reference, Printed(self.monitored, bias, parameters[:, 1])

    def both(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood under both hypotheses, shape (n, 2)."""
        return self.reference.log_hypotheses(parameters[:, 0], self.printed(parameters))

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,), the indicator summed out."""
        if self.hypothesis is not None:
            which = np.full(len(parameters), self.hypothesis)
            return self.reference.log_hypothesis(parameters[:, 0], self.printed(parameters), which)
        both = self.both(parameters)
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

    def repeat(self, parameters: FloatArray, generator: Generator) -> tuple[FloatArray, FloatArray]:
        """The same for a repeat: under the hypothesis that the present data tell of."""
        if self.hypothesis is None:
            which = int(generator.random() < self.interchanged(parameters[None])[0])
            return replace(self, hypothesis=which).simulate(parameters, generator)
        return self.simulate(parameters, generator)

    def log_same(self, parameters: FloatArray) -> FloatArray:
        """Log probability that a repeat prints all the same digits, shape (n,)."""
        if self.hypothesis is not None:
            return self(parameters)
        return log_same_hypothesis(self.both(parameters))

    def given(self, data: tuple[FloatArray, FloatArray]) -> Self:
        """The same positions with other angles."""
        return replace(self, reference=replace(self.reference, angles=data[0]), monitored=data[1])

    @cached_property
    def likely(self) -> int:
        """The hypothesis given, or the one that leaves less of both kinds of angles over."""
        if self.hypothesis is not None:
            return self.hypothesis
        left = []
        for hypothesis in (0, 1):
            focal, rest = self.reference.fit(hypothesis)
            pair = np.array([rest, self.errors(hypothesis, focal).std(axis=0).max()])
            left.append(float(np.log(np.hypot(pair, self.reference.half_angle)).sum()))
        return int(np.argmin(left))

    def errors(self, hypothesis: int, focal: float) -> FloatArray:
        """Monitored angles less those of the motions, shape (states, blocks)."""
        motions = self.reference.positions[1:] - self.reference.positions[0]
        monitored = self.monitored[:, ::-1] if hypothesis else self.monitored
        return np.asarray(monitored + np.arctan2(motions, focal))

    def start(self) -> tuple[FloatArray, FloatArray]:
        """Least squares under the likely hypothesis, and its standard errors."""
        focal, left = self.reference.fit(self.likely)
        left = max(left, self.reference.half_angle / 2)
        errors = self.errors(self.likely, focal)
        noise = max(float((errors - errors.mean(axis=0)).std()), self.reference.half_angle)
        focal_error = focal * left / np.abs(self.reference.angles).max() / 2
        bias = errors.mean(axis=0)[::-1]
        centre = np.array([focal, noise, *bias, np.log10(left * ARCSEC_PER_RADIAN)])
        return centre, np.array([focal_error, noise / 4, noise / 2, noise / 2, 0.1])

    def coordinates(self) -> StageTableCoordinates:
        """Coordinates that take out what noise and scatter do to the others."""
        return StageTableCoordinates(self)

    def checks(self, data: tuple[FloatArray, FloatArray] | None = None) -> dict[str, float]:
        """Misfit of the reference angles under both hypotheses, and of the monitored ones."""
        angles, monitored = (self.reference.angles, self.monitored) if data is None else data
        motions = self.reference.positions[1:] - self.reference.positions[0]
        found = {}
        for name, order in zip(HYPOTHESES, ([0, 1], [1, 0]), strict=True):
            ordered = angles[:, order]
            slope = (motions * ordered).sum() / (motions * motions).sum()
            rms = np.sqrt(np.square(ordered - slope * motions).mean())
            found[f"reference off a line, {name} (arcsec)"] = float(rms * ARCSEC_PER_RADIAN)
        differences = (monitored - angles) * ARCSEC_PER_RADIAN
        found["monitored less reference, rms (arcsec)"] = float(np.sqrt((differences**2).mean()))
        return found


@dataclass(frozen=True, eq=False)
class StageTableCoordinates:
    """Given noise and scatter, focal length and biases are nearly Gaussian.

    In the order of the parameters: log focal length, standardised; normal score of the noise;
    biases given all of these, standardised; normal score of the scatter. Where the scatter hides
    which block the columns belong to, the biases have a second mode: interchanged.

    - `likelihood`: with its data.
    """

    likelihood: StageTableLikelihood

    @cached_property
    def _blocks(self) -> tuple[FloatArray, FloatArray]:
        """Motions, and monitored angles in the blocks they seem to belong to."""
        positions, monitored = self.likelihood.reference.positions, self.likelihood.monitored
        ordered = monitored[:, ::-1] if self.likelihood.likely else monitored
        return positions[1:] - positions[0], ordered

    @cached_property
    def _log_fitted(self) -> float:
        return float(np.log(self.likelihood.reference.fit(self.likelihood.likely)[0]))

    def _noise(self, log_noise: FloatArray) -> FloatArray:
        return np.hypot(np.exp(log_noise), self.likelihood.reference.half_angle)

    def _focal(self, log_noise: FloatArray, scatter: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Mean and deviation of the log focal length, from both kinds of angles."""
        motions, monitored = self._blocks
        variance = self._noise(log_noise) ** 2
        # A bias of known width takes this share out of the products of the sums.
        share = BIAS_SPREAD**2 / (variance + len(motions) * BIAS_SPREAD**2)
        products = (motions**2).sum() - share * (motions.sum(axis=0) ** 2).sum()
        crossed = (motions.sum(axis=0) * monitored.sum(axis=0)).sum()
        inverse = -((motions * monitored).sum() - share * crossed) / products
        error = np.sqrt(variance / products) / inverse
        both = self.likelihood.reference.focal_error(in_radians(scatter))
        held, spread = weighted(self._log_fitted, both, self._log_fitted, FOCAL_SPREAD)
        return weighted(-np.log(inverse), error, held, spread)

    def _bias(
        self, camera: FloatArray, log_noise: FloatArray, other: bool = False
    ) -> tuple[FloatArray, FloatArray]:
        """Means, about X and about Y, and their deviation, under the likely hypothesis or not."""
        motions, monitored = self._blocks
        means = monitored.mean(axis=0)[::-1] if other else monitored.mean(axis=0)
        left = means + motions.mean(axis=0) * np.exp(-camera)[:, None]
        error = self._noise(log_noise)[:, None] / np.sqrt(len(motions))
        return weighted(left[:, ::-1], error, 0.0, BIAS_SPREAD)

    def straight(self, parameters: FloatArray) -> FloatArray:
        """Coordinates of parameter vectors, shape (n, 5)."""
        camera, log_noise = np.log(parameters[:, 0]), np.log(parameters[:, 1])
        focal, focal_error = self._focal(log_noise, parameters[:, 4])
        bias, bias_error = self._bias(camera, log_noise)
        return np.column_stack(
            [
                (camera - focal) / focal_error,
                scores(log_noise, self.likelihood.log_noise),
                (parameters[:, 2:4] - bias) / bias_error,
                scores(parameters[:, 4], self.likelihood.reference.scatter),
            ]
        )

    def parameters(self, straight: FloatArray) -> FloatArray:
        """Parameter vectors at coordinates, shape (n, 5)."""
        log_noise = from_scores(straight[:, 1], self.likelihood.log_noise)
        scatter = from_scores(straight[:, 4], self.likelihood.reference.scatter)
        focal, focal_error = self._focal(log_noise, scatter)
        camera = focal + focal_error * straight[:, 0]
        bias, bias_error = self._bias(camera, log_noise)
        biases = bias + bias_error * straight[:, 2:4]
        return np.column_stack([np.exp(camera), np.exp(log_noise), biases, scatter])

    def mirrored(self, straight: FloatArray) -> FloatArray:
        """Biases on the other side of the middle between both hypotheses, shape (n, 5)."""
        rest = self.parameters(straight)[:, :2]
        camera, log_noise = np.log(rest).T
        bias, error = self._bias(camera, log_noise)
        mirrored = straight.copy()
        mirrored[:, 2:4] = (self._bias(camera, log_noise, other=True)[0] - bias) / error
        mirrored[:, 2:4] -= straight[:, 2:4]
        return mirrored

    def log_volume(self, parameters: FloatArray) -> FloatArray:
        """Log determinant, shape (n,)."""
        camera, log_noise = np.log(parameters[:, 0]), np.log(parameters[:, 1])
        widths = self._focal(log_noise, parameters[:, 4])[1]
        widths = widths * self._bias(camera, log_noise)[1][:, 0] ** 2
        ends = log_slope(log_noise, self.likelihood.log_noise)
        ends = ends + log_slope(parameters[:, 4], self.likelihood.reference.scatter)
        return np.asarray(camera + log_noise + np.log(widths) + ends)


def table_model(likelihood: StageTableLikelihood, nominal: float) -> Model:
    """Focal length, bias and noise from Table V: five parameters, in metres and radians."""
    bias = Normal(0.0, BIAS_SPREAD, "the zero state is averaged over hundreds of images: its "
                  "error stays well below an arc second")  # fmt: skip
    return Model(
        "table-5",
        (
            _focal_parameter(nominal),
            Parameter("noise", r"\sigma", "arcsec", LogUniform(*NOISE,
                "from the last printed digit to an arc second, no scale preferred"),
                ARCSEC_PER_RADIAN),
            Parameter("bias-x", "b_X", "arcsec", bias, ARCSEC_PER_RADIAN),
            Parameter("bias-y", "b_Y", "arcsec", bias, ARCSEC_PER_RADIAN),
            _scatter_parameter(likelihood.reference.scatter),
        ),
        likelihood,
        {"focal-length": nominal},
    )  # fmt: skip
