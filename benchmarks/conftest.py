"""What the project promises to be fast, each promise a ratio to a reference that runs beside it.

Machines differ by a factor of three, and other work comes and goes; so the two are timed in turns,
in processor time, the best round of each. Seconds are printed for information and promise nothing.
"""

from __future__ import annotations

import resource
import time
from collections.abc import Callable

import pytest

Call = Callable[[], object]


def processor_seconds() -> float:
    """Return what this process, and those it has waited for, have used of processors so far."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def seconds(call: Call, least: float = 0.02) -> float:
    """Return the processor time of one call, repeated until the clock can tell it."""
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
    """Hold a call to a share of its reference's time.

    ``promise(name, ours, reference, at_most, rounds=5, work=1.0)``: `work` is how many times the
    reference's work ours does, where the reference is too slow to do all of it.
    """

    def hold(
        name: str,
        ours: Call,
        reference: Call,
        at_most: float,
        *,
        rounds: int = 5,
        work: float = 1,
    ) -> None:
        pairs = [(seconds(ours), work * seconds(reference)) for _ in range(rounds)]
        mine, theirs = (min(column) for column in zip(*pairs, strict=True))
        ratio = mine / theirs
        with capsys.disabled():
            print(f"\n{name}: {_share(ratio)} (promised: {_share(at_most)})", end="")
            print(f"  [{1e3 * mine:,.3g} ms for {1e3 * theirs:,.3g} ms]", end="")
        assert ratio <= at_most

    with capsys.disabled():
        print()
    return hold


def _share(ratio: float) -> str:
    return (
        f"{ratio:.2f} of its time" if ratio >= 0.2 else f"{1 / ratio:.0f} times as fast"
    )
