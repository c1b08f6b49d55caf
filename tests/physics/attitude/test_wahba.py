"""Wahba's problem against SciPy, Davenport's matrix, closed forms, limits and Markley's cases."""

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, kstest

from reproduce.physics.attitude import (
    attitude,
    emitted_directions,
    mean_rotation,
    quest,
)
from reproduce.physics.validate import DegenerateGeometryError

EPSILON = np.finfo(float).eps
# Largest error, as a multiple of machine precision over the gap; 45 measured.
ROUNDINGS = 60
MARKLEY = json.loads(
    (Path(__file__).parents[1] / "data/markley_wahba_12cases.json").read_text()
)
# The designed lasers: four directions within 0.6 degrees about the boresight.
LASERS = emitted_directions(11e-3 * np.array([[0, -1], [-1, 0], [1, 0], [0, 1]]), 2.0)
RNG = default_rng(11)


def angle_between(one, two):
    """Angle of the rotation that leads from one matrix to the other, accurate when small."""
    twist = one.mT @ two
    odd = np.linalg.norm(twist - twist.mT, axis=(-2, -1)) / 8**0.5
    return np.arctan2(odd, (np.trace(twist, axis1=-2, axis2=-1) - 1) / 2)


def noisy(target, sigma, rng=RNG):
    moved = target + sigma * rng.standard_normal(target.shape)
    return moved / np.linalg.norm(moved, axis=-1, keepdims=True)


def profile(target, source, weights=1.0):
    return (np.asarray(weights)[..., None] * target).mT @ source


def davenport(matrix):
    """K, (..., 4, 4): the gain trace(A B^T) as a form in A's quaternion, scalar last."""
    trace = np.trace(matrix, axis1=-2, axis2=-1)
    result = np.empty((*matrix.shape[:-2], 4, 4))
    result[..., :3, :3] = matrix + matrix.mT - trace[..., None, None] * np.eye(3)
    axial = (matrix - matrix.mT)[..., [2, 0, 1], [1, 2, 0]]
    result[..., :3, 3] = result[..., 3, :3] = axial
    result[..., 3, 3] = trace
    return result


def gap(target, source, weights=1.0):
    """Return the gap of Davenport's eigenvalues, for weights of sum 1."""
    share = weights / np.sum(weights * np.ones(source.shape[-2]))
    matrix = profile(target, source, share * np.ones(source.shape[-2]))
    return np.diff(np.linalg.eigvalsh(davenport(matrix)))[..., -1]


TURNS = Rotation.from_rotvec(
    [
        [0, 0, 0],
        [3e-6, -2e-6, 5e-6],
        [np.pi, 0, 0],
        [0, np.pi, 0],
        [0.6 * np.pi, 0, 0.8 * np.pi],
        [0, (1 - 1e-9) * np.pi, 0],
        [0.3, -1.2, 2.0],
    ]
).as_matrix()
SETS = {
    "axes": np.eye(3),
    "two at a right angle": np.eye(3)[:2],
    "two at ten degrees": np.array([[1, 0, 0], [np.cos(0.17), np.sin(0.17), 0]]),
    "lasers": LASERS,
    "two opposite pairs": np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0.0]]),
}


@pytest.mark.parametrize("directions", SETS)
def test_finds_the_rotation_that_made_the_data(directions):
    source = SETS[directions]
    found = attitude(source @ TURNS.mT, source)
    limit = ROUNDINGS * EPSILON / gap(source, source)
    assert (angle_between(found, TURNS) < limit).all()


def test_agrees_with_scipy_and_with_the_eigenvector_of_davenport():
    source = noisy(np.zeros((300, 5, 3)), 1.0)
    truth = Rotation.random(300, random_state=12).as_matrix()
    target = noisy(source @ truth.mT, 10 ** RNG.uniform(-6, 0, (300, 1, 1)))
    target[::10] *= -1  # a reflection would fit these better
    weights = RNG.uniform(0.1, 10, (300, 5))
    found = attitude(target, source, weights)
    theirs = [
        Rotation.align_vectors(*row)[0].as_matrix()
        for row in zip(target, source, weights, strict=True)
    ]
    assert angle_between(found, np.array(theirs)).max() < 1e-12
    values, vectors = np.linalg.eigh(davenport(profile(target, source, weights)))
    quaternions = Rotation.from_quat(vectors[..., -1]).as_matrix()
    assert angle_between(found, quaternions).max() < 1e-12
    misses = np.square(target - source @ found.mT).sum(axis=-1)
    loss = 2 * (weights.sum(axis=-1) - values[:, -1])
    assert_allclose((weights * misses).sum(axis=-1), loss, atol=1e-12)


