"""Formulas and declarations: values, and rejected lines."""

import math

import pytest
from made_up import declared, printed_cell

from reproduce.consistency._relation import Formula

CELLS = {
    a: printed_cell(a, text, unit)
    for a, text, unit in [
        ("t#1.length", "2.0", "m"),
        ("t#2.length", "4.0", "m"),
        ("t#1.time", "3.0", "s"),
    ]
}
X, Y, LIST = -1.7, 0.3, [3.0, -4.1, 0.7]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("-x ** 3 + 2 * y / 3 * u.arcsec", -(X**3) + 2 * Y / 3 * math.pi / 648000),
        (
            "sqrt(abs(x)) - atan(y) * sin(x) + tan(y)",
            math.sqrt(-X) - math.atan(Y) * math.sin(X) + math.tan(Y),
        ),
        ("rms(list)", math.hypot(*LIST) / math.sqrt(3)),
        ("mean(list, x) - sum(list) * count(list)", (X - 0.4) / 4 + 0.4 * 3),
        ("min(list) - max(x, y)", -4.1 - Y),
        ("-y ** 2 + 2 * u.um", -(Y**2) + 2e-6),
    ],
)
def test_a_formula_gives_the_value_of_python(text, expected):
    values = {"x": X, "y": Y, "z": 2.0, "list": LIST}
    right = Formula(f"z = {text}").values(values)[1]
    assert right == pytest.approx(expected, rel=1e-12)


def line(**changes):
    entry = {"name": "n", "formula": "a <= b", "cells": "a=t#1.length b=t#2.length"}
    entry |= {"source": "s", "kind": "order"} | changes
    inside = ", ".join(f'{key} = "{value}"' for key, value in entry.items() if value)
    return f"[relations]\nall = [ {{ {inside} }} ]"


def test_wrong_lines_are_rejected():
    assert [r.name for r in declared(line(), CELLS)] == ["n"]
    for changes, named in (
        ({"cells": "a=t#1.length"}, "b"),
        ({"formula": "a = a"}, "b"),
        ({"cells": "a=t#1.length b=t#9.length"}, "t#9.length"),
        ({"formula": "a + b"}, "unpack"),
        ({"sorce": "x"}, "sorce"),
        ({"kind": "guess"}, "kind"),
        ({"found_by": "fourth"}, "found_by"),
        ({"formula": "a = b", "restates": "t#2.length"}, "solved for"),
        ({"formula": "a <= b", "restates": "t#1.length"}, "solved for"),
    ):
        with pytest.raises(ValueError, match=named):
            declared(line(**changes), CELLS)
    twice = line().removesuffix("]") + ", " + line().partition("[ ")[2]
    with pytest.raises(ValueError, match="twice"):
        declared(twice, CELLS)
    (found,) = declared(line(formula="a = b", restates="t#1.length (a)"), CELLS)
    assert found.restates == "t#1.length (a)"


def test_placeholders_make_one_relation_each():
    text = """
    [[relations.all]]
    name = "less-{i}-{j}"
    formula = "a <= b"
    cells = "a=t#{i}.length b=t#{j}.length"
    each = { "i,j" = ["1,2", "2,1"] }
    source = "s"
    kind = "order"
    """
    found = declared(text, CELLS)
    assert [r.name for r in found] == ["less-1-2", "less-2-1"]
    assert found[1].addresses == ["t#2.length", "t#1.length"]
    with pytest.raises(ValueError, match="twice"):
        declared(text.replace("less-{i}-{j}", "less"), CELLS)
