"""Rivals of the similarity in model choice: a radial term beside it, or an affine transform.

All are linear in their coefficients, so with flat priors and a log-uniform noise their evidence is
known in closed form (`linear_log_evidence`). Units and conventions are those of `registration`.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Literal, Self

import numpy as np
from numpy.random import Generator
from scipy.special import gammaln

from reproduce.inference.model import Model, Parameter
from reproduce.inference.priors import LogUniform, Uniform
from reproduce.inference.registration import GaussianRegistration, fit_checks
from reproduce.physics.validate import FloatArray

Shape = Literal["similarity", "radial", "affine"]


@dataclass(frozen=True, eq=False)
class LinearRegistration:
    """Target = design times coefficients; parameters: the coefficients, then the noise.

    The coefficients are displacements in px at the edge of the field, so that all have one scale:
    x scale, x shear, ... for the affine transform; the similarity's two and the radial one.

    Parameters
    ----------
    source, target : ndarray, shape (n, 2)
        In px.
    pivot : ndarray, shape (2,)
        The source channel's principal point, in px.
    shape : {"similarity", "radial", "affine"}
        Which columns the design has.
    """

    # `start` is the least-squares estimate with its standard errors.
    least_squares: ClassVar[bool] = True

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
        shift = [(one, zero), (zero, one)]
        similar = [(x, y), (-y, x)]
        columns = {
            "similarity": similar + shift,
            "radial": [*similar, *shift, (x * square, y * square)],
            "affine": [(x, zero), (y, zero), (zero, x), (zero, y), *shift],
        }[self.shape]
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
    """Log evidence of a linear registration in closed form.

    Parameters
    ----------
    model : Model
        From `similarity_model`, `radial_model` or `affine_model`.

    Returns
    -------
    float
        Exact but for what the posterior leaves outside the priors' ends.
    """
    likelihood = model.likelihood
    if not isinstance(likelihood, LinearRegistration):
        raise TypeError(
            f"model: expected a linear registration, got {type(likelihood).__name__}; "
            "use `evidence.log_evidence`"
        )
    best, root, least = likelihood.reduced
    size, half = len(likelihood.design), (len(likelihood.design) - len(best)) / 2
    total = -0.5 * size * np.log(2 * np.pi) + 0.5 * len(best) * np.log(2 * np.pi)
    total -= np.log(np.abs(np.diagonal(root))).sum()
    total += gammaln(half) - np.log(2) - half * np.log(least / 2)
    for parameter in model.parameters[:-1]:
        total += float(parameter.prior.log_density(np.array(0.0)))
    noise = model.parameters[-1].prior
    if not isinstance(noise, LogUniform):
        raise TypeError(f"noise prior: expected LogUniform, got {type(noise).__name__}")
    return float(total - np.log(np.log(noise.high / noise.low)))


def linear_model(base: Model, shape: Shape) -> Model:
    """A linear registration of the same data.

    Parameters
    ----------
    base : Model
        From `registration.registration_model`.
    shape : {"similarity", "radial", "affine"}
        Its columns.

    Returns
    -------
    Model
        Coefficients as displacements at the edge of the field, in px, and the noise.
    """
    plain = base.likelihood
    if not isinstance(plain, GaussianRegistration):
        raise TypeError(f"base: expected a Gaussian registration, got {type(plain).__name__}")
    likelihood = LinearRegistration(plain.source, plain.target, plain.pivot, shape)
    prior = Uniform(-50.0, 50.0, "channels of one prism lie within some tens of px of each other, "
                    "everywhere in the field")  # fmt: skip
    count = likelihood.design.shape[1]
    parameters = tuple(
        Parameter(f"displacement-{i + 1}", f"c_{i + 1}", "px", prior) for i in range(count)
    )
    noise = base.parameters[4]
    name = f"registration-{shape}"
    return Model(name, f"Registration: {shape}", (*parameters, noise), likelihood)


def radial_model(base: Model) -> Model:
    """The similarity with a radial term of third order beside it."""
    return linear_model(base, "radial")


def affine_model(base: Model) -> Model:
    """The affine transform."""
    return linear_model(base, "affine")


def similarity_model(base: Model) -> Model:
    """The similarity with the coefficients and priors of its rivals."""
    return linear_model(base, "similarity")
