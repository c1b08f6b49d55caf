"""Laying one image over another by resampling, and adding images up.

Images are arrays [..., y, x], rows from the first upwards; the centre of the first pixel is at
(0, 0). Transforms take source points to target points, as in `similarity`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.registration.fit import RegistrationFit
from reproduce.physics.registration.transforms import Registration
from reproduce.physics.validate import FloatArray, finite_array

_ORDERS = (0, 1, 3)


def registered_image(
    image: ArrayLike,
    transform: Registration | RegistrationFit,
    *,
    order: Literal[0, 1, 3] = 3,
    corner: tuple[int, int] = (0, 0),
) -> FloatArray:
    """Return a source image on the pixels of the target.

    The value of a target pixel is read off the source where the transform comes from, between the
    pixels by splines. It is divided by how much the transform enlarges an area there: a spot that
    is stretched over more pixels keeps its light.

    Parameters
    ----------
    image : array_like, shape (height, width)
        In any unit of light, background taken away: outside the image there is nothing.
    transform : Registration or RegistrationFit
        From source to target; a single one.
    order : int
        0 for the nearest pixel, 1 for straight lines, 3 for cubic splines.
    corner : tuple of int
        x and y of the image's first pixel, where it is a window of a larger one.

    Returns
    -------
    ndarray, shape (height, width)
        On target pixels that begin at the same corner.

    Raises
    ------
    DegenerateGeometryError
        If the transform cannot be undone on some pixel.

    Examples
    --------
    A spot one pixel to the right, brought back by a shift of one.

    >>> image = np.zeros((3, 4))
    >>> image[1, 2] = 8.0
    >>> registered_image(image, Registration.similarity(1, 0, (1, 0), (0, 0)), order=1)
    array([[0., 0., 0., 0.],
           [0., 8., 0., 0.],
           [0., 0., 0., 0.]])
    """
    light = finite_array("image", image, shape=(None, None))
    if light.ndim != 2:
        raise ValueError(f"image: expected one image, got shape {light.shape}; pass them singly")
    if order not in _ORDERS:
        raise ValueError(f"order: expected one of {_ORDERS}, got {order!r}")
    # A fit holds its transform, and so does what the front door returns for a user's stars.
    transform = getattr(transform, "transform", transform)
    if not isinstance(transform, Registration):
        raise TypeError(f"transform: expected a Registration, got {type(transform).__name__}")
    if transform.batch:
        raise ValueError(f"transform: expected one, got a batch of shape {transform.batch}")
    first = finite_array("corner", corner, shape=(2,))
    if first.ndim != 1:
        raise ValueError(f"corner: expected one, got shape {first.shape}; give x and y")
    if transform.model == "similarity+radial":
        return _bent(light, transform, order, first)
    matrix = np.linalg.inv(transform.matrix)
    origin = transform.undo([[0.0, 0.0]])[0]
    enlarged = abs(float(np.linalg.det(transform.matrix)))
    # Source position of target pixel p: matrix (p + corner) + origin - corner; y before x below.
    offset = (matrix @ first + origin - first)[::-1]
    from scipy.ndimage import affine_transform  # only now: registering stars needs no SciPy

    resampled = affine_transform(
        light, matrix[::-1, ::-1], offset, order=order, mode="constant", cval=0.0
    )
    return resampled / enlarged


def _bent(
    light: FloatArray, transform: Registration, order: Literal[0, 1, 3], first: FloatArray
) -> FloatArray:
    """Return an image registered by a transform with a radial term."""
    y, x = np.indices(light.shape)
    points = transform.undo(np.stack([x.ravel(), y.ravel()], axis=-1) + first)
    from scipy.ndimage import map_coordinates

    resampled = map_coordinates(
        light, (points - first).T[::-1], order=order, mode="constant", cval=0.0
    )
    # A length along the radius grows by 1 + 3 c r^2, one across it by 1 + c r^2.
    bend = transform.radial * np.square(points - transform.pivot).sum(axis=-1)
    enlarged = np.abs(np.linalg.det(transform.matrix) * (1 + bend) * (1 + 3 * bend))
    return (resampled / enlarged).reshape(light.shape)


def fused_image(images: Sequence[ArrayLike], weights: ArrayLike | None = None) -> FloatArray:
    """Add images up, pixel by pixel.

    Parameters
    ----------
    images : sequence of array_like, each of shape (..., height, width)
        Registered onto the same pixels.
    weights : array_like, shape (n,), optional
        One for each image; one by default, which keeps electrons electrons.

    Returns
    -------
    ndarray, shape (..., height, width)
        Their weighted sum.

    Examples
    --------
    >>> fused_image([[[1.0, 2.0]], [[3.0, 4.0]]])
    array([[4., 6.]])
    """
    layers = [finite_array("images", image, shape=(None, None)) for image in images]
    if len({layer.shape for layer in layers}) != 1:
        raise ValueError(
            f"images: expected one or more of the same shape, got {[x.shape for x in layers]}; "
            "register them onto one grid first"
        )
    share = np.ones(len(layers)) if weights is None else finite_array("weights", weights)
    if share.shape != (len(layers),):
        raise ValueError(f"weights: expected {len(layers)}, got shape {share.shape}; one each")
    total = share[0] * layers[0]
    for one, layer in zip(share[1:], layers[1:], strict=True):
        total += one * layer
    return total
