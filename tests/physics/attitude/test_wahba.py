"""Wahba's problem against SciPy, closed forms, limits, Markley's cases and its own optimality."""

import json
from collections import namedtuple
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, kstest

from reproduce.physics.attitude import (
    attitude,
    by_quest,
    by_svd,
    cross_matrix,
    mean_rotation,
    rotations,
)
from reproduce.physics.validate import DegenerateGeometryError

METHODS = ("svd", "quest")
EPSILON = np.finfo(float).eps
# The multiple of machine precision over the gap within which all solvers agree; 45 measured.
ROUNDINGS = 100
MARKLEY = json.loads(
    (Path(__file__).parents[1] / "data/markley_wahba_12cases.json").read_text()
)

# Four directions within 0.3 degrees, 0.8 degrees off the boresight, as laser spots are.
CLUSTER = np.array(
    [[-5.9e-3, 16.2e-3, 1], [-2e-3, 11e-3, 1], [-12.3e-3, 11e-3, 1], [-7e-3, 6e-3, 1]]
)
CLUSTER /= np.linalg.norm(CLUSTER, axis=-1, keepdims=True)


def angle_between(one, two):
    """Angle of the rotation that leads from one matrix to the other, accurate when small."""
    twist = np.swapaxes(one, -1, -2) @ two
    axial = [twist[..., k, j] - twist[..., j, k] for j, k in ((1, 2), (2, 0), (0, 1))]
    sine = np.linalg.norm(axial, axis=0) / 2
    return np.arctan2(sine, (np.trace(twist, axis1=-2, axis2=-1) - 1) / 2)


def random_rotations(count, seed):
    return Rotation.random(count, random_state=np.random.default_rng(seed)).as_matrix()


def noisy(target, sigma, rng):
    moved = target + sigma * rng.standard_normal(target.shape)
    return moved / np.linalg.norm(moved, axis=-1, keepdims=True)


def scipy_attitude(target, source, weights=None):
    return Rotation.align_vectors(target, source, weights=weights)[0].as_matrix()


def profile(target, source, weights):
    return np.einsum("...n,...ni,...nj->...ij", weights, target, source)


def davenport_matrix(profile):
    """K, (..., 4, 4): the gain trace(A B^T) as a form in A's quaternion, scalar last."""
    trace = np.trace(profile, axis1=-2, axis2=-1)[..., None, None]
    axial = np.stack(
        [profile[..., k, j] - profile[..., j, k] for j, k in CYCLE], axis=-1
    )
    block = profile + profile.mT - trace * np.eye(3)
    upper = np.concatenate([block, axial[..., None]], axis=-1)
    return np.concatenate(
        [upper, np.append(axial[..., None, :], trace, axis=-1)], axis=-2
    )


CYCLE = ((1, 2), (2, 0), (0, 1))
Solution = namedtuple("Solution", "rotation loss eigenvalue_gap")


def solve(target, source, weights=None, method="svd"):
    """The best rotation, what it leaves, and the gap that Davenport's eigenvalues have."""
    rotation = attitude(target, source, weights, method)
    target, source = (
        np.asarray(rows) / np.linalg.norm(rows, axis=-1, keepdims=True)
        for rows in (target, source)
    )
    weights = np.ones(source.shape[-2]) if weights is None else np.asarray(weights)
    misses = target - source @ rotation.mT
    loss = np.einsum("...n,...ni,...ni->...", weights, misses, misses)
    matrix = profile(*np.broadcast_arrays(target, source), weights)
    values = np.linalg.eigvalsh(davenport_matrix(matrix))
    return Solution(rotation, loss, values[..., -1] - values[..., -2])


