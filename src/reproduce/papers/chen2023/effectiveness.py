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

The focal lengths that the rows imply are compared row by row.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING

import numpy as np
from numpy.random import SeedSequence

from reproduce.papers import declare
from reproduce.papers.chen2023 import accuracy, platform
from reproduce.papers.sketch import named_below, pair
from reproduce.physics.attitude import stage_angle
from reproduce.physics.optics import spawned_normals
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given
from reproduce.units import RADIANS_PER_ARCSEC

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from matplotlib.figure import Figure


TABLE = "chen2023/table-5"
_PLAN = "chen2023/text-effectiveness"
_QUOTED = f"{_PLAN}#focal-length"
FRAMES = f"{_PLAN}#frames-per-state"
STATES = (1, 2, 3, 4, 5)
_MOVED = STATES[1:]
# A motion along one axis turns the camera about the other one.
_TURNS = {"x": "y", "y": "x"}
_REPLICATES = 4000
# The angle from which one focal length for the whole table is taken.
LAST = f"{TABLE}#5.reference-y"
_WORDS = declare.words(TABLE)


@declare.reproduces(TABLE, cells=["*.motion-?"], given=[f"{TABLE}#*.position-?"])
def motion(given: Given) -> declare.Results:
    """Motion of the stage: the position less that of the first state."""
    return {f"{s}.motion-{axis}": _moved(given, s, axis) for axis in _TURNS for s in STATES}


_MEASURED = (f"{TABLE}#*.position-?", f"{TABLE}#[2-5].motion-?", LAST, platform.TELESCOPE, _QUOTED)


def _moved(printed: Given | Mapping[str, float], state: int, axis: str) -> float:
    """Return a motion as the difference of the printed positions: one printed motion is a slip."""
    return printed[f"{TABLE}#{state}.position-{axis}"] - printed[f"{TABLE}#1.position-{axis}"]


def _common_length(given: Given, axis: str) -> float:
    """Return the focal length for which (10) joins the last angle about Y with a motion."""
    return float(-_moved(given, STATES[-1], axis) / np.tan(given[LAST]))


def _expected_angles(given: Given, state: int, turn: str) -> dict[tuple[str, str], float]:
    """Return the angle of the stage in a state, in radians, by columns and telescope."""
    axis, exchanged = _TURNS[turn], _common_length(given, "y")
    printed = given[f"{TABLE}#{state}.motion-{axis}"]
    sides = {
        ("printed", "quoted"): (printed, given[_QUOTED]),
        ("printed", "nominal"): (printed, given[platform.TELESCOPE]),
        ("printed", "common"): (printed, _common_length(given, "x")),
        ("motions", "common"): (_moved(given, state, turn), exchanged),
        ("references", "common"): (_moved(given, state, axis), exchanged),
    }
    angles = stage_angle(*np.transpose(list(sides.values())))
    return dict(zip(sides, angles.tolist(), strict=True))


def _angles_read(name: str, angles: Mapping[tuple[str, str], float]) -> declare.Blocked:
    """Return an angle under all its readings; the nominal focal length stands in."""
    chosen = (way.choices for way in _WORDS.readings[name])
    found = [angles[one["columns"], one["telescope"]] for one in chosen]
    return declare.blocked(_WORDS, name, found, angles["printed", "nominal"])


@declare.reproduces(
    TABLE,
    cells=["[2-4].reference-?", "5.reference-x"],
    given=_MEASURED,
    equations=["10"],
    options=declare.options_of(_WORDS, "reference"),
)
def reference_angle(given: Given) -> declare.Results:
    """Reference angles from the motions and each focal length that the text leaves open."""
    results = {}
    for turn, state in product(_TURNS, _MOVED):
        if f"{TABLE}#{state}.reference-{turn}" != LAST:
            angles = _expected_angles(given, state, turn)
            # An angle under the other heading is one of the other motion.
            angles["references", "common"] = angles["motions", "common"]
            results[f"{state}.reference-{turn}"] = _angles_read("reference", angles)
    return results


