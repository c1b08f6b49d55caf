"""Formulas: what is read, what is refused, and how dimensions are guarded."""

import pytest

from reproduce.audit.declared import declared
from reproduce.audit.formula import FormulaError, evaluate, read
from reproduce.audit.quantity import quantity
from reproduce.audit.relation import Book

CELLS = {
    a: quantity(a, text, unit)
    for a, text, unit in [
        ("t#1.length", "2.0", "m"),
        ("t#2.length", "4.0", "m"),
        ("t#1.time", "3.0", "s"),
        ("t#1.angle", "0.5", "deg"),
    ]
}


def test_functions_take_lists_and_units():
    values = {"a": [3.0, 4.0], "b": 2.0}
    assert evaluate(read("b = rms(a)").right, values) == pytest.approx(12.5**0.5)
    assert evaluate(read("b = mean(a) + count(a)").right, values) == 5.5
    assert evaluate(read("b = max(a, b) - min(a, b)").right, values) == 2.0
    assert evaluate(read("b = -a ** 2").right, {"a": 3.0}) == -9.0
    assert evaluate(read("b = 2 * u.um").right, {}) == pytest.approx(2e-6)


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
        Book(CELLS).relate("name", formula, "source", "definition", cells)


def test_names_are_unique_and_kinds_known():
    book = Book(CELLS)
    cells = {"a": "t#1.length", "b": "t#2.length"}
    book.relate("name", "a <= b", "source", "order", cells)
    with pytest.raises(FormulaError, match="twice"):
        book.relate("name", "a <= b", "source", "order", cells)
    with pytest.raises(FormulaError, match="unknown kind"):
        book.relate("other", "a <= b", "source", "guess", cells)


def line(**changes):
    entry = {"name": "n", "formula": "a <= b", "cells": "a=t#1.length b=t#2.length"}
    entry |= {"source": "s", "kind": "order"} | changes
    inside = ", ".join(f'{key} = "{value}"' for key, value in entry.items() if value)
    return f"[relations]\nall = [{{ {inside} }}]"


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
    name = "less"
    formula = "a <= b"
    cells = "a=t#{i}.length b=t#{j}.length"
    each = { "i,j" = [["1", "2"], ["2", "1"]] }
    source = "s"
    kind = "order"
    """
    found = declared(text, CELLS)
    assert [r.name for r in found] == ["less-1-2", "less-2-1"]
    assert found[1].addresses == ("t#2.length", "t#1.length")


@pytest.mark.parametrize(
    "text",
    [
        "z = -x ** 3 + 2 * y / 3 * u.arcsec",
        "z = sqrt(abs(x)) - atan(y) * sin(x) + cos(x) * tan(y)",
        "z = rms(list) + mean(list, x) - sum(list) * count(list)",
        "z = min(list) - max(x, y)",
        "z = mean(mean, values)",  # cells that are called as functions are
    ],
)
def test_a_compiled_side_says_what_evaluation_says(text):
    values = {"x": -1.7, "y": 0.3, "z": 2.0, "list": [3.0, -4.1, 0.7], "mean": 5.5, "values": 6.25}
    formula = read(text)
    left, right = formula.plain
    assert left(values) == evaluate(formula.left, values) == 2.0
    assert right(values) == evaluate(formula.right, values)
