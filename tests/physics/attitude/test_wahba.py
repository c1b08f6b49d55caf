"""Wahba's problem against SciPy, closed forms, limits and Markley's cases."""

import json
from pathlib import Path

import bench
import numpy as np
import pytest
from numpy.random import default_rng
from scipy.spatial.transform import Rotation

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
LASERS = emitted_directions(bench.LASERS, 2.0)
RNG = default_rng(11)


def angle_between(one, two):
    """Angle of the rotation that leads from one matrix to the other, accurate when small."""
    twist = one.mT @ two
    odd = np.linalg.norm(twist - twist.mT, axis=(-2, -1)) / 8**0.5
    return np.arctan2(odd, (np.trace(twist, axis1=-2, axis2=-1) - 1) / 2)


def noisy(target, sigma, rng=RNG):
    moved = target + sigma * rng.standard_normal(target.shape)
    return moved / np.linalg.norm(moved, axis=-1, keepdims=True)


def gap(target, source, weights=1.0):
    """Return the gap of Davenport's two largest eigenvalues, for weights of sum 1."""
    share = weights * np.ones(source.shape[-2])
    matrix = ((share / share.sum())[:, None] * target).mT @ source
    values = np.linalg.svd(matrix, compute_uv=False)
    return 2 * (values[..., 1] + np.sign(np.linalg.det(matrix)) * values[..., 2])


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
    source, sigma = map(np.array, MARKLEY["cases"][case].values())
    source = noisy(source, 0.0)
    exact = np.tile(source @ np.transpose(MARKLEY["A_true"]), (1000, 1, 1))
    target = noisy(exact, sigma[:, None], default_rng([71, int(case)]))
    found = attitude(target, source, sigma**-2.0)

    def loss(points):
        return np.square((target - points) / sigma[:, None]).sum(axis=(-2, -1))

    # Best means no worse than the truth.
    assert (loss(source @ found.mT) <= loss(exact) * (1 + 1e-6)).all()


def test_the_mean_rotation_agrees_with_scipy():
    sample = Rotation.from_rotvec(0.3 * RNG.standard_normal((50, 3)))
    found = mean_rotation(sample.as_matrix())
    assert angle_between(found, sample.mean().as_matrix()) < 1e-14
    half_turns = [np.diag([1, -1, -1]), np.diag([-1, 1, -1]), np.diag([-1, -1, 1])]
    with pytest.raises(DegenerateGeometryError):
        mean_rotation([np.eye(3), *half_turns])


def test_agrees_with_scipy():
    source = noisy(np.zeros((300, 5, 3)), 1.0)
    truth = Rotation.random(300, random_state=12).as_matrix()
    target = noisy(source @ truth.mT, 10 ** RNG.uniform(-6, 0, (300, 1, 1)))
    target[::10] *= -1  # a reflection would fit these better
    weights = RNG.uniform(0.1, 10, (300, 5))
    theirs = [
        Rotation.align_vectors(*row)[0].as_matrix()
        for row in zip(target, source, weights, strict=True)
    ]
    found = attitude(target, source, weights)
    assert angle_between(found, np.array(theirs)).max() < 1e-12
