"""Focal length, angle bias and noise from the printed stage test: Table V of chen2023 as data.

Reference and monitored angles are taken together, under both hypotheses about the table's columns
(`inference.models.reference_angles`), equally probable beforehand: the indicator is summed out.
Lengths in metres, angles in radians; arrays of the moved states have shape (states, blocks).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.random import Generator

from reproduce.inference import (
    LogUniform,
    Model,
    Normal,
    Parameter,
    from_scores,
    log_slope,
    scores,
    weighted,
)
from reproduce.inference.models.reference_angles import (
    FOCAL_SPREAD,
    HYPOTHESES,
    Printed,
    ReferenceAngles,
    focal_parameter,
    in_radians,
    log_same_hypothesis,
    scatter_parameter,
)
from reproduce.physics.validate import FloatArray
from reproduce.units import ARCSEC_PER_RADIAN

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
            focal_parameter(nominal),
            Parameter("noise", r"\sigma", "arcsec", LogUniform(*NOISE,
                "from the last printed digit to an arc second, no scale preferred"),
                ARCSEC_PER_RADIAN),
            Parameter("bias-x", "b_X", "arcsec", bias, ARCSEC_PER_RADIAN),
            Parameter("bias-y", "b_Y", "arcsec", bias, ARCSEC_PER_RADIAN),
            scatter_parameter(likelihood.reference.scatter),
        ),
        likelihood,
        {"focal-length": nominal},
    )  # fmt: skip
