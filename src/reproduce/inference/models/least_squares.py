"""What niu2024 itself makes of a registration: the least-squares similarity, and what it leaves."""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

from reproduce.physics.registration import fit_registration
from reproduce.physics.validate import FloatArray


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
