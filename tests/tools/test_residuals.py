"""Rounding residuals: which cells count, and what they are."""

import numpy as np
import pandas as pd
import pytest

from reproduce.judge.ledger import build
from reproduce.papers.catalogue import catalogue
from reproduce.store import studies
from residuals import NAME, _distance, _laws, _place, residuals, study, unrounded


def test_only_cells_that_carry_information_count():
    ledger = build(["niu2024/table-2", "chen2023/table-5", "chen2023/text-positioning"])
    niu, chen = (residuals(ledger, paper) for paper in ("niu2024", "chen2023"))
    assert niu.cells == ("niu2024/table-2#scale.red", "niu2024/table-2#scale.blue")
    red = (25.0 / 25.0601 - 0.9976) / 1e-4
    assert niu.values[0] == pytest.approx(red, abs=1e-6)
    assert (
        chen.cells == ()
    )  # exact differences of equal decimals, and numbers printed twice
    assert chen.exact > 10
    assert np.isnan(chen.probability)


def test_residuals_lie_within_half_a_unit():
    ledger = build(["niu2024/table-2"])
    assert np.abs(residuals(ledger, "niu2024").values).max() <= 0.5


def test_every_law_is_the_one_of_its_formula():
    """A quotient of finely printed numbers is uniform; a difference of equal decimals has steps."""
    judged = {"niu2024/table-2#scale.red", "chen2023/table-5#2.motion-x"}
    laws = {}
    for item in catalogue().values():
        for computation in item.computations:
            if computation.key in {"niu2024/table-2", "chen2023/table-5"}:
                laws |= (
                    _laws(computation, judged, 2000)
                    if not computation.replicates
                    else {}
                )
    law, seen = laws["niu2024/table-2#scale.red"]
    assert seen == pytest.approx((25.0 / 25.0601 - 0.9976) / 1e-4, abs=1e-6)
    # Focal lengths to a tenth of a micrometre move the scale by a twentieth of its last digit.
    assert np.quantile(law, [0.25, 0.5, 0.75]) == pytest.approx(
        [-0.25, 0, 0.25], abs=0.05
    )
    steps, counts = np.unique(
        np.round(laws["chen2023/table-5#2.motion-x"][0]), return_counts=True
    )
    assert steps.tolist() == [-1, 0, 1]
    # The rounding errors of two numbers differ by half a unit or more in one case of four.
    assert counts / 2000 == pytest.approx([1 / 8, 3 / 4, 1 / 8], abs=0.03)


def test_transforms_are_even_under_their_own_law_and_leave_repeats_out():
    ledger = build(["chen2023/table-5", "chen2023/text-positioning"])
    found = unrounded(ledger, "chen2023", 400)
    assert not any("text-positioning" in cell for cell in found.cells)
    assert (
        len(found.cells) == 15
    )  # seven motions and eight differences; the zeros say nothing
    assert found.exact == residuals(ledger, "chen2023").exact
    assert 0 < found.probability <= 1
    assert ((found.values >= 0) & (found.values <= 1)).all()
    rng = np.random.default_rng(3)
    for law in (rng.random(500), rng.integers(0, 3, 500).astype(float)):
        assert _distance(_place(law, rng.random(500))) < 0.08


def test_the_distance_from_the_uniform_law():
    assert _distance(np.array([0.5])) == pytest.approx(0.5)
    assert _distance(np.array([0.9, 0.95])) == pytest.approx(0.9)


def test_the_stored_study_is_what_is_found_again():
    pd.testing.assert_frame_equal(
        study(), studies.table(NAME), check_dtype=False, rtol=1e-9
    )
