"""Promised times, each a ratio to a reference in the same process.

Machines differ by a factor of 3 and have other load. Both are timed alternately in processor time,
and the best round of each counts. Seconds are printed for information.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable

import pytest

Call = Callable[[], object]


def processor_seconds() -> float:
    """Return the processor time of this process and its finished children, in seconds."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def seconds(call: Call, least: float = 0.02) -> float:
    """Return the processor time of one call, in seconds, from `least` seconds of repeated calls."""
    repeats = 1
    while True:
        begin = processor_seconds()
        for _ in range(repeats):
            call()
        spent = processor_seconds() - begin
        if spent >= least:
            return spent / repeats
        repeats *= 4


@pytest.fixture
def promise(capsys: pytest.CaptureFixture[str]) -> Callable[..., None]:
    """Compare the time of a call with that of a reference.

    ``promise(name, call, reference, at_most, rounds=5, work=1.0)``: `work` is the ratio of the work
    of the call to the work of the reference, for a slow reference with less work.
    """

    def compare(
        name: str,
        call: Call,
        reference: Call,
        at_most: float,
        *,
        rounds: int = 5,
        work: float = 1,
    ) -> None:
        pairs = [(seconds(call), work * seconds(reference)) for _ in range(rounds)]
        time, other = (min(column) for column in zip(*pairs, strict=True))
        ratio = time / other
        with capsys.disabled():
            print(f"\n{name}: {_ratio(ratio)} (promised: {_ratio(at_most)})", end="")
            print(f"  [{1e3 * time:,.3g} ms, reference {1e3 * other:,.3g} ms]", end="")
        assert ratio <= at_most

    with capsys.disabled():
        print()
    return compare


def _ratio(ratio: float) -> str:
    return (
        f"{ratio:.2f} of its time" if ratio >= 0.2 else f"{1 / ratio:.0f} times as fast"
    )
