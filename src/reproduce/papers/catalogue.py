"""All items of all papers, in order of print; the module of an item is imported when it is used."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterator, Mapping
from functools import cache, partial
from types import ModuleType

from reproduce.locate import papers
from reproduce.papers.declare import Computation, Drawing, Item
from reproduce.papers.study import Study


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


def studies() -> dict[str, Callable[[], Study]]:
    """Return the tables of our own that stand beside the papers, by name.

    Name, such as ``chen2023/readings``, to what computes the table: the function of that name in
    its module.

    Examples
    --------
    >>> sorted(studies())[0].partition("/")[0]
    'chen2023'
    """
    return {
        key: partial(_study, key, name)
        for paper in papers()
        for key, name in _module(paper).STUDIES.items()
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


def _study(key: str, name: str) -> Study:
    paper, _, title = key.partition("/")
    found: Study = getattr(_module(paper, name), title.replace("-", "_"))()
    return found
