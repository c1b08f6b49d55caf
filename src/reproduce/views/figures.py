"""Drawing an item in the project's one style, and writing it to a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import find, library

if TYPE_CHECKING:
    from matplotlib.figure import Figure

STYLE = Path(__file__).parent / "figures.mplstyle"
ENDINGS = (".svg", ".pdf", ".png")


def drawable() -> list[str]:
    """Return the keys of the items that draw.

    Returns
    -------
    list of str
        In order of print.
    """
    return [key for key, item in catalogue().items() if item.draw is not None]


def draw(key: str) -> Figure:
    """Draw an item.

    Parameters
    ----------
    key : str
        An item that draws.

    Returns
    -------
    matplotlib.figure.Figure
        The figure, with the printed values marked where there are any.

    Raises
    ------
    ValueError
        If the item does not draw; the message lists those that do.
    """
    item = catalogue()[key]
    if item.draw is None:
        raise ValueError(f"{key} has no figure; these have one: {', '.join(drawable())}")
    from matplotlib import style
    from matplotlib.figure import Figure

    table = library().get(key)
    marked = [*(table.cells if table else ()), *(c for mark in item.marks for c in find(mark))]
    printed = {c.address: c.si for c in marked if c.is_number}
    with style.context(STYLE):
        figure = Figure(layout="constrained")
        item.draw(figure, printed)
    return figure


def save(key: str, out: Path) -> None:
    """Draw an item and write it.

    Parameters
    ----------
    key : str
        An item that draws.
    out : pathlib.Path
        Where to write; the ending chooses the format.

    Raises
    ------
    ValueError
        If the item does not draw or the ending is not .svg, .pdf or .png.
    OSError
        If the file cannot be written.
    """
    if out.suffix.lower() not in ENDINGS:
        raise ValueError(f"unknown ending {out.suffix!r}: expected one of {', '.join(ENDINGS)}")
    figure = draw(key)
    from matplotlib import style

    # Dates and random ids would make every build differ from the last one.
    metadata = {"Date": None} if out.suffix.lower() == ".svg" else {}
    if out.suffix.lower() == ".pdf":
        metadata = {"CreationDate": None}
    with style.context(STYLE):
        figure.savefig(out, metadata=metadata)
