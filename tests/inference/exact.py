"""The posterior of the registration in closed form: what the sampler is held against.

About the pivot the model is linear in beta = (k cos theta, k sin theta, shift x, shift y). With a
flat prior in beta and one over the noise the posterior of beta is a Student-t about the
least-squares solution, with 2n - 4 degrees of freedom. A prior flat in (k, theta) instead is flat
in beta divided by k, since d(a) d(b) = k dk d(theta).
"""

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from reproduce.physics.registration import fit_registration
from reproduce.physics.validate import FloatArray


@dataclass(frozen=True, eq=False)
class RegistrationPosterior:
    """The exact posterior of one channel's registration.

    - `mean`, (4,): of (k cos theta, k sin theta, shift x, shift y): the least-squares solution.
    - `scale`, (4, 4): scale matrix of the Student-t.
    - `freedom`: degrees of freedom.
    - `squares`: sum of squared residuals of the least-squares solution, in px^2.
    """

    mean: FloatArray
    scale: FloatArray
    freedom: float
    squares: float

    def draw(self, generator: Generator, count: int) -> FloatArray:
        """Independent draws of (k, theta, shift x, shift y, noise), shape (count, 5).

        The prior is flat in (k cos theta, k sin theta) and one over the noise.
        """
        noise = np.sqrt(self.squares / generator.chisquare(self.freedom, count))
        root = np.linalg.cholesky(self.scale * self.freedom / self.squares)
        beta = self.mean + noise[:, None] * (generator.normal(size=(count, 4)) @ root.T)
        k, theta = np.hypot(beta[:, 0], beta[:, 1]), np.arctan2(beta[:, 1], beta[:, 0])
        return np.column_stack([k, theta, beta[:, 2:], noise])


def registration_posterior(
    source: FloatArray, target: FloatArray, pivot: FloatArray
) -> RegistrationPosterior:
    """Return the exact posterior of a registration, flat in (k cos theta, k sin theta, shift).

    Examples
    --------
    >>> points = np.array([[-1.0, -1], [1, -1], [-1, 1], [1, 1]])
    >>> moved = points + [[1, 0], [-1, 0], [0, 0], [0, 0]]
    >>> exact = registration_posterior(points, moved, (0, 0))
    >>> exact.mean.round(3) + 0.0, exact.freedom, round(exact.squares, 3)
    (array([0.75, 0.  , 0.  , 0.  ]), 4.0, 1.5)
    """
    fit = fit_registration(source, target, pivot)
    k, theta = fit.parameters[:2]
    mean = np.array([k * np.cos(theta), k * np.sin(theta), *fit.parameters[2:]])
    # Jacobian of (a, b) by (k, theta): carries the fit's cofactor over.
    turn = np.eye(4)
    turn[:2, :2] = [
        [np.cos(theta), -k * np.sin(theta)],
        [np.sin(theta), k * np.cos(theta)],
    ]
    freedom, squares = 2.0 * fit.residuals.shape[-2] - 4, float(fit.chi_square)
    scale = squares / freedom * (turn @ fit.cofactor @ turn.T)
    return RegistrationPosterior(mean, scale, freedom, squares)
