"""Equations: implemented once, cited by items, and shown in the book with their functions."""

import ast
import re
from pkgutil import resolve_name

from places import ROOT

from equation_source import implementations
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import computations

LABEL = re.compile(r"^\$\$ ?\(((?:niu2024|chen2023)-[a-z0-9-]+)\)", re.MULTILINE)
LINK = re.compile(r"\{py:(?:func|meth|class)\}`~?(reproduce\.physics[\w.]+)`")
LOST = re.compile(r"Implements(?!: (niu2024|chen2023) \(\d+\))")
BOOK = [path.read_text(encoding="utf-8") for path in (ROOT / "book").glob("*/*.md")]


def test_every_equation_is_implemented_once():
    made = {n: [*by] for n, by in implementations().items() if "printed" not in n}
    niu = {f"niu2024-{number}" for number in range(1, 27)}
    chen = {f"chen2023-{number}" for number in range(1, 12)}
    assert set(made) == niu | chen
    several = {name: len(by) for name, by in made.items() if len(by) > 1}
    assert several == {"niu2024-25": 2}, "(25) defines two matrices"
    assert made["niu2024-17"][0].name == "Registration.apply"
    for path in (ROOT / "src/reproduce/physics").rglob("*.py"):
        assert not LOST.search(path.read_text(encoding="utf-8")), path
    (rmse,) = made["niu2024-26"]
    (function,) = ast.parse(rmse.text).body
    assert function.name == rmse.name == "rmse"
    every = [one for key in catalogue() for one in computations(key)]
    cited = {f"{c.key.partition('/')[0]}-{n}" for c in every for n in c.equations}
    assert set() < cited <= set(made)


def test_the_book_shows_each_equation_with_its_function():
    made = implementations()
    pages = {label: text for text in BOOK for label in LABEL.findall(text)}
    assert set(pages) == set(made)
    for label, text in pages.items():
        names = {link.rpartition(".")[2] for link in LINK.findall(text)}
        functions = {name for one in made[label] for name in one.name.split(".")}
        assert functions & names or label.endswith("-printed"), label
    for link in {link for text in BOOK for link in LINK.findall(text)}:
        assert resolve_name(link)
