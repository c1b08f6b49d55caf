"""Formulas: what is read, what is refused, and how dimensions are guarded."""

import math

import pytest

from reproduce.audit.formula import FormulaError, read
from reproduce.audit.relation import declared
from reproduce.audit.rounding import printed_cell

CELLS = {
    a: printed_cell(a, text, unit)
    for a, text, unit in [
        ("t#1.length", "2.0", "m"),
        ("t#2.length", "4.0", "m"),
        ("t#1.time", "3.0", "s"),
        ("t#1.angle", "0.5", "deg"),
    ]
}


def test_functions_take_lists_and_units():
    values = {"a": [3.0, 4.0], "b": 2.0}
    assert read("b = rms(a)").right(values) == pytest.approx(12.5**0.5)
    assert read("b = mean(a) + count(a)").right(values) == 5.5
    assert read("b = max(a, b) - min(a, b)").right(values) == 2.0
    assert read("b = -a ** 2").right({"a": 3.0}) == -9.0
    assert read("b = 2 * u.um").right({}) == pytest.approx(2e-6)


@pytest.mark.parametrize(
    "text",
    [
        "a + b",
        "a = b = c",
        "a < b",
        "a = __import__('os')",
        "a = b.real",
        "a = [1]",
        "a = b ** c",
        "a = u.parsec",
        "a = sqrt()",
        "a = 'text'",
        "a = (",
    ],
)
def test_what_cannot_be_read_is_refused(text):
    with pytest.raises(FormulaError, match="expected"):
        read(text)


@pytest.mark.parametrize(
    ("formula", "cells", "complaint"),
    [
        ("a = b", {"a": "t#1.length", "b": "t#1.time"}, "left side is"),
        ("a = b + c", {"a": "t#1.length", "b": "t#1.length", "c": "t#1.time"}, "Cannot convert"),
        ("a = tan(b)", {"a": "t#1.angle", "b": "t#1.length"}, "Cannot convert"),
        ("a = b", {"a": "t#1.length"}, "only once"),
        ("a = a", {"a": "t#1.length", "b": "t#1.time"}, "only once"),
        ("a = b", {"a": "t#1.length", "b": "t#9.length"}, "no printed number at"),
        ("a = sum(b)", {"a": "t#1.length", "b": "t#9.*"}, "no printed number matches"),
    ],
)
def test_wrong_declarations_are_refused(formula, cells, complaint):
    with pytest.raises(FormulaError, match=complaint):
        declared(line(formula=formula, cells=" ".join(map("=".join, cells.items()))), CELLS)


def test_names_are_unique_and_kinds_known():
    twice = line().removesuffix("]") + ", " + line().partition("[ ")[2]
    with pytest.raises(FormulaError, match="twice"):
        declared(twice, CELLS)
    with pytest.raises(FormulaError, match="unknown kind"):
        declared(line(kind="guess"), CELLS)
    with pytest.raises(FormulaError, match="unknown reading"):
        declared(line(reading="fourth"), CELLS)


def test_a_difference_in_a_denominator_has_a_dimension():
    cells = "a=t#1.time b=t#1.length c=t#2.length"
    (found,) = declared(line(formula="a = a * (b + c) / (b - c)", cells=cells), CELLS)
    assert found.sides({"t#1.time": 3.0, "t#1.length": 2.0, "t#2.length": 4.0})[1] == -9.0


def test_only_the_cell_that_a_formula_is_solved_for_can_be_restated():
    found = declared(line(formula="a = b", restates="t#1.length (one reading)"), CELLS)
    assert found[0].restates == "t#1.length (one reading)"
    for formula, restated in (("a = b", "t#2.length"), ("a <= b", "t#1.length")):
        with pytest.raises(FormulaError, match="solved for"):
            declared(line(formula=formula, restates=restated), CELLS)


def line(**changes):
    entry = {"name": "n", "formula": "a <= b", "cells": "a=t#1.length b=t#2.length"}
    entry |= {"source": "s", "kind": "order"} | changes
    inside = ", ".join(f'{key} = "{value}"' for key, value in entry.items() if value)
    return f"[relations]\nall = [ {{ {inside} }} ]"


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"sorce": "x"}, "unknown keys"),
        ({"source": ""}, "missing"),
        ({"unknown": "f"}, "no unknown called"),
        ({"tolerance": "f"}, "no tolerance called"),
    ],
)
def test_wrong_lines_are_refused(changes, complaint):
    assert [r.name for r in declared(line(), CELLS)] == ["n"]
    with pytest.raises(FormulaError, match=complaint):
        declared(line(**changes), CELLS)


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
    with pytest.raises(FormulaError, match="put every placeholder"):
        declared(text.replace("less-{i}-{j}", "less"), CELLS)


@pytest.mark.parametrize(
    ("text", "plain"),
    [
        ("-x ** 3 + 2 * y / 3 * u.arcsec", lambda x, y: -(x**3) + 2 * y / 3 * math.pi / 648000),
        (
            "sqrt(abs(x)) - atan(y) * sin(x) + cos(x) * tan(y)",
            lambda x, y: math.sqrt(-x) - math.atan(y) * math.sin(x) + math.cos(x) * math.tan(y),
        ),
        ("rms(list)", lambda x, y: math.hypot(3.0, 4.1, 0.7) / math.sqrt(3)),
        ("mean(list, x) - sum(list) * count(list)", lambda x, y: (x - 0.4) / 4 + 0.4 * 3),
        ("min(list) - max(x, y)", lambda x, y: -4.1 - y),
        ("mean(mean, values)", lambda x, y: (5.5 + 6.25) / 2),  # cells called as functions are
    ],
)
def test_a_formula_gives_what_python_gives(text, plain):
    values = {"x": -1.7, "y": 0.3, "z": 2.0, "list": [3.0, -4.1, 0.7], "mean": 5.5, "values": 6.25}
    formula = read(f"z = {text}")
    assert formula.left(values) == 2.0
    assert formula.right(values) == pytest.approx(plain(-1.7, 0.3), rel=1e-12)


def test_a_power_without_end_is_refused_at_once():
    with pytest.raises(OverflowError):
        read("a = 9 ** 99999999").right({})
