"""The test with the moving stage: Table V and its plan (chen2023, IV-B and V-C).

A reference angle is (10), with a motion of the stage and the focal length of the telescope. A
monitored angle is predicted to be that angle plus the mean centroid noise of its state, minus the
noise of the zero state, which all states share.

Table II gives the nominal focal length. The paper does not print the focal length with which the
angles were computed. No single focal length agrees with all motions and reference angles with the
columns as printed. If the columns of the two axes are interchanged, one does. These choices, and
the images that an angle averages, are options. The ledger evaluates all combinations. The focal
length for the whole table is computed from the largest reference angle about Y.

A supplementary table compares the focal lengths that the rows imply.
"""

from __future__ import annotations

import numpy as np
from numpy.random import SeedSequence, default_rng

from reproduce.papers.charts import Figure, set_size
from reproduce.papers.chen2023.accuracy import (
    DURATION,
    FRAMES,
    SMOOTHED,
    time_per_frame,
)
from reproduce.papers.chen2023.platform import (
    INSTRUMENT,
    SIGMAS,
    TELESCOPE,
    angle_sigma,
    unit_rotations,
)
from reproduce.papers.declare import (
    Results,
    Rows,
    by_cell,
    draws,
    item_text,
    reproduces,
    studied,
)
from reproduce.physics.attitude import shared_zero_chi_square, stage_angle
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs
from reproduce.units import ARCSEC_PER_RADIAN, RADIANS_PER_ARCSEC

_QUOTED = "chen2023/text-effectiveness#focal-length"
BOUND = "chen2023/text-effectiveness#difference-bound"
FRAMES_PER_STATE = "chen2023/text-effectiveness#frames-per-state"
_MOVED_STATES = (2, 3, 4, 5)
# A motion along one axis rotates the camera about the other axis. Arrays of both, of shape (4, 2),
# have the motions along X and Y, and the angles about Y and X.
_ABOUT = "yx"
# The angle from which one focal length for the whole table is computed.
LAST = "chen2023/table-5#5.reference-y"
_OPTIONS = item_text("chen2023/table-5").options
_MEASURED = (
    "chen2023/table-5#*.position-?",
    "chen2023/table-5#[2-5].motion-?",
    LAST,
    TELESCOPE,
    _QUOTED,
)


def stage_motions(inputs: Inputs, columns: str = "") -> FloatArray:
    """Return the motions of the stage in all states, (5, 2): as printed, or between positions.

    One printed motion has a typographical error, which the differences do not have.
    """
    positions = inputs.pairs("chen2023/table-5#*.position-?")
    motions = positions - positions[0]
    if columns == "printed":
        motions[1:] = inputs.pairs("chen2023/table-5#[2-5].motion-?")
    return motions


def _angles(inputs: Inputs) -> tuple[FloatArray, FloatArray]:
    """Return the printed monitored and reference angles, each (4, 2)."""
    return (
        inputs.pairs("chen2023/table-5#[2-5].monitoring-?"),
        inputs.pairs("chen2023/table-5#[2-5].reference-?"),
    )


@reproduces(
    "chen2023/table-5", cells=["*.motion-?"], inputs=["chen2023/table-5#*.position-?"]
)
def motion(inputs: Inputs) -> Results:
    """Compute the motions of the stage: the position minus the position of the first state."""
    return by_cell("{}.motion-{}", stage_motions(inputs), range(1, 6), "xy")


def telescope_length(inputs: Inputs, columns: str, telescope: str) -> float:
    """Return the focal length of the telescope in metres under a reading."""
    if telescope == "common":
        # (10) relates the last angle about Y to a motion.
        x, y = stage_motions(inputs)[-1]
        return -(x if columns == "printed" else y) / np.tan(inputs[LAST])
    return inputs[{"quoted": _QUOTED, "nominal": TELESCOPE}[telescope]]


@reproduces(
    "chen2023/table-5",
    cells=["[2-4].reference-?", "5.reference-x"],
    inputs=_MEASURED,
)
def reference_angle(inputs: Inputs, *, columns: str, telescope: str) -> Results:
    """Compute the reference angles from the motions of the stage and the focal length.

    Implements: chen2023 (10).
    """
    motions = stage_motions(inputs, columns)[1:]
    if columns != "printed":
        # Either interchange pairs an angle with the motion of the other axis.
        motions = motions[:, ::-1]
    angles = stage_angle(motions, telescope_length(inputs, columns, telescope))
    results = by_cell("{}.reference-{}", angles, _MOVED_STATES, _ABOUT)
    del results["5.reference-y"]
    return results