TURNS = {
    "identity": np.eye(3),
    "tiny": Rotation.from_rotvec([3e-6, -2e-6, 5e-6]).as_matrix(),
    "half turn about X": np.diag([1.0, -1.0, -1.0]),
    "half turn about Y": np.diag([-1.0, 1.0, -1.0]),
    "half turn about Z": np.diag([-1.0, -1.0, 1.0]),
    "half turn askew": Rotation.from_rotvec(
        np.pi * np.array([0.6, 0.0, 0.8])
    ).as_matrix(),
    "nearly half a turn": Rotation.from_rotvec([0, (1 - 1e-9) * np.pi, 0]).as_matrix(),
    "general": Rotation.from_rotvec([0.3, -1.2, 2.0]).as_matrix(),
}
SETS = {
    "axes": np.eye(3),
    "two at a right angle": np.eye(3)[:2],
    "two at ten degrees": np.array([[1, 0, 0], [np.cos(0.17), np.sin(0.17), 0]]),
    "four within 0.3 degrees": CLUSTER,
    "two opposite pairs": np.array([[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, -1, 0.0]]),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("turn", TURNS)
@pytest.mark.parametrize("directions", SETS)
def test_finds_the_rotation_that_made_the_data(method, turn, directions):
    source, truth = SETS[directions], TURNS[turn]
    solution = solve(source @ truth.T, source, method=method)
    gap = solution.eigenvalue_gap / len(source)
    assert angle_between(solution.rotation, truth) < ROUNDINGS * EPSILON / gap
    assert angle_between(solution.rotation, truth) < 1e-9
    assert solution.loss < 1e-20


def test_svd_agrees_with_scipy_to_a_picoradian():
    rng = np.random.default_rng(11)
    source = rng.standard_normal((200, 5, 3))
    source /= np.linalg.norm(source, axis=-1, keepdims=True)
    truth = random_rotations(200, 12)
    target = noisy(source @ np.swapaxes(truth, -1, -2), 0.02, rng)
    weights = rng.uniform(0.1, 10, (200, 5))
    ours = attitude(target, source, weights, "svd")
    theirs = np.array(
        [scipy_attitude(*row) for row in zip(target, source, weights, strict=True)]
    )
    assert angle_between(ours, theirs).max() < 1e-12


@pytest.mark.parametrize("near", [True, False])
@pytest.mark.parametrize("seen_from", ["boresight", "aside"])
def test_on_a_tight_cluster_svd_agrees_with_scipy_and_the_others_to_a_nanoradian(
    near, seen_from
):
    rng = np.random.default_rng(21)
    source = (
        CLUSTER if seen_from == "boresight" else CLUSTER @ random_rotations(1, 22)[0]
    )
    turns = (
        1e-5 * rng.standard_normal((300, 3)) if near else rng.standard_normal((300, 3))
    )
    truth = Rotation.from_rotvec(turns).as_matrix()
    target = noisy(source @ np.swapaxes(truth, -1, -2), 4e-6, rng)
    reference = np.array([scipy_attitude(row, source) for row in target])
    if seen_from == "boresight":
        assert (
            angle_between(attitude(target, source, method="svd"), reference).max()
            < 1e-12
        )
    for method in METHODS:
        solution = solve(target, source, method=method)
        error = angle_between(solution.rotation, reference)
        assert error.max() < 1e-9
        assert (error < ROUNDINGS * EPSILON * 4 / solution.eigenvalue_gap).all()


def test_quest_falls_back_on_svd_only_for_mirrored_data(monkeypatch):
    rng = np.random.default_rng(23)
    sides = random_rotations(200, 24)
    profiles = {
        name: np.mean(
            noisy(rows @ np.swapaxes(sides, -1, -2), 1e-5, rng)[..., :, np.newaxis]
            * rows[:, np.newaxis, :],
            axis=-3,
        )
        for name, rows in {**SETS, "cluster aside": CLUSTER @ sides[0]}.items()
    }
    expected = {name: by_svd(profile)[0] for name, profile in profiles.items()}

    def refuse(profile):
        raise AssertionError(f"QUEST gave up on {len(profile)} sets")

    monkeypatch.setattr(rotations, "by_svd", refuse)
    for name, profile in profiles.items():
        rotation, gap = by_quest(profile)[0], by_svd(profile)[1]
        assert (
            angle_between(rotation, expected[name]) < ROUNDINGS * EPSILON / gap
        ).all()
    with pytest.raises(AssertionError, match="QUEST gave up on 1 sets"):
        by_quest(np.diag([-0.4, -0.3, -0.300001]))


def test_the_solvers_agree_from_wide_fields_to_clusters_lost_in_noise():
    rng = np.random.default_rng(25)
    count, spread, noise = (
        4000,
        10 ** rng.uniform(-4, 0, 4000),
        10 ** rng.uniform(-7, 0, 4000),
    )
    source = np.tile([0.0, 0.0, 1.0], (count, 4, 1))
    source += spread[:, None, None] * rng.standard_normal(source.shape)
    source /= np.linalg.norm(source, axis=-1, keepdims=True)
    target = source @ np.swapaxes(random_rotations(count, 26), -1, -2)
    target = noisy(target, noise[:, None, None], rng)
    svd = solve(target, source)
    error = angle_between(attitude(target, source), svd.rotation)
    assert (error < ROUNDINGS * EPSILON * 4 / svd.eigenvalue_gap).all()


def test_the_sign_of_the_rotation_one_sidedly():
    # The target frame sees X where Y was: a right-handed quarter turn about Z.
    for method in METHODS:
        rotation = attitude(
            [[0, 1, 0], [0, 0, 1]], [[1, 0, 0], [0, 0, 1]], method=method
        )
        np.testing.assert_allclose(
            rotation, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-15
        )


@pytest.mark.parametrize("method", METHODS)
def test_two_noisy_directions_share_their_angle_error(method):
    # Closed form: with equal weights the fit splits a wrong angle evenly between both.
    source = [[1, 0, 0], [0, 1, 0]]
    excess = 0.02
    target = [[1, 0, 0], [-np.sin(excess), np.cos(excess), 0]]
    solution = solve(target, source, method=method)
    expected = Rotation.from_rotvec([0, 0, excess / 2]).as_matrix()
    assert angle_between(solution.rotation, expected) < 1e-14
    assert float(solution.loss) == pytest.approx(
        2 * (2 * np.sin(excess / 4)) ** 2, rel=1e-9
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_heavy_direction_is_met_exactly_in_the_limit(method):
    # However poorly the light direction holds the roll, the heavy one is met to rounding.
    one, two = random_rotations(2, 29)
    target, source = np.array([[1, 0, 0], [-0.02, 1, 0]]) @ one, np.eye(3)[:2] @ two
    rotation = attitude(target, source, [1e10, 1], method)
    np.testing.assert_allclose(rotation @ source[0], target[0], atol=1e-11)


def test_the_solution_is_stationary_and_stiff_and_nothing_nearby_is_better():
    rng = np.random.default_rng(31)
    source = rng.standard_normal((50, 4, 3))
    target = rng.standard_normal((50, 4, 3))  # unrelated: the loss is large
    weights = rng.uniform(0.5, 2, (50, 4))
    solution = solve(target, source, weights)
    unit_target = target / np.linalg.norm(target, axis=-1, keepdims=True)
    unit_source = source / np.linalg.norm(source, axis=-1, keepdims=True)
    found = unit_source @ solution.rotation.mT
    torque = np.einsum("bn,bni->bi", weights, np.cross(found, unit_target))
    assert np.abs(torque).max() < 1e-13
    gain = profile(unit_target, unit_source, weights) @ solution.rotation.mT
    stiffness = np.trace(gain, axis1=-2, axis2=-1)[:, None, None] * np.eye(3) - gain
    least = np.linalg.eigvalsh((stiffness + np.swapaxes(stiffness, -1, -2)) / 2)[:, 0]
    np.testing.assert_allclose(2 * least, solution.eigenvalue_gap, atol=1e-13)
    for turn in rng.standard_normal((40, 3)):
        other = Rotation.from_rotvec(turn).as_matrix() @ solution.rotation
        carried = unit_source @ other.mT
        loss = np.einsum("bn,bni->b", weights, (unit_target - carried) ** 2)
        assert (loss > solution.loss).all()


def test_loss_follows_from_the_largest_eigenvalue():
    rng = np.random.default_rng(41)
    target, source = rng.standard_normal((2, 30, 6, 3))
    solution = solve(target, source)
    target /= np.linalg.norm(target, axis=-1, keepdims=True)
    source /= np.linalg.norm(source, axis=-1, keepdims=True)
    values = np.linalg.eigvalsh(davenport_matrix(profile(target, source, np.ones(6))))
    np.testing.assert_allclose(solution.loss, 2 * (6 - values[:, -1]), rtol=1e-12)


def test_the_solvers_report_the_gap_between_the_two_largest_eigenvalues():
    rng = np.random.default_rng(51)
    profiles = rng.standard_normal((500, 3, 3))
    profiles /= np.linalg.norm(profiles, axis=(-2, -1), ord="nuc")[:, None, None]
    values = np.linalg.eigvalsh(davenport_matrix(profiles))
    expected = values[:, -1] - values[:, -2]
    np.testing.assert_allclose(by_svd(profiles)[1], expected, atol=1e-12)
    # QUEST knows the product with the distances to the other two, which are 2 at most.
    product = (values[:, -1:] - values[:, :-1]).prod(axis=-1)
    np.testing.assert_allclose(by_quest(profiles)[1], product / 4, atol=1e-12)


@pytest.mark.parametrize("method", METHODS)
def test_inverted_directions_still_give_a_proper_rotation(method):
    # Every target is the mirror image of its source: the best rotation is far from perfect.
    source = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.6, 0.8, 0]])
    rotation = attitude(-source, source, [1, 2, 4, 3], method)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    assert (
        angle_between(rotation, scipy_attitude(-source, source, [1, 2, 4, 3])) < 1e-12
    )


