"""The angle that a pixel sees behind each lens."""

from __future__ import annotations

from reproduce.papers.declare import draws, reproduces, studied
from reproduce.physics.optics import angle_from_pixels

LENSES = "lamp2025/table-1"


@reproduces(
    "lamp2025/table-2",
    inputs=[LENSES],
)
def pixel_angle(inputs):
    """Angle of one pixel from its pitch and the focal length.

    Implements: lamp2025 (1).
    """
    return {
        f"angle.{lens}": float(
            angle_from_pixels(
                1.0,
                inputs[f"{LENSES}#pixel.{lens}"],
                inputs[f"{LENSES}#focal-length.{lens}"],
            )
        )
        for lens in ("near", "far")
    }


@draws("lamp2025/fig-1", inputs=[f"{LENSES}#focal-length.*"])
def draw(figure, printed, inputs):
    """Focal lengths of both lenses."""
    lengths = inputs.array(f"{LENSES}#focal-length.*")
    figure.add_subplot().plot([1, 2], lengths * 1e3, "o", label="lenses")


@studied("lamp2025/ratio", inputs=[f"{LENSES}#focal-length.*"])
def ratio(inputs):
    """How the focal lengths compare."""
    near, far = inputs.array(f"{LENSES}#focal-length.*")
    return [("far over near", float(far / near))]
