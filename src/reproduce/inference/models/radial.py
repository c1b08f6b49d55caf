"""Rivals of the similarity in model choice: a radial term beside it, or an affine transform.

All are linear in their coefficients, whose priors are flat or Gaussian, so with the noise given
their evidence is known in closed form; one sum over the noise remains (`linear_log_evidence`).
Evidence of a rival hangs on how wide the prior of its additional terms is: `WIDTHS` are compared.
Units and conventions are those of `registration`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Literal, Self

import numpy as np
from numpy.random import Generator
from scipy.special import logsumexp

from reproduce.inference.model import Model, Parameter, UnsuitableModelError
from reproduce.inference.models.least_squares import fit_checks
from reproduce.inference.models.registration import GaussianRegistration
from reproduce.inference.priors import LogUniform, Normal, Uniform
from reproduce.physics.validate import FloatArray

__all__ = [
    "TERMS", "WIDTH", "WIDTHS", "affine_model", "linear_log_evidence", "linear_model",
    "radial_model", "similarity_model",
]  # fmt: skip

Shape = Literal["similarity", "radial", "affine"]
# The coefficients: those of the similarity, which all have, then those of the shape.
SIMILARITY = ("dilation", "turn", "shift-x", "shift-y")
TERMS: dict[Shape, tuple[str, ...]] = {
    "similarity": (),
    "radial": ("radial",),
    "affine": ("stretch", "shear"),
}
# Prior standard deviation of a term of the shape, in px at the edge of the field: that of the
# distortions in `variants.distortion_model`; and others, to see what it decides.
WIDTH = 2.0
WIDTHS = (1.0, 2.0, 5.0)
# Nodes for the noise, and how far they reach, in standard errors of its logarithm.
NODES, REACH = 200, 12.0


@dataclass(frozen=True, eq=False)
class LinearRegistration:
    """Target = design times coefficients; parameters: the coefficients, then the noise.

    The coefficients are displacements in px at the edge of the field, so that all have one scale:
    the similarity's dilation, turn and two shifts; beside them one radial term of third order, or
    stretch (x outward, y inward) and shear, which make the affine transform.

    - `source`, `target`, (n, 2): in px.
    - `pivot`, (2,): the source channel's principal point, in px.
    - `shape`: which columns the design has.
    """

    source: FloatArray
    target: FloatArray
    pivot: FloatArray
    shape: Shape

    @cached_property
    def design(self) -> FloatArray:
        """Columns of the displacement target minus source, shape (2 n, m)."""
        x, y = (self.source - self.pivot).T
        edge = np.hypot(x, y).max()
        x, y = x / edge, y / edge
        zero, one, square = np.zeros_like(x), np.ones_like(x), x**2 + y**2
        similar = [(x, y), (-y, x), (one, zero), (zero, one)]
        terms = {
            "radial": (x * square, y * square),
            "stretch": (x, -y),
            "shear": (y, x),
        }
        columns = similar + [terms[name] for name in TERMS[self.shape]]
        return np.stack([np.concatenate(pair) for pair in columns], axis=-1)

    @cached_property
    def reduced(self) -> tuple[FloatArray, FloatArray, float]:
        """Least-squares coefficients, triangular factor, and squared residuals."""
        moved = (self.target - self.source).T.ravel()
        unitary, root = np.linalg.qr(self.design)
        best = np.linalg.solve(root, unitary.T @ moved)
        left = moved - self.design @ best
        return best, root, float(left @ left)

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        best, root, least = self.reduced
        noise = parameters[:, -1]
        off = (parameters[:, :-1] - best) @ root.T
        squares = least + np.square(off).sum(axis=1)
        size = len(self.design)
        return np.asarray(-0.5 * size * np.log(2 * np.pi * noise**2) - squares / (2 * noise**2))

    def simulate(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Target points for one parameter vector, shape (n, 2), in px."""
        moved = (self.design @ parameters[:-1]).reshape(2, -1).T
        noise = parameters[-1] * generator.normal(size=self.source.shape)
        return np.asarray(self.source + moved + noise)

    def given(self, data: FloatArray) -> Self:
        """The same sources with other target points."""
        return replace(self, target=data)

    def start(self) -> tuple[FloatArray, FloatArray]:
        """The least-squares solution and its standard errors."""
        best, root, least = self.reduced
        freedom = len(self.design) - len(best)
        noise = np.sqrt(least / freedom)
        errors = noise * np.sqrt(np.square(np.linalg.inv(root)).sum(axis=1))
        return np.append(best, noise), np.append(errors, noise / np.sqrt(2 * freedom))

    def checks(self, data: FloatArray | None = None) -> dict[str, float]:
        """As for the registration."""
        return fit_checks(self.source, self.target if data is None else data, self.pivot)


