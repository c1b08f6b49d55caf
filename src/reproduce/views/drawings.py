"""Drawings that belong to no printed item: one call shows one of them."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING

from reproduce.judge.readings import printed_values
from reproduce.papers.chen2023.figures import attitude
from reproduce.papers.niu2024.figures import (
    approximations,
    calibration,
    images,
    readings,
    registration,
)
from reproduce.papers.study import Fact
from reproduce.views.figures import STYLE
from reproduce.views.inline_svg import inline
from reproduce.views.numbers import fact, powers
from reproduce.views.pages import Html
from reproduce.views.record_text import filled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["DRAWINGS", "FACTS", "drawing", "paint"]


def _distributions(figure: Figure) -> None:
    readings.draw_distributions(figure, printed_values())


DRAWINGS: dict[str, Callable[[Figure], None]] = {
    "chen2023-instruments": attitude.draw_instruments,
    "chen2023-misalignment": attitude.draw_misalignment,
    "chen2023-stage": attitude.draw_stage,
    "niu2024-approximations-table-1": approximations.draw_table_1,
    "niu2024-approximations-table-4": approximations.draw_table_4,
    "niu2024-colours": images.draw_colours,
    "niu2024-convergence": readings.draw_convergence,
    "niu2024-distributions": _distributions,
    "niu2024-fusion-errors": images.draw_errors,
    "niu2024-fusion-stars": images.draw_stars,
    "niu2024-fusion-star": images.draw_star,
    "niu2024-registration": registration.draw_registration,
    "niu2024-rotary-table": calibration.draw_table,
}

# What the drawings' alternative texts may say in numbers.
FACTS: dict[str, Callable[[], dict[str, Fact]]] = {
    "niu2024-convergence": readings.convergence_facts,
    "niu2024-approximations-table-1": partial(approximations.facts, "Table 1"),
    "niu2024-approximations-table-4": partial(approximations.facts, "Table 4"),
    "niu2024-colours": images.colour_facts,
    "niu2024-fusion-errors": images.error_facts,
    "niu2024-fusion-stars": images.star_kind_facts,
    "niu2024-fusion-star": images.star_facts,
}


def paint(name: str) -> Figure:
    """Draw one of the drawings in the project's style."""
    if name not in DRAWINGS:
        raise KeyError(f"unknown drawing {name!r}; expected one of {', '.join(DRAWINGS)}")
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE):
        figure = Figure(layout="constrained")
        DRAWINGS[name](figure)
    return figure


def drawing(name: str, alternative: str) -> Html:
    """Show a drawing that follows the page's light or dark theme."""
    facts = {label: fact(quoted) for label, quoted in FACTS.get(name, dict)().items()}
    return Html(inline(paint(name), f"drawing-{name}", powers(filled(alternative, facts))))
