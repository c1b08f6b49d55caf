"""Work in parts: on any executor, in any order, killed and resumed; sampling is such work."""

import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from parts import ResumeError, Store, processes, run_parts


def squares(part):
    """The slower the earlier, so that they end in another order."""
    time.sleep(0.02 * (4 - part))
    return part**2, np.arange(part)


@pytest.mark.parametrize("pool", [lambda: ThreadPoolExecutor(4), lambda: processes(2)])
def test_results_come_in_the_order_of_the_parts(pool):
    alone = run_parts(squares, range(5))
    with pool() as executor:
        found = run_parts(squares, range(5), executor)
    assert [int(square) for square, _ in found] == [0, 1, 4, 9, 16]
    for one, other in zip(found, alone, strict=True):
        for array, same in zip(one, other, strict=True):
            np.testing.assert_array_equal(array, same)


def test_progress_counts_what_lies_there_already(tmp_path):
    store, seen = Store(tmp_path, {"what": "squares"}), []
    run_parts(squares, range(3), store=store)
    run_parts(
        squares,
        range(5),
        store=store,
        progress=lambda done, total: seen.append((done, total)),
    )
    assert seen == [(4, 5), (5, 5)]


def test_a_part_that_is_there_is_not_run_again(tmp_path):
    store = Store(tmp_path, {"what": "squares"})
    first = run_parts(squares, range(3), store=store)
    again = run_parts(None, range(3), store=store)
    assert [[array.tolist() for array in part] for part in again] == [
        [array.tolist() for array in part] for part in first
    ]


def test_other_work_is_refused(tmp_path):
    run_parts(squares, range(2), store=Store(tmp_path, {"what": "squares", "seed": 1}))
    with pytest.raises(ResumeError, match="differ in seed"):
        run_parts(
            squares, range(2), store=Store(tmp_path, {"what": "squares", "seed": 2})
        )


def test_an_error_keeps_what_was_done(tmp_path):
    def broken(part):
        if part == 2:
            raise ArithmeticError("a fault")
        return (part,)

    store = Store(tmp_path, {})
    with ThreadPoolExecutor(1) as pool, pytest.raises(ArithmeticError, match="a fault"):
        run_parts(broken, range(4), pool, store)
    assert {0, 1} <= set(store.opened(4))
    assert 2 not in store.opened(4)
