"""Chen et al., IEEE TGRS (2023): watching a camera's misalignment with lasers on SVGF-1."""

from reproduce.papers.chen2023 import accuracy, design, platform, resolution, stage
from reproduce.papers.declare import Item

ITEMS = (
    Item("chen2023/text-context"),
    Item("chen2023/table-1", (design.ground_resolution,)),
    Item("chen2023/text-positioning", (design.quoted_resolution,)),
    Item("chen2023/text-design", (design.focal_ratio, design.dichroic_tilt)),
    Item("chen2023/text-hardware"),
    Item("chen2023/table-2", (platform.pixel_angle,)),
    Item("chen2023/text-effectiveness", (stage.plan, stage.largest_angle, stage.bound)),
    Item("chen2023/text-extraction", (platform.scatter_range,)),
    Item("chen2023/table-3"),
    Item(
        "chen2023/text-accuracy",
        (
            accuracy.times,
            accuracy.quoted_accuracy,
            accuracy.centroid_accuracy,
            accuracy.pixel_angle,
        ),
    ),
    Item("chen2023/table-4", (accuracy.frame_averaging,), accuracy.draw),
    Item(
        "chen2023/table-5",
        (stage.motion, stage.reference_angle, stage.monitored_angle, stage.difference),
        stage.draw,
    ),
    Item("chen2023/text-angular-resolution", (resolution.spot, resolution.optimum)),
)
