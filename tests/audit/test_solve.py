"""Intervals through relations: sharp, both ways, and from one relation to the next."""

import math

import pytest
from made_up import declared, printed_cell

from reproduce.audit.intervals import contract, projection, propagate


def relations(*formulas, cells, unknown=""):
    lines = [
        f'{{ name = "r{i}", formula = "{formula}", cells = "{bound}", source = "s", '
        f'kind = "equation"{unknown} }}'
        for i, (formula, bound) in enumerate(formulas)
    ]
    head = '[unknown]\nf = { unit = "1", low = 0, high = 1000, label = "factor" }\n'
    sheet = {f"t#{name}": printed_cell(f"t#{name}", "1.0") for name in cells}
    return declared(f"{head}[relations]\nall = [{', '.join(lines)}]", sheet)


def test_contraction_goes_both_ways():
    (relation,) = relations(("a = b + c", "a=t#a b=t#b c=t#c"), cells="abc")
    found = contract(relation, {"t#a": (0.0, 5.0), "t#b": (2.0, 9.0), "t#c": (1.0, 9.0)})
    assert found["t#a"] == pytest.approx((3.0, 5.0))
    assert found["t#b"] == pytest.approx((2.0, 4.0))
    assert found["t#c"] == pytest.approx((1.0, 3.0))


def test_what_cannot_hold_leaves_nothing():
    (relation,) = relations(("a = b + c", "a=t#a b=t#b c=t#c"), cells="abc")
    assert contract(relation, {"t#a": (0.0, 2.9), "t#b": (2.0, 9.0), "t#c": (1.0, 9.0)}) is None


@pytest.mark.parametrize(
    ("formula", "function"),
    [("a = atan(b / c)", math.atan2), ("a = sqrt(b * c)", lambda b, c: math.sqrt(b * c))],
)
def test_ends_of_a_monotone_formula_are_its_corners(formula, function):
    (relation,) = relations((formula, "a=t#a b=t#b c=t#c"), cells="abc")
    b, c = (2.0, 2.5), (3.0, 3.5)
    found = contract(relation, {"t#a": (-9.0, 9.0), "t#b": b, "t#c": c})
    corners = [function(x, y) for x in b for y in c]
    assert found["t#a"] == pytest.approx((min(corners), max(corners)))


def test_projection_is_the_interval_of_the_unknown():
    (relation,) = relations(("a = f * b", "a=t#a b=t#b"), cells="ab", unknown=', unknown = "f"')
    found = projection(relation, {"t#a": (6.0, 8.0), "t#b": (2.0, 2.5)})
    assert found == pytest.approx((2.4, 4.0))
    assert projection(relation, {"t#a": (-8.0, -6.0), "t#b": (2.0, 2.5)}) is None


def test_propagation_sees_what_no_relation_sees_alone():
    """a <= b, b <= c, c <= a - 1: any two can hold, all three cannot."""
    circle = relations(
        ("a <= b", "a=t#a b=t#b"),
        ("b <= c", "b=t#b c=t#c"),
        ("c <= a - 1", "c=t#c a=t#a"),
        cells="abc",
    )
    boxes = {f"t#{name}": (0.0, 3.0) for name in "abc"}
    assert all(contract(relation, boxes) for relation in circle)
    assert propagate(circle, boxes) is None
    assert propagate(circle[:2], boxes) is not None
