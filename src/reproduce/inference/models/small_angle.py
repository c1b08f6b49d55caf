"""The posterior of a misalignment in the small-angle limit: exact, without a sampler.

About its best fit the prediction of the spots is linear in the angles, in the scale and in the
directions, all their priors are Gaussian, and only the noise is left: given it the posterior is
Gaussian, and the noise itself has a density of one dimension. With a flat prior this would be the
Student-t of the registration; here the priors are kept. Conventions are those of `misalignment`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from scipy.special import logsumexp

from reproduce.inference import Model, Normal, UnsuitableModelError
from reproduce.inference.models.misalignment import SpotLikelihood
from reproduce.physics.validate import FloatArray

# Points over the noise, and how many of its own errors they reach.
POINTS, REACH = 401, 9.0


@dataclass(frozen=True, eq=False)
class SmallAnglePosterior:
    """The posterior, as a mixture of Gaussians over the noise.

    - `noise`, `weight`, (m,): values of the noise, in px, and their probabilities.
    - `means`, (m, d - 1): means of all other parameters, given the noise; SI.
    - `roots`, (m, d - 1, d - 1): roots of their covariances: any matrix whose product with its
      transpose is the covariance.
    """

    noise: FloatArray
    weight: FloatArray
    means: FloatArray
    roots: FloatArray

    @property
    def mean(self) -> FloatArray:
        """Mean of all parameters, the noise last, shape (d,)."""
        return np.append(self.weight @ self.means, self.weight @ self.noise)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of all parameters, shape (d, d)."""
        rows = np.column_stack([self.means, self.noise]) - self.mean
        total = np.einsum("m,mi,mj->ij", self.weight, rows, rows)
        inner = np.einsum("m,mik,mjk->ij", self.weight, self.roots, self.roots)
        total[:-1, :-1] += inner
        return np.asarray(total)

    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Independent draws, shape (count, d)."""
        chosen = generator.choice(len(self.noise), count, p=self.weight)
        normal = generator.normal(size=(count, self.means.shape[1]))
        others = self.means[chosen] + np.einsum("nij,nj->ni", self.roots[chosen], normal)
        return np.column_stack([others, self.noise[chosen]])


def small_angle_posterior(model: Model) -> SmallAnglePosterior:
    """Return the posterior of a misalignment whose prediction is replaced by its tangent.

    Exact in the limit of small angles; every prior but that of the noise has to be a `Normal`.
    """
    likelihood = model.likelihood_of(SpotLikelihood)
    priors = [parameter.prior for parameter in model.parameters[:-1]]
    if not all(isinstance(prior, Normal) for prior in priors):
        raise UnsuitableModelError(
            "model: expected Gaussian priors of all parameters but the noise"
        )
    sigma = np.array([prior.sigma for prior in priors if isinstance(prior, Normal)])
    middle = np.array([prior.mean for prior in priors if isinstance(prior, Normal)])
    centre, spread = likelihood.start()
    scale = spread[:-1]
    response, left = likelihood.linearised(centre, scale)
    # In units of the errors, or the matrices cannot be inverted.
    response, off = response * scale, (middle - centre[:-1]) / scale
    held = np.square(scale / sigma)
    noise = centre[-1] + spread[-1] * np.linspace(-REACH, REACH, POINTS)
    precise = noise[:, None] ** -2
    inverse = np.linalg.inv(response.T @ response * precise[..., None] + np.diag(held))
    pull = response.T @ left * precise + held * off
    means = np.einsum("mij,mj->mi", inverse, pull)
    roots = np.linalg.cholesky(inverse)
    statistics = likelihood.statistics
    logs = -statistics.size * np.log(noise) + model.parameters[-1].prior.log_density(noise)
    logs -= 0.5 * (statistics.squares + left @ left) / noise**2
    logs += 0.5 * np.einsum("mi,mi->m", means, pull)
    logs += np.log(np.diagonal(roots, axis1=1, axis2=2)).sum(axis=1)
    return SmallAnglePosterior(
        noise,
        np.exp(logs - logsumexp(logs)),
        centre[:-1] + means * scale,
        roots * scale[:, None],
    )


def errors_with_free_lasers(likelihood: SpotLikelihood) -> FloatArray:
    """Standard errors of the misalignment if the direction of every laser were free, (3,), radians.

    The first group then measures where each laser points, and only the motion of its spot from
    group to group tells of the misalignment: the noise of both groups is in it, and no prior.
    """
    centre, spread = likelihood.start()
    first, second = likelihood.statistics.counts
    # Of the weighted means of the second group; the first does not answer to the misalignment.
    response = likelihood.linearised(centre, spread[:-1])[0][:, 3:6]
    covariance = np.linalg.inv(response.T @ response) * centre[-1] ** 2 * (1 + second / first)
    return np.asarray(np.sqrt(np.diagonal(covariance)))