@declare.reproduces(
    TABLE,
    cells=["5.reference-y"],
    given=[f"{TABLE}#5.motion-x", platform.TELESCOPE, _QUOTED],
    equations=["10"],
    options={"telescope": declare.options_of(_WORDS, "last-reference")["telescope"]},
)
def last_reference_angle(given: Given) -> declare.Results:
    """The reference angle that the others take their focal length from, by the nominal one."""
    lengths = {"quoted": given[_QUOTED], "nominal": given[platform.TELESCOPE]}
    motion = given[f"{TABLE}#5.motion-x"]
    angles = {("printed", n): float(stage_angle(motion, one)) for n, one in lengths.items()}
    return {"5.reference-y": _angles_read("last-reference", angles)}


@declare.reproduces(
    TABLE,
    cells=["*.monitoring-?"],
    given=[*_MEASURED, *platform.INSTRUMENT, f"{platform.SCATTER}#2-*", FRAMES, accuracy.SMOOTHED],
    equations=["7", "10"],
    replicates=_REPLICATES,
    options=declare.options_of(_WORDS, "monitoring"),
)
def monitored_angle(given: Given, seed: SeedSequence, replicates: int) -> declare.Results:
    """Monitored angles: the angle of the stage, the noise of its state and of the zero state."""
    errors, count = _monitoring_errors(given, seed, replicates), given.count(accuracy.SMOOTHED)
    shares = {"state": 1.0, "ramp": np.sqrt(given.count(FRAMES) / count)}
    results: dict[str, declare.Result] = {}
    for turn, state in product(_TURNS, _MOVED):
        noise, angles = errors[:, state - 2, "xy".index(turn)], _expected_angles(given, state, turn)
        readings = []
        for way in _WORDS.readings["monitoring"]:
            columns, telescope, images = way.choices.values()
            drawn = declare.Prediction(angles[columns, telescope] + shares[images] * noise)
            readings.append(declare.read(replace(way, name=way.name.format(count=count)), drawn))
        missing = _WORDS.missing["monitoring"]
        results[f"{state}.monitoring-{turn}"] = declare.Blocked(missing, readings=tuple(readings))
    return results


def _monitoring_errors(given: Given, seed: SeedSequence, replicates: int) -> FloatArray:
    """Return the errors of monitored angles that centroid noise makes.

    Shape (replicates, states, 2). About X and Y, in radians, for all states but the zero state,
    whose error they share.
    """
    response = platform.angle_response(given)[:2]
    spots = platform.scatter(given, 2) / np.sqrt(given.count(FRAMES))
    noise = spawned_normals(seed, replicates, (len(STATES), *spots.shape)) * spots
    angles = np.tensordot(noise, response, axes=([-2, -1], [-2, -1]))
    return np.asarray(angles[:, 1:] - angles[:, :1])


@declare.reproduces(
    TABLE,
    cells=["*.difference-?"],
    given=[f"{TABLE}#*.reference-?", f"{TABLE}#*.monitoring-?"],
)
def difference(given: Given) -> declare.Results:
    """Difference of the printed monitored and reference angles."""
    return {
        f"{state}.difference-{turn}": given[f"{TABLE}#{state}.monitoring-{turn}"]
        - given[f"{TABLE}#{state}.reference-{turn}"]
        for turn, state in product(_TURNS.values(), _MOVED)
    }


@declare.reproduces(
    _PLAN,
    cells=["states", "time-per-state"],
    given=[f"{_PLAN}#travel-*", f"{_PLAN}#step", FRAMES, accuracy.DURATION, accuracy.FRAMES],
)
def plan(given: Given) -> declare.Results:
    """Number of states, and the time that each one takes at the pace of the first groups."""
    travel = given[f"{_PLAN}#travel-end"] - given[f"{_PLAN}#travel-start"]
    per_frame = given[accuracy.DURATION] / given.count(accuracy.FRAMES)
    return {
        "states": travel / given[f"{_PLAN}#step"] + 1,
        "time-per-state": given.count(FRAMES) * per_frame,
    }