@pytest.mark.parametrize("method", METHODS)
def test_a_batch_is_a_loop(method):
    rng = np.random.default_rng(61)
    source = rng.standard_normal((4, 3))
    target = noisy(source @ random_rotations(1, 62)[0].T, 0.01, rng)
    targets = target + 1e-3 * rng.standard_normal((2, 5, 4, 3))
    weights = rng.uniform(1, 2, (5, 4))
    together = attitude(targets, source, weights, method)
    assert together.shape == (2, 5, 3, 3)
    for i in range(2):
        for j in range(5):
            alone = attitude(targets[i, j], source, weights[j], method)
            np.testing.assert_allclose(together[i, j], alone, atol=1e-14)


def test_an_empty_batch_gives_an_empty_answer_only_with_directions():
    with pytest.raises(ValueError, match="expected at least one value"):
        attitude(np.zeros((0, 4, 3)), CLUSTER)


@given(
    lengths=st.lists(st.floats(1e-150, 1e150), min_size=4, max_size=4),
    scale=st.floats(1e-150, 1e150),
    turn=st.lists(st.floats(-1.8, 1.8), min_size=3, max_size=3),
    method=st.sampled_from(METHODS),
)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_lengths_and_the_scale_of_the_weights_do_not_matter(
    lengths, scale, turn, method
):
    source = np.array([[1, 0.2, 0], [0, 1, 0.3], [0.1, 0, 1], [0.5, 0.5, 0.5]])
    truth = Rotation.from_rotvec(turn).as_matrix()
    target = (source @ truth.T) * np.array(lengths)[:, None]
    weights = scale * np.array([1.0, 2.0, 3.0, 4.0])
    assert angle_between(attitude(target, source, weights, method), truth) < 1e-13


