"""The study of the angular resolution (chen2023, section V-D)."""

from __future__ import annotations

from reproduce.papers.declare import Pending, Results, reproduces
from reproduce.printed.given import Given

STUDY = "chen2023/text-angular-resolution"
FOCAL_LENGTH = "chen2023/table-2#tracker-focal-length.value"


@reproduces(
    STUDY,
    cells=["spot-radius-pixels", "position-*", "optimum-radius"],
    given=[f"{STUDY}#spot-radius", f"{STUDY}#pixel-size", f"{STUDY}#optimum", FOCAL_LENGTH],
)
def spot(given: Given) -> Results:
    """Spot radius in pixels, here and at the optimum, and the ends of one pixel."""
    radius, pixel = given[f"{STUDY}#spot-radius"], given[f"{STUDY}#pixel-size"]
    pixel_at_optimum = given[f"{STUDY}#optimum"] * given[FOCAL_LENGTH]
    return {
        "spot-radius-pixels": radius / pixel,
        "position-low": -pixel / 2,
        "position-high": pixel / 2,
        "optimum-radius": radius / pixel_at_optimum,
    }


@reproduces(STUDY, cells=["optimum", "optimum-accuracy", "saturation"])
def optimum(given: Given) -> Results:
    """Where centroiding is best, and how good: to come from the Monte Carlo of Figure 11."""
    study = Pending("the Monte Carlo of Figure 11")
    return dict.fromkeys(("optimum", "optimum-accuracy", "saturation"), study)
