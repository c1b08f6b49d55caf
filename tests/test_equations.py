"""Equations: implemented once, cited by items, and shown in the book with their functions."""

import ast
import re
from collections import defaultdict
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
BOOK = [path.read_text(encoding="utf-8") for path in (ROOT / "book").glob("*/*.md")]


def docstrings(node, prefix):
    """Yield the names and docstrings of the public functions, classes and methods."""
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.FunctionDef | ast.ClassDef) and child.name[0] != "_":
            name = f"{prefix}.{child.name}"
            yield name, ast.get_docstring(child) or ""
            yield from docstrings(child, name)


DOCSTRINGS = {}
for path in PHYSICS.rglob("*.py"):
    parts = path.relative_to(PHYSICS).with_suffix("").parts
    tree = ast.parse(path.read_text(encoding="utf-8"))
    DOCSTRINGS |= dict(docstrings(tree, ".".join(["reproduce.physics", *parts])))


def claims(text):
    """Return the equations that a docstring claims to implement."""
    found = CLAIM.findall(text)
    return {f"{paper}-{n}" for paper, group in found for n in re.findall(r"\d+", group)}


IMPLEMENTED = defaultdict(set)
for name, text in DOCSTRINGS.items():
    for equation in claims(text):
        IMPLEMENTED[equation].add(name)


def test_every_equation_is_implemented_once():
    assert claims("Implements: niu2024 (17), (18).") == {"niu2024-17", "niu2024-18"}
    assert claims("Printed form of niu2024 (24).") == set()
    # A claim in another form would be lost.
    assert [
        n for n, text in DOCSTRINGS.items() if "Implements" in text and not claims(text)
    ] == []
    niu = {f"niu2024-{number}" for number in range(1, 27)}
    chen = {f"chen2023-{number}" for number in range(1, 12)}
    assert set(IMPLEMENTED) == niu | chen
    several = {name: len(by) for name, by in IMPLEMENTED.items() if len(by) > 1}
    assert several == {"niu2024-25": 2}, "(25) defines two matrices"
    computations = [one for item in catalogue().values() for one in item.computations]
    cited = {
        f"{c.key.partition('/')[0]}-{n}" for c in computations for n in c.equations
    }
    assert set() < cited <= set(IMPLEMENTED)


def test_the_book_shows_each_equation_with_its_function():
    pages = {label: text for text in BOOK for label in LABEL.findall(text)}
    for equation, functions in IMPLEMENTED.items():
        assert functions & set(LINK.findall(pages[equation])), equation
    forms = [form for text in DOCSTRINGS.values() for form in PRINTED.findall(text)]
    assert set(pages) - set(IMPLEMENTED) <= {f"{p}-{n}-printed" for p, n in forms}
    assert {link for text in BOOK for link in LINK.findall(text)} <= set(DOCSTRINGS)
