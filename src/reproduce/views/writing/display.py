"""What shows itself by its blocks, in a notebook and in a terminal."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterable
from dataclasses import dataclass

from reproduce.views.writing.blocks import Block
from reproduce.views.writing.page import html


class Display(ABC):
    """What shows itself by its blocks, in a notebook and in a terminal."""

    @abstractmethod
    def blocks(self) -> Iterable[Block]:
        """Return what is shown."""

    def _repr_html_(self) -> str:
        return html(self.blocks())

    def print(self) -> None:
        """Write the blocks on the terminal."""
        from reproduce.views.writing import terminal  # only now: a fit needs no terminal

        terminal.write(self.blocks())

    def __repr__(self) -> str:
        """Return the blocks as text, without colour."""
        from reproduce.views.writing import terminal

        return terminal.text(self.blocks())


@dataclass(frozen=True, repr=False)
class Blocks(Display):
    """Some blocks as one object."""

    shown: tuple[Block, ...]

    def blocks(self) -> tuple[Block, ...]:
        """Return them."""
        return self.shown