@declare.reproduces(
    _PLAN, cells=["simulated-angle"], given=[f"{_PLAN}#maximum-travel", _QUOTED], equations=["10"]
)
def largest_angle(given: Given) -> declare.Results:
    """Largest misalignment that the stage can simulate, without its sign."""
    angle = stage_angle(given[f"{_PLAN}#maximum-travel"], given[_QUOTED])
    return {"simulated-angle": abs(float(angle))}


@declare.reproduces(_PLAN, cells=["difference-bound"], given=[f"{TABLE}#*.difference-?"])
def bound(given: Given) -> declare.Results:
    """Largest printed difference between reference and monitored angle."""
    return {"difference-bound": float(np.abs(given.array(f"{TABLE}#*.difference-?")).max())}


@declare.draws("chen2023/table-5", given=monitored_angle.given)
def _draw(figure: Figure, printed: Mapping[str, float], door: Given) -> None:
    """Focal length that each printed angle implies for its printed motion."""
    panels = pair(figure, 3.6, 5.6, "focal length (mm)")
    sigma = platform.angle_sigma(door, 2, door.count(FRAMES))
    for axes, (axis, turn) in zip(panels, _TURNS.items(), strict=True):
        motions = _column(printed, f"motion-{axis}")
        reference = _column(printed, f"reference-{turn}")
        monitoring = _column(printed, f"monitoring-{turn}")
        noise = np.sqrt(2.0) * sigma["xy".index(turn)]  # of the state and of the zero state
        length = _implied(motions, monitoring)
        error = length * noise / np.abs(monitoring)
        left, right = np.add(_MOVED, -0.1), np.add(_MOVED, 0.1)
        own, blue = _implied(motions, reference), "#0072B2"
        axes.plot(left, own, "o", color=blue, label="reference")
        # Differences of the positions, not the printed motions: one of these holds a slip.
        across = np.array([_moved(printed, state, turn) for state in _MOVED])
        exchanged = _implied(across, reference)
        axes.plot(left, exchanged, "o", fillstyle="none", color=blue, label="reference, exchanged")
        axes.errorbar(right, length, error, fmt="s", color="#D55E00", label="monitoring")
        nominal = door[platform.TELESCOPE] * 1e3
        axes.axhline(nominal, color="#000000", ls="--", lw=1, label="nominal")
        axes.set(xlabel="state", title=f"stage along {axis.upper()}", xticks=_MOVED)
    named_below(figure, 4)


def _column(printed: Given | Mapping[str, float], name: str) -> FloatArray:
    return np.array([printed[f"{TABLE}#{state}.{name}"] for state in _MOVED])


