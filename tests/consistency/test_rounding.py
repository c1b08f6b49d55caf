"""Values that a printed number stands for: rounding rules, about, bounds, counts."""

from decimal import ROUND_CEILING, ROUND_DOWN, ROUND_HALF_EVEN, ROUND_HALF_UP, Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reproduce.consistency.examine import _rounding_interval
from reproduce.printed.cells import library
from reproduce.printed.inputs import load_inputs as given_cells
from reproduce.printed.number import PrintedNumber, si_factor


@pytest.mark.parametrize(
    ("text", "qualifier", "rule", "wanted"),
    [
        ("2.0", "", "truncation", (2.0, 2.1)),
        ("-2.0", "", "truncation", (-2.1, -2.0)),
        ("0.0", "", "truncation", (-0.1, 0.1)),
        ("2.0", "", "ceiling", (1.9, 2.0)),
        ("-2.0", "", "ceiling", (-2.1, -2.0)),
        ("2.1", "about", "ceiling", (2.0, 2.2)),
        ("2.0", "about", "digits", (1.95, 2.05)),
        ("4", "within", "digits", (4.0, 4.0)),
        ("2.0", "less", "truncation", (2.0, 2.0)),
        ("2.0", "nominal", "truncation", (1.9, 2.1)),
    ],
)
def test_intervals_of_print(text, qualifier, rule, wanted):
    found = _rounding_interval(PrintedNumber(text, qualifier=qualifier), rule)
    assert found == pytest.approx(wanted)


def test_the_ledger_and_the_audit_take_the_same_interval_for_every_printed_number():
    cells = [c for t in library().values() for c in t.cells if c.is_number]
    assert {c.number.qualifier for c in cells} > {"", "about", "nominal"}
    for cell in (cell for cell in cells if not cell.number.is_bound):
        ends = _rounding_interval(cell.number)
        assert ends == cell.number.interval()
        inputs = given_cells([cell.address])
        for side, end in zip((-1.0, 1.0), ends, strict=True):
            moved = inputs.shifted({cell.address: side})[cell.address]
            assert moved == pytest.approx(end * si_factor(cell.unit), rel=1e-12)


@given(
    st.decimals(min_value=-99, max_value=99, places=4),
    st.sampled_from(["0.01", "0.1", "1"]),
)
def test_rules_are_those_of_decimal_arithmetic(value, step):
    """The interval of the digits that the decimal module prints contains the value."""
    for rounding, rule in (
        (ROUND_HALF_UP, ""),
        (ROUND_HALF_EVEN, ""),
        (ROUND_DOWN, "truncation"),
        (ROUND_CEILING, "ceiling"),
    ):
        text = str(value.quantize(Decimal(step), rounding=rounding))
        low, high = _rounding_interval(PrintedNumber(text), rule)
        assert low - 1e-9 <= float(value) <= high + 1e-9
