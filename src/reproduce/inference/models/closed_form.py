"""The posterior of the registration in closed form: it needs no sampler.

About the pivot the model is linear in beta = (k cos theta, k sin theta, shift x, shift y). With a
flat prior in beta and one over the noise the posterior of beta is a Student-t about the
least-squares solution, with 2n - 4 degrees of freedom; with known noise it is Gaussian. A prior
flat in (k, theta) instead is flat in beta divided by k, since d(a) d(b) = k dk d(theta).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.random import Generator
from scipy import stats

from reproduce.physics.registration import fit_registration
from reproduce.physics.validate import FloatArray

Flat = Literal["affine", "polar"]


@dataclass(frozen=True, eq=False)
class RegistrationPosterior:
    """The exact posterior of one channel's registration.

    - `mean`, (4,): of (k cos theta, k sin theta, shift x, shift y): the least-squares solution.
    - `scale`, (4, 4): scale matrix of the Student-t, or covariance of the Gaussian.
    - `freedom`: degrees of freedom; infinite where the noise is known.
    - `squares`: sum of squared residuals of the least-squares solution, in px^2.
    - `count`: number of points.
    """

    mean: FloatArray
    scale: FloatArray
    freedom: float
    squares: float
    count: int

    @property
    def covariance(self) -> FloatArray:
        """Covariance of (k cos theta, k sin theta, shift x, shift y), shape (4, 4)."""
        if np.isinf(self.freedom):
            return self.scale
        return self.scale * self.freedom / (self.freedom - 2)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Independent draws of (k, theta, shift x, shift y, noise), shape (count, 5).

        The prior is flat in (k cos theta, k sin theta) and one over the noise.
        """
        if np.isinf(self.freedom):
            raise ValueError("draw: expected an unknown noise, got a known one; draw the Gaussian")
        noise = np.sqrt(self.squares / generator.chisquare(self.freedom, count))
        root = np.linalg.cholesky(self.scale * self.freedom / self.squares)
        beta = self.mean + noise[:, None] * (generator.normal(size=(count, 4)) @ root.T)
        return np.column_stack([polar(beta), noise])

    def log_density(self, parameters: FloatArray, flat: Flat = "affine") -> FloatArray:
        """Log density of (k, theta, shift x, shift y), shape (n,), noise integrated out.

        The prior is flat in (k cos theta, k sin theta), or in (k, theta). The second is normalised
        with k taken at its mean: exact to the square of its relative width.
        """
        k, theta = parameters[:, 0], parameters[:, 1]
        beta = np.column_stack([k * np.cos(theta), k * np.sin(theta), parameters[:, 2:4]])
        if np.isinf(self.freedom):
            density = stats.multivariate_normal(self.mean, self.scale).logpdf(beta)
        else:
            density = stats.multivariate_t(self.mean, self.scale, int(self.freedom)).logpdf(beta)
        # The density of beta, carried to (k, theta), gains the Jacobian k.
        jacobian = np.log(k) if flat == "affine" else np.log(np.hypot(*self.mean[:2]))
        return np.asarray(density + jacobian)


def registration_posterior(
    source: FloatArray, target: FloatArray, pivot: FloatArray, noise: float | None = None
) -> RegistrationPosterior:
    """Return the exact posterior of a registration, flat in (k cos theta, k sin theta, shift).

    Student-t, or Gaussian where the noise of a residual coordinate is known, in px.

    Examples
    --------
    >>> points = np.array([[-1.0, -1], [1, -1], [-1, 1], [1, 1]])
    >>> exact = registration_posterior(points, points, (0, 0), noise=2.0)
    >>> np.sqrt(np.diagonal(exact.covariance)).round(3)
    array([0.707, 0.707, 1.   , 1.   ])
    """
    fit = fit_registration(source, target, pivot)
    k, theta = fit.parameters[:2]
    mean = np.array([k * np.cos(theta), k * np.sin(theta), *fit.parameters[2:]])
    # Jacobian of (a, b) by (k, theta): carries the fit's cofactor over.
    turn = np.eye(4)
    turn[:2, :2] = [[np.cos(theta), -k * np.sin(theta)], [np.sin(theta), k * np.cos(theta)]]
    cofactor = turn @ fit.cofactor @ turn.T
    count = fit.residuals.shape[-2]
    freedom, squares = 2.0 * count - 4, float(fit.chi_square)
    if noise is not None:
        return RegistrationPosterior(mean, noise**2 * cofactor, np.inf, squares, count)
    return RegistrationPosterior(mean, squares / freedom * cofactor, freedom, squares, count)


def polar(beta: FloatArray) -> FloatArray:
    """Return (k, theta, shift) of (k cos theta, k sin theta, shift), shape (n, 4)."""
    return np.column_stack(
        [np.hypot(beta[:, 0], beta[:, 1]), np.arctan2(beta[:, 1], beta[:, 0]), beta[:, 2:]]
    )
