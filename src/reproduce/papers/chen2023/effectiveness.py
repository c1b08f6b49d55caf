"""The test with the moving stage: Table V and its plan (chen2023, IV-B and V-C).

A reference angle is (10), with a motion of the stage and the focal length of the telescope. A
monitored angle is predicted to be that angle plus the mean centroid noise of its state, minus that
of the zero state, which all states share.

Table II gives the nominal focal length; the one that the angles were computed with is not printed.
As the columns are printed, no one focal length joins all motions and reference angles; with columns
of the two axes interchanged one does. So an angle has several readings, and the ledger shows them
side by side. Where one focal length stands for the whole table, the largest reference angle about Y
gives it. The columns as printed with the nominal length came first, 14 minutes before the first
verdicts in the history; all other readings were added when that result was known.

The focal lengths that the rows imply are compared row by row, and fitted together to the monitored
angles of an axis, which share the noise of the zero state.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers.chen2023 import accuracy, platform
from reproduce.papers.declare import (
    Blocked,
    Prediction,
    Reading,
    Result,
    Results,
    draws,
    reproduces,
)
from reproduce.papers.study import Column, Fact, studied
from reproduce.physics.attitude.misalignment import stage_angle
from reproduce.physics.optics.simulate import spawned_normals
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

__all__ = [
    "DECIDED",
    "FRAMES",
    "LAST",
    "STATES",
    "TABLE",
    "common_length",
    "fitted_length",
    "focal_lengths",
    "monitoring_errors",
]

TABLE = "chen2023/table-5"
PLAN = "chen2023/text-effectiveness"
QUOTED = f"{PLAN}#focal-length"
FRAMES = f"{PLAN}#frames-per-state"
STATES = (1, 2, 3, 4, 5)
MOVED = STATES[1:]
# A motion along one axis turns the camera about the other one.
TURNS = {"x": "y", "y": "x"}
REPLICATES = 4000
# The angle from which one focal length for the whole table is taken.
LAST = f"{TABLE}#5.reference-y"
MISSING = "the focal length of the telescope, of which a nominal one is printed"
COLUMNS = f"{MISSING}, and on which columns of Table V belong together"
AS_QUOTED = ("columns as printed; 2000 mm", "IV-B writes it without 'nominal'")
NOMINAL = ("columns as printed; nominal 2000 mm", "Table II")
AS_PRINTED = ("columns as printed; one focal length", "(10), with the last angle about Y")
MOTIONS = (
    "positions and motions interchanged; one focal length",
    "headings of Table V; (10), with the last angle about Y",
)
REFERENCES = (
    "reference angles interchanged; one focal length",
    "headings of Table V; (10), with the last angle about Y",
)
# What each reading chooses of what Table V leaves open.
CHOICES = {
    AS_QUOTED: {"columns": "printed", "telescope": "quoted"},
    NOMINAL: {"columns": "printed", "telescope": "nominal"},
    AS_PRINTED: {"columns": "printed", "telescope": "common"},
    MOTIONS: {"columns": "motions", "telescope": "common"},
    REFERENCES: {"columns": "references", "telescope": "common"},
}
LENGTHS = {
    "quoted": "2000 mm, as IV-B writes it without 'nominal'",
    "nominal": "the nominal 2000 mm of Table II, known to a few per cent",
    "common": "the one that joins the last angle about Y with its motion",
}
OPTIONS = {
    "columns": {
        "printed": "columns as printed",
        "motions": "positions and motions interchanged",
        "references": "reference angles interchanged",
    },
    "telescope": LENGTHS,
}
# A monitored angle that agrees with every reading: no reading decides it.
DECIDED = ("2.monitoring-y",)


@reproduces(TABLE, cells=["*.motion-?"], given=[f"{TABLE}#*.position-?"])
def motion(given: Given) -> Results:
    """Motion of the stage: the position less that of the first state."""
    return {
        f"{state}.motion-{axis}": given[f"{TABLE}#{state}.position-{axis}"]
        - given[f"{TABLE}#1.position-{axis}"]
        for axis in TURNS
        for state in STATES
    }


MEASURED = (f"{TABLE}#*.position-?", f"{TABLE}#[2-5].motion-?", LAST, platform.TELESCOPE, QUOTED)


def _moved(printed: Given | Mapping[str, float], state: int, axis: str) -> float:
    """Return a motion as the difference of the printed positions: one printed motion is a slip."""
    return printed[f"{TABLE}#{state}.position-{axis}"] - printed[f"{TABLE}#1.position-{axis}"]


def common_length(given: Given, axis: str) -> float:
    """Return the focal length for which (10) joins the last angle about Y with a motion."""
    return float(-_moved(given, STATES[-1], axis) / np.tan(given[LAST]))


def expected_angles(given: Given, state: int, turn: str) -> dict[tuple[str, str], float]:
    """Return the angle of the stage in a state under every reading of Table V.

    Name and place of the reading to the angle in radians.
    """
    axis = TURNS[turn]
    printed = given[f"{TABLE}#{state}.motion-{axis}"]
    own, other = _moved(given, state, axis), _moved(given, state, turn)
    exchanged = common_length(given, "y")
    sides = {
        AS_QUOTED: (printed, given[QUOTED]),
        NOMINAL: (printed, given[platform.TELESCOPE]),
        AS_PRINTED: (printed, common_length(given, "x")),
        MOTIONS: (other, exchanged),
        REFERENCES: (own, exchanged),
    }
    return {reading: float(stage_angle(*pair)) for reading, pair in sides.items()}


@reproduces(
    TABLE,
    cells=["[2-4].reference-?", "5.reference-x"],
    given=MEASURED,
    equations=["10"],
    options=OPTIONS,
)
def reference_angle(given: Given) -> Results:
    """Reference angles from the motions and each focal length that the text leaves open."""
    results = {}
    for turn in TURNS:
        for state in MOVED:
            angles = expected_angles(given, state, turn)
            # An angle under the other heading is one of the other motion.
            angles[REFERENCES] = angles[MOTIONS]
            if f"{TABLE}#{state}.reference-{turn}" != LAST:
                results[f"{state}.reference-{turn}"] = _blocked(COLUMNS, angles)
    return results


@reproduces(
    TABLE,
    cells=["5.reference-y"],
    given=[f"{TABLE}#5.motion-x", platform.TELESCOPE, QUOTED],
    equations=["10"],
    options={"telescope": {name: LENGTHS[name] for name in ("quoted", "nominal")}},
)
def last_reference_angle(given: Given) -> Results:
    """The reference angle that the others take their focal length from, by the nominal one."""
    motion = given[f"{TABLE}#5.motion-x"]
    lengths = {AS_QUOTED: given[QUOTED], NOMINAL: given[platform.TELESCOPE]}
    angles = {reading: float(stage_angle(motion, length)) for reading, length in lengths.items()}
    return {"5.reference-y": _blocked(MISSING, angles)}


def _blocked(
    missing: str,
    angles: Mapping[tuple[str, str], float | Prediction],
    choices: Mapping[tuple[str, str], Mapping[str, str]] = CHOICES,
) -> Blocked:
    """Return all readings of an angle; the nominal focal length stands in."""
    stand_in = angles.get(NOMINAL)
    return Blocked(
        missing,
        stand_in if isinstance(stand_in, float) else None,
        tuple(Reading(*name, result, choices[name]) for name, result in angles.items()),
    )


@reproduces(
    TABLE,
    cells=["*.monitoring-?"],
    given=[*MEASURED, *platform.INSTRUMENT, f"{platform.SCATTER}#2-*", FRAMES, accuracy.SMOOTHED],
    equations=["7", "10"],
    replicates=REPLICATES,
    options={
        "columns": OPTIONS["columns"],
        "telescope": {name: LENGTHS[name] for name in ("quoted", "common")},
        "images": {
            "state": "means of all images of a state",
            "ramp": "means of as many images as V-C averages on the ramps",
        },
    },
)
def monitored_angle(given: Given, seed: SeedSequence, replicates: int) -> Results:
    """Monitored angles: the angle of the stage, the noise of its state and of the zero state."""
    errors, count = monitoring_errors(given, seed, replicates), given.count(accuracy.SMOOTHED)
    fewer = np.sqrt(given.count(FRAMES) / count)
    choices = {reading: {**chosen, "images": "state"} for reading, chosen in CHOICES.items()}
    results: dict[str, Result] = {}
    for turn in TURNS:
        for row, state in enumerate(MOVED):
            noise, name = errors[:, row, "xy".index(turn)], f"{state}.monitoring-{turn}"
            angles = expected_angles(given, state, turn)
            del angles[NOMINAL]  # a length known to a few per cent is no law to draw from
            found = {reading: Prediction(angle + noise) for reading, angle in angles.items()}
            for label, place in (MOTIONS, REFERENCES):
                reading = (f"{label}; means of {count} images", f"{place}; V-C on the ramps")
                found[reading] = Prediction(angles[label, place] + fewer * noise)
                choices[reading] = {**CHOICES[label, place], "images": "ramp"}
            blocked = _blocked(COLUMNS, found, choices)
            results[name] = found[AS_QUOTED] if name in DECIDED else blocked
    return results


def monitoring_errors(given: Given, seed: SeedSequence, replicates: int) -> FloatArray:
    """Return the errors of monitored angles that centroid noise makes.

    Shape (replicates, states, 2). About X and Y, in radians, for all states but the zero state,
    whose error they share.
    """
    response = platform.angle_response(given)
    spots = platform.scatter(given, 2) / np.sqrt(given.count(FRAMES))
    noise = spawned_normals(seed, replicates, (len(STATES), *spots.shape)) * spots
    angles = np.tensordot(noise, response, axes=([-2, -1], [-2, -1]))
    return np.asarray(angles[:, 1:] - angles[:, :1])


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
        accuracy.DURATION,
        accuracy.FRAMES,
    ],
)
def plan(given: Given) -> Results:
    """Number of states, and the time that each one takes at the pace of the first groups."""
    travel = given[f"{PLAN}#travel-end"] - given[f"{PLAN}#travel-start"]
    per_frame = given[accuracy.DURATION] / given.count(accuracy.FRAMES)
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


@draws("chen2023/table-5", given=monitored_angle.given)
def draw(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Focal length that each printed angle implies for its printed motion."""
    panels = figure.subplots(1, 2, sharey=True)
    for axes, (axis, turn) in zip(panels, TURNS.items(), strict=True):
        motions = np.array([printed[f"{TABLE}#{state}.motion-{axis}"] for state in MOVED])
        angles = {
            name: np.array([printed[f"{TABLE}#{state}.{name}-{turn}"] for state in MOVED])
            for name in ("reference", "monitoring")
        }
        noise = np.sqrt(2.0) * state_noise(door, turn)  # of the state and of the zero state
        error = _implied(motions, angles["monitoring"]) * noise / np.abs(angles["monitoring"])
        left, right = np.add(MOVED, -0.1), np.add(MOVED, 0.1)
        own, blue = _implied(motions, angles["reference"]), "#0072B2"
        axes.plot(left, own, "o", color=blue, label="reference")
        # Differences of the positions, not the printed motions: one of these holds a slip.
        motions_across = np.array([_moved(printed, state, turn) for state in MOVED])
        exchanged = _implied(motions_across, angles["reference"])
        axes.plot(left, exchanged, "o", fillstyle="none", color=blue, label="reference, exchanged")
        axes.errorbar(
            right,
            _implied(motions, angles["monitoring"]),
            error,
            fmt="s",
            color="#D55E00",
            label="monitoring",
        )
        axes.axhline(
            door[platform.TELESCOPE] * 1e3, color="#000000", ls="--", lw=1, label="nominal"
        )
        axes.set(xlabel="state", title=f"stage along {axis.upper()}", xticks=MOVED)
    panels[0].set_ylabel("focal length (mm)")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)