def test_quest_agrees_with_singular_values():
    """QUEST loses the square root of its digits if the gap is small."""
    for name, source in SETS.items():
        weights = RNG.uniform(0.5, 2.0, len(source))
        for turn in TURNS:
            target = noisy(source @ turn.T, 1e-5)
            error = angle_between(
                quest(target, source, weights), attitude(target, source, weights)
            )
            limit = 1e3 * EPSILON / gap(target, source, weights) ** 2
            assert error < max(limit, 1e-12), name


FREE = {
    "one direction": ([[0, 0, 1]], [[1, 0, 0]]),
    "opposite": ([[0, 0, 1], [0, 0, -1]], [[1, 0, 0], [-1, 0, 0]]),
    "parallel": ([[1, 2, 3], [2, 4, 6]], [[3, 1, 1], [3, 1, 1]]),
    "mirrored": (-TURNS[-1], TURNS[-1]),
    "cancelling": ([[1, 0, 0], [-1, 0, 0]], [[1, 0, 0], [1, 0, 0]]),
    "one with weight": (np.eye(3), np.eye(3), [0, 1, 0]),
}


@pytest.mark.parametrize("case", FREE)
def test_geometry_that_leaves_a_rotation_free_is_an_error(case):
    with pytest.raises(DegenerateGeometryError):
        attitude(*FREE[case])


def test_the_error_contains_the_index_of_the_set():
    target = np.tile(np.eye(3), (4, 1, 1))
    target[2] = [[1, 0, 0]] * 3
    with pytest.raises(DegenerateGeometryError, match="index 2"):
        attitude(target, target)


@pytest.mark.parametrize("case", MARKLEY["cases"])
def test_markley_cases(case):
    source = np.array(MARKLEY["cases"][case]["r"], dtype=float)
    source /= np.linalg.norm(source, axis=-1, keepdims=True)
    sigma, truth = (
        np.array(MARKLEY["cases"][case]["sigma"]),
        np.array(MARKLEY["A_true"]),
    )
    rng = default_rng([71, int(case)])
    exact = np.broadcast_to(source @ truth.T, (1000, *source.shape))
    target = noisy(exact, sigma[:, None], rng)
    found = attitude(target, source, sigma**-2.0)

    def loss(points):
        return np.square((target - points) / sigma[:, None]).sum(axis=(-2, -1))

    # Best means no worse than the truth.
    assert (loss(source @ found.mT) <= loss(exact) * (1 + 1e-6)).all()
    # The error, in units of its predicted covariance, has three degrees of freedom. The
    # covariance is of first order: errors must be small compared with the angles between the
    # directions, unlike those of cases 8 and 9.
    if case not in ("8", "9"):
        turns = Rotation.from_matrix(found @ truth.T).as_rotvec()
        outer = exact[0][:, :, None] * exact[0][:, None]
        held = ((np.eye(3) - outer) / sigma[:, None, None] ** 2).sum(axis=0)
        distance = np.einsum("bi,ij,bj->b", turns, held, turns)
        assert kstest(distance, chi2(3).cdf).pvalue > 1e-3


def test_the_mean_rotation_agrees_with_scipy():
    sample = Rotation.from_rotvec(0.3 * RNG.standard_normal((50, 3)))
    found = mean_rotation(sample.as_matrix())
    assert angle_between(found, sample.mean().as_matrix()) < 1e-14
    half_turns = [np.diag([1, -1, -1]), np.diag([-1, 1, -1]), np.diag([-1, -1, 1])]
    with pytest.raises(DegenerateGeometryError):
        mean_rotation([np.eye(3), *half_turns])