@given(
    turn=st.lists(st.floats(-1.8, 1.8), min_size=3, max_size=3),
    seed=st.integers(0, 2**16),
    method=st.sampled_from(METHODS),
)
@settings(max_examples=60, deadline=None, derandomize=True)
def test_turning_the_target_frame_turns_the_answer(turn, seed, method):
    rng = np.random.default_rng(seed)
    source = np.eye(3) + 0.2 * rng.standard_normal((3, 3))
    target = noisy(source, 0.05, rng)
    extra = Rotation.from_rotvec(turn).as_matrix()
    turned = attitude(target @ extra.T, source, method=method)
    assert (
        angle_between(turned, extra @ attitude(target, source, method=method)) < 1e-12
    )


FREE = {
    "one direction": ([[0, 0, 1]], [[1, 0, 0]], None),
    "parallel": ([[0, 0, 1], [0, 0, 2]], [[1, 0, 0], [1, 0, 0]], None),
    "opposite": ([[0, 0, 1], [0, 0, -1]], [[1, 0, 0], [-1, 0, 0]], None),
    "parallel askew": ([[1, 2, 3], [2, 4, 6]], [[3, 1, 1], [3, 1, 1]], None),
    "coincident": (
        np.tile([0.1, 0.7, 0.2], (6, 1)),
        np.tile([0.3, 0.3, 0.1], (6, 1)),
        None,
    ),
    "one with weight": (np.eye(3), np.eye(3), [0, 1, 0]),
    "mirrored": (-np.eye(3), np.eye(3), None),
    "cancelling": ([[1, 0, 0], [-1, 0, 0]], [[1, 0, 0], [1, 0, 0]], None),
}


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("case", FREE)
def test_geometry_that_leaves_a_rotation_free_is_refused(method, case):
    target, source, weights = FREE[case]
    with pytest.raises(
        DegenerateGeometryError, match=r"leaves a rotation free .* add a direction"
    ):
        attitude(target, source, weights, method)


