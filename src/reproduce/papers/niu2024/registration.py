"""Registration (niu2024, section 2): scales and translations that Table 1 implies."""

from __future__ import annotations

from reproduce.papers.declare import Results, by_cell, reproduces
from reproduce.papers.niu2024.simulation import REGISTERED, principal_points
from reproduce.physics import optics
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs


def scale_factors(inputs: Inputs, table: str = "niu2024/table-1") -> FloatArray:
    """Return the ratios of green's focal length in a table to those of red and blue."""
    red, green, blue = inputs.array(f"{table}#focal-length.*")
    return optics.scale_factor(green, [red, blue])


@reproduces(
    "niu2024/table-2",
    cells=["scale.*"],
    inputs=["niu2024/table-1#focal-length.*"],
)
def true_scale(inputs: Inputs) -> Results:
    """Compute the scale factors as ratios of the focal lengths of Table 1.

    Implements: niu2024 (6).
    """
    return by_cell("scale.{}", scale_factors(inputs), REGISTERED)


@reproduces(
    "niu2024/table-2",
    cells=["translation-*"],
    inputs=["niu2024/table-1#principal-point-*"],
)
def true_translation(inputs: Inputs) -> Results:
    """Compute the translations as differences of the principal points of Table 1.

    Implements: niu2024 (14).
    """
    green, *others = principal_points(inputs)
    return by_cell("translation-{1}.{0}", others - green, REGISTERED, "xy")
