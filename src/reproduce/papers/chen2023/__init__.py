"""Chen et al., IEEE TGRS (2023): watching a camera's misalignment with lasers on SVGF-1."""

from reproduce.papers.chen2023 import (
    accuracy,
    design,
    figures_monitoring,
    figures_platform,
    figures_resolution,
    figures_satellite,
    figures_tracker,
    ground_study,
    lasers,
    light_study,
    orbit_study,
    platform,
    resolution,
    resolution_study,
    stage,
    twin_study,
)
from reproduce.papers.declare import Item

ITEMS = (
    Item("chen2023/text-context"),
    Item("chen2023/fig-1a", draw=figures_satellite.draw_geometry),
    Item("chen2023/fig-1b", draw=figures_satellite.draw_system),
    Item("chen2023/fig-1c", draw=figures_platform.draw_frame, marks=(lasers.SPOTS,)),
    Item("chen2023/fig-1d", draw=figures_monitoring.draw_example),
    Item("chen2023/table-1", (design.ground_resolution,)),
    Item("chen2023/text-positioning", (design.quoted_resolution,)),
    Item("chen2023/fig-2a", draw=figures_satellite.draw_structure),
    Item("chen2023/fig-2b", draw=figures_satellite.draw_focal_plane),
    Item("chen2023/fig-3a", draw=figures_tracker.draw_structure),
    Item("chen2023/fig-3b", draw=figures_tracker.draw_paths, marks=(figures_tracker.TILT,)),
    Item(
        "chen2023/fig-3c",
        draw=figures_tracker.draw_filters,
        marks=(*figures_tracker.BANDS, figures_tracker.FILTER),
    ),
    Item("chen2023/text-design", (design.focal_ratio, design.dichroic_tilt)),
    Item("chen2023/fig-4", draw=figures_tracker.draw_route),
    Item("chen2023/fig-5", draw=figures_tracker.draw_transform),
    Item("chen2023/fig-6a", draw=figures_platform.draw_stage, marks=(lasers.DIAGONAL,)),
    Item("chen2023/fig-6b", draw=figures_platform.draw_bench, marks=figures_platform.ANGLES),
    Item("chen2023/text-hardware"),
    Item("chen2023/table-2", (platform.pixel_angle,)),
    Item("chen2023/text-effectiveness", (stage.plan, stage.largest_angle, stage.bound)),
    Item("chen2023/text-extraction", (platform.scatter_range,)),
    Item(
        "chen2023/fig-7",
        draw=figures_monitoring.draw_spots,
        marks=("chen2023/text-extraction#spot-*",),
    ),
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
    Item(
        "chen2023/fig-8",
        draw=figures_monitoring.draw_transform,
        marks=("chen2023/text-accuracy#transform-single-?",),
    ),
    Item(
        "chen2023/fig-9",
        draw=figures_monitoring.draw_misalignment,
        marks=("chen2023/text-accuracy#misalignment-single-?",),
    ),
    Item("chen2023/table-4", (accuracy.frame_averaging,), accuracy.draw),
    Item(
        "chen2023/table-5",
        (stage.motion, stage.reference_angle, stage.monitored_angle, stage.difference),
        stage.draw,
    ),
    Item(
        "chen2023/fig-10a",
        draw=figures_monitoring.draw_pattern,
        marks=("chen2023/table-5#*.position-?",),
    ),
    Item(
        "chen2023/fig-10b",
        draw=figures_monitoring.draw_about_y,
        marks=("chen2023/table-5#[2-5].monitoring-y",),
    ),
    Item(
        "chen2023/fig-10c",
        draw=figures_monitoring.draw_about_x,
        marks=("chen2023/table-5#[2-5].monitoring-x",),
    ),
    Item("chen2023/text-angular-resolution", (resolution.spot, resolution.optimum)),
    Item(
        "chen2023/fig-11a",
        draw=figures_resolution.draw_centroids,
        marks=figures_resolution.MARKS_CENTROIDS,
    ),
    Item(
        "chen2023/fig-11b",
        draw=figures_resolution.draw_monitoring,
        marks=figures_resolution.MARKS_MONITORING,
    ),
)

# Tables of our own, beside the paper's; by the name that a page shows them under.
STUDIES = {
    "chen2023/retro-reflectors": light_study.retroreflectors,
    "chen2023/dichroic": light_study.dichroic,
    "chen2023/heat": light_study.heat,
    "chen2023/patterns": light_study.patterns,
    "chen2023/budget": ground_study.budget,
    "chen2023/strategies": orbit_study.strategies,
    "chen2023/ages": orbit_study.ages,
    "chen2023/floors": twin_study.floors,
    "chen2023/misfit": twin_study.misfit,
    "chen2023/roll": twin_study.roll,
    "chen2023/focal-lengths": twin_study.focal_lengths,
    "chen2023/readings": resolution_study.readings,
    "chen2023/estimators": resolution_study.estimators,
}