def linear_log_evidence(model: Model) -> float:
    """Log evidence of a linear registration, summed over the noise alone.

    With the noise given the flat coefficients integrate to a constant, and the least-squares
    estimates of the shape are Gaussian about nothing, with the covariances of prior and estimate
    added. Exact but for what the posterior leaves outside the ends of the flat priors.
    """
    likelihood = model.likelihood_of(LinearRegistration)
    flat = len(SIMILARITY)
    _, root, least = likelihood.reduced
    size = len(likelihood.design)
    noise, weights = _noise_nodes(model.parameters[-1], least, size - len(root))
    logs = -0.5 * (size - len(root)) * np.log(2 * np.pi * noise**2) - least / (2 * noise**2)
    logs = logs + weights + _terms(likelihood, model.parameters[flat:-1], noise)
    logs = logs - np.log(np.abs(np.diagonal(root))).sum()
    for parameter in model.parameters[:flat]:
        if not isinstance(parameter.prior, Uniform):
            raise _unexpected(parameter, "Uniform")
        logs = logs - np.log(parameter.prior.high - parameter.prior.low)
    return float(logsumexp(logs))


def _noise_nodes(parameter: Parameter, least: float, freedom: int) -> tuple[FloatArray, FloatArray]:
    """Nodes for the noise between the ends of its prior, and log weights with the prior in them."""
    prior = parameter.prior
    if not isinstance(prior, LogUniform):
        raise _unexpected(parameter, "LogUniform")
    middle, reach = 0.5 * np.log(least / freedom), REACH / np.sqrt(2 * freedom)
    low, high = np.log(prior.low), np.log(prior.high)
    start, end = max(middle - reach, low), min(middle + reach, high)
    places, weights = np.polynomial.legendre.leggauss(NODES)
    logs = start + (places + 1) / 2 * (end - start)
    return np.exp(logs), np.log(weights * (end - start) / 2 / (high - low))


def _terms(
    likelihood: LinearRegistration, parameters: tuple[Parameter, ...], noise: FloatArray
) -> FloatArray:
    """Log density of the estimated shape, for each noise, shape (n,)."""
    if not parameters:
        return np.zeros(len(noise))
    best, root, _ = likelihood.reduced
    count = len(parameters)
    inverse = np.linalg.inv(root[-count:, -count:])
    wide, off = np.zeros(count), best[-count:].copy()
    for i, parameter in enumerate(parameters):
        if not isinstance(parameter.prior, Normal):
            raise _unexpected(parameter, "Normal")
        wide[i] = parameter.prior.sigma**2
        off[i] -= parameter.prior.mean
    covariance = noise[:, None, None] ** 2 * (inverse @ inverse.T) + np.diag(wide)
    squares = (off @ np.linalg.solve(covariance, off[:, None]))[:, 0]
    return np.asarray(-0.5 * (squares + np.linalg.slogdet(2 * np.pi * covariance)[1]))


def _unexpected(parameter: Parameter, kind: str) -> UnsuitableModelError:
    return UnsuitableModelError(
        f"{parameter.name}: expected a prior {kind}, got {type(parameter.prior).__name__}"
    )


def linear_model(base: Model, shape: Shape, width: float = WIDTH) -> Model:
    """A linear registration of the data of a `registration_model`.

    Coefficients as displacements at the edge of the field, in px, and the noise. `width` is the
    prior standard deviation of the terms of the shape.
    """
    plain = base.likelihood_of(GaussianRegistration)
    likelihood = LinearRegistration(plain.source, plain.target, plain.pivot, shape)
    placed = Uniform(-50.0, 50.0, "channels of one prism lie within some tens of px of each other, "
                     "turned and scaled alike")  # fmt: skip
    shaped = Normal(0.0, width, "a corrected star camera moves its outermost stars by a few px at "
                    "most, and so may two channels differ in shape")  # fmt: skip
    priors = [(name, placed) for name in SIMILARITY] + [(name, shaped) for name in TERMS[shape]]
    parameters = tuple(
        Parameter(name, f"c_{i}", "px", prior) for i, (name, prior) in enumerate(priors, start=1)
    )
    noise = base.parameters[4]
    return Model(f"registration-{shape}", (*parameters, noise), likelihood)


def radial_model(base: Model, width: float = WIDTH) -> Model:
    """The similarity with a radial term of third order beside it."""
    return linear_model(base, "radial", width)


def affine_model(base: Model, width: float = WIDTH) -> Model:
    """The affine transform."""
    return linear_model(base, "affine", width)


def similarity_model(base: Model, width: float = WIDTH) -> Model:
    """The similarity with the coefficients and priors of its rivals; the width plays no part."""
    return linear_model(base, "similarity", width)
