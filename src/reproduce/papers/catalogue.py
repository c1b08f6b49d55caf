"""All items of all papers, in order of print; the module of an item is imported when it is used."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any, TypeVar

from reproduce.locate import papers
from reproduce.papers.declare import Computation, Drawing, Item, Study

Own = TypeVar("Own", bound=Item | Study | Drawing)


class Declared(Mapping[str, Own]):
    """Tables or drawings of our own by their key; a module is imported when it is used."""

    def __init__(self, kind: type[Own], modules: Mapping[str, str]) -> None:
        self.kind, self.modules = kind, modules
        self._found: dict[str, Own] = {}

    def __getitem__(self, key: str) -> Own:
        """Return what is declared under a key."""
        if key not in self.modules:
            raise KeyError(f"unknown key {key!r}; expected one of {', '.join(self.modules)}")
        if key not in self._found:
            self._found[key] = self._made(key)
        return self._found[key]

    def _made(self, key: str) -> Own:
        found: Own = _declared(key, self.modules[key], self.kind)[0]
        return found

    def __contains__(self, key: object) -> bool:
        """Tell whether there is such a one, without importing it."""
        return key in self.modules

    def __iter__(self) -> Iterator[str]:
        """Go through the keys, paper by paper, in order of print."""
        return iter(self.modules)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.modules)


class Catalogue(Declared[Item]):
    """Every item by its key, made of its computations and its drawing."""

    def _made(self, key: str) -> Item:
        found = _declared(key, self.modules[key], Computation, Drawing)
        computations = tuple(one for one in found if isinstance(one, Computation))
        drawings = [one for one in found if isinstance(one, Drawing)]
        return Item(key, computations, *drawings)


@cache
def catalogue() -> Catalogue:
    """Return every item by its key, paper by paper, in order of print.

    Examples
    --------
    >>> list(catalogue())[0]
    'niu2024/text-context'
    """
    return Catalogue(Item, _modules("ITEMS"))


@cache
def studies() -> Declared[Study]:
    """Return the tables of our own that stand beside the papers, by key.

    Examples
    --------
    >>> "chen2023/heat" in studies()
    True
    """
    return Declared(Study, _modules("STUDIES"))


@cache
def drawings() -> Declared[Drawing]:
    """Return the drawings of our own that stand beside the papers, by key.

    Examples
    --------
    >>> "niu2024/drawing-fusion-star" in drawings()
    True
    """
    return Declared(Drawing, _modules("DRAWINGS"))


def _modules(kind: str) -> dict[str, str]:
    found = {}
    for paper in papers():
        package = f"{__package__}.{paper}"
        for key, names in getattr(importlib.import_module(package), kind, {}).items():
            found[key] = " ".join(f"{package}.{name}" for name in names.split())
    return found


def _declared(key: str, names: str, *kinds: type[Any]) -> list[Any]:
    """Return what modules, named in one string, declare under a key; not what they import."""
    modules = [importlib.import_module(name) for name in names.split()]
    found = [
        one
        for module in modules
        for one in vars(module).values()
        if isinstance(one, kinds) and one.key == key and one.function.__module__ == module.__name__
    ]
    if modules and not found:
        raise ValueError(f"{key}: expected its declaration in {names}")
    return found
