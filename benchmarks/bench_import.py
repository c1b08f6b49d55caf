"""What a fresh process takes to import the package, and to show its first table."""

import subprocess
import sys
import time

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

ROUNDS = 5


def seconds(statement: str) -> float:
    """Return how long a fresh interpreter takes for one statement."""
    start = time.perf_counter()
    subprocess.run([sys.executable, "-c", statement], check=True)
    return time.perf_counter() - start


@pytest.mark.benchmark(group="import")
@pytest.mark.parametrize(
    ("statement", "limit"),
    [
        ("import reproduce", 0.05),
        ("import reproduce as rp; repr(rp.table('niu2024/table-1'))", 1.5),
        ("import reproduce as rp; repr(rp.table('niu2024/table-3'))", 1.5),
    ],
    ids=["import", "first-table", "first-drawn-table"],
)
def bench_first_use(benchmark: BenchmarkFixture, statement: str, limit: float) -> None:
    """Time a first use beyond the interpreter's own start, and hold it to its limit."""
    bare = min(seconds("pass") for _ in range(ROUNDS))
    benchmark.pedantic(seconds, args=(statement,), rounds=ROUNDS)
    assert benchmark.stats.stats.min - bare < limit
