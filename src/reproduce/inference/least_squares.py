"""What niu2024 itself makes of a registration: the least-squares similarity, and what it leaves."""

from __future__ import annotations

import numpy as np

from reproduce.physics.registration import fit_similarity
from reproduce.physics.validate import FloatArray


def least_squares(
    source: FloatArray, target: FloatArray, pivot: FloatArray, source_noise: bool = False
) -> tuple[FloatArray, FloatArray]:
    """Return the least-squares (k, theta, shift x, shift y, noise) and their standard errors.

    Parameters
    ----------
    source, target, pivot, source_noise
        As for `GaussianRegistration`.

    Returns
    -------
    tuple of ndarray, shape (5,)
        Estimates and errors. Those of the similarity take the residuals' own variance, whatever
        is in it; the noise is the share of one coordinate in it.
    """
    fit = fit_similarity(source, target, pivot)
    freedom = float(fit.degrees_of_freedom)
    residual = np.sqrt(fit.chi_square / freedom)
    noise = residual / np.sqrt(1 + fit.parameters[0] ** 2 * source_noise)
    errors = residual * np.sqrt(np.diagonal(fit.cofactor))
    return np.append(fit.parameters, noise), np.append(errors, noise / np.sqrt(2 * freedom))


def fit_checks(source: FloatArray, target: FloatArray, pivot: FloatArray) -> dict[str, float]:
    """What predictive checks compare: the least-squares fit and what it leaves over.

    Returns
    -------
    dict
        Residuals in px; their mean outwards and around in the outer half of the field is zero
        only if a similarity is the right model.
    """
    fit = fit_similarity(source, target, pivot)
    offsets = source - pivot
    radius = np.hypot(*offsets.T)
    outer = radius >= np.median(radius)
    unit = offsets[outer] / radius[outer, None]
    left = fit.residuals[outer]
    return {
        "residual, rms (px)": float(np.sqrt(np.square(fit.residuals).mean())),
        "residual, largest (px)": float(np.abs(fit.residuals).max()),
        "outer residual, outwards (px)": float((left * unit).sum(axis=1).mean()),
        "outer residual, around (px)": float(
            (unit[:, 0] * left[:, 1] - unit[:, 1] * left[:, 0]).mean()
        ),
    }
