"""Wahba's problem over 800 frames of four spots, against a loop over SciPy's solver.

The promise is a ratio of times taken in one run on one machine, so that a slow or a busy one
does not break it: QUEST at least 30 times faster, the other solvers, which wait for LAPACK, 15.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture
from scipy.spatial.transform import Rotation

from reproduce.physics.attitude import attitude

FRAMES = 800
METHODS = ("quest", "svd", "q-method")


def four_spots() -> tuple[np.ndarray, np.ndarray]:
    """Four directions half a degree apart, seen 800 times with a microradian of noise."""
    rng = np.random.default_rng(1)
    source = np.array([[0, 5e-3, 1], [0, -5e-3, 1], [5e-3, 0, 1], [-5e-3, 0, 1]])
    source /= np.linalg.norm(source, axis=-1, keepdims=True)
    turn = Rotation.from_rotvec([0.3, -1.2, 2.0]).as_matrix()
    target = source @ turn.T + 1e-6 * rng.standard_normal((FRAMES, 4, 3))
    return target / np.linalg.norm(target, axis=-1, keepdims=True), source


def scipy_loop(target: np.ndarray, source: np.ndarray) -> np.ndarray:
    return np.array([Rotation.align_vectors(row, source)[0].as_matrix() for row in target])


def best_time(function: Callable[[], object], repeats: int) -> float:
    times = []
    for _ in range(repeats):
        start = time.perf_counter()
        function()
        times.append(time.perf_counter() - start)
    return min(times)


def test_ratio_to_scipy(benchmark: BenchmarkFixture, capsys: pytest.CaptureFixture[str]) -> None:
    target, source = four_spots()
    reference = scipy_loop(target, source)
    for method in METHODS:
        np.testing.assert_allclose(attitude(target, source, None, method), reference, atol=1e-8)
    # Alternate, so that another load on the machine slows both.
    loop, ours = np.inf, dict.fromkeys(METHODS, np.inf)
    for _ in range(5):
        loop = min(loop, best_time(lambda: scipy_loop(target, source), 1))
        for method in METHODS:
            ours[method] = min(
                ours[method], best_time(lambda m=method: attitude(target, source, None, m), 10)
            )
    with capsys.disabled():
        print(f"\n{FRAMES} frames of four spots: SciPy's loop {1e3 * loop:.1f} ms")
        for method, seconds in ours.items():
            print(f"  {method:9s} {1e3 * seconds:6.2f} ms, {loop / seconds:5.1f} times faster")
    assert loop / ours["quest"] > 30
    assert all(loop / seconds > 15 for seconds in ours.values())
    benchmark(attitude, target, source, None, "quest")


@pytest.mark.parametrize("method", METHODS)
def test_attitude(benchmark: BenchmarkFixture, method: str) -> None:
    benchmark(attitude, *four_spots(), None, method)
