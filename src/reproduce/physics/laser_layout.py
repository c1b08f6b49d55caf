"""How many lasers, and where: the layout of spots that errs least on the ground, roll included.

Spots are in px from the principal point of the tracker, x before y, of shape (..., n, 2). The
camera's frame is laid along the tracker's, which the mirrors between them do not hinder: an angle
between lasers is the same in both. A centroid errs alike along x and y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import Generator
from numpy.typing import ArrayLike
from scipy.optimize import NonlinearConstraint, minimize

from reproduce.physics.lasers import received_directions, received_jacobian
from reproduce.physics.misalignment import angle_jacobian
from reproduce.physics.validate import (
    FloatArray,
    finite_array,
    non_negative,
    positive,
    whole_number,
)

# Step of the difference quotients, in shares of the field's half width.
STEP = 1e-5
CORNERS = np.array([[1.0, 1.0], [-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0]])


@dataclass(frozen=True)
class Field:
    """Where spots may lie, and the ground that counts.

    Attributes
    ----------
    half_width : float
        Of the square field around the principal point, in px.
    separation : float
        Least distance between two spots, in px: nearer ones cannot be told apart.
    pixel_pitch, focal_length : float
        Of the tracker, in metres.
    altitude : float
        Of the satellite, in metres.
    half_image : float
        Half the width of the square image on the ground, in metres.

    Examples
    --------
    >>> Field(100.0, 7.0, 1e-5, 0.05, 5e5, 5e3).half_width
    100.0
    """

    half_width: float
    separation: float
    pixel_pitch: float
    focal_length: float
    altitude: float
    half_image: float

    def __post_init__(self) -> None:
        for name in ("half_width", "pixel_pitch", "focal_length", "altitude"):
            positive(name, getattr(self, name))
        for name in ("separation", "half_image"):
            non_negative(name, getattr(self, name))


def layout_covariance(spots: ArrayLike, field: Field) -> FloatArray:
    """Return the covariance of the camera's angles for centroid errors of one pixel.

    Parameters
    ----------
    spots : array_like, shape (..., n, 2)
        In px from the principal point.
    field : Field
        Holds pixel pitch and focal length.

    Returns
    -------
    ndarray, shape (..., 3, 3)
        About X, Y and Z of the camera, in rad^2 per px^2; times the variance of a centroid.

    Raises
    ------
    DegenerateGeometryError
        If all spots fall together.
    ValueError
        If a shape does not fit or a value is not finite.

    Examples
    --------
    Four spots hold X and Y to half a pixel's angle, and Z by the root sum of their squared arms.

    >>> field = Field(100.0, 7.0, 1e-5, 1.0, 5e5, 5e3)
    >>> square = [[30, 0], [0, 30], [-30, 0], [0, -30]]
    >>> np.sqrt(layout_covariance(square, field).diagonal()).round(8)
    array([5.000000e-06, 5.000000e-06, 1.666667e-02])
    """
    tracker = (spots, (0.0, 0.0), field.pixel_pitch, field.focal_length)
    light = received_directions(*tracker)
    response = angle_jacobian(light, light, received_jacobian(*tracker))
    flat = response.reshape(*response.shape[:-2], -1)
    result: FloatArray = flat @ np.swapaxes(flat, -1, -2)
    return result


def image_error(covariance: ArrayLike, field: Field) -> FloatArray:
    """Return the error on the ground straight below, root mean square over a square image.

    A turn theta moves the point seen along a by altitude times theta × a.

    Parameters
    ----------
    covariance : array_like, shape (..., 3, 3)
        Of the camera's angles, in rad^2.
    field : Field
        Holds altitude and width of the image.

    Returns
    -------
    ndarray, shape (...)
        Both directions on the ground together, in metres.

    Raises
    ------
    ValueError
        If a shape does not fit or a value is not finite.

    Examples
    --------
    At the centre of the image the roll does not count.

    >>> point = Field(100.0, 7.0, 1e-5, 1.0, 500e3, 0.0)
    >>> float(image_error(np.diag([9e-12, 16e-12, 1.0]), point).round(9))
    2.5
    """
    spread = finite_array("covariance", covariance, shape=(3, 3))
    tilt = spread[..., 0, 0] + spread[..., 1, 1]
    # Over a square of half width L the mean of x^2 + y^2 is two thirds of L^2.
    roll = spread[..., 2, 2] * (2.0 / 3.0) * field.half_image**2
    return np.asarray(np.sqrt(field.altitude**2 * tilt + roll))


def best_layout(count: int, field: Field, generator: Generator, starts: int = 6) -> FloatArray:
    """Return the spots that make the error over the image least.

    Sequential quadratic programming from several starts; the field and the least separation are
    constraints. Turning or mirroring the result by symmetry of the square changes nothing, and
    other layouts may be as good: see the error, not the places.

    Parameters
    ----------
    count : int
        How many lasers, two or more.
    field : Field
        Where they may lie and what counts.
    generator : numpy.random.Generator
        Draws the starts.
    starts : int
        How many.

    Returns
    -------
    ndarray, shape (count, 2)
        In px from the principal point.

    Raises
    ------
    TypeError, ValueError
        If a count is not a whole number in range, or the field does not hold so many spots.

    Examples
    --------
    Two spots go to opposite corners.

    >>> field = Field(50.0, 7.0, 1e-5, 0.05, 5e5, 5e3)
    >>> np.abs(best_layout(2, field, np.random.default_rng(1))).round(3)
    array([[50., 50.],
           [50., 50.]])
    """
    number = whole_number("count", count, least=2)
    pairs = np.triu_indices(number, 1)
    least = (field.separation / field.half_width) ** 2
    apart = NonlinearConstraint(
        lambda places: _apart(places, pairs, least),
        0.0,
        np.inf,
        jac=lambda p: _apart_slope(p, pairs),
    )
    found: list[tuple[float, FloatArray]] = []
    for _ in range(whole_number("starts", starts)):
        # Dealt out over the corners, since the roll wants long arms, and some way inwards.
        corners = CORNERS[(generator.permutation(number) + generator.integers(4)) % 4]
        answer = minimize(
            _cost_and_slope,
            (corners * generator.uniform(0.3, 1.0, (number, 2))).ravel(),
            args=(field,),
            jac=True,
            method="SLSQP",
            bounds=[(-1.0, 1.0)] * (2 * number),
            constraints=apart,
            options={"maxiter": 300, "ftol": 1e-12},
        )
        if answer.success and _apart(answer.x, pairs, least).min() > -1e-9:
            found.append((float(answer.fun), answer.x.reshape(number, 2)))
    if not found:
        raise ValueError(
            f"count: expected spots that fit into the field, got {count} at least "
            f"{field.separation:g} px apart in {2 * field.half_width:g} px; widen the field"
        )
    return np.asarray(min(found, key=lambda pair: pair[0])[1] * field.half_width)


def _cost_and_slope(places: FloatArray, field: Field) -> tuple[float, FloatArray]:
    """Return the logarithm of the error and its slope, from one batch of layouts."""
    steps = STEP * np.eye(len(places))
    layouts = np.concatenate([places[np.newaxis], places + steps, places - steps])
    spots = field.half_width * layouts.reshape(len(layouts), -1, 2)
    costs = np.log(image_error(layout_covariance(spots, field), field))
    ahead, behind = np.split(costs[1:], 2)
    return float(costs[0]), (ahead - behind) / (2.0 * STEP)


Pairs = tuple[np.ndarray, ...]


def _apart(places: FloatArray, pairs: Pairs, least: float) -> FloatArray:
    """Return squared distances less the least that is allowed, pair by pair."""
    rows = places.reshape(-1, 2)
    between = rows[pairs[0]] - rows[pairs[1]]
    return np.asarray((between**2).sum(axis=-1) - least)


def _apart_slope(places: FloatArray, pairs: Pairs) -> FloatArray:
    rows = places.reshape(-1, 2)
    between = 2.0 * (rows[pairs[0]] - rows[pairs[1]])
    slope = np.zeros((len(between), *rows.shape))
    each = np.arange(len(between))
    slope[each, pairs[0]], slope[each, pairs[1]] = between, -between
    return slope.reshape(len(between), -1)