@reproduces(
    "chen2023/table-5",
    cells=["5.reference-y"],
    inputs=[
        "chen2023/table-5#*.position-y",
        "chen2023/table-5#5.motion-x",
        TELESCOPE,
        _QUOTED,
    ],
    options={
        "columns": _OPTIONS["columns"],
        "telescope": {n: _OPTIONS["telescope"][n] for n in ("quoted", "nominal")},
    },
)
def last_reference_angle(inputs: Inputs, *, columns: str, telescope: str) -> Results:
    """Compute the angle that gives the common focal length, with the other two lengths.

    Implements: chen2023 (10).
    """
    first, *_, last = inputs.array("chen2023/table-5#*.position-y")
    motion = last - first
    if columns == "printed":
        motion = inputs["chen2023/table-5#5.motion-x"]
    length = telescope_length(inputs, columns, telescope)
    return {"5.reference-y": stage_angle(motion, length)}


@reproduces(
    "chen2023/table-5",
    cells=["*.monitoring-?"],
    inputs=[
        *_MEASURED,
        *INSTRUMENT,
        "chen2023/table-3#2-*",
        FRAMES_PER_STATE,
        SMOOTHED,
    ],
    replicates=4000,
)
def monitored_angle(
    inputs: Inputs,
    seed: SeedSequence,
    replicates: int,
    *,
    columns: str,
    telescope: str,
    images: str,
) -> Results:
    """Compute the monitored angles: the angle of the stage and the noise of two states.

    Implements: chen2023 (7), (10).
    """
    generator = default_rng(seed)
    # About Y and X, by the noise of one image in each coordinate.
    rotations = unit_rotations(inputs, 2)[1::-1]
    shape = (replicates, 1 + len(_MOVED_STATES), rotations.shape[1])
    errors = generator.standard_normal(shape) @ rotations.T
    lag, noise = _averaging(inputs, images)
    # One telescope for all angles of a replicate, anywhere in the range of a nominal length.
    half = (telescope == "nominal") * inputs.half_width(TELESCOPE)
    spread = generator.uniform(-half, half, (replicates, 1, 1))
    length = telescope_length(inputs, columns, telescope) + spread
    motions = stage_motions(inputs, columns)
    if columns == "motions":
        motions = motions[:, ::-1]
    angles = stage_angle(motions, length)
    # A mean that includes the ramp contains a part of the step from the state before.
    means = angles[:, 1:] - lag * np.diff(angles, axis=1)
    # All angles share the error of the zero state.
    means += noise * (errors[:, 1:] - errors[:, :1])
    return by_cell("{}.monitoring-{}", means, _MOVED_STATES, _ABOUT)


def _averaging(inputs: Inputs, images: str) -> tuple[float, float]:
    """Return the missing fraction of a step in a mean, and its noise relative to one image.

    A smoothed angle is the mean of the last images, which may include images of the state before.
    Their noise is taken as independent of the mean of that state.
    """
    frames = inputs.count(FRAMES_PER_STATE)
    # Weights of the images in a mean.
    state, smoothed = (
        np.full(count, 1 / count) for count in (frames, inputs.count(SMOOTHED))
    )
    weights = {
        "state": state,
        "smoothed": smoothed,
        "with-ramp": np.convolve(state, smoothed),
    }[images]
    # Images before the last state.
    lag = weights[:-frames].sum()
    return lag, np.sqrt(weights @ weights)


@reproduces(
    "chen2023/table-5",
    cells=["*.difference-?"],
    inputs=["chen2023/table-5#*.reference-?", "chen2023/table-5#*.monitoring-?"],
)
def difference(inputs: Inputs) -> Results:
    """Compute the differences of the printed monitored and reference angles."""
    monitored, reference = _angles(inputs)
    return by_cell("{}.difference-{}", monitored - reference, _MOVED_STATES, _ABOUT)


