"""The least variance that any unbiased registration can have: the Cramér-Rao bound.

Image points have shape (..., n, 2), in px; parameters are in the order scale k, rotation theta
(radians), shift x, shift y (px), as in `similarity`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.gauss_newton import jacobian
from reproduce.physics.similarity import Similarity
from reproduce.physics.validate import DegenerateGeometryError, FloatArray, non_negative


def registration_bound(
    source: ArrayLike,
    similarity: Similarity,
    source_sigma: ArrayLike,
    target_sigma: ArrayLike,
) -> FloatArray:
    """The Cramér-Rao bound of the four parameters where both channels are noisy.

    The true positions are unknown too, one for each spot. Eliminating them leaves the variance of
    one coordinate of target minus transformed source, target_sigma^2 + k^2 source_sigma^2.

    Parameters
    ----------
    source : array_like, shape (..., n, 2)
        True source points, in px.
    similarity : Similarity
        The true transform.
    source_sigma, target_sigma : array_like, shape (...)
        Standard deviations of one coordinate of one spot, in px; not both zero.

    Returns
    -------
    ndarray, shape (..., 4, 4)
        Lower bound of the covariance of (k, theta, shift x, shift y).

    Raises
    ------
    ValueError
        If an argument is not finite or has the wrong shape, or both noises are zero.
    DegenerateGeometryError
        If the points coincide.

    Examples
    --------
    Two points 2 px apart: the mean of two shifts, and the slope of a short lever.

    >>> identity = Similarity(1.0, 0.0, (0, 0), (0, 0))
    >>> registration_bound([[-1, 0], [1, 0]], identity, 0.0, 1.0).diagonal()
    array([0.5, 0.5, 0.5, 0.5])
    """
    source_sigma = non_negative("source_sigma", source_sigma)
    target_sigma = non_negative("target_sigma", target_sigma)
    variance = target_sigma**2 + (similarity.scale * source_sigma) ** 2
    if (variance == 0).any():
        raise ValueError("sigma: expected noise in one channel at least, got none; give one")
    rows = jacobian(similarity.parameters, source, similarity.pivot)
    normal = np.swapaxes(rows, -1, -2) @ rows
    size = np.sqrt(np.diagonal(normal, axis1=-2, axis2=-1))
    scaled = normal / (size[..., :, None] * size[..., None, :])
    if (np.linalg.det(scaled) < 1e-14).any():
        raise DegenerateGeometryError(
            "source: expected points that fix scale and rotation, got coincident ones; spread them"
        )
    inverse = np.linalg.inv(scaled) / (size[..., :, None] * size[..., None, :])
    return np.asarray(variance[..., None, None] * inverse)
