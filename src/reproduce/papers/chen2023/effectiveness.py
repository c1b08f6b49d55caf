"""The test with the moving stage: Table V and its plan (chen2023, IV-B and V-C).

A reference angle is (10), with a motion of the stage and the focal length of the telescope. A
monitored angle is predicted to be that angle plus the mean centroid noise of its state, minus that
of the zero state, which all states share.

Table II gives the nominal focal length; the one that the angles were computed with is not printed.
No single focal length joins all motions and reference angles with the columns as printed. With the
columns of the two axes interchanged there is one. These choices, and the images that an angle
averages, are options; the ledger evaluates all combinations. If one focal length stands for the
whole table, the largest reference angle about Y gives it.

The focal lengths that the rows imply are compared row by row.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.random import Generator, SeedSequence, default_rng

from reproduce.papers import declare
from reproduce.papers.charts import named_below, pair
from reproduce.papers.chen2023 import accuracy, platform
from reproduce.physics.attitude import stage_angle
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
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
_WORDS = declare.item_text(TABLE)
_LENGTHS = {n: w for n, w in _WORDS.options["telescope"].items() if n != "common"}
_MEASURED = (
    f"{TABLE}#*.position-?",
    f"{TABLE}#[2-5].motion-?",
    LAST,
    platform.TELESCOPE,
    _QUOTED,
)


def _by_state(name: str, values: FloatArray) -> dict[str, float]:
    """Return the cells of a column for the states with a motion."""
    return {f"{s}.{name}": v for s, v in zip(_MOVED, values.tolist(), strict=True)}


@declare.reproduces(TABLE, cells=["*.motion-?"], inputs=[f"{TABLE}#*.position-?"])
def motion(inputs: Inputs) -> declare.Results:
    """Motion of the stage: the position minus that of the first state."""
    results = {}
    for axis in _TURNS:
        results[f"1.motion-{axis}"] = 0.0
        results |= _by_state(f"motion-{axis}", _motions(inputs, axis))
    return results


def _motions(
    inputs: Inputs, axis: str, columns: str = "", states: str = "[2-5]"
) -> FloatArray:
    """Return motions of the stage along an axis: as printed, or differences of positions.

    One printed motion has a typographical error, which the differences do not have.
    """
    if columns == "printed":
        return inputs.array(f"{TABLE}#{states}.motion-{axis}")
    first = inputs[f"{TABLE}#1.position-{axis}"]
    return inputs.array(f"{TABLE}#{states}.position-{axis}") - first


def _length(inputs: Inputs, columns: str, telescope: str) -> float:
    """Return the focal length of the telescope in metres."""
    if telescope == "common":
        # (10) joins the last angle about Y with a motion.
        (motion,) = _motions(inputs, "x" if columns == "printed" else "y", states="5")
        return float(-motion / np.tan(inputs[LAST]))
    return inputs[{"quoted": _QUOTED, "nominal": platform.TELESCOPE}[telescope]]


@declare.reproduces(
    TABLE,
    cells=["[2-4].reference-?", "5.reference-x"],
    inputs=_MEASURED,
    equations=["10"],
)
def reference_angle(inputs: Inputs, *, columns: str, telescope: str) -> declare.Results:
    """Reference angles from the motions of the stage and the focal length of the telescope."""
    length = _length(inputs, columns, telescope)
    results: dict[str, float] = {}
    for turn, axis in _TURNS.items():
        # Either interchange pairs an angle with the motion of the other axis.
        moving = axis if columns == "printed" else turn
        angles = stage_angle(_motions(inputs, moving, columns), length)
        results |= _by_state(f"reference-{turn}", angles)
    del results["5.reference-y"]
    return results


@declare.reproduces(
    TABLE,
    cells=["5.reference-y"],
    inputs=[
        f"{TABLE}#*.position-y",
        f"{TABLE}#5.motion-x",
        platform.TELESCOPE,
        _QUOTED,
    ],
    equations=["10"],
    options={**_WORDS.options, "telescope": _LENGTHS},
)
def last_reference_angle(
    inputs: Inputs, *, columns: str, telescope: str
) -> declare.Results:
    """The reference angle that gives the common focal length, by the other two lengths."""
    moving = "x" if columns == "printed" else "y"
    (motion,) = _motions(inputs, moving, columns, states="5")
    angle = stage_angle(motion, _length(inputs, columns, telescope))
    return {"5.reference-y": float(angle)}


@declare.reproduces(
    TABLE,
    cells=["*.monitoring-?"],
    inputs=[
        *_MEASURED,
        *platform.INSTRUMENT,
        f"{platform.SCATTER}#2-*",
        FRAMES,
        accuracy.SMOOTHED,
    ],
    equations=["7", "10"],
    replicates=_REPLICATES,
)
def monitored_angle(
    inputs: Inputs,
    seed: SeedSequence,
    replicates: int,
    *,
    columns: str,
    telescope: str,
    images: str,
) -> declare.Results:
    """Monitored angles: the angle of the stage, the noise of its state and of the zero state."""
    generator = default_rng(seed)
    errors = _monitoring_errors(inputs, generator, replicates)
    lag, noise = _averaging(inputs, images)
    length = np.full(replicates, _length(inputs, columns, telescope))
    if telescope == "nominal":
        # One telescope for all angles of a replicate, anywhere in the range of a nominal length.
        spread = generator.uniform(-1, 1, replicates)
        length += spread * (inputs.upper(platform.TELESCOPE) - length)
    results = {}
    for place, (turn, axis) in enumerate(_TURNS.items()):
        motions = _motions(inputs, turn if columns == "motions" else axis, columns)
        angles = stage_angle(np.insert(motions, 0, 0.0)[:, None], length)
        # A mean that includes the ramp contains a part of the step from the state before.
        means = angles[1:] - lag * np.diff(angles, axis=0)
        drawn = means + noise * errors[..., place].T
        for state, draws in zip(_MOVED, drawn, strict=True):
            results[f"{state}.monitoring-{turn}"] = declare.Prediction(draws)
    return results


def _averaging(inputs: Inputs, images: str) -> tuple[float, float]:
    """Return the fraction of a step that a mean lacks, and its noise over that of a state's mean.

    A smoothed angle is the mean of the last images, those of the state before included. Their
    noise is taken as independent of the mean of that state.
    """
    frames, smoothed = inputs.count(FRAMES), inputs.count(accuracy.SMOOTHED)
    if images == "state":
        return 0.0, 1.0
    if images == "smoothed":
        return 0.0, float(np.sqrt(frames / smoothed))
    # Weight of each image in the mean of `frames` smoothed angles.
    weights = np.convolve(np.ones(frames), np.ones(smoothed)) / (frames * smoothed)
    lag = weights[: smoothed - 1].sum()
    return float(lag), float(np.sqrt(frames * np.square(weights).sum()))


def _monitoring_errors(
    inputs: Inputs, generator: Generator, replicates: int
) -> FloatArray:
    """Return the errors of monitored angles by centroid noise, (replicates, states, 2).

    They are about X and Y, in radians, for all states but the zero state, whose error they share.
    """
    response = platform.angle_response(inputs)[:2]
    spots = platform.scatter(inputs, 2) / np.sqrt(inputs.count(FRAMES))
    noise = generator.standard_normal((replicates, len(STATES), *spots.shape)) * spots
    angles = np.tensordot(noise, response, axes=([-2, -1], [-2, -1]))
    return np.asarray(angles[:, 1:] - angles[:, :1])


@declare.reproduces(
    TABLE,
    cells=["*.difference-?"],
    inputs=[f"{TABLE}#*.reference-?", f"{TABLE}#*.monitoring-?"],
)
def difference(inputs: Inputs) -> declare.Results:
    """Difference of the printed monitored and reference angles."""
    results: dict[str, float] = {}
    for turn in _TURNS:
        monitored, reference = (
            _column(inputs, f"{name}-{turn}") for name in ("monitoring", "reference")
        )
        results |= _by_state(f"difference-{turn}", monitored - reference)
    return results


@declare.reproduces(
    _PLAN,
    cells=["states", "time-per-state"],
    inputs=[
        f"{_PLAN}#travel-*",
        f"{_PLAN}#step",
        FRAMES,
        accuracy.DURATION,
        accuracy.FRAMES,
    ],
)
def plan(inputs: Inputs) -> declare.Results:
    """Number of states, and the time that each one takes at the pace of the first groups."""
    travel = inputs[f"{_PLAN}#travel-end"] - inputs[f"{_PLAN}#travel-start"]
    return {
        "states": travel / inputs[f"{_PLAN}#step"] + 1,
        "time-per-state": inputs[FRAMES] * accuracy.time_per_frame(inputs),
    }


@declare.reproduces(
    _PLAN,
    cells=["simulated-angle"],
    inputs=[f"{_PLAN}#maximum-travel", _QUOTED],
    equations=["10"],
)
def largest_angle(inputs: Inputs) -> declare.Results:
    """Largest misalignment that the stage can simulate, without its sign."""
    angle = stage_angle(inputs[f"{_PLAN}#maximum-travel"], inputs[_QUOTED])
    return {"simulated-angle": abs(float(angle))}


@declare.reproduces(
    _PLAN, cells=["difference-bound"], inputs=[f"{TABLE}#*.difference-?"]
)
def bound(inputs: Inputs) -> declare.Results:
    """Largest printed difference between reference and monitored angle."""
    return {
        "difference-bound": float(np.abs(inputs.array(f"{TABLE}#*.difference-?")).max())
    }


@declare.draws("chen2023/table-5", inputs=monitored_angle.inputs)
def _draw(figure: Figure, printed: Mapping[str, float], inputs: Inputs) -> None:
    """Focal length that each printed angle implies for its printed motion."""
    panels, blue = pair(figure, 3.6, 5.6, "focal length (mm)"), "#0072B2"
    # Noise of the state and of the zero state.
    sigmas = np.sqrt(2.0) * platform.angle_sigma(inputs, 2, inputs.count(FRAMES))
    for axes, (axis, turn) in zip(panels, _TURNS.items(), strict=True):
        motions = _column(printed, f"motion-{axis}")
        reference = _column(printed, f"reference-{turn}")
        monitoring = _column(printed, f"monitoring-{turn}")
        length = _implied(motions, monitoring)
        error = length * sigmas["xy".index(turn)] / np.abs(monitoring)
        left, right = np.add(_MOVED, -0.1), np.add(_MOVED, 0.1)
        axes.plot(
            left, _implied(motions, reference), "o", color=blue, label="reference"
        )
        axes.plot(
            left,
            _implied(_motions(inputs, turn), reference),
            "o",
            fillstyle="none",
            color=blue,
            label="reference, exchanged",
        )
        axes.errorbar(
            right, length, error, fmt="s", color="#D55E00", label="monitoring"
        )
        nominal = inputs[platform.TELESCOPE] * 1e3
        axes.axhline(nominal, color="#000000", ls="--", lw=1, label="nominal")
        axes.set(xlabel="state", title=f"stage along {axis.upper()}", xticks=_MOVED)
    named_below(figure, 4)


def _column(printed: Inputs | Mapping[str, float], name: str) -> FloatArray:
    return np.array([printed[f"{TABLE}#{state}.{name}"] for state in _MOVED])


def _implied(motions: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the focal lengths in millimetres for which (10) joins motions and angles."""
    return np.asarray(-motions / np.tan(angles) * 1e3)


