"""Equations: the cited ones are implemented, and the book shows each with its function."""

import ast
import re
from pathlib import Path

from reproduce.papers.catalogue import catalogue

ROOT = Path(__file__).parent.parent
PHYSICS = ROOT / "src" / "reproduce" / "physics"
CLAIM = re.compile(
    r"^\s*Implements: (niu2024|chen2023) ((?:\(\d+\)(?:, | and |\.))+)", re.MULTILINE
)
PRINTED = re.compile(r"Printed form of (niu2024|chen2023) \((\d+)\)")
LABEL = re.compile(r"^\$\$ ?\(((?:niu2024|chen2023)-[a-z0-9-]+)\)", re.MULTILINE)
LINK = re.compile(r"\{py:(?:func|meth|class)\}`~?(reproduce\.physics[\w.]+)`")


def docstrings(node, prefix):
    """Yield the full name and the docstring of public functions, classes and methods."""
    for child in ast.iter_child_nodes(node):
        kind = isinstance(child, ast.FunctionDef | ast.ClassDef)
        if kind and not child.name.startswith("_"):
            name = f"{prefix}.{child.name}"
            yield name, ast.get_docstring(child) or ""
            yield from docstrings(child, name)


def claims(text):
    """Return the equations that a docstring implements."""
    return {
        f"{paper}-{number}"
        for paper, numbers in CLAIM.findall(text)
        for number in re.findall(r"\d+", numbers)
    }


TEXTS = {
    name: text
    for path in sorted(PHYSICS.rglob("*.py"))
    for name, text in docstrings(
        ast.parse(path.read_text(encoding="utf-8")),
        ".".join(
            ("reproduce.physics", *path.relative_to(PHYSICS).with_suffix("").parts)
        ),
    )
}
IMPLEMENTED = {
    equation: [name for name, text in TEXTS.items() if equation in claims(text)]
    for equation in sorted(set().union(*map(claims, TEXTS.values())))
}
PAGES = {
    path: path.read_text(encoding="utf-8")
    for path in sorted((ROOT / "book").glob("*/*.md"))
}
SHOWN = {label: path for path, text in PAGES.items() for label in LABEL.findall(text)}


def test_every_claim_is_parsed():
    """A docstring that states Implements in another form would claim nothing."""
    assert claims("Implements: niu2024 (17), (18).") == {"niu2024-17", "niu2024-18"}
    assert claims("Printed form of niu2024 (24).") == set()
    for name, text in TEXTS.items():
        assert claims(text) or "Implements" not in text, name


def test_every_equation_of_both_papers_is_implemented_once():
    """Except for (25) of niu2024, which defines two matrices, each a separate function."""
    niu = {f"niu2024-{n}" for n in range(1, 27)}
    assert set(IMPLEMENTED) == niu | {f"chen2023-{n}" for n in range(1, 12)}
    cited = {
        f"{computation.key.partition('/')[0]}-{number}"
        for item in catalogue().values()
        for computation in item.computations
        for number in computation.equations
    }
    assert set(IMPLEMENTED) >= cited != set()
    several = {e: len(names) for e, names in IMPLEMENTED.items() if len(names) > 1}
    assert several == {"niu2024-25": 2}


def test_the_book_shows_each_equation_with_its_function_and_no_other():
    printed = {
        f"{paper}-{number}-printed"
        for text in TEXTS.values()
        for paper, number in PRINTED.findall(text)
    }
    assert set(SHOWN) <= set(IMPLEMENTED) | printed
    for equation, functions in IMPLEMENTED.items():
        links = set(LINK.findall(PAGES[SHOWN[equation]]))
        assert links & set(functions), equation
    for path, text in PAGES.items():
        assert set(LINK.findall(text)) <= set(TEXTS), path.name
