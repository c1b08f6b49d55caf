"""Judging everything: under 20 s and 1 GiB on two cores."""

import resource
import subprocess
import sys

SECONDS, GIBIBYTES = 20.0, 1.0


def test_check_of_everything(benchmark):
    """A fresh interpreter each time: nothing is cached from the run before."""
    command = [sys.executable, "-m", "reproduce", "check"]
    benchmark.pedantic(subprocess.run, args=[command], kwargs={"check": True}, rounds=3)
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 2**20
    benchmark.extra_info["peak GiB"] = round(peak, 3)
    print(f"\ncheck: {benchmark.stats['median']:.1f} s (limit {SECONDS}), peak {peak:.2f} GiB")
    assert benchmark.stats["median"] < SECONDS
    assert peak < GIBIBYTES