def _implied(motions: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the focal lengths in millimetres for which (10) joins motions and angles."""
    return np.asarray(-motions / np.tan(angles) * 1e3)


def _implied_facts(given: Given) -> dict[str, declare.Fact]:
    """What sentences say of the implied focal lengths: their ends, and where all rows meet.

    Of the readings with interchanged columns, also the largest difference between a monitored and a
    reference angle if the reference columns were the interchanged ones.
    """
    own, half, other, _ = _focal_lengths(given).iloc[:, 1:].to_numpy(np.float64).T
    away = [
        np.abs(_column(given, f"monitoring-{turn}") - _column(given, f"reference-{axis}")).max()
        for axis, turn in _TURNS.items()
    ]
    lengths = {
        "printed-least": own.min(),
        "printed-most": own.max(),
        "interchanged-least": other.min(),
        "interchanged-most": other.max(),
        "shared-low": (other - half).max(),
        "shared-high": (other + half).min(),
    }
    facts = {name: declare.Fact(float(value), ".1f", "mm") for name, value in lengths.items()}
    largest = float(max(away)) / RADIANS_PER_ARCSEC
    return facts | {"largest-difference": declare.Fact(largest, ".3f", "arcsec")}


@declare.studied("chen2023/focal-lengths", given=[f"{TABLE}#*"], named=_implied_facts)
def _focal_lengths(given: Given) -> Iterator[tuple[str | float, ...]]:
    """Focal lengths that the rows of Table V imply, as printed and with the columns exchanged."""
    for axis, turn in _TURNS.items():
        motions = [np.array([_moved(given, s, moving) for s in _MOVED]) for moving in (axis, turn)]
        angles = _column(given, f"reference-{turn}")
        own, other = (_implied(motion, angles) for motion in motions)
        # What the rounding of both numbers allows; a motion is the difference of two positions,
        # each printed to a hundredth of a micrometre.
        half_motion, half_angle = 1e-8, 0.0005 * RADIANS_PER_ARCSEC
        error = np.abs(own) * (half_motion / np.abs(motions[0]) + half_angle / np.abs(angles))
        for state, *one in zip(_MOVED, own, error, other, strict=True):
            yield (f"reference about {turn.upper()}, state {state}", *one, one[1])


def _shared_zero_chi_square(differences: FloatArray, sigma: float) -> float:
    """Return chi-square of differences that each carry the noise of the same zero state."""
    total = np.square(differences).sum() - differences.sum() ** 2 / (differences.size + 1)
    return float(total / sigma**2)


def _test_facts(given: Given) -> dict[str, declare.Fact]:
    """What sentences say of the test: the probability under each noise, chi-square of the first.

    Also the lag of a mean over the smoothed angles of a whole state, with its ramp, and the mean
    and the largest of the differences, which have no such lag.
    """
    rows = [tuple(row) for row in _differences(given).itertuples(index=False)]
    # Smaller probabilities say "never", not how rarely.
    chances = [declare.Fact(row[3], "chance", zero=1e-12) for row in rows]
    facts = dict(zip(("state-chance", "ramp-chance", "printed-chance"), chances, strict=True))
    few, frames = given.count(accuracy.SMOOTHED), given.count(FRAMES)
    # After a step the mean of the last n images is short of it by (n - 1)/n, ..., 1/n, 0.
    short = (few - 1) / (2 * frames)
    step = np.abs([given[f"{TABLE}#{STATES[-1]}.reference-{a}"] for a in _TURNS]).mean()
    differences = given.array(f"{TABLE}#[2-5].difference-?") / RADIANS_PER_ARCSEC
    lag = step / len(_MOVED) * short / RADIANS_PER_ARCSEC
    return facts | {
        "ramp-lag": declare.Fact(float(lag), ".2f", "arcsec"),
        "mean": declare.Fact(float(differences.mean()), ".4f", "arcsec"),
        "largest": declare.Fact(float(np.abs(differences).max()), ".3f", "arcsec"),
        "state-chi-square": declare.Fact(rows[0][1], ".1f"),
        "freedom": declare.Fact(rows[0][2], "d"),
    }


@declare.studied(
    "chen2023/differences",
    given=(
        f"{TABLE}#[2-5].difference-?",
        f"{TABLE}#{STATES[-1]}.reference-?",
        f"{accuracy.TABLE}#*.misalignment-?",
        FRAMES,
        accuracy.SMOOTHED,
    ),
    named=_test_facts,
)
def _differences(given: Given) -> list[tuple[str, float, int, float]]:
    """Whether the differences of Table V are noise: all of them tested together."""
    from scipy.special import chdtrc

    few, frames = given.count(accuracy.SMOOTHED), given.count(FRAMES)
    rows, freedom = [], len(_MOVED) * len(_TURNS)
    for name, row, averaged in (
        (f"one frame of Table IV, means of {frames}", 1, frames),
        (f"one frame of Table IV, means of {few}", 1, few),
        (f"{few} frames of Table IV", few, 1),
    ):
        found = 0.0
        for turn in _TURNS:
            accurate = given[f"{accuracy.TABLE}#{row}.misalignment-{turn}"]
            sigma = accurate / platform.SIGMAS / np.sqrt(averaged)
            found += _shared_zero_chi_square(_column(given, f"difference-{turn}"), sigma)
        rows.append((name, found, freedom, float(chdtrc(freedom, found))))
    return rows
