"""Formulas and declarations: what is read, and what of a line is refused."""

import math

import pytest
from made_up import declared, printed_cell

from reproduce.consistency.relation import Formula

CELLS = {
    a: printed_cell(a, text, unit)
    for a, text, unit in [
        ("t#1.length", "2.0", "m"),
        ("t#2.length", "4.0", "m"),
        ("t#1.time", "3.0", "s"),
    ]
}


def right(text, **values):
    return Formula(text).values(values)[1]


def test_functions_take_lists_and_units():
    assert right("a = rms(a)", a=[3.0, 4.0]) == pytest.approx(12.5**0.5)
    assert right("b = mean(a) + count(a)", a=[3.0, 4.0], b=2.0) == 5.5
    assert right("b = max(a, b) - min(a, b)", a=[3.0, 4.0], b=2.0) == 2.0
    assert right("b = -a ** 2", a=3.0, b=0.0) == -9.0
    assert right("b = 2 * u.um", b=0.0) == pytest.approx(2e-6)


def line(**changes):
    entry = {"name": "n", "formula": "a <= b", "cells": "a=t#1.length b=t#2.length"}
    entry |= {"source": "s", "kind": "order"} | changes
    inside = ", ".join(f'{key} = "{value}"' for key, value in entry.items() if value)
    return f"[relations]\nall = [ {{ {inside} }} ]"


def test_wrong_lines_are_refused():
    assert [r.name for r in declared(line(), CELLS)] == ["n"]
    for changes, named in (
        ({"cells": "a=t#1.length"}, "b"),
        ({"formula": "a = a"}, "b"),
        ({"cells": "a=t#1.length b=t#9.length"}, "t#9.length"),
        ({"formula": "a = sum(b)", "cells": "a=t#1.length b=t#9.*"}, "t#9"),
        ({"formula": "a + b"}, "unpack"),
        ({"formula": "a = b = a"}, "unpack"),
        ({"sorce": "x"}, "sorce"),
        ({"source": ""}, "source"),
        ({"kind": "guess"}, "kind"),
        ({"reading": "fourth"}, "reading"),
    ):
        with pytest.raises(ValueError, match=named):
            declared(line(**changes), CELLS)


def test_names_are_unique():
    twice = line().removesuffix("]") + ", " + line().partition("[ ")[2]
    with pytest.raises(ValueError, match="twice"):
        declared(twice, CELLS)


def test_only_the_cell_that_a_formula_is_solved_for_can_be_restated():
    found = declared(line(formula="a = b", restates="t#1.length (one reading)"), CELLS)
    assert found[0].restates == "t#1.length (one reading)"
    for formula, restated in (("a = b", "t#2.length"), ("a <= b", "t#1.length")):
        with pytest.raises(ValueError, match="solved for"):
            declared(line(formula=formula, restates=restated), CELLS)


def test_placeholders_make_one_relation_each():
    text = """
    [[relations.all]]
    name = "less-{i}-{j}"
    formula = "a <= b"
    cells = "a=t#{i}.length b=t#{j}.length"
    each = { "i,j" = [["1", "2"], ["2", "1"]] }
    source = "s"
    kind = "order"
    """
    found = declared(text, CELLS)
    assert [r.name for r in found] == ["less-1-2", "less-2-1"]
    assert {r.declared for r in found} == {"less-{i}-{j}"}
    assert found[1].addresses == ("t#2.length", "t#1.length")
    with pytest.raises(ValueError, match="twice"):
        declared(text.replace("less-{i}-{j}", "less"), CELLS)


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        (
            "-x ** 3 + 2 * y / 3 * u.arcsec",
            lambda x, y: -(x**3) + 2 * y / 3 * math.pi / 648000,
        ),
        (
            "sqrt(abs(x)) - atan(y) * sin(x) + tan(y)",
            lambda x, y: math.sqrt(-x) - math.atan(y) * math.sin(x) + math.tan(y),
        ),
        ("rms(list)", lambda x, y: math.hypot(3.0, 4.1, 0.7) / math.sqrt(3)),
        (
            "mean(list, x) - sum(list) * count(list)",
            lambda x, y: (x - 0.4) / 4 + 0.4 * 3,
        ),
        ("min(list) - max(x, y)", lambda x, y: -4.1 - y),
    ],
)
def test_a_formula_gives_what_python_gives(text, plain):
    values = {"x": -1.7, "y": 0.3, "z": 2.0, "list": [3.0, -4.1, 0.7]}
    assert right(f"z = {text}", **values) == pytest.approx(plain(-1.7, 0.3), rel=1e-12)
