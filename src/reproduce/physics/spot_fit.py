"""Centres of spots by fitting the pixel-integrated Gaussian: matched filter, maximum likelihood.

Positions are in px, x before y, the centre of the first pixel at (0, 0). Windows are arrays
[..., y, x] in electrons, without background; `corners` holds x and y of the first pixel of each.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.centroids import STEPS, centre_of_gravity, checked_windows, kept_inside
from reproduce.physics.spots import spot_gradient
from reproduce.physics.validate import (
    FloatArray,
    common_batch,
    non_negative,
    positive,
    whole_number,
)

WEIGHTINGS = ("likelihood", "uniform")


def fitted_centre(
    windows: ArrayLike,
    corners: ArrayLike,
    radius: ArrayLike,
    read_noise: float = 0.0,
    weighting: str = "likelihood",
    steps: int = STEPS,
) -> FloatArray:
    """Return the centre of the pixel-integrated Gaussian that fits each window best.

    With weighting "likelihood" it is the maximum-likelihood estimate under photon and read noise
    (the sum is taken as Poisson, shifted by the read noise's variance, which is exact without
    read noise). With "uniform" it is least squares: the matched filter for noise that is the same
    in every pixel.

    Parameters
    ----------
    windows : array_like, shape (..., height, width)
        Light without background, in electrons.
    corners : array_like, shape (..., 2)
        First pixel of each window.
    radius : array_like, shape (...)
        Standard deviation of the spot, in px; known.
    read_noise : float
        Noise of a pixel without light, in electrons.
    weighting : {"likelihood", "uniform"}
        How pixels count.
    steps : int
        Steps of Fisher scoring from the centre of gravity.

    Returns
    -------
    ndarray, shape (..., 2)
        Centroids, in px.

    Raises
    ------
    DegenerateGeometryError, TypeError, ValueError
        As for `centre_of_gravity`; also if the weighting is unknown.

    Examples
    --------
    >>> from reproduce.physics.spots import spot_windows
    >>> window = spot_windows([0.2, -0.3], 1e4, 0.6, [-2, -2], 5)
    >>> fitted_centre(window, (-2, -2), 0.6).round(6)
    array([ 0.2, -0.3])
    """
    if weighting not in WEIGHTINGS:
        raise ValueError(f"weighting: expected one of {WEIGHTINGS}, got {weighting!r}; choose one")
    light, first = checked_windows(windows, corners)
    width = positive("radius", radius)
    variance = float(non_negative("read_noise", read_noise)) ** 2
    common_batch(windows=light.shape[:-2], radius=width.shape)
    batch = light.shape[:-2]
    state = np.empty((*batch, 3))
    state[..., :2] = centre_of_gravity(light, first) - first
    state[..., 2] = light.sum(axis=(-2, -1))
    for _ in range(whole_number("steps", steps)):
        model, slopes = spot_gradient(state, width, light.shape[-1], light.shape[-2])
        trust = np.ones_like(model)
        if weighting == "likelihood":
            # A pixel that should be dark must not count without limit.
            trust = 1.0 / np.maximum(model + variance, 1e-3)
        weighted = slopes * trust[..., np.newaxis, :, :]
        score = np.einsum("...kyx,...yx->...k", weighted, light - model)
        information = np.einsum("...kyx,...lyx->...kl", weighted, slopes)
        state = state + np.linalg.solve(information, score[..., np.newaxis])[..., 0]
        state[..., :2] = kept_inside(state[..., :2], light)
        state[..., 2] = np.maximum(state[..., 2], 1.0)
    return np.asarray(state[..., :2] + first)