@reproduces(
    "chen2023/text-effectiveness",
    cells=["states", "time-per-state"],
    inputs=[
        "chen2023/text-effectiveness#travel-*",
        "chen2023/text-effectiveness#step",
        FRAMES_PER_STATE,
        DURATION,
        FRAMES,
    ],
)
def plan(inputs: Inputs) -> Results:
    """Compute the number of states, and the time of a state at the pace of the first groups."""
    start, end = inputs.array("chen2023/text-effectiveness#travel-*")
    return {
        "states": (end - start) / inputs["chen2023/text-effectiveness#step"] + 1,
        "time-per-state": inputs[FRAMES_PER_STATE] * time_per_frame(inputs),
    }


@reproduces(
    "chen2023/text-effectiveness",
    cells=["simulated-angle"],
    inputs=["chen2023/text-effectiveness#maximum-travel", _QUOTED],
)
def largest_angle(inputs: Inputs) -> Results:
    """Compute the largest misalignment that the stage can simulate, without its sign.

    Implements: chen2023 (10).
    """
    travel = inputs["chen2023/text-effectiveness#maximum-travel"]
    return {"simulated-angle": abs(stage_angle(travel, inputs[_QUOTED]))}


@reproduces(
    "chen2023/text-effectiveness",
    cells=["difference-bound"],
    inputs=["chen2023/table-5#*.difference-?"],
)
def bound(inputs: Inputs) -> Results:
    """Compute the largest printed difference between reference and monitored angle."""
    differences = inputs.array("chen2023/table-5#*.difference-?")
    return {"difference-bound": np.abs(differences).max()}


