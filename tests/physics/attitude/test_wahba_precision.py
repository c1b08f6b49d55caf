"""How many digits each solver of Wahba's problem keeps, against sixty-digit arithmetic."""

from decimal import Decimal, localcontext

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from reproduce.physics.attitude import attitude, emitted_directions, received_directions, solve
from reproduce.physics.attitude.wahba import METHODS
from reproduce.physics.validate import DegenerateGeometryError

EPSILON = np.finfo(float).eps
# What each solver loses: multiples of machine precision over the relative eigenvalue gap, and for
# the direct one over its root. The worst of 24,000 random sets lost about half as much.
OVER_GAP = {"svd": 60, "q-method": 20, "quest": 15}
DIRECT_OVER_ROOT = 2

SPOTS = np.array([[544.822, 435.751], [520.724, 459.788], [569.035, 459.876], [544.579, 483.940]])

exactly = np.vectorize(lambda x: Decimal(float(x)), otypes=[object])
root = np.vectorize(Decimal.sqrt, otypes=[object])


def cross(a, b):
    return np.stack([a[..., i] * b[..., j] - a[..., j] * b[..., i] for i, j in CYCLE], axis=-1)


CYCLE = ((1, 2), (2, 0), (0, 1))


def inverse(m):
    columns = np.stack([cross(m[i], m[j]) for i, j in CYCLE], axis=-1)
    return columns / (m[0] * columns[:, 0]).sum()


def exact_attitude(target, source, weights, start):
    """Newton's iteration on the loss in sixty digits, from a start that is nearly there."""
    with localcontext() as context:
        context.prec = 60
        target, source = (
            (rows := exactly(side)) / root((rows * rows).sum(axis=-1))[:, None]
            for side in (target, source)
        )
        share, one, rotation = exactly(weights)[:, None], exactly(np.eye(3)), exactly(start)
        for _ in range(4):
            rotation = rotation.dot(3 * one - rotation.T.dot(rotation)) / 2
        for _ in range(8):
            rows = source.dot(rotation.T)
            torque = (share * cross(rows, target - rows)).sum(axis=0)
            product = (share * rows).T.dot(target)
            stiffness = np.trace(product) * one - (product + product.T) / 2
            x, y, z = inverse(stiffness).dot(torque) / 2
            half = np.array([[0 * x, -z, y], [z, 0 * x, -x], [-y, x, 0 * x]])
            rotation = inverse(one - half).dot(one + half).dot(rotation)
        return rotation


def away(rotation, exact):
    """Angle between a rotation in doubles and one in sixty digits."""
    with localcontext() as context:
        context.prec = 60
        twist = exact.T.dot(exactly(rotation))
        axial = np.array([(twist[j, i] - twist[i, j]) / 2 for i, j in CYCLE])
        return float((axial * axial).sum().sqrt())


def errors(target, source, method):
    """Errors of a solver, or of SciPy's, over a batch of frames with equal weights."""
    source = np.broadcast_to(source, target.shape)
    if method == "scipy":
        pairs = zip(target, source, strict=True)
        found = [Rotation.align_vectors(*pair)[0].as_matrix() for pair in pairs]
    else:
        found = attitude(target, source, method=method)
    starts = attitude(target, source)
    ones = np.ones(target.shape[-2])
    rows = zip(target, source, starts, strict=True)
    exact = [exact_attitude(one, other, ones, start) for one, other, start in rows]
    return np.array([away(*pair) for pair in zip(found, exact, strict=True)])


def printed_spots(frames):
    """Directions of the spots that chen2023 prints, with noise, and of its designed lasers."""
    spots = SPOTS + 0.017 * np.random.default_rng(1).standard_normal((frames, 4, 2))
    lasers = 11e-3 * np.array([[0, -1], [-1, 0], [1, 0], [0, 1]])
    target = received_directions(spots, (511.5, 511.5), pixel_pitch=13e-6, focal_length=60e-3)
    return target, emitted_directions(lasers, focal_length=2.0)


def turned_aside(frames):
    """The same, both instruments turned so that no axis of a frame is near the spots."""
    target, source = printed_spots(frames)
    sides = Rotation.random(2, random_state=np.random.default_rng(2)).as_matrix()
    return target @ sides[0], source @ sides[1]


def test_svd_agrees_with_scipy_to_a_picoradian_for_the_printed_spots():
    target, source = printed_spots(800)
    theirs = np.array([Rotation.align_vectors(row, source)[0].as_matrix() for row in target])
    twist = np.swapaxes(attitude(target, source), -1, -2) @ theirs
    axial = [(twist[:, j, i] - twist[:, i, j]) / 2 for i, j in CYCLE]
    assert np.linalg.norm(axial, axis=0).max() < 1e-14


@pytest.mark.parametrize("method", [*METHODS, "scipy"])
def test_the_printed_spots_are_solved_far_below_the_promised_ten_nanoradians(method):
    assert errors(*printed_spots(20), method).max() < 1e-10


