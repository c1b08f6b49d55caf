"""The angle that a pixel sees behind each lens."""

from __future__ import annotations

from reproduce.papers.declare import draws, reproduces
from reproduce.papers.study import Study
from reproduce.physics.optics.camera import angle_from_pixels
from reproduce.printed.given import given

LENSES = "lamp2025/table-1"


@reproduces("lamp2025/table-2", given=[LENSES], equations=["1"])
def pixel_angle(given):
    """Angle of one pixel from its pitch and the focal length."""
    return {
        f"angle.{lens}": float(
            angle_from_pixels(
                1.0, given[f"{LENSES}#pixel.{lens}"], given[f"{LENSES}#focal-length.{lens}"]
            )
        )
        for lens in ("near", "far")
    }


@draws("lamp2025/fig-1", given=[f"{LENSES}#focal-length.*"])
def draw(figure, printed, door):
    """Focal lengths of both lenses."""
    lengths = door.array(f"{LENSES}#focal-length.*")
    figure.add_subplot().plot([1, 2], lengths * 1e3, "o", label="lenses")


def ratio():
    """Return how the focal lengths compare."""
    near, far = given([LENSES]).array(f"{LENSES}#focal-length.*")
    return Study("The lenses compared", ("lens", "ratio"), (("far over near", f"{far / near:g}"),))