def _implied_facts(inputs: Inputs) -> dict[str, declare.Fact]:
    """Return the extremes of the implied focal lengths, and the range that fits all rows.

    The largest difference is between monitored and reference angles with interchanged columns.
    """
    own, half, other, _ = _focal_lengths(inputs).iloc[:, 1:].to_numpy(np.float64).T
    lengths = {
        "printed-least": own.min(),
        "printed-most": own.max(),
        "interchanged-least": other.min(),
        "interchanged-most": other.max(),
        "shared-low": (other - half).max(),
        "shared-high": (other + half).min(),
    }
    largest = max(
        np.abs(
            _column(inputs, f"monitoring-{turn}") - _column(inputs, f"reference-{axis}")
        ).max()
        for axis, turn in _TURNS.items()
    )
    facts = {
        name: declare.Fact(float(value), ".1f", "mm") for name, value in lengths.items()
    }
    return facts | {
        "largest-difference": declare.Fact(
            float(largest / RADIANS_PER_ARCSEC), ".3f", "arcsec"
        )
    }


@declare.studied("chen2023/focal-lengths", inputs=[f"{TABLE}#*"], named=_implied_facts)
def _focal_lengths(inputs: Inputs) -> Iterator[tuple[str | float, ...]]:
    """Focal lengths that the rows of Table V imply, as printed and with the columns exchanged."""
    # Rounding: a motion is the difference of two positions to 0.01 µm.
    half_motion, half_angle = 1e-8, 0.0005 * RADIANS_PER_ARCSEC
    for axis, turn in _TURNS.items():
        angles, motions = _column(inputs, f"reference-{turn}"), _motions(inputs, axis)
        own, other = (_implied(_motions(inputs, a), angles) for a in (axis, turn))
        relative = half_motion / np.abs(motions) + half_angle / np.abs(angles)
        for state, *row in zip(_MOVED, own, own * relative, other, strict=True):
            yield (f"reference about {turn.upper()}, state {state}", *row, row[1])


