"""`__all__` of every module of the engine names what others use, and nothing else."""

import ast
from collections import defaultdict
from functools import cache
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
ENGINE = ROOT / "src" / "reproduce" / "inference"
FOLDERS = ("src", "tests", "benchmarks", "tools")


def module_of(path):
    return ".".join(path.relative_to(ROOT / "src").with_suffix("").parts)


MODULES = [module_of(path) for path in sorted(ENGINE.rglob("*.py")) if path.stem != "__init__"]


@cache
def used():
    """Module -> the names that other files import from it, or take as its attributes."""
    found = defaultdict(set)
    for path in (path for folder in FOLDERS for path in (ROOT / folder).rglob("*.py")):
        tree = ast.parse(path.read_text(encoding="utf-8"))
        whole = {}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                for alias in node.names:
                    found[node.module].add(alias.name)
                    whole[alias.asname or alias.name] = f"{node.module}.{alias.name}"
        for node in ast.walk(tree):
            if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                found[whole.get(node.value.id)].add(node.attr)
    return found


@pytest.mark.parametrize("name", MODULES)
def test_what_others_use_is_public_and_nothing_else(name):
    module = import_module(name)
    taken = {one for one in used()[name] if not one.startswith("_")}
    defined = {one for one in taken if getattr(getattr(module, one), "__module__", name) == name}
    assert set(module.__all__) == defined