@draws("chen2023/table-5", inputs=monitored_angle.inputs, marks=[BOUND])
def _draw(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the differences from several reference angles, and the implied focal lengths."""
    rows = (4, 1) if set_size(figure, 6.6, 10.5) else (2, 2)
    panels = np.reshape(figure.subplots(*rows, sharex=True), (2, 2))
    # Noise of the state and of the zero state.
    sigmas = np.sqrt(2.0) * angle_sigma(inputs, 2, inputs.count(FRAMES_PER_STATE))
    nominal = inputs[TELESCOPE]
    common = telescope_length(inputs, "motions", "common")
    bound = printed[BOUND] * ARCSEC_PER_RADIAN
    monitored, reference = _angles(printed)
    own = stage_motions(inputs)[1:]
    other = own[:, ::-1]
    differences = (
        ("C0o", reference, "printed reference angle"),
        ("C1s", stage_angle(own, nominal), f"angle for {nominal * 1e3:.0f} mm"),
        ("C2^", stage_angle(own, common), f"angle for {common * 1e3:.0f} mm"),
        ("C3D", stage_angle(other, common), "same, columns exchanged"),
    )
    lengths = (
        ("C2^", _implied(own, reference), "motion of the same axis"),
        ("C3D", _implied(other, reference), "motion of the other axis"),
    )
    for place, (upper, lower) in enumerate(panels.T):
        bar = sigmas[1 - place] * ARCSEC_PER_RADIAN
        upper.axhspan(
            -bound, bound, fc=("C6", 0.2), ec="C6", label="bound of the paper"
        )
        shifts = np.linspace(-0.21, 0.21, 4)
        for shift, (look, angles, label) in zip(shifts, differences, strict=True):
            error = (monitored - angles)[:, place] * ARCSEC_PER_RADIAN
            upper.errorbar(shift + _MOVED_STATES, error, bar, fmt=look, label=label)
        for look, implied, label in lengths:
            lower.plot(_MOVED_STATES, implied[:, place], look, label=label)
        lower.axhline(nominal * 1e3, color="k", ls="--", lw=1, label="nominal")
        lower.axhline(common * 1e3, color="C3", lw=1, label="one for all angles")
        title = f"angle about {_ABOUT[place].upper()}"
        upper.set(title=title, ylabel="difference (arcsec)", ylim=(-0.25, 0.4))
        lower.set(
            ylabel="focal length (mm)",
            xlabel="state",
            xticks=_MOVED_STATES,
            ylim=(1990, 2095),
        )
        if rows == (4, 1):
            lower.set_title(title)
    above, below = (row[0].get_legend_handles_labels() for row in panels)
    names = {"ncols": rows[1], "title": "monitored angle minus"}
    figure.legend(*above, loc="outside upper center", **names)
    names["title"] = "focal length from the printed reference angle and"
    figure.legend(*below, loc="outside lower center", **names)
    for axes in panels.flat:
        axes.label_outer()


def _implied(motions: FloatArray, angles: FloatArray) -> FloatArray:
    """Return the focal lengths in millimetres for which (10) relates motions to angles."""
    return -motions / np.tan(angles) * 1e3


def _implied_facts(inputs: Inputs) -> Results:
    """Return the range of focal lengths that agrees with all rows, and differences.

    The largest differences are between monitored angles and reference angles: the printed ones with
    interchanged columns, and those for two focal lengths. The needed accuracy of a focal length
    changes the last reference angle by the bound of the paper.
    """
    *_, other, half = zip(*_focal_lengths.function(inputs), strict=True)
    monitored, reference = _angles(inputs)
    lengths = inputs[TELESCOPE], telescope_length(inputs, "motions", "common")
    own = [stage_angle(stage_motions(inputs)[1:], length) for length in lengths]
    differences = np.abs(monitored - [reference[:, ::-1], *own]).max(axis=(1, 2))
    return {
        "shared-low": np.subtract(other, half).max(),
        "shared-high": np.add(other, half).min(),
        **by_cell(
            "{}-difference",
            differences / RADIANS_PER_ARCSEC,
            ("largest", "nominal", "common"),
        ),
        "needed": 100 * inputs[BOUND] / abs(inputs[LAST]),
    }


@studied(
    "chen2023/focal-lengths",
    inputs=["chen2023/table-5#*", TELESCOPE, BOUND],
    named=_implied_facts,
)
def _focal_lengths(inputs: Inputs) -> Rows:
    """Compute the focal lengths that the rows of Table V imply, also with columns exchanged."""
    # Rounding: a motion is the difference of two positions to 0.01 µm.
    half_motion, half_angle = 1e-8, 0.0005 * RADIANS_PER_ARCSEC
    (_, angles), motions = _angles(inputs), stage_motions(inputs)[1:]
    columns = list[FloatArray]()
    for of_angle in (motions, motions[:, ::-1]):
        lengths = _implied(of_angle, angles)
        relative = half_motion / np.abs(of_angle) + half_angle / np.abs(angles)
        columns += [lengths.T.ravel(), (lengths * relative).T.ravel()]
    names = (f"reference about {x}, state {n}" for x in "YX" for n in _MOVED_STATES)
    yield from zip(names, *columns, strict=True)


def _test_facts(inputs: Inputs) -> Results:
    """Return the mean and the largest difference, and a lag.

    The lag is the lag of a mean over the smoothed angles of a whole state, with its ramp.
    """
    lag, _ = _averaging(inputs, "with-ramp")
    last, differences = (
        inputs.array(f"chen2023/table-5#{cells}-?") / RADIANS_PER_ARCSEC
        for cells in ("5.reference", "[2-5].difference")
    )
    return {
        "ramp-lag": np.abs(last).mean() / len(_MOVED_STATES) * lag,
        "mean": differences.mean(),
        "largest": np.abs(differences).max(),
    }


@studied(
    "chen2023/differences",
    inputs=(
        "chen2023/table-5#[2-5].difference-?",
        "chen2023/table-5#5.reference-?",
        "chen2023/table-4#*.misalignment-?",
        FRAMES_PER_STATE,
        SMOOTHED,
    ),
    named=_test_facts,
)
def _differences(inputs: Inputs) -> Rows:
    """Test the differences of Table V jointly against noise."""
    from scipy.special import chdtrc

    few, frames = inputs.count(SMOOTHED), inputs.count(FRAMES_PER_STATE)
    differences = inputs.pairs("chen2023/table-5#[2-5].difference-?")
    for name, row, averaged in (
        (f"one frame of Table IV, means of {frames}", 1, frames),
        (f"one frame of Table IV, means of {few}", 1, few),
        (f"{few} frames of Table IV", few, 1),
    ):
        # About X and Y.
        accurate = inputs.array(f"chen2023/table-4#{row}.misalignment-?")[::-1]
        sigma = accurate / SIGMAS / np.sqrt(averaged)
        chi_square = shared_zero_chi_square((differences / sigma).T).sum()
        yield name, chi_square, differences.size, chdtrc(differences.size, chi_square)
