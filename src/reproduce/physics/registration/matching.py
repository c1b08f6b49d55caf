"""Matching two lists of points under an unknown transform, and weights of the matched pairs.

Shifts are found from the differences of all positions. Scale and rotation are found from triangles
of neighbours, whose shapes do not change under a similarity. Points are in px, as in `fit`.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics.registration._similarity import (
    ComplexArray,
    as_complex,
    as_points,
)
from reproduce.physics.registration.fit import fit_registration
from reproduce.physics.registration.transforms import Registration
from reproduce.physics.validate import FloatArray, IntArray, Size, checked

# Common stars that identify a transform, at least: three agree too often by chance.
_MIN_COMMON = 4
# Stars of a sample whose triangles are compared, at most, and triangles of a sample, about.
_SAMPLE_STARS, _SAMPLE_TRIANGLES = 150, 10_000
# Largest difference in shape of two triangles, and pairs of triangles that are tried, at most.
_MAX_DIFFERENCE, _MAX_TRIED = 0.02, 4_000
# Differences of positions that vote for a shift, about, and shifts that are tried, at most.
_VOTES, _MAX_SHIFTS = 60_000, 20
# Probability that unrelated stars agree equally under the best transform and under another one, at
# most, and pairs under another transform, as a fraction of the pairs under the best one.
_MAX_CHANCES, _MAX_OTHERS = (1e-6, 1e-2), 0.5
# Agreement of positions that counts as exact, in px, also if all positions are whole numbers:
# rounded positions agree by chance.
_ROUNDED_PX, _WHOLE_PX = 0.1, 0.5
# Pairs of a robust fit, at least; rounds of fits that add neighbours.
_MIN_ROBUST, _ROUNDS = 7, 4
# Factors and offsets of the only transform of stars that a start has moved, and their number.
_IDENTITY = np.ones(1, complex), np.zeros(1, complex), 1
# Iterations of the scatter beyond the errors; variance of an exact position, in px^2.
_SCATTER_STEPS, _EXACT_VARIANCE = 6, 1e-12


@checked
def match_points(
    source: FloatArray,
    target: FloatArray,
    radius: Size,
    start: Registration | None = None,
) -> tuple[IntArray, Registration]:
    """Match two lists of points that are related by a similarity or its mirror image.

    Without a start, shifts are tried first, then triangles of the first points of both lists, then
    triangles of the points with the most distant neighbours. A transform is accepted if the
    probability of an equal agreement of unrelated points is below 1e-6, and no other transform with
    a probability below 1e-2 has more than half as many pairs. A shift may also be the only one that
    pairs every point of a list.

    Parameters
    ----------
    source, target : ndarray, shapes (n, 2) and (m, 2)
        Points, in px, the brightest first if their brightness is known.
    radius : float
        Largest distance between the two points of a pair, in px.
    start : Registration, optional
        Rough transform. Default: found from the points.

    Returns
    -------
    rows : ndarray of int, shape (p, 2)
        Row of the source and row of the target of each pair.
    transform : Registration
        Transform under which the pairs are neighbours. The determinant of its matrix is negative
        for a mirror image.

    Raises
    ------
    ValueError
        If a list has fewer than four points, or the points do not agree better than by chance, also
        under a start.

    Examples
    --------
    >>> stars = np.random.default_rng(1).uniform(0, 500, (40, 2))
    >>> rows, transform = match_points(stars, 1.01 * stars[::-1] + (3, 4), radius=1.0)
    >>> bool((rows.sum(axis=1) == 39).all()), transform.apply([[100.0, 0]]).round(6)
    (True, array([[104.,   4.]]))
    """
    found = (
        _candidates(source, target, radius)
        if start is None
        else [_best(as_complex(start.apply(source)), as_complex(target), radius)]
    )
    best, transform, rivals = np.zeros((0, 2), int), start, 0
    fewest = min(len(source), len(target))
    for number, (rows, others) in enumerate(found):
        # The first pairs are those of a shift. Only one shift pairs all stars of a whole grid.
        if number == 0 and len(rows) == fewest > others:
            others = 0
        rivals = max(rivals, others)
        is_clear = others <= _MAX_OTHERS * len(rows)
        if is_clear and len(rows) >= max(_MIN_COMMON, len(best) + 1):
            # The pairs of a sample lead to those of both lists.
            best, transform = _refined(rows, source, target, radius)
        if 2 * len(best) > fewest:
            break
    is_ambiguous = rivals > _MAX_OTHERS * len(best)
    if transform and len(best) >= _MIN_COMMON and not is_ambiguous:
        return best, transform
    agreement = (
        "under several transforms, as a grid does"
        if is_ambiguous
        else "as well as by chance"
    )
    raise ValueError(
        f"source, target: expected {_MIN_COMMON} or more common stars, got lists of "
        f"{len(source)} and {len(target)} stars that agree {agreement}. Give a start, or another "
        "one"
    )


def _refined(
    rows: IntArray, source: FloatArray, target: FloatArray, radius: float
) -> tuple[IntArray, Registration]:
    """Return the pairs under the affine transform of pairs, and the transform."""
    for _ in range(_ROUNDS):
        fit = fit_registration(
            source[rows[:, 0]],
            target[rows[:, 1]],
            source.mean(axis=0),
            model="affine",
            robust=len(rows) >= _MIN_ROBUST,
        )
        rows = neighbours(fit.transform.apply(source), target, radius)
    return rows, fit.transform


def neighbours(source: FloatArray, target: FloatArray, radius: float) -> IntArray:
    """Return the rows of points that are nearest to each other and closer than a radius.

    Parameters
    ----------
    source, target : ndarray, shapes (n, 2) and (m, 2)
        Points, in px.
    radius : float
        Largest distance, in px.

    Returns
    -------
    ndarray of int, shape (p, 2)
        Row of the source and row of the target of each pair.

    Examples
    --------
    >>> neighbours(np.array([[0.0, 0], [9, 9]]), np.array([[9.0, 8], [0, 5], [0, 1]]), radius=2.0)
    array([[0, 2],
           [1, 0]])
    """
    from scipy.spatial import KDTree

    distance, nearest = KDTree(target).query(source)
    back = np.asarray(KDTree(source).query(target)[1])
    rows = np.arange(len(source))
    mutual = (distance < radius) & (back[nearest] == rows)
    return np.stack([rows, nearest], axis=-1)[mutual]


def _candidates(
    source: FloatArray, target: FloatArray, radius: float
) -> Iterator[tuple[IntArray, int]]:
    """Yield the pairs under the best transform of each kind and sample, as `_best` returns them."""
    first, other = as_complex(source), as_complex(target)
    if min(len(first), len(other)) < _MIN_COMMON:
        return
    yield _best(first, other, radius, _shifts(source, target, radius))
    # The first stars, then those with the most distant nearest neighbour: two lists of the same
    # stars have this order in common for any rotation and any order of rows.
    first_rows = np.arange(len(source)), np.arange(len(target))
    for samples in (first_rows, (_isolated(source), _isolated(target))):
        i, j = (sample[:_SAMPLE_STARS] for sample in samples)
        # A mirror image has the conjugate positions.
        for stars in (first[i], first[i].conj()):
            similarities = _similarities(_triangles(stars), _triangles(other[j]))
            rows, others = _best(stars, other[j], radius, similarities)
            yield np.stack([i[rows[:, 0]], j[rows[:, 1]]], axis=-1), others


def _isolated(points: FloatArray) -> IntArray:
    """Return the rows of points, the most distant nearest neighbour first."""
    from scipy.spatial import KDTree

    distance = np.asarray(KDTree(points).query(points, 2)[0])
    return np.argsort(-distance[:, 1], kind="stable")


def _best(
    stars: ComplexArray,
    others: ComplexArray,
    radius: float,
    transforms: tuple[ComplexArray, ComplexArray, int] = _IDENTITY,
) -> tuple[IntArray, int]:
    """Return the pairs under the transform with most of them, and the number under another one.

    Pairs that agree as well as by chance do not count, nor stars that both transforms move to the
    same place.
    """
    from scipy.spatial import KDTree

    factors, offsets, trials = transforms
    if not len(factors):
        return np.zeros((0, 2), int), 0
    tree = KDTree(as_points(others))
    images = as_points(factors[:, None] * stars + offsets[:, None])
    hit = np.asarray(tree.query(images, distance_upper_bound=radius)[1])
    found = []
    for limit in _MAX_CHANCES:
        # Several stars near a star of the target count once; the last index means no star.
        most = (np.diff(np.sort(hit), append=tree.n) > 0).sum(axis=1).argmax()
        rows = neighbours(images[most], tree.data, radius)
        rows = rows[hit[most, rows[:, 0]] == rows[:, 1]]
        chance = trials * _chance(images[most], rows, tree)
        found.append(rows[: len(rows) * (chance < limit)])
        # A star that another transform moves elsewhere may have another pair.
        moved = np.linalg.norm(images - images[most], axis=-1)
        hit[moved < 2 * radius] = tree.n
    return found[0], len(found[1])


def _chance(stars: FloatArray, rows: IntArray, tree: Any) -> float:
    """Return the expected number of equal agreements of unrelated stars, in one trial."""
    from scipy.special import pdtrc

    # Two stars agree by the transform itself. Density from the third nearest.
    distance = np.asarray(tree.query(stars, 3)[0])
    smallest = _ROUNDED_PX if (tree.data % 1).any() else _WHOLE_PX
    agreement = np.maximum(np.sort(distance[rows[:, 0], 0])[3:], smallest)
    third = np.maximum(distance[:, 2], smallest)
    expected = 2 * (third**-2.0).sum() * agreement**2
    chances = pdtrc(np.arange(len(agreement)) + 1, expected)
    return float(len(rows) * chances.min(initial=1.0))


def _shifts(
    source: FloatArray, target: FloatArray, radius: float
) -> tuple[ComplexArray, ComplexArray, int]:
    """Return the shifts with most votes of differences of positions, and the number of shifts."""
    field = np.ptp(target, axis=0).max()
    reach = 2 * radius + field * np.sqrt(_VOTES / (len(source) * len(target)))
    near = _close_pairs(source, target, reach)
    moves = as_complex(target[near["j"]] - source[near["i"]])
    _, first, votes = np.unique(
        np.round(moves / radius), return_index=True, return_counts=True
    )
    chosen = moves[first[np.argsort(-votes, kind="stable")[:_MAX_SHIFTS]]]
    return np.ones_like(chosen), chosen, len(votes)


def _close_pairs(first: FloatArray, second: FloatArray, reach: float) -> Any:
    """Return the rows ``i`` and ``j`` of points that are close, and their distance ``v``."""
    from scipy.spatial import KDTree

    return KDTree(first).sparse_distance_matrix(
        KDTree(second), reach, output_type="ndarray"
    )


def _similarities(
    triangles: ComplexArray, others: ComplexArray
) -> tuple[ComplexArray, ComplexArray, int]:
    """Return the similarities of the triangles that are most alike, and the number of pairs."""
    first, second = (as_points((c - a) / (b - a)) for a, b, c in (triangles, others))
    alike = _close_pairs(first, second, _MAX_DIFFERENCE)
    alike = np.sort(alike, order=("v", "i", "j"))
    # By their longest sides: a narrow triangle may fit its own mirror image better.
    a, b, _ = triangles[:, alike["i"][:_MAX_TRIED]]
    c, d, _ = others[:, alike["j"][:_MAX_TRIED]]
    factors = (d - c) / (b - a)
    return factors, c - factors * a, len(first) * len(second)


def _triangles(stars: ComplexArray) -> ComplexArray:
    """Return the corners of triangles of neighbours, shape (3, n).

    The longest side joins the first two corners, and the third is nearer to the first.
    """
    from scipy.spatial import KDTree

    points = as_points(stars)
    count = min(len(points), round(np.cbrt(6 * _SAMPLE_TRIANGLES / len(points))))
    near = np.asarray(KDTree(points).query(points, count)[1])
    rows = near[:, list(combinations(range(count), 3))].reshape(-1, 3)
    corners = stars[np.unique(np.sort(rows), axis=0)]
    corners = corners[np.ptp(corners, axis=1) != 0]
    sides = np.abs(np.roll(corners, 1, axis=1) - np.roll(corners, -1, axis=1))
    return np.take_along_axis(corners, np.argsort(sides)[:, [1, 0, 2]], axis=1).T


def pair_weights(
    source: FloatArray,
    target: FloatArray,
    pivot: ArrayLike,
    covariances: FloatArray,
    matrix: ArrayLike,
    **settings: Any,
) -> tuple[FloatArray, float]:
    """Return the weights of pairs of points, and the scatter in addition to their errors.

    With this scatter, chi-square is equal to the degrees of freedom. The scatter is zero if the
    errors explain the residuals.

    Parameters
    ----------
    source, target, pivot
        As in `fit_registration`.
    covariances : ndarray, shape (2, n, 2, 2), in px^2
        Covariances of the source and of the target.
    matrix : array_like, shape (2, 2)
        Linear part of a rough transform from source to target.
    **settings
        Parameters of `fit_registration`.

    Returns
    -------
    weights : ndarray, shape (n,)
        Weights, the largest of which is one.
    beyond : float
        Scatter beyond the errors, in px.

    Examples
    --------
    >>> square = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> known = np.tile(1e-4 * np.eye(2), (2, 4, 1, 1))
    >>> pair_weights(square, square, (0, 0), known, np.eye(2))
    (array([1., 1., 1., 1.]), 0.0)
    """
    linear = np.asarray(matrix, dtype=np.float64)
    spread = linear @ covariances[0] @ linear.T + covariances[1]
    variance = np.maximum(np.trace(spread, axis1=1, axis2=2) / 2, _EXACT_VARIANCE)
    extra = 0.0
    for _ in range(_SCATTER_STEPS):
        total = variance + extra
        fit = fit_registration(source, target, pivot, total.min() / total, **settings)
        freedom = fit.degrees_of_freedom
        surplus = fit.chi_square - freedom * total.min()
        # Variance that removes the surplus for constant weights.
        mean = fit.weights.sum() / np.count_nonzero(fit.weights)
        extra = max(0.0, extra + surplus / (max(freedom, 1.0) * mean))
    total = variance + extra
    return total.min() / total, float(np.sqrt(extra))
