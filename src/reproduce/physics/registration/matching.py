"""Pairing two lists of points whose transform is not known, and weighing the pairs.

Triangles of neighbours vote: their shapes are changed by no shift, turn or scale, and are mirrored
by a mirror image. Points are in px, as in `fit`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics.registration.fit import fit_registration
from reproduce.physics.registration.transforms import Registration, as_complex, as_points
from reproduce.physics.validate import FloatArray

# Stars among which triangles are looked for, first and where that fails; neighbours of each.
_BRIGHTEST, _NEIGHBOURS = (50, 200), 6
# How far triangles may differ in shape; how many are tried at most, the likeliest first.
_ALIKE, _TRIED = 0.02, 4_000
# Fewer pairs are not sharpened by a fit of all; rounds of the scatter beyond the errors.
_FEW, _TIMES = 6, 6
# Of a place that is known exactly, in px^2.
_EXACT = 1e-12
# The chance that as many stars land on others by chance.
_CHANCE = 1e-6


def match_points(
    source: FloatArray, target: FloatArray, radius: float, start: Registration | None = None
) -> tuple[NDArray[np.int64], Registration]:
    """Pair two lists of points: neighbours under a start, or under what their triangles say.

    Shapes of triangles are changed by no shift, turn or scale. A mirror image is recognised.

    Parameters
    ----------
    source, target : ndarray, shapes (n, 2) and (m, 2), in px, the brightest first
    radius : float
        How far from each other two points of a pair may land, in px.
    start : Registration, optional

    Returns
    -------
    rows : ndarray of int, shape (p, 2)
        Of each pair the row of the source and that of the target.
    found : Registration
        Under which they are neighbours; its determinant is negative of a mirror image.

    Raises
    ------
    ValueError
        If no more points land on others than chance lays there.

    Examples
    --------
    >>> stars = np.random.default_rng(1).uniform(0, 500, (40, 2))
    >>> rows, found = match_points(stars, 1.01 * stars[::-1] + (3, 4), radius=1.0)
    >>> bool((rows.sum(axis=1) == 39).all()), found.apply([[100.0, 0]]).round(6)
    (True, array([[104.,   4.]]))
    """
    found = start or _asterism(source, target, radius)
    rows = neighbours(found.apply(source), target, radius)
    for _ in range(2 if len(rows) > _FEW else 0):
        # What was found from a few bright stars is sharpened by all.
        pairs, middle = (source[rows[:, 0]], target[rows[:, 1]]), source.mean(axis=0)
        found = fit_registration(*pairs, middle, model="affine", robust=True).transform
        rows = neighbours(found.apply(source), target, radius)
    return rows, found


def neighbours(source: FloatArray, target: FloatArray, radius: float) -> NDArray[np.int64]:
    """Return the rows of points that are each other's nearest and closer than a radius.

    Parameters
    ----------
    source, target : ndarray, shapes (n, 2) and (m, 2)
    radius : float

    Returns
    -------
    ndarray of int, shape (p, 2)
        Of each pair the row of the source and that of the target.

    Examples
    --------
    >>> neighbours(np.array([[0.0, 0], [9, 9]]), np.array([[9.0, 8], [0, 5], [0, 1]]), radius=2.0)
    array([[0, 2],
           [1, 0]])
    """
    from scipy.spatial import KDTree

    apart, there = KDTree(target).query(source)
    back = np.asarray(KDTree(source).query(target)[1])
    rows = np.arange(len(source))
    return np.stack([rows, there], axis=-1)[(apart < radius) & (back[there] == rows)]


def _asterism(source: FloatArray, target: FloatArray, radius: float) -> Registration:
    """Return the similarity, perhaps of a mirror image, under which most stars are neighbours."""
    from scipy.special import pdtrc

    for count in _BRIGHTEST:
        some = source[:count], target[:count]
        best, landed = max((_consensus(*some, radius, flip) for flip in (1, -1)),
                           key=lambda one: one[1])  # fmt: skip
        area = float(np.prod(np.ptp(some[1], axis=0))) or 1.0
        mean = len(some[0]) * min(1.0, len(some[1]) * np.pi * radius**2 / area)
        # Two stars were laid there by the transform itself.
        if landed >= 3 and _TRIED * pdtrc(landed - 3, mean) < _CHANCE:
            return best
    raise ValueError(
        f"expected the same stars in both pictures, got {landed} of {len(some[0])} on others, no "
        "more than chance lays there; give a start"
    )


def _consensus(
    source: FloatArray, target: FloatArray, radius: float, flip: int
) -> tuple[Registration, int]:
    """Return the similarity of the triangles that lay most stars on others, and how many."""
    from scipy.spatial import KDTree

    mirror = Registration("affine", np.array([1.0, 0, 0, flip, 0, 0]), np.zeros(2))
    source = source * (1, flip)
    (ours, shapes), (theirs, others) = _triangles(source), _triangles(target)
    alike = KDTree(shapes).sparse_distance_matrix(KDTree(others), _ALIKE, output_type="ndarray")
    alike = np.sort(alike, order=("v", "i", "j"))[:_TRIED]
    if not len(alike):
        return mirror, 0
    ours, theirs = ours[alike["i"]], theirs[alike["j"]]
    # By their longest sides: a narrow triangle may fit its own mirror image better.
    sides = source[ours[:, :2]]
    tried = fit_registration(sides, target[theirs[:, :2]], sides.mean(axis=1)).transform
    apart, hit = KDTree(target).query(tried.apply(source))
    # Several stars in one place are one.
    hit = np.sort(np.where(apart < radius, hit, -1), axis=1)
    counts = (np.diff(hit, axis=1, prepend=-1) > 0).sum(axis=1)
    best = int(counts.argmax())
    found = Registration("similarity", tried.parameters[best], tried.pivot[best])
    return found.after(mirror), int(counts[best])


def _triangles(points: FloatArray) -> tuple[NDArray[np.int64], FloatArray]:
    """Return triangles of neighbours: their corners, and their shapes, (n, 2).

    The longest side leads from the first corner to the second; the shape says where, in units of
    it, the third one lies, nearer to the first.
    """
    from scipy.spatial import KDTree

    wanted = np.arange(min(len(points), _NEIGHBOURS + 1)) + 1
    near = np.asarray(KDTree(points).query(points, wanted)[1])
    first, second = np.triu_indices(near.shape[1] - 1, 1)
    corners = np.stack([near[:, [0] * len(first)], near[:, 1 + first], near[:, 1 + second]], -1)
    corners = np.unique(np.sort(corners.reshape(-1, 3), axis=1), axis=0)
    stars = as_complex(points)
    # Turned so that the longest side joins the first two, and the third is nearer to the first.
    sides = np.abs(stars[np.roll(corners, 1, axis=1)] - stars[np.roll(corners, -1, axis=1)])
    corners = np.take_along_axis(corners, np.argsort(sides, axis=1)[:, [1, 0, 2]], axis=1)
    a, b, c = stars[corners].T
    return corners, as_points((c - a) / (b - a))


def pair_weights(
    source: FloatArray, target: FloatArray, pivot: ArrayLike, covariances: FloatArray,
    start: Registration, **settings: Any,
) -> tuple[FloatArray, float]:  # fmt: skip
    """Return the weights of pairs of points, and their scatter beyond the errors, in px.

    With that scatter chi-square is its degrees of freedom; it is zero where the errors explain all.

    Parameters
    ----------
    source, target, pivot
        As in `fit_registration`.
    covariances : ndarray, shape (2, n, 2, 2), in px^2
        Of the source and of the target.
    start : Registration
        Under which they are neighbours.
    **settings
        Of `fit_registration`.

    Returns
    -------
    weights : ndarray, shape (n,)
        The largest is one.
    beyond : float

    Examples
    --------
    >>> square = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> known = np.tile(1e-4 * np.eye(2), (2, 4, 1, 1))
    >>> pair_weights(square, square, (0, 0), known, Registration.similarity(1, 0, (0, 0), (0, 0)))
    (array([1., 1., 1., 1.]), 0.0)
    """
    spread = start.matrix @ covariances[0] @ start.matrix.T + covariances[1]
    variance = np.maximum(np.trace(spread, axis1=1, axis2=2) / 2, _EXACT)
    extra = 0.0
    for _ in range(_TIMES):
        weights = 1 / (variance + extra)
        fit = fit_registration(source, target, pivot, weights / weights.max(), **settings)
        used, freedom = weights * (fit.weights > 0), float(fit.degrees_of_freedom)
        surplus = used @ np.square(fit.residuals).sum(axis=1) - freedom
        # What added to each variance would take the surplus away, were the weights to stay.
        mean = used.sum() / np.count_nonzero(used)
        extra = max(0.0, extra + surplus / (max(freedom, 1.0) * mean))
    weights = 1 / (variance + extra)
    return weights / weights.max(), float(np.sqrt(extra))
