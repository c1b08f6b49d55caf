"""Equations: those that items cite are implemented, and the book shows each with its function."""

import ast
import re
from pathlib import Path

from reproduce.papers.catalogue import catalogue

ROOT = Path(__file__).parent.parent
PHYSICS = ROOT / "src" / "reproduce" / "physics"
BOOK = ROOT / "book"
CLAIM = re.compile(
    r"^\s*Implements: (niu2024|chen2023) ((?:\(\d+\)(?:, | and |\.))+)", re.MULTILINE
)
PRINTED = re.compile(r"Printed form of (niu2024|chen2023) \((\d+)\)")
LABEL = re.compile(r"^\$\$ ?\(((?:niu2024|chen2023)-[a-z0-9-]+)\)", re.MULTILINE)


def docstrings():
    """Yield the full name and the docstring of every public function, class and method."""
    for path in sorted(PHYSICS.rglob("*.py")):
        inner = path.relative_to(PHYSICS).with_suffix("").parts
        module = ".".join(["reproduce.physics", *inner])
        yield from _inside(ast.parse(path.read_text(encoding="utf-8")), module)


def _inside(node, prefix):
    for child in ast.iter_child_nodes(node):
        if isinstance(
            child, ast.FunctionDef | ast.ClassDef
        ) and not child.name.startswith("_"):
            name = f"{prefix}.{child.name}"
            yield name, ast.get_docstring(child) or ""
            yield from _inside(child, name)


def claims(text):
    """Return the equations that a docstring says it implements."""
    return {
        f"{paper}-{number}"
        for paper, numbers in CLAIM.findall(text)
        for number in re.findall(r"\d+", numbers)
    }


IMPLEMENTED: dict[str, list[str]] = {}
for _name, _text in docstrings():
    for _equation in claims(_text):
        IMPLEMENTED.setdefault(_equation, []).append(_name)
CITED = {
    f"{computation.key.partition('/')[0]}-{number}"
    for item in catalogue().values()
    for computation in item.computations
    for number in computation.equations
}
PAGES = {path: path.read_text(encoding="utf-8") for path in sorted(BOOK.glob("*/*.md"))}
SHOWN = {label: path for path, text in PAGES.items() for label in LABEL.findall(text)}


def test_claims_are_read():
    assert claims("Implements: niu2024 (17), (18).") == {"niu2024-17", "niu2024-18"}
    assert claims("Printed form of niu2024 (24).") == set()


def test_cited_equations_are_implemented():
    assert set(IMPLEMENTED) >= CITED != set()


def test_nearly_every_equation_of_both_papers_is_implemented():
    niu = {f"niu2024-{n}" for n in range(1, 27)}
    chen = {f"chen2023-{n}" for n in range(1, 12)}
    assert set(IMPLEMENTED) == niu | chen


def test_every_equation_of_niu2024_is_implemented_once():
    """But for (25), which defines two matrices, each a function of its own."""
    many = {
        e: n for e, n in IMPLEMENTED.items() if e.startswith("niu2024") and len(n) > 1
    }
    assert {e: len(names) for e, names in many.items()} == {"niu2024-25": 2}


def test_each_equation_of_chen2023_is_implemented_once():
    chen = {name: by for name, by in IMPLEMENTED.items() if name.startswith("chen2023")}
    assert {name: by for name, by in chen.items() if len(by) != 1} == {}


def test_every_mention_of_implementing_is_understood():
    """A docstring that says Implements in another form would silently claim nothing."""
    for name, text in docstrings():
        if "Implements" in text:
            assert claims(text), name


def test_the_book_shows_each_equation_beside_its_function():
    for equation, functions in IMPLEMENTED.items():
        page = PAGES[SHOWN[equation]]
        links = set(re.findall(r"\{py:(?:func|meth|class)\}`~?([\w.]+)`", page))
        assert links & set(functions), equation


def test_the_book_shows_no_equation_that_is_not_implemented():
    printed = {
        f"{paper}-{number}-printed"
        for _, text in docstrings()
        for paper, number in PRINTED.findall(text)
    }
    assert set(SHOWN) <= set(IMPLEMENTED) | printed


def test_links_from_the_book_lead_to_public_functions():
    public = {name for name, _ in docstrings()}
    for path, text in PAGES.items():
        for name in re.findall(
            r"\{py:(?:func|meth|class)\}`~?(reproduce\.physics[\w.]+)`", text
        ):
            assert name in public, f"{path.name}: {name}"
