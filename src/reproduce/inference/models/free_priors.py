"""Priors of a registration of anyone's stars: flat, with ends that nothing reaches.

They take the place of those of `registration.registration_parameters`, which suit the channels of
one telescope. Conventions and units are those of `registration`.
"""

from __future__ import annotations

import numpy as np

from reproduce.inference.models.least_squares import robust_similarity
from reproduce.inference.priors import LogUniform, Prior, Uniform
from reproduce.physics.registration.fit import RegistrationFit, fit_registration
from reproduce.physics.validate import FloatArray

# Of the residual of least squares: ends of the noise, as good as none.
NOISE = (1e-9, 1e3)
# The shift may lie so many fields or standard errors, the scale so many times, from the fit.
FIELDS, ERRORS, SCALES = 10.0, 1e3, 10.0
# Residuals below this share of the coordinates are rounding.
ROUNDING = 1e-11


def free_priors(source: FloatArray, target: FloatArray, pivot: FloatArray) -> dict[str, Prior]:
    """Return flat priors whose ends are as far from the fit as the data's own scale allows.

    By parameter. Few or mirrored points, or points that fit without any error, are refused.

    Examples
    --------
    >>> points = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> moved = points + [[1, 0], [0, 1], [1, 1], [0, 0]]
    >>> print(free_priors(points, moved, np.zeros(2))["rotation"])
    uniform from -3.14159 to 3.14159
    """
    largest = float(np.abs([source, target]).max())
    if len(source) < 4:
        raise ValueError(f"expected four or more stars, got {len(source)}; add some")
    robust = robust_similarity(source, target, pivot)
    fit = fit_registration(source, target, pivot)
    residual = _residual(fit)
    k, theta, x, y = fit.parameters.tolist()
    if residual < ROUNDING * max(largest, float(np.abs(pivot).max())):
        raise ValueError(
            "the points fit without any error, so there is no noise to sample; exactly: scale "
            f"{k:.10g}, rotation {np.degrees(theta):.10g} deg, shift {x:.10g} and {y:.10g} px"
        )
    # No least-squares scale exceeds the ratio of both patterns' sizes.
    size = float(np.sqrt(np.square(target - target.mean(axis=0)).sum() * fit.cofactor[0, 0]))
    size = max(size, float(robust.fit.parameters[0]))
    error = residual * float(np.sqrt(fit.cofactor[2, 2]))
    reach = max(FIELDS * float(np.ptp(target, axis=0).max()), ERRORS * error)
    place = "ten fields, or a thousand standard errors, on both sides of least squares"
    return {
        "scale": Uniform(0.0, SCALES * size, "up to ten times the ratio of the sizes of both "
                         "patterns; flat"),
        "rotation": Uniform(theta - np.pi, theta + np.pi, "any: the full turn, cut opposite to "
                            "least squares"),
        "shift-x": Uniform(x - reach, x + reach, place),
        "shift-y": Uniform(y - reach, y + reach, place),
        "noise": LogUniform(NOISE[0] * residual, NOISE[1] * residual, "no scale preferred: from a "
                            "billionth of the residuals of least squares to a thousand times them"),
    }  # fmt: skip


def _residual(fit: RegistrationFit) -> float:
    """Standard deviation of a residual coordinate, in px."""
    return float(np.sqrt(fit.chi_square / max(float(fit.degrees_of_freedom), 1.0)))