def _implied(motions: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the focal lengths in millimetres for which (10) joins motions and angles."""
    return np.asarray(-motions / np.tan(angles) * 1e3)


def state_noise(given: Given, turn: str) -> float:
    """Return the standard deviation of a mean over one state about one axis, in radians."""
    response = platform.angle_response(given)["xy".index(turn)]
    spots = platform.scatter(given, 2)
    return float(np.sqrt((response**2 * spots**2).sum() / given.count(FRAMES)))


@dataclass(frozen=True, eq=False)
class FittedLength:
    """One focal length fitted to monitored angles that share their zero point.

    Attributes
    ----------
    length : float
        In metres.
    error : float
        Its standard deviation, in metres.
    chi_square : float
        Of the rows about it.
    """

    length: float
    error: float
    chi_square: float


def fitted_length(motions: FloatArray, angles: FloatArray, sigma: float) -> FittedLength:
    """Fit one focal length to angles that each carry the noise of the same zero state."""
    covariance = sigma**2 * (np.eye(len(angles)) + 1.0)
    inverse = np.linalg.inv(covariance)
    information = float(motions @ inverse @ motions)
    slope = -float(motions @ inverse @ angles) / information
    away = angles + slope * motions
    error = float(np.sqrt(1.0 / information))
    return FittedLength(1.0 / slope, error / slope**2, float(away @ inverse @ away))


def implied_facts(given: Given) -> dict[str, Fact]:
    """What sentences say of the implied focal lengths: their ends, and where all rows meet.

    Of the readings with interchanged columns, also the largest difference between a monitored and a
    reference angle if the reference columns were the interchanged ones.
    """
    frame = focal_lengths(given)
    frame = frame[frame["Angle"].str.startswith("reference")]
    own, other, half = (frame.iloc[:, column].to_numpy(np.float64) for column in (1, 4, 5))
    across = [
        given[f"{TABLE}#{state}.monitoring-{turn}"] - given[f"{TABLE}#{state}.reference-{axis}"]
        for axis, turn in TURNS.items()
        for state in MOVED
    ]
    lengths = {
        "printed-least": own.min(),
        "printed-most": own.max(),
        "interchanged-least": other.min(),
        "interchanged-most": other.max(),
        "shared-low": (other - half).max(),
        "shared-high": (other + half).min(),
    }
    facts = {name: Fact(float(value), ".1f", "mm") for name, value in lengths.items()}
    facts |= {
        "printed-spread": Fact(float(np.ptp(own)), ".0f", "mm"),
        "interchanged-spread": Fact(float(np.ptp(other)), ".1f", "mm"),
        "largest-difference": Fact(
            float(np.abs(across).max()) / RADIANS_PER_ARCSEC, ".3f", "arcsec"
        ),
    }
    return facts


@studied(
    "chen2023/focal-lengths",
    given=(f"{TABLE}#*", *platform.INSTRUMENT, platform.SCATTER, FRAMES),
    columns=(
        Column("Angle"),
        Column("with the motion of its own axis (mm)", ".1f", error="error with its own"),
        Column("error with its own", ".1f"),
        Column("χ²", ".1f"),
        Column("with that of the other (mm)", ".1f", error="error with the other"),
        Column("error with the other", ".1f"),
        Column("χ² with the other", ".1f"),
    ),
    caption="Focal length implied by Table V: by reference angles (± rounding of the print) and by "
    "all monitored angles of an axis together (± noise, the shared zero point included; χ² of "
    f"{len(MOVED) - 1}). Motions are differences of the printed positions, which mends the one "
    "digit.",
    named=implied_facts,
)
def focal_lengths(given: Given) -> list[tuple[str | float, ...]]:
    """Focal lengths that the rows of Table V imply, as printed and with the columns exchanged."""
    rows: list[tuple[str | float, ...]] = []
    for axis, turn in TURNS.items():
        motions = [
            np.array([_moved(given, state, moving) for state in MOVED]) for moving in (axis, turn)
        ]
        for index, state in enumerate(MOVED):
            angle = given[f"{TABLE}#{state}.reference-{turn}"]
            own, other = (-float(motion[index] / np.tan(angle)) * 1e3 for motion in motions)
            error = _rounding(own, motions[0][index], angle)
            label = f"reference about {turn.upper()}, state {state}"
            rows.append((label, own, error, np.nan, other, error, np.nan))
        angles = np.array([given[f"{TABLE}#{state}.monitoring-{turn}"] for state in MOVED])
        fits = [fitted_length(motion, angles, state_noise(given, turn)) for motion in motions]
        numbers = [n for fit in fits for n in (fit.length * 1e3, fit.error * 1e3, fit.chi_square)]
        rows.append((f"all monitored about {turn.upper()}", *numbers))
    return rows


def _rounding(length: float, motion: float, angle: float) -> float:
    """Return half the width of focal lengths that the rounding of both numbers allows."""
    # A motion is the difference of two positions, each printed to a hundredth of a micrometre.
    half_motion, half_angle = 1e-8, 0.0005 * RADIANS_PER_ARCSEC
    return abs(length) * (half_motion / abs(motion) + half_angle / abs(angle))
