"""Drawing an item in the project's one style, and writing it to a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from reproduce.papers.catalogue import catalogue, drawings
from reproduce.papers.declare import Drawing, Marks
from reproduce.printed.cells import find, library

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from reproduce.printed.given import Given

__all__ = ["STYLE", "check_ending", "data", "declared", "draw", "drawable", "save"]

STYLE = Path(__file__).parent / "figures.mplstyle"
ENDINGS = (".svg", ".pdf", ".png")


def drawable() -> list[str]:
    """Return the keys of the items that draw.

    In order of print.
    """
    return [key for key, item in catalogue().items() if item.draw is not None]


def declared(key: str) -> Drawing:
    """Return what draws a key: an item, or a drawing of our own."""
    if key in drawings():
        return drawings()[key]
    found = catalogue()[key].draw if key in catalogue() else None
    if found is None:
        known = ", ".join((*drawable(), *drawings()))
        raise ValueError(f"{key} has no figure; these have one: {known}")
    return found


def draw(key: str, door: Given | None = None) -> Figure:
    """Draw an item, or one of our own drawings."""
    drawing = declared(key)
    from matplotlib import style
    from matplotlib.figure import Figure

    table = library().get(key)
    marked = [*(table.cells if table else ()), *(c for mark in drawing.marks for c in find(mark))]
    numbers = [cell for cell in marked if cell.is_number]
    printed = Marks({c.address: c.si for c in numbers}, {c.address: c.si_interval for c in numbers})
    with style.context(STYLE):
        figure = Figure(layout="constrained")
        drawing(figure, printed, door)
    return figure


def data(figure: Figure) -> pd.DataFrame:
    """Return the lines and points of a figure."""
    import numpy as np
    import pandas as pd

    parts = []
    for panel, axes in enumerate(figure.axes, start=1):
        drawn = [(line.get_label(), line.get_xydata()) for line in axes.lines]
        drawn += [(one.get_label(), one.get_offsets()) for one in axes.collections]
        for number, (label, points) in enumerate(drawn, start=1):
            x, y = np.asarray(points, dtype=float).reshape(-1, 2).T
            named = str(label)
            curve = f"curve {number}" if named.startswith("_") else named
            parts.append(pd.DataFrame({"panel": panel, "curve": curve, "x": x, "y": y}))
    columns = ["panel", "curve", "x", "y"]
    return pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=columns)


def check_ending(out: Path) -> str:
    """Return the ending of a file to write, or raise ValueError if no figure has it."""
    if out.suffix.lower() not in ENDINGS:
        raise ValueError(f"unknown ending {out.suffix!r}: expected one of {', '.join(ENDINGS)}")
    return out.suffix.lower()


def save(figure: Figure, out: Path) -> None:
    """Write a drawn figure."""
    from matplotlib import style

    ending = check_ending(out)

    # Dates and random ids would make every build differ from the last one.
    undated = {".svg": {"Date": None}, ".pdf": {"CreationDate": None}}.get(ending, {})
    with style.context(STYLE):
        figure.savefig(out, metadata=undated)
