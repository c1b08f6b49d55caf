"""Drawings that belong to no printed item: one call shows one of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from reproduce.papers.niu2024 import figures_costs, figures_images, figures_study
from reproduce.store import studies
from reproduce.views.figures import STYLE
from reproduce.views.inline_svg import inline
from reproduce.views.pages import Html
from reproduce.views.studies import FUSION

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _fusion_errors(figure: Figure) -> None:
    figures_images.draw_errors(figure, studies.read(FUSION).arrays)


DRAWINGS: dict[str, Callable[[Figure], None]] = {
    "niu2024-approximations-table-1": figures_costs.draw_table_1,
    "niu2024-approximations-table-4": figures_costs.draw_table_4,
    "niu2024-convergence": figures_study.draw_convergence,
    "niu2024-fusion-errors": _fusion_errors,
    "niu2024-fusion-star": figures_images.draw_star,
}


def paint(name: str) -> Figure:
    """Draw one of the drawings in the project's style.

    Parameters
    ----------
    name : str
        One of `DRAWINGS`.

    Returns
    -------
    matplotlib.figure.Figure
        The figure.

    Raises
    ------
    KeyError
        If there is no such drawing.
    """
    if name not in DRAWINGS:
        raise KeyError(f"unknown drawing {name!r}; expected one of {', '.join(DRAWINGS)}")
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE):
        figure = Figure(layout="constrained")
        DRAWINGS[name](figure)
    return figure


def drawing(name: str, alternative: str) -> Html:
    """Show a drawing that follows the page's light or dark theme.

    Parameters
    ----------
    name : str
        One of `DRAWINGS`.
    alternative : str
        What it shows, for readers who cannot see it.

    Returns
    -------
    Html
        The drawing as inline SVG.
    """
    return Html(inline(paint(name), f"drawing-{name}", alternative))