def _shared_zero_chi_square(differences: FloatArray, sigma: float) -> float:
    """Return chi-square of differences that each carry the noise of the same zero state."""
    count = differences.size + 1
    total = np.square(differences).sum() - differences.sum() ** 2 / count
    return float(total / sigma**2)


def _test_facts(inputs: Inputs) -> dict[str, declare.Fact]:
    """Return the probability under each noise, chi-square of the first, and the differences.

    The lag is that of a mean over the smoothed angles of a whole state, with its ramp.
    """
    rows = _differences(inputs).to_numpy()
    # A probability below 1e-12 is quoted as zero.
    facts = {
        f"{name}-chance": declare.Fact(row[3], "chance", zero=1e-12)
        for name, row in zip(("state", "ramp", "printed"), rows, strict=True)
    }
    few, frames = inputs.count(accuracy.SMOOTHED), inputs.count(FRAMES)
    # After a step the mean of the last n images lacks (n - 1)/n, ..., 1/n, 0 of it.
    short = (few - 1) / (2 * frames)
    step = np.abs(
        [inputs[f"{TABLE}#{STATES[-1]}.reference-{a}"] for a in _TURNS]
    ).mean()
    differences = inputs.array(f"{TABLE}#[2-5].difference-?") / RADIANS_PER_ARCSEC
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
    inputs=(
        f"{TABLE}#[2-5].difference-?",
        f"{TABLE}#{STATES[-1]}.reference-?",
        f"{accuracy.TABLE}#*.misalignment-?",
        FRAMES,
        accuracy.SMOOTHED,
    ),
    named=_test_facts,
)
def _differences(inputs: Inputs) -> Iterator[tuple[str, float, int, float]]:
    """Joint test of the differences of Table V: are they noise?"""
    from scipy.special import chdtrc

    few, frames = inputs.count(accuracy.SMOOTHED), inputs.count(FRAMES)
    freedom = len(_MOVED) * len(_TURNS)
    for name, row, averaged in (
        (f"one frame of Table IV, means of {frames}", 1, frames),
        (f"one frame of Table IV, means of {few}", 1, few),
        (f"{few} frames of Table IV", few, 1),
    ):
        found = 0.0
        for turn in _TURNS:
            accurate = inputs[f"{accuracy.TABLE}#{row}.misalignment-{turn}"]
            sigma = accurate / platform.SIGMAS / np.sqrt(averaged)
            found += _shared_zero_chi_square(
                _column(inputs, f"difference-{turn}"), sigma
            )
        yield (name, found, freedom, float(chdtrc(freedom, found)))
