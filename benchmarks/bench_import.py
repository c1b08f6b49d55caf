"""``import reproduce`` costs next to nothing beyond NumPy's own import."""

import subprocess
import sys
import time

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

LIMIT = 0.3


def seconds(statement: str) -> float:
    """Return how long a fresh interpreter takes for one statement."""
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", statement], check=True)
    return time.perf_counter() - start


@pytest.mark.benchmark(group="import")
def bench_import_reproduce(benchmark: BenchmarkFixture) -> None:
    """Time the import in a fresh interpreter, and hold it to its limit."""
    numpy_alone = min(seconds("import numpy") for _ in range(5))
    benchmark.pedantic(seconds, args=("import numpy, reproduce",), rounds=5)
    assert benchmark.stats.stats.min - numpy_alone < LIMIT