def test_aside_of_the_boresights_the_profile_matrix_loses_the_roll_for_scipy_as_for_us():
    """Not a matter of the solver: SVD and SciPy err alike, and the direct way by far less."""
    target, source = turned_aside(20)
    found = {method: errors(target, source, method).max() for method in ("svd", "scipy", "direct")}
    assert 1e-12 < found["scipy"] < 1e-11
    assert 1e-12 < found["svd"] < 1e-11
    assert found["direct"] < 2e-14


def random_sets(count, seed):
    """Directions from wide to a ten-thousandth of a radian apart, anywhere, noise and weights."""
    rng = np.random.default_rng(seed)
    size = int(rng.integers(2, 9))
    spread, noise = 10 ** rng.uniform(-4, 0, count), 10 ** rng.uniform(-7, -1, count)
    middle = rng.standard_normal((count, 1, 3))
    middle /= np.linalg.norm(middle, axis=-1, keepdims=True)
    source = middle + spread[:, None, None] * rng.standard_normal((count, size, 3))
    source /= np.linalg.norm(source, axis=-1, keepdims=True)
    turn = Rotation.random(count, random_state=rng).as_matrix()
    scatter = (noise * spread)[:, None, None] * rng.standard_normal(source.shape)
    target = source @ np.swapaxes(turn, -1, -2) + scatter
    target /= np.linalg.norm(target, axis=-1, keepdims=True)
    return target, source, rng.uniform(0.2, 5.0, (count, size))


@pytest.mark.parametrize("seed", [100, 101, 102])
def test_each_solver_keeps_its_stated_multiple_over_random_sets(seed):
    target, source, weights = random_sets(2000, seed)
    direct = solve(target, source, weights, "direct")
    gap = direct.eigenvalue_gap / weights.sum(axis=-1)
    for index in range(0, 2000, 100):
        exact = exact_attitude(target[index], source[index], weights[index], direct.rotation[index])
        limit = DIRECT_OVER_ROOT * EPSILON / np.sqrt(gap[index])
        assert away(direct.rotation[index], exact) < limit
    for method, multiple in OVER_GAP.items():
        twist = np.swapaxes(attitude(target, source, weights, method), -1, -2) @ direct.rotation
        axial = [(twist[:, j, i] - twist[:, i, j]) / 2 for i, j in CYCLE]
        assert (np.linalg.norm(axial, axis=0) < multiple * EPSILON / gap).all(), method


def heavy_and_light(seed):
    """Noisy directions all over the sky whose weights span 24 decades."""
    rng = np.random.default_rng(seed)
    size = int(rng.integers(2, 7))
    source = rng.standard_normal((size, 3))
    target = Rotation.random(random_state=rng).apply(source) + 1e-4 * rng.standard_normal((size, 3))
    weights = 10 ** rng.uniform(-12, 12, size)
    weights[:2] = 1e12, 1e-12
    sides = (rows / np.linalg.norm(rows, axis=1, keepdims=True) for rows in (target, source))
    return (*sides, weights)


@pytest.mark.parametrize("seed", range(8))
def test_the_solver_that_is_used_unless_another_is_named_bears_weights_over_24_decades(seed):
    target, source, weights = heavy_and_light(seed)
    found = solve(target, source, weights)
    exact = exact_attitude(target, source, weights, found.rotation)
    assert away(found.rotation, exact) < 1e-8
    np.testing.assert_array_equal(attitude(target, source, weights), found.rotation)
    assert found.eigenvalue_gap > 0


@pytest.mark.parametrize("angle", [1e-5, 1e-6, 1e-7, 1e-8, 1e-9])
def test_narrow_cones_are_solved_as_well_as_their_directions_are_written(angle):
    rng = np.random.default_rng(3)
    middle = np.array([2.0, -1.0, 2.0]) / 3
    for _ in range(3):
        source = middle + angle * rng.standard_normal((4, 3))
        target = Rotation.random(random_state=rng).apply(source)
        source, target = (r / np.linalg.norm(r, axis=1, keepdims=True) for r in (source, target))
        found = attitude(target, source)
        exact = exact_attitude(target, source, np.ones(4), found)
        assert away(found, exact) < 100 * EPSILON / angle


@pytest.mark.parametrize("method", METHODS)
def test_parallel_directions_and_mirror_images_are_refused_however_they_are_rounded(method):
    rng = np.random.default_rng(4)
    line = np.outer([1.0, -2.0, 3.0, 0.1], rng.standard_normal(3))
    turned = Rotation.random(random_state=rng).apply(line)
    with pytest.raises(DegenerateGeometryError, match="fix all three axes"):
        attitude(turned, line, method=method)
    spread = np.random.default_rng(5).standard_normal(line.shape)
    with pytest.raises(DegenerateGeometryError, match="fix all three axes"):
        attitude(spread, line, method=method)
    axes = Rotation.random(random_state=rng).as_matrix()
    with pytest.raises(DegenerateGeometryError, match="fix all three axes"):
        attitude(-axes, axes, method=method)
