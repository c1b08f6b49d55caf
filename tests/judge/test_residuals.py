"""Rounding residuals: which cells count, and what they are."""

import numpy as np
import pytest

from reproduce.judge.ledger import build
from reproduce.judge.residuals import residuals


def test_only_cells_that_carry_information_count():
    ledger = build(["niu2024/table-2", "chen2023/table-5", "chen2023/text-positioning"])
    niu, chen = (residuals(ledger, paper) for paper in ("niu2024", "chen2023"))
    assert niu.cells == ("niu2024/table-2#scale.red", "niu2024/table-2#scale.blue")
    red = (25.0 / 25.0601 - 0.9976) / 1e-4
    assert niu.values[0] == pytest.approx(red, abs=1e-6)
    assert chen.cells == ()  # exact differences of equal decimals, and numbers printed twice
    assert chen.exact > 10
    assert np.isnan(chen.probability)


def test_residuals_lie_within_half_a_unit():
    ledger = build(["niu2024/table-2"])
    assert np.abs(residuals(ledger, "niu2024").values).max() <= 0.5