def test_the_refusal_names_the_set():
    target = np.tile(np.eye(3), (4, 1, 1))
    target[2] = [[1, 0, 0]] * 3
    with pytest.raises(
        DegenerateGeometryError, match=r"in 1 of 4 sets, the first at index \(2,\)"
    ):
        attitude(target, target)


@pytest.mark.parametrize("case", MARKLEY["cases"])
def test_markley_cases(case):
    source = np.array(MARKLEY["cases"][case]["r"], dtype=float)
    source /= np.linalg.norm(source, axis=-1, keepdims=True)
    sigma = np.array(MARKLEY["cases"][case]["sigma"])
    truth = np.array(MARKLEY["A_true"])
    rng = np.random.default_rng([71, int(case)])
    exact = np.broadcast_to(source @ truth.T, (1000, *source.shape))
    target = noisy(exact, sigma[:, None], rng)
    solutions = {
        method: solve(target, source, sigma**-2.0, method) for method in METHODS
    }
    svd = solutions["svd"]
    relative_gap = svd.eigenvalue_gap / np.sum(sigma**-2.0)
    for solution in solutions.values():
        error = angle_between(solution.rotation, svd.rotation)
        assert (error < ROUNDINGS * EPSILON / relative_gap).all()
    # Best means no worse than the truth.
    at_truth = (((target - exact) / sigma[:, None]) ** 2).sum(axis=(-2, -1))
    assert (svd.loss <= at_truth * (1 + 1e-6)).all()
    # The error, in units of its predicted covariance, has three degrees of freedom. First
    # order needs errors small beside the angles between the directions; 8 and 9 are not.
    if case not in ("8", "9"):
        turns = Rotation.from_matrix(svd.rotation @ truth.T).as_rotvec()
        # Its inverse: how strongly the directions resist a turn about each axis.
        held = sum(
            (np.eye(3) - np.outer(d, d)) / s**2
            for d, s in zip(exact[0], sigma, strict=True)
        )
        distance = np.einsum("bi,ij,bj->b", turns, held, turns)
        assert kstest(distance, chi2(3).cdf).pvalue > 1e-3


def test_the_loss_follows_the_chi_square_law():
    rng = np.random.default_rng(81)
    source = rng.standard_normal((6, 3))
    source /= np.linalg.norm(source, axis=-1, keepdims=True)
    sigma = np.geomspace(1e-5, 1e-4, 6)
    target = noisy(np.broadcast_to(source, (4000, 6, 3)), sigma[:, None], rng)
    loss = solve(target, source, sigma**-2.0).loss
    assert kstest(loss, chi2(2 * 6 - 3).cdf).pvalue > 1e-3


def test_small_error_as_a_cross_product_is_in_the_target_frame():
    # (I + [e×]) in front of the rotation: the error e is in the target frame.
    error = np.array([1e-7, 2e-7, -3e-7])
    truth = random_rotations(1, 111)[0]
    target = np.eye(3) @ truth.T
    turned = attitude(target @ (np.eye(3) + cross_matrix(error)).T, np.eye(3))
    np.testing.assert_allclose(
        Rotation.from_matrix(turned @ truth.T).as_rotvec(), error, atol=1e-13
    )


def test_the_mean_rotation_agrees_with_scipy():
    rng = np.random.default_rng(121)
    sample = Rotation.from_rotvec(0.3 * rng.standard_normal((50, 3)))
    assert (
        angle_between(mean_rotation(sample.as_matrix()), sample.mean().as_matrix())
        < 1e-14
    )
    with pytest.raises(DegenerateGeometryError):
        mean_rotation(
            [
                np.eye(3),
                np.diag([1, -1, -1]),
                np.diag([-1, 1, -1]),
                np.diag([-1, -1, 1]),
            ]
        )


def test_an_unknown_method_is_refused():
    with pytest.raises(ValueError, match="method: expected one of"):
        attitude(np.eye(3), np.eye(3), method="triad")
