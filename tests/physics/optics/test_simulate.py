"""Simulated centroids: geometry, noise law, and independence from how replicates are batched."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.random import PCG64, SeedSequence
from scipy import stats

from reproduce.physics.optics import (
    Camera,
    channel_centroids,
    image_points,
    noisy_centroids,
    spawned_angles,
    spawned_normals,
    spawned_streams,
    starlight,
)
from reproduce.physics.registration import fit_registration, similarity_between

CAMERAS = [
    Camera(25.1e-3, (1034.0, 774.0), 0.0, 4e-6),
    Camera(25.0e-3, (1032.0, 772.0), 0.0, 4e-6),
    Camera(24.9e-3, (1031.0, 770.0), 0.0, 4e-6),
]
ROTATIONS = (0.002, 0.0, -0.001)
ANGLES = np.random.default_rng(1).uniform(-0.1, 0.1, (30, 2))


def test_x_is_the_middle_frame_and_y_the_external_one() -> None:
    along_x, along_y = channel_centroids(CAMERAS[1:2], [0.0], [[0.1, 0.0], [0.0, 0.1]])[
        0
    ]
    assert along_x[1] == 772.0
    assert along_y[0] == 1032.0


def test_every_channel_is_its_own_camera() -> None:
    centroids = channel_centroids(CAMERAS, ROTATIONS, ANGLES)
    assert centroids.shape == (3, 30, 2)
    for found, camera, rotation in zip(centroids, CAMERAS, ROTATIONS, strict=True):
        np.testing.assert_array_equal(
            found, image_points(starlight(ANGLES[:, 1], ANGLES[:, 0]), camera, rotation)
        )


def test_channels_register_onto_the_reference() -> None:
    red, green, blue = channel_centroids(CAMERAS, ROTATIONS, ANGLES)
    for points, i in ((red, 0), (blue, 2)):
        expected = similarity_between(CAMERAS[i], ROTATIONS[i], CAMERAS[1])
        fit = fit_registration(points, green, CAMERAS[i].principal_point)
        np.testing.assert_allclose(fit.parameters, expected.parameters, atol=1e-10)


def test_a_batch_of_angles_is_a_loop() -> None:
    angles = spawned_angles(SeedSequence(2), 4, 7, (0.1, 0.05))
    together = channel_centroids(CAMERAS, ROTATIONS, angles)
    assert together.shape == (4, 3, 7, 2)
    for i in range(4):
        np.testing.assert_array_equal(
            together[i], channel_centroids(CAMERAS, ROTATIONS, angles[i])
        )


def test_replicates_do_not_depend_on_batching() -> None:
    whole = spawned_normals(SeedSequence(3), 10, (4, 2))
    parts = [
        spawned_normals(SeedSequence(3), 5, (4, 2), first=first) for first in (0, 5)
    ]
    np.testing.assert_array_equal(whole, np.concatenate(parts))
    centroids = channel_centroids(CAMERAS, ROTATIONS, ANGLES)
    whole = noisy_centroids(centroids, 0.1, SeedSequence(3), 6, repeats=3)
    tail = noisy_centroids(centroids, 0.1, SeedSequence(3), 2, repeats=3, first=4)
    np.testing.assert_array_equal(whole[4:], tail)


def test_seeds_are_not_used_up() -> None:
    seeds = SeedSequence(4)
    first = spawned_normals(seeds, 2, (3,))
    seeds.spawn(5)
    np.testing.assert_array_equal(first, spawned_normals(seeds, 2, (3,)))


@pytest.mark.parametrize(
    "entropy", [0, 20240102, 2**32, 2**128 - 5, [1, 2**40, 3, 4, 5, 6]]
)
@pytest.mark.parametrize("key", [(), (3,), (2**31, 0), (2**33, 1, 2)])
def test_streams_have_the_states_of_numpys_own_children(
    entropy: int, key: tuple[int, ...]
) -> None:
    numbers = [0, 1, 2**32 - 1]
    for number in numbers:
        (ours,) = spawned_streams(SeedSequence(entropy, spawn_key=key), 1, number)
        numpys = PCG64(SeedSequence(entropy, spawn_key=(*key, number)))
        assert ours.bit_generator.state == numpys.state


def test_uniform_angles_are_numpys_own() -> None:
    half = np.array([0.217, 0.1031])
    stream = next(spawned_streams(SeedSequence(3), 1))
    expected = stream.uniform(-half, half, (52, 2))
    np.testing.assert_array_equal(
        spawned_angles(SeedSequence(3), 1, 52, half)[0], expected
    )


def test_streams_are_those_of_spawned_children() -> None:
    child = SeedSequence(5).spawn(3)[2]
    expected = np.random.Generator(np.random.PCG64(child)).standard_normal(6)
    np.testing.assert_array_equal(
        spawned_normals(SeedSequence(5), 3, (6,))[2], expected
    )


def test_different_seeds_and_replicates_differ() -> None:
    numbers = np.concatenate(
        [spawned_normals(SeedSequence(s), 50, (4,)) for s in (6, 7)]
    )
    assert len(np.unique(numbers)) == numbers.size


def test_normals_are_normal_and_independent_between_replicates() -> None:
    numbers = spawned_normals(SeedSequence(8), 2000, (5,))
    assert stats.kstest(numbers.ravel(), "norm").pvalue > 0.001
    neighbours = np.corrcoef(numbers[:-1].ravel(), numbers[1:].ravel())[0, 1]
    assert abs(neighbours) < 4 / np.sqrt(numbers.size)


@pytest.mark.parametrize("repeats", [1, 2, 10])
def test_noise_has_the_sigma_of_its_channel_over_root_repeats(repeats: int) -> None:
    centroids = channel_centroids(CAMERAS, ROTATIONS, ANGLES)
    sigma = np.array([0.05, 0.0, 0.2])
    noise = (
        noisy_centroids(centroids, sigma, SeedSequence(9), 400, repeats=repeats)
        - centroids
    )
    np.testing.assert_allclose(
        noise.std(axis=(0, 2, 3)), sigma / np.sqrt(repeats), rtol=0.02
    )
    assert np.abs(noise[:, 1]).max() == 0


def test_noise_without_sigma_is_the_truth() -> None:
    centroids = channel_centroids(CAMERAS, ROTATIONS, ANGLES)
    noisy = noisy_centroids(centroids, 0.0, SeedSequence(10), 2)
    np.testing.assert_array_equal(noisy, np.stack([centroids, centroids]))


def test_replicates_may_have_their_own_truth() -> None:
    angles = spawned_angles(SeedSequence(11), 3, 5, (0.1, 0.1))
    centroids = channel_centroids(CAMERAS, ROTATIONS, angles)
    noisy = noisy_centroids(centroids, 0.05, SeedSequence(12), 3)
    assert noisy.shape == centroids.shape
    assert np.abs(noisy - centroids).max() < 0.05 * 6


def test_angles_fill_the_rectangle_uniformly() -> None:
    angles = spawned_angles(SeedSequence(13), 400, 10, (0.2, 0.1)).reshape(-1, 2)
    for column, half in zip(angles.T, (0.2, 0.1), strict=True):
        assert stats.kstest(column, "uniform", args=(-half, 2 * half)).pvalue > 0.001


def test_streams_beyond_one_word_are_refused() -> None:
    with pytest.raises(ValueError, match=r"below 2\*\*32, got 4294967296; start lower"):
        spawned_streams(SeedSequence(1), 2, 2**32 - 1)
