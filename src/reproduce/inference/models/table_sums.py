"""Table V with its angle columns of X and Y interchanged, summed without sampling.

Given the focal length the two blocks and the two kinds of angles part, so what is left is sums
over small grids: trapezoids in the focal length (on a scale that reaches far into the tails),
Gauss-Legendre in the logarithms of the scatters and in the biases. A coarser grid changes no mean
by 1e-5 of it, as a test proves. Conventions are those of `stage_table`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.interpolate import make_interp_spline
from scipy.special import logsumexp

from reproduce.inference import LogUniform, Model, Normal, Uniform
from reproduce.inference.models.stage_table import (
    NODES,
    WEIGHTS,
    StageTableLikelihood,
    in_radians,
    log_rounded,
)
from reproduce.physics.validate import FloatArray

# The printed columns that belong to motions along X and along Y.
CROSSED = (1, 0)
# Reach of the focal length: its relative error times sinh of this, and the points up to there.
REACH, POINTS, EVERY, SPLINE = 7.0, 240, 4, 5
# Nodes in log scatter, log noise and bias, and the reach of the bias in its own errors.
ORDERS = (80, 64, 24)
BIAS_REACH = 6.5
# Even shares of the noise, and the places between which they are sought.
SHARES, FINE = 100, 4001


@dataclass(frozen=True)
class TableResult:
    """What Table V comes to.

    - `means`, `deviations`: of focal length (m), noise, bias of the angles about X and about Y as
      printed (rad).
    - `noises`: values of the noise that share its probability evenly, in rising order (rad).
    """

    means: tuple[float, ...]
    deviations: tuple[float, ...]
    noises: tuple[float, ...]


def interchanged(model: Model, finer: float = 1) -> TableResult:
    """Moments of a `table_model` whose angle columns of X and Y are interchanged, by quadrature.

    The model's own hypothesis plays no part; `finer` multiplies the points of every grid.
    """
    table = StageTable.of(model, model.likelihood_of(StageTableLikelihood))
    points = EVERY * round(finer * POINTS / EVERY) + 1
    orders = [round(finer * order) for order in ORDERS]
    u = np.linspace(-REACH, REACH, points)
    centre, error = table.focal()
    focal = centre * np.exp(error * np.sinh(u))
    scatters, for_scatter = _gauss(orders[0], table.scatter_ends)
    log_noises, for_noise = _gauss(orders[1], table.noise_ends)
    noises = np.exp(log_noises)
    # The noise is far wider than the last digit: its part is smooth in the focal length.
    few = table.monitored_parts(focal[::EVERY], noises, orders[2])
    parts = Parts(*(make_interp_spline(u[::EVERY], part, SPLINE)(u) for part in few))
    held = table.reference_parts(focal, in_radians(scatters))
    density = model.parameters[0].prior.log_density(focal)
    density = density + np.log(focal * error * np.cosh(u) * (u[1] - u[0]))
    weights = density[:, None, None] + for_scatter[:, None] + for_noise
    values = (focal[:, None, None], noises)
    return _summed(weights, held, parts, values)


class Parts(NamedTuple):
    """What the monitored angles of each block give, shape (focal, nodes, blocks, noises).

    The log probability with the bias integrated out, and the mean and mean square of the bias.
    """

    log_probability: FloatArray
    mean: FloatArray
    square: FloatArray


@dataclass(frozen=True, eq=False)
class StageTable:
    """The table, its angle columns interchanged.

    - `positions`, (states + 1, 2): in metres.
    - `reference`, `monitored`, (states, 2): angles in the blocks of the motions, in radians.
    - `half_position`, `half_angle`: half the last printed digits.
    - `bias`: standard deviation of the prior of the biases, about zero.
    - `scatter_ends`, `noise_ends`: ends of the priors: log10 of the scatter in arcsec, natural
      logarithm of the noise in rad.
    """

    positions: FloatArray
    reference: FloatArray
    monitored: FloatArray
    half_position: float
    half_angle: float
    bias: float
    scatter_ends: tuple[float, float]
    noise_ends: tuple[float, float]

    @classmethod
    def of(cls, model: Model, likelihood: StageTableLikelihood) -> StageTable:
        """Interchange the columns, and take the priors apart."""
        noise, first, second, scatter = (p.prior for p in model.parameters[1:])
        if not (
            isinstance(noise, LogUniform)
            and isinstance(scatter, Uniform)
            and isinstance(first, Normal)
            and first == second
            and first.mean == 0
        ):
            raise TypeError("model: expected the priors of `table_model`")
        source = likelihood.reference
        return cls(
            source.positions,
            source.angles[:, CROSSED],
            likelihood.monitored[:, CROSSED],
            source.half_position,
            source.half_angle,
            first.sigma,
            (scatter.low, scatter.high),
            (float(np.log(noise.low)), float(np.log(noise.high))),
        )

    def focal(self) -> tuple[float, float]:
        """Least-squares focal length, and its relative error."""
        motions = self.positions[1:] - self.positions[0]
        centre = -float((motions**2).sum() / (motions * self.reference).sum())
        left = self.reference + np.arctan2(motions, centre)
        error = np.hypot(np.sqrt(np.square(left).mean()), self.half_angle)
        return centre, float(error / np.sqrt(np.square(self.reference).sum()))

    def predicted(self, focal: FloatArray) -> FloatArray:
        """Angles by (10) for every place of the zero position, (focal, nodes, states, blocks)."""
        zero = self.positions[0] + self.half_position * NODES[:, None, None]
        return np.asarray(-np.arctan2(self.positions[1:] - zero, focal[:, None, None, None]))

    def reference_parts(self, focal: FloatArray, scatters: FloatArray) -> FloatArray:
        """Log probability of the reference angles, shape (focal, nodes, blocks, scatters)."""
        off = (self.reference - self.predicted(focal))[..., None]
        half = (self.half_position / focal)[:, None, None, None, None]
        return np.asarray(log_rounded(off, self.half_angle, half, scatters).sum(axis=2))

    def monitored_parts(self, focal: FloatArray, noises: FloatArray, order: int) -> Parts:
        """Integrate the bias of each block out, about what its angles leave over."""
        nodes, log_weights = np.polynomial.legendre.leggauss(order)
        off = self.monitored - self.predicted(focal)
        count = off.shape[2]
        spread = 1 / np.sqrt(count / noises**2 + 1 / self.bias**2)
        middle = off.mean(axis=2)[..., None] * count * (spread / noises) ** 2
        half = (self.half_position / focal)[:, None, None, None, None]
        total, first, second = [], [], []
        for node, weight in zip(nodes, np.log(log_weights), strict=True):
            biases = middle + BIAS_REACH * np.hypot(spread, self.half_angle) * node
            logs = log_rounded(
                off[..., None] - biases[:, :, None], self.half_angle, half, noises
            ).sum(axis=2)
            logs = logs - 0.5 * (biases / self.bias) ** 2 + weight
            total.append(logs)
            first.append(biases)
            second.append(biases**2)
        logs = np.stack(total)
        whole = logsumexp(logs, axis=0)
        shares = np.exp(logs - whole)
        scale = BIAS_REACH * np.hypot(spread, self.half_angle)
        whole = whole + np.log(scale / self.bias) - 0.5 * np.log(2 * np.pi)
        return Parts(whole, (shares * np.stack(first)).sum(axis=0),
                     (shares * np.stack(second)).sum(axis=0))  # fmt: skip


def _gauss(order: int, ends: tuple[float, float]) -> tuple[FloatArray, FloatArray]:
    """Nodes of a flat prior between two ends, and the logarithms of their shares."""
    nodes, weights = np.polynomial.legendre.leggauss(order)
    return ends[0] + (nodes + 1) / 2 * (ends[1] - ends[0]), np.log(weights / 2)


def _summed(
    weights: FloatArray,
    held: FloatArray,
    parts: Parts,
    values: tuple[FloatArray, FloatArray],
) -> TableResult:
    """Sum over zero positions, then over focal length, scatter and noise."""
    logs = weights.copy()
    biases = []
    for printed in (1, 0):  # the angles printed about X, then those about Y
        block = CROSSED.index(printed)
        # Over the nodes of the zero position a product of matrices, each row by its largest number.
        first = held[:, :, block].swapaxes(1, 2) + np.log(WEIGHTS / 2)
        second = parts.log_probability[:, :, block]
        tops = first.max(axis=2, keepdims=True), second.max(axis=1, keepdims=True)
        left, right = np.exp(first - tops[0]), np.exp(second - tops[1])
        whole = left @ right
        with np.errstate(divide="ignore"):  # a sum of nothing is nothing
            logs += np.log(whole) + tops[0] + tops[1]
        whole = np.maximum(whole, np.finfo(float).tiny)
        biases.append([left @ (right * part[:, :, block]) / whole for part in parts[1:]])
    density = np.exp(logs - logsumexp(logs))
    moments = [(value, value**2) for value in values] + biases
    means = [float((density * first).sum()) for first, _ in moments]
    squares = [float((density * second).sum()) for _, second in moments]
    deviations = [float(np.sqrt(max(s - m**2, 0))) for s, m in zip(squares, means, strict=True)]
    noises = _shared(values[1], density.sum(axis=(0, 1)))
    return TableResult(tuple(means), tuple(deviations), noises)


def _shared(noises: FloatArray, shares: FloatArray) -> tuple[float, ...]:
    """The middles of even shares, by a spline through the density at the nodes."""
    nodes, weights = np.polynomial.legendre.leggauss(len(noises))
    whole = make_interp_spline(nodes, shares / weights, SPLINE).antiderivative()
    fine = np.linspace(nodes[0], nodes[-1], FINE)
    below = (whole(fine) - whole(nodes[0])) / (whole(nodes[-1]) - whole(nodes[0]))
    places = np.interp((np.arange(SHARES) + 0.5) / SHARES, below, fine)
    # The nodes lie evenly in the logarithm.
    return tuple(np.exp(np.interp(places, nodes, np.log(noises))).tolist())
