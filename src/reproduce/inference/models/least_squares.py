"""What niu2024 itself makes of a registration: the least-squares similarity, and what it leaves.

The same of the stars that fit alone, where some are wrongly matched.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from reproduce.physics.registration.fit import RegistrationFit, fit_registration
from reproduce.physics.validate import DegenerateGeometryError, FloatArray, MirroredPointsError

__all__ = ["fit_checks", "least_squares", "noise_growth", "robust_similarity"]

# The robust fit takes all pairs of so many stars; its residuals are then those of all stars.
PAIRED = 300
# A star further off than so many standard deviations of a coordinate is taken for wrongly matched:
# of honest ones with Gaussian noise that is one in 270,000.
FAR = 5.0
# The median length of a two-dimensional Gaussian residual, in standard deviations of a coordinate.
MEDIAN_LENGTH = float(np.sqrt(2 * np.log(2)))
# Residuals below this share of the coordinates are rounding.
ROUNDING = 1e-12


def least_squares(
    source: FloatArray, target: FloatArray, pivot: FloatArray, source_noise: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return the least-squares (k, theta, shift x, shift y, noise) and their standard errors, (5,).

    Those of the similarity take the residuals' own variance, whatever is in it; the noise is the
    share of one coordinate in it.
    """
    fit = fit_registration(source, target, pivot)
    freedom = float(fit.degrees_of_freedom)
    residual = np.sqrt(fit.chi_square / freedom)
    noise = residual / np.sqrt(1 + fit.parameters[0] ** 2 * source_noise)
    errors = residual * np.sqrt(np.diagonal(fit.cofactor))
    return np.append(fit.parameters, noise), np.append(errors, noise / np.sqrt(2 * freedom))


def fit_checks(source: FloatArray, target: FloatArray, pivot: FloatArray) -> dict[str, float]:
    """What predictive checks compare: the least-squares fit and what it leaves over, in px.

    The mean residuals outwards and around in the outer half of the field are zero only if a
    similarity is the right model.
    """
    fit = fit_registration(source, target, pivot)
    offsets = source - pivot
    radius = np.hypot(*offsets.T)
    outer = radius >= np.median(radius)
    unit = offsets[outer] / radius[outer, None]
    left = fit.residuals[outer]
    lengths = np.hypot(*fit.residuals.T)
    return {
        "residual, rms (px)": float(np.sqrt(np.square(fit.residuals).mean())),
        "residual, largest (px)": float(np.abs(fit.residuals).max()),
        # Free of the noise, which follows the size of the residuals, that of a wrong match too.
        "star furthest off, over rms": float(lengths.max() / np.sqrt(np.square(lengths).mean())),
        "outer residual, outwards (px)": float((left * unit).sum(axis=1).mean()),
        "outer residual, around (px)": float(
            (unit[:, 0] * left[:, 1] - unit[:, 1] * left[:, 0]).mean()
        ),
    }


def noise_growth(source: FloatArray, target: FloatArray, pivot: FloatArray) -> tuple[float, float]:
    """Return how the logarithm of the noise grows from centre to edge, and its standard error.

    The likeliest growth h of a noise sigma exp(h rho^2), rho being the distance from the pivot over
    the largest one, in the residuals of the least-squares similarity.
    """
    squares = np.square(fit_registration(source, target, pivot).residuals).sum(axis=1)
    rho = np.square(source - pivot).sum(axis=1)
    rho = rho / rho.max()
    off = rho - rho.mean()

    def surprise(growth: float) -> float:
        # Less the log likelihood over the count, sigma at its likeliest.
        return float(np.log((squares * np.exp(-2 * growth * off)).mean()))

    return float(minimize_scalar(surprise).x), float(0.5 / np.sqrt(off @ off))


@dataclass(frozen=True, eq=False)
class RobustFit:
    """The least-squares similarity of the stars that fit.

    - `fit`: of those alone.
    - `noise`: standard deviation of a residual coordinate of those, in px.
    - `off`, (n,): length of every star's residual in such standard deviations.
    - `suspects`: the stars that do not fit, the furthest first.
    """

    fit: RegistrationFit
    noise: float
    off: FloatArray
    suspects: NDArray[np.intp]

    def estimate(self) -> tuple[FloatArray, FloatArray]:
        """(k, theta, shift x, shift y, noise) and their standard errors, both of shape (5,)."""
        freedom = max(float(self.fit.degrees_of_freedom), 1.0)
        errors = self.noise * np.sqrt(np.diagonal(self.fit.cofactor))
        centre = np.append(self.fit.parameters, self.noise)
        return centre, np.append(errors, self.noise / np.sqrt(2 * freedom))


def robust_similarity(source: FloatArray, target: FloatArray, pivot: FloatArray) -> RobustFit:
    """Fit the similarity though up to almost half of the stars are wrongly matched.

    Where half of them or more coincide there are no medians to start from: least squares starts.
    Points that do not fix a similarity, or mirror each other, are a `DegenerateGeometryError`.

    Examples
    --------
    >>> source = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9], [4, 7], [6, 2]])
    >>> target = source + [[3, 0], [3.1, 0], [3, 0.1], [3, 0], [66, 0], [3, -0.1]]
    >>> robust_similarity(source, target, np.zeros(2)).suspects
    array([4])
    """
    count = len(source)
    some = np.linspace(0, count - 1, min(count, PAIRED)).astype(int)
    try:
        start = fit_registration(source[some], target[some], pivot, robust=True)
    except MirroredPointsError:
        raise
    except DegenerateGeometryError:
        start = fit_registration(source, target, pivot)
    length = np.hypot(*(target - start.transform.apply(source)).T)
    # Few stars: the fit leaves less of their scatter (Rousseeuw and Leroy, 1987, chapter 5).
    spread = float(np.median(length)) / MEDIAN_LENGTH * (1 + 5 / (count - 2))
    rounding = ROUNDING * float(np.abs([source, target]).max())
    good = length <= FAR * max(spread, rounding)
    fit = fit_registration(source[good], target[good], pivot)
    freedom = max(float(fit.degrees_of_freedom), 1.0)
    noise = max(float(np.sqrt(fit.chi_square / freedom)), rounding)
    furthest = np.argsort(-length)
    return RobustFit(fit, noise, length / noise, furthest[~good[furthest]])
