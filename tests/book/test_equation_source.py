"""Tests of the links from equations to the functions that implement them."""

import ast
import re
from pathlib import Path

from equation_source import implementations

BOOK = Path(__file__).parent.parent.parent / "book"


def test_every_numbered_equation_of_the_papers_has_its_functions() -> None:
    pages = [path.read_text(encoding="utf-8") for path in BOOK.glob("*/*.md")]
    shown = {
        label
        for text in pages
        for label in re.findall(r"^\$\$ ?\(([^)]+)\)", text, re.M)
    }
    assert {label for label in shown if not label.startswith("book-")} == set(
        implementations()
    )


def test_the_text_is_that_of_a_whole_function() -> None:
    (rmse,) = implementations()["niu2024-26"]
    (function,) = ast.parse(rmse.text).body
    assert isinstance(function, ast.FunctionDef)
    assert function.name == rmse.name == "rmse"
    assert Path(rmse.path).read_text(encoding="utf-8").count(rmse.text) == 1


def test_what_a_class_claims_its_method_does() -> None:
    assert [one.name for one in implementations()["niu2024-17"]] == [
        "Registration.apply"
    ]


def test_printed_forms_are_told_apart() -> None:
    right = {one.name for one in implementations()["niu2024-24"]}
    printed = {one.name for one in implementations()["niu2024-24-printed"]}
    assert right
    assert printed
    assert not right & printed
