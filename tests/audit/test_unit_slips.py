"""A unit is mistaken for one of the same kind: a length for a length, an angle for an angle."""

import pint
import pytest
from made_up import PINT, printed_cell

from reproduce.audit.corrections import _of_cell
from reproduce.printed.number import UNITS


@pytest.mark.parametrize(
    ("unit", "likely", "never"),
    [
        ("mm", {"nm", "um", "m", "km"}, {"s", "deg", "Hz", "mm"}),
        ("arcsec", {"deg"}, {"1", "mm", "arcsec"}),
        ("s", {"ms", "min"}, {"Hz", "m"}),
        ("px", set(), {"1", "mm"}),
    ],
)
def test_a_slip_of_the_unit_stays_within_its_kind(unit, likely, never):
    slips = [slip for slip in _of_cell(printed_cell("t#1.a", "5.0", unit)) if slip.kind == "unit"]
    found = {printed.unit for slip in slips for _, printed in slip.changes}
    assert likely <= found
    assert not never & found


def test_every_unit_with_another_of_its_dimension_can_slip():
    """Pure numbers apart, which no pen gives another unit."""
    registry = pint.application_registry
    dimensions = {u: registry.Quantity(1.0, PINT.get(u, u)).dimensionality for u in UNITS}
    for unit, dimension in dimensions.items():
        if dimension and unit != "px":
            alike = {u for u, other in dimensions.items() if other == dimension and u != unit}
            slips = [s for s in _of_cell(printed_cell("t#1.a", "5.0", unit)) if s.kind == "unit"]
            assert {changed.unit for s in slips for _, changed in s.changes} == alike
