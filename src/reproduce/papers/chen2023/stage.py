"""The test with the moving stage: Table V and its plan (chen2023, IV-B and V-C).

The readings, fixed before their result was known: a reference angle is (10), with the printed
motion and the nominal focal length of the telescope; a monitored angle is predicted to be that
angle plus the mean centroid noise of its state, with the least number of frames that the text
allows, minus that of the zero state, which all states share.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers.chen2023 import lasers
from reproduce.papers.declare import Prediction, Results, reproduces
from reproduce.physics.simulate import spawned_normals
from reproduce.physics.stage import stage_angle
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

TABLE = "chen2023/table-5"
PLAN = "chen2023/text-effectiveness"
TELESCOPE = f"{lasers.PLATFORM}#telescope-focal-length.value"
FRAMES = f"{PLAN}#frames-per-state"
STATES = (1, 2, 3, 4, 5)
MOVED = STATES[1:]
# A motion along one axis turns the camera about the other one.
TURNS = {"x": "y", "y": "x"}
REPLICATES = 4000


@reproduces(TABLE, cells=["*.motion-?"], given=[f"{TABLE}#*.position-?"])
def motion(given: Given) -> Results:
    """Motion of the stage: the position less that of the first state."""
    return {
        f"{state}.motion-{axis}": given[f"{TABLE}#{state}.position-{axis}"]
        - given[f"{TABLE}#1.position-{axis}"]
        for axis in TURNS
        for state in STATES
    }


@reproduces(
    TABLE,
    cells=["*.reference-?"],
    given=[f"{TABLE}#[2-5].motion-?", TELESCOPE],
    equations=["10"],
)
def reference_angle(given: Given) -> Results:
    """Reference angles from the printed motions and the nominal focal length."""
    return {
        f"{state}.reference-{turn}": float(
            stage_angle(given[f"{TABLE}#{state}.motion-{axis}"], given[TELESCOPE])
        )
        for axis, turn in TURNS.items()
        for state in MOVED
    }


@reproduces(
    TABLE,
    cells=["*.monitoring-?"],
    given=[
        f"{TABLE}#[2-5].motion-?",
        *lasers.READS,
        f"{lasers.SCATTER}#2-*",
        FRAMES,
    ],
    equations=["7", "10"],
    replicates=REPLICATES,
)
def monitored_angle(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """Monitored angles: the reference, the noise of the state and that of the zero state."""
    response = lasers.angle_response(given)
    spots = lasers.scatter(given, 2) / np.sqrt(given.count(FRAMES))
    noise = spawned_normals(seed, replicates, (len(STATES), *spots.shape)) * spots
    angles = np.tensordot(noise, response, axes=([-2, -1], [-2, -1]))
    errors = angles[:, 1:] - angles[:, :1]
    return {
        f"{state}.monitoring-{turn}": Prediction(
            float(stage_angle(given[f"{TABLE}#{state}.motion-{axis}"], given[TELESCOPE]))
            + errors[:, row, "xy".index(turn)]
        )
        for axis, turn in TURNS.items()
        for row, state in enumerate(MOVED)
    }


@reproduces(
    TABLE,
    cells=["*.difference-?"],
    given=[f"{TABLE}#*.reference-?", f"{TABLE}#*.monitoring-?"],
)
def difference(given: Given) -> Results:
    """Difference of the printed monitored and reference angles."""
    return {
        f"{state}.difference-{turn}": given[f"{TABLE}#{state}.monitoring-{turn}"]
        - given[f"{TABLE}#{state}.reference-{turn}"]
        for turn in TURNS.values()
        for state in MOVED
    }


@reproduces(
    PLAN,
    cells=["states", "time-per-state"],
    given=[
        f"{PLAN}#travel-start",
        f"{PLAN}#travel-end",
        f"{PLAN}#step",
        FRAMES,
        "chen2023/text-accuracy#duration",
        "chen2023/text-accuracy#frames",
    ],
)
def plan(given: Given) -> Results:
    """Number of states, and the time that each one takes at the pace of the first groups."""
    travel = given[f"{PLAN}#travel-end"] - given[f"{PLAN}#travel-start"]
    per_frame = given["chen2023/text-accuracy#duration"] / given.count(
        "chen2023/text-accuracy#frames"
    )
    return {
        "states": travel / given[f"{PLAN}#step"] + 1,
        "time-per-state": given.count(FRAMES) * per_frame,
    }


@reproduces(
    PLAN,
    cells=["simulated-angle"],
    given=[f"{PLAN}#maximum-travel", f"{PLAN}#focal-length"],
    equations=["10"],
)
def largest_angle(given: Given) -> Results:
    """Largest misalignment that the stage can simulate, without its sign."""
    angle = stage_angle(given[f"{PLAN}#maximum-travel"], given[f"{PLAN}#focal-length"])
    return {"simulated-angle": abs(float(angle))}


@reproduces(PLAN, cells=["difference-bound"], given=[f"{TABLE}#*.difference-?"])
def bound(given: Given) -> Results:
    """Largest printed difference between reference and monitored angle."""
    return {"difference-bound": float(np.abs(given.array(f"{TABLE}#*.difference-?")).max())}


def draw(figure: Figure, printed: Mapping[str, float]) -> None:
    """Focal length that each printed angle implies for its printed motion.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        An empty figure.
    printed : mapping
        Addresses of Table V to values, in SI.
    """
    door = given(monitored_angle.given)
    predicted = monitored_angle(door)
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (axis, turn) in zip(panels, TURNS.items(), strict=True):
        motions = np.array([printed[f"{TABLE}#{state}.motion-{axis}"] for state in MOVED])
        angles = {
            name: np.array([printed[f"{TABLE}#{state}.{name}-{turn}"] for state in MOVED])
            for name in ("reference", "monitoring")
        }
        noise = [_spread(predicted[f"{state}.monitoring-{turn}"]) for state in MOVED]
        error = _implied(motions, angles["monitoring"]) * noise / np.abs(angles["monitoring"])
        left, right = np.add(MOVED, -0.1), np.add(MOVED, 0.1)
        own, blue = _implied(motions, angles["reference"]), "#0072B2"
        axes.plot(left, own, "o", color=blue, label="reference")
        # Differences of the positions, not the printed motions: one of these holds a slip.
        exchanged = _implied(_moved(printed, turn), angles["reference"])
        axes.plot(left, exchanged, "o", fillstyle="none", color=blue, label="reference, exchanged")
        axes.errorbar(
            right,
            _implied(motions, angles["monitoring"]),
            error,
            fmt="s",
            color="#D55E00",
            label="monitoring",
        )
        axes.axhline(door[TELESCOPE] * 1e3, color="#000000", ls="--", lw=1, label="nominal")
        axes.set(xlabel="state", title=f"stage along {axis.upper()}", xticks=MOVED)
    panels[0].set_ylabel("focal length (mm)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)


def _implied(motions: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the focal lengths in millimetres for which (10) joins motions and angles."""
    return np.asarray(-motions / np.tan(angles) * 1e3)


def _moved(printed: Mapping[str, float], axis: str) -> FloatArray:
    places = np.array([printed[f"{TABLE}#{state}.position-{axis}"] for state in STATES])
    return np.asarray(places[1:] - places[0])


def _spread(result: object) -> float:
    """Return one standard deviation of a prediction."""
    if not isinstance(result, Prediction):
        raise TypeError(f"expected a Prediction, got {type(result).__name__}")
    return float(result.draws.std())
