"""What every object of the front door can do: show itself by its parts."""

from __future__ import annotations

import io
from abc import ABC, abstractmethod
from collections.abc import Iterator

from rich.console import Console, RenderableType

__all__ = ["Shown"]

WIDTH = 80


class Shown(ABC):
    """What shows itself in a terminal by its parts, without colour in a notebook's text."""

    @abstractmethod
    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield what a terminal of this many columns shows."""

    def print(self, console: Console) -> None:
        """Write the parts on a terminal."""
        for part in self.parts(console.width):
            if isinstance(part, str):
                console.print(part, markup=False, highlight=False)
            else:
                console.print(part)

    def __repr__(self) -> str:
        """Return the parts as text."""
        text = io.StringIO()
        self.print(Console(file=text, width=WIDTH, no_color=True, force_jupyter=False))
        return "\n".join(line.rstrip() for line in text.getvalue().splitlines())
