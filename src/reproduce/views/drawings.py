"""Drawings that belong to no printed item: one call shows one of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from reproduce.papers.chen2023.figures import attitude
from reproduce.papers.niu2024 import (
    figures_costs,
    figures_distributions,
    figures_images,
    figures_signs,
    figures_study,
)
from reproduce.store import studies
from reproduce.views.distribution_pages import printed_values
from reproduce.views.facts import filled
from reproduce.views.figures import STYLE
from reproduce.views.inline_svg import inline
from reproduce.views.numbers import powers
from reproduce.views.pages import Html
from reproduce.views.studies import FUSION, READINGS

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def _fusion_errors(figure: Figure) -> None:
    figures_images.draw_errors(figure, studies.read(FUSION).arrays)


def _fusion_stars(figure: Figure) -> None:
    figures_images.draw_stars(figure, studies.read(FUSION).arrays)


def _fusion_facts() -> dict[str, str]:
    return figures_images.error_facts(studies.read(FUSION).arrays)


def _star_kind_facts() -> dict[str, str]:
    return figures_images.star_kind_facts(studies.read(FUSION).arrays)


def _distributions(figure: Figure) -> None:
    figures_distributions.draw(figure, studies.read(READINGS).arrays, printed_values())


DRAWINGS: dict[str, Callable[[Figure], None]] = {
    "chen2023-instruments": attitude.draw_instruments,
    "chen2023-misalignment": attitude.draw_misalignment,
    "chen2023-stage": attitude.draw_stage,
    "niu2024-approximations-table-1": figures_costs.draw_table_1,
    "niu2024-approximations-table-4": figures_costs.draw_table_4,
    "niu2024-colours": figures_images.draw_colours,
    "niu2024-convergence": figures_study.draw_convergence,
    "niu2024-distributions": _distributions,
    "niu2024-fusion-errors": _fusion_errors,
    "niu2024-fusion-stars": _fusion_stars,
    "niu2024-fusion-star": figures_images.draw_star,
    "niu2024-registration": figures_signs.draw_registration,
    "niu2024-rotary-table": figures_signs.draw_table,
}

# What the drawings' alternative texts may say in numbers.
FACTS: dict[str, Callable[[], dict[str, str]]] = {
    "niu2024-convergence": figures_study.facts,
    "niu2024-approximations-table-1": figures_costs.facts_table_1,
    "niu2024-approximations-table-4": figures_costs.facts_table_4,
    "niu2024-colours": figures_images.colour_facts,
    "niu2024-fusion-errors": _fusion_facts,
    "niu2024-fusion-stars": _star_kind_facts,
    "niu2024-fusion-star": figures_images.star_facts,
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
    facts = FACTS[name]() if name in FACTS else {}
    return Html(inline(paint(name), f"drawing-{name}", powers(filled(alternative, facts))))
