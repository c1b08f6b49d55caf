"""All items of all papers, in order of print; the module of an item is imported when it is used."""

from __future__ import annotations

import importlib
from collections.abc import Iterator, Mapping
from functools import cache
from types import ModuleType
from typing import TypeVar

from reproduce.locate import papers
from reproduce.papers.declare import Computation, Drawing, Item
from reproduce.papers.study import Study

__all__ = ["Declared", "catalogue", "drawings", "studies"]

Own = TypeVar("Own", bound=Study | Drawing)


class Catalogue(Mapping[str, Item]):
    """Every item by its key."""

    def __init__(self, modules: Mapping[str, str]) -> None:
        self._modules = modules
        self._items: dict[str, Item] = {}

    def __getitem__(self, key: str) -> Item:
        """Return an item, with what its modules declare of it."""
        if key not in self._items:
            self._items[key] = _item(key, self._modules[key].split())
        return self._items[key]

    def __contains__(self, key: object) -> bool:
        """Tell whether there is such an item, without importing it."""
        return key in self._modules

    def __iter__(self) -> Iterator[str]:
        """Go through the keys, in order of print."""
        return iter(self._modules)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self._modules)


@cache
def catalogue() -> Catalogue:
    """Return every item by its key, paper by paper, in order of print.

    Examples
    --------
    >>> list(catalogue())[0]
    'niu2024/text-context'
    """
    return Catalogue(
        {key: name for paper in papers() for key, name in _module(paper).ITEMS.items()}
    )


class Declared(Mapping[str, Own]):
    """Tables or drawings of our own by their key; a module is imported when it is used."""

    def __init__(self, kind: type[Own], modules: Mapping[str, str]) -> None:
        self.kind, self.modules = kind, modules

    def __getitem__(self, key: str) -> Own:
        """Return what a module declares under this key."""
        if key not in self.modules:
            raise KeyError(f"unknown key {key!r}; expected one of {', '.join(self.modules)}")
        module = importlib.import_module(self.modules[key])
        declared = [one for one in vars(module).values() if isinstance(one, self.kind)]
        found = next((one for one in declared if one.key == key), None)
        if found is None:
            raise ValueError(f"{key}: expected its declaration in {module.__name__}")
        return found

    def __contains__(self, key: object) -> bool:
        """Tell whether there is such a one, without importing it."""
        return key in self.modules

    def __iter__(self) -> Iterator[str]:
        """Go through the keys, paper by paper."""
        return iter(self.modules)

    def __len__(self) -> int:
        """Return how many there are."""
        return len(self.modules)


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
    >>> "niu2024-convergence" in drawings()
    True
    """
    return Declared(Drawing, _modules("DRAWINGS"))


def _modules(kind: str) -> dict[str, str]:
    return {
        key: f"{__package__}.{paper}.{name}"
        for paper in papers()
        for key, name in getattr(_module(paper), kind, {}).items()
    }


def _module(*path: str) -> ModuleType:
    return importlib.import_module(".".join(("reproduce.papers", *path)))


def _item(key: str, names: list[str]) -> Item:
    computations: list[Computation] = []
    drawings: list[Drawing] = []
    for name in names:
        module = _module(key.partition("/")[0], name)
        for declared in vars(module).values():
            if not isinstance(declared, Computation | Drawing) or declared.key != key:
                continue
            if isinstance(declared, Drawing):
                drawings.append(declared)
            elif declared.function.__module__ == module.__name__:  # not one that it imports
                computations.append(declared)
    if (names and not computations and not drawings) or len(drawings) > 1:
        raise ValueError(
            f"{key}: expected computations or one drawing in {', '.join(names)}, got "
            f"{len(computations)} computations and {len(drawings)} drawings"
        )
    return Item(key, tuple(computations), drawings[0] if drawings else None)
