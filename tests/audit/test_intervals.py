"""Interval arithmetic: it keeps every solution, it is sharp, and it rounds outwards."""

import math
from fractions import Fraction

import numpy as np
import pytest
from made_up import declared, printed_cell

from reproduce.audit.intervals import EVERYTHING, _add, _contractor, _multiply, _quotients

# Formulas for z, with plain ones beside them and where x and y are drawn.
FORMULAS = {
    "x + y": (lambda x, y: x + y, (-9, 9), (-9, 9)),
    "x - y": (lambda x, y: x - y, (-9, 9), (-9, 9)),
    "x * y": (lambda x, y: x * y, (-9, 9), (-9, 9)),
    "x / y": (lambda x, y: x / y, (-9, 9), (-9, 9)),
    "x ** 2 + y": (lambda x, y: x**2 + y, (-9, 9), (-9, 9)),
    "x ** 3 - y ** 4": (lambda x, y: x**3 - y**4, (-3, 3), (-3, 3)),
    "-abs(x) * y": (lambda x, y: -abs(x) * y, (-9, 9), (-9, 9)),
    "sqrt(x) / y": (lambda x, y: math.sqrt(x) / y, (0, 9), (1, 9)),
    "sin(x) - y": (lambda x, y: math.sin(x) - y, (-1.5, 1.5), (-9, 9)),
    "tan(x) + y": (lambda x, y: math.tan(x) + y, (-1.5, 1.5), (-9, 9)),
    "2 * atan(x / y)": (lambda x, y: 2 * math.atan(x / y), (-9, 9), (1, 9)),
    "min(x, y)": (min, (-9, 9), (-9, 9)),
    "max(x, y)": (max, (-9, 9), (-9, 9)),
}


def narrowed(formula, **boxes):
    """Narrow intervals of x, y and so on by a formula."""
    cells = {f"t#{name}": printed_cell(f"t#{name}", "1") for name in boxes}
    bound = " ".join(f"{name}=t#{name}" for name in boxes)
    line = f'name = "r", formula = "{formula}", cells = "{bound}", kind = "equation", source = "s"'
    (relation,) = declared(f"[relations]\nall = [{{ {line} }}]", cells)
    found = _contractor(relation)((*boxes.values(), (0.0, 0.0), (0.0, 0.0)))
    return None if found is None else dict(zip(boxes, found, strict=False))


@pytest.mark.parametrize("formula", FORMULAS)
def test_no_solution_is_lost(formula):
    """Boxes are drawn around solutions, one side of some open to infinity."""
    function, x_range, y_range = FORMULAS[formula]
    rng = np.random.default_rng(len(formula))
    for _ in range(300):
        x, y = float(rng.uniform(*x_range)), float(rng.uniform(*y_range))
        point = {"x": x, "y": y, "z": function(x, y)}
        sizes = rng.choice([0.0, 1e-9, 0.1, 2.0, math.inf], (3, 2), p=[0.2, 0.2, 0.3, 0.2, 0.1])
        room = 1e-12 * max(1.0, *map(abs, point.values()))  # the point itself is rounded
        boxes = {
            name: (value - room - float(low), value + room + float(high))
            for (name, value), (low, high) in zip(point.items(), sizes, strict=True)
        }
        found = narrowed(f"z = {formula}", **boxes)
        assert found is not None
        for name, value in point.items():
            assert found[name][0] <= value <= found[name][1]
            assert boxes[name][0] <= found[name][0] <= found[name][1] <= boxes[name][1]


@pytest.mark.parametrize(
    ("formula", "boxes", "name", "wanted"),
    [
        ("z = x ** 2", {"z": (4, 9), "x": (-2.5, 9)}, "x", (-2.5, 3)),
        ("z = x ** 2", {"z": (4, 9), "x": (-1, 9)}, "x", (2, 3)),
        ("z = x ** 2", {"z": (-9, 99), "x": (-3, 2)}, "z", (0, 9)),
        ("z = x ** 3", {"z": (-8, 27), "x": EVERYTHING}, "x", (-2, 3)),
        ("z = abs(x)", {"z": (1, 2), "x": (-9, 0.5)}, "x", (-2, -1)),
        ("z = x / y", {"z": EVERYTHING, "x": (1, 2), "y": (0, 4)}, "z", (0.25, math.inf)),
        ("1 = z * y", {"z": (-5, 9), "y": (-0.5, 0.25)}, "z", (-5, 9)),
        ("1 = z * y", {"z": (-1, 9), "y": (-0.5, 0.25)}, "z", (4, 9)),
        ("abs(z / y - 1) <= 1", {"z": (1, 1), "y": EVERYTHING}, "y", (0.5, math.inf)),
        ("z = sin(x)", {"z": EVERYTHING, "x": (0.2, 0.5)}, "z", (math.sin(0.2), math.sin(0.5))),
        ("z = sin(x)", {"z": (0.6, 0.7), "x": (0, 1)}, "x", (math.asin(0.6), math.asin(0.7))),
        ("z = tan(x)", {"z": (-1, 1), "x": (-2, 4)}, "x", (-math.pi / 4, math.pi / 4)),
        ("z = sqrt(x)", {"z": (-5, 2), "x": (-1, 9)}, "x", (0, 4)),
        ("z = max(x, y)", {"z": (5, 6), "x": (0, 9), "y": (0, 4)}, "x", (5, 6)),
        ("z = min(x, y)", {"z": (5, 6), "x": (0, 9), "y": (7, 9)}, "x", (5, 6)),
        ("z <= x", {"z": (0, 5), "x": (-1, 3)}, "z", (0, 3)),
        ("z >= x", {"z": (0, 5), "x": (1, 9)}, "z", (1, 5)),
    ],
)  # fmt: skip
def test_what_is_left_is_sharp(formula, boxes, name, wanted):
    assert narrowed(formula, **boxes)[name] == pytest.approx(wanted, rel=1e-12)


@pytest.mark.parametrize(
    ("formula", "boxes"),
    [
        ("z = x ** 2", {"z": (-9, -1), "x": EVERYTHING}),
        ("z = sqrt(x)", {"z": EVERYTHING, "x": (-2, -1)}),
        ("z = sin(x)", {"z": (1.1, 2), "x": (0, 1)}),
        ("1 = z * y", {"z": EVERYTHING, "y": (0, 0)}),
        ("z <= x", {"z": (2, 3), "x": (0, 1.999)}),
    ],
)
def test_what_cannot_hold_leaves_nothing(formula, boxes):
    assert narrowed(formula, **boxes) is None


def test_sums_products_and_quotients_enclose_the_exact_result():
    """Held against fractions: outwards, by a few floats at most."""
    rng = np.random.default_rng(1)
    for x, y in (rng.normal(size=(500, 2)) * 10.0 ** rng.integers(-9, 9, (500, 2))).tolist():
        p, q = Fraction(x), Fraction(y)
        for exact, (start, end) in (
            (p + q, _add((x, x), (y, y))),
            (p * q, _multiply((x, x), (y, y))),
            (p / q, _quotients((x, x), (y, y))[0]),
        ):
            assert Fraction(start) <= exact <= Fraction(end)
            assert end - start <= 6 * math.ulp(float(exact))
        if Fraction(x + y) == p + q:
            assert _add((x, x), (y, y)) == (x + y, x + y)
