"""What the twin of the ground platform says beyond the printed tables (chen2023, V)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.random import default_rng

from reproduce.papers.chen2023 import accuracy, design, lasers, stage, twin
from reproduce.papers.declare import seed_of
from reproduce.papers.study import Study
from reproduce.physics.averaging import averaged_error, moving_average
from reproduce.physics.ground import altitude_for_resolution
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given

TABLE = accuracy.TABLE
FLOOR_REPLICATES = 1000
# Floors that are tried, in units of the column's single-frame accuracy.
FLOORS = np.linspace(0.0, 0.4, 81)
SMOOTHED = "chen2023/text-accuracy#smoothing-frames"
SATELLITE = (
    *(f"{design.SATELLITE}#panchromatic-{name}.value" for name in ("focal-length", "pixel-size")),
    f"{design.SATELLITE}#panchromatic-ground-resolution.value",
)
# Distances from the middle of the image, on the ground, for which the roll is told.
OFF_CENTRE = (0.0, 1e3, 5e3, 10e3)


@dataclass(frozen=True, eq=False)
class FloorFit:
    """A floor b in E^2 = a^2/n + b^2, fitted to one column of Table IV.

    Attributes
    ----------
    floor : float
        The most likely b, in radians.
    upper : float
        The largest b that the column does not refuse at 95 %, in radians.
    probability : float
        How often a column without floor prefers a floor at least as strongly.
    """

    floor: float
    upper: float
    probability: float


def floors() -> Study:
    """Whether Table IV needs a floor that averaging does not reduce, column by column.

    Returns
    -------
    Study
        One row per column.
    """
    door = given((*accuracy.READS, f"{TABLE}#*"))
    counts = [int(n) for n in door.array(f"{TABLE}#*.frames")]
    noise = accuracy.simulated_accuracies(
        door, seed_of("chen2023/floors"), FLOOR_REPLICATES, counts
    )
    rows = []
    for m, matrix in enumerate(accuracy.MATRICES):
        for a, axis in enumerate("xy"):
            printed = door.array(f"{TABLE}#*.{matrix}-{axis}")
            found = fit_floor(printed, noise[:, m, :, a], _last_digit())
            said = "needed" if found.probability < 0.01 else "not needed"
            values = np.degrees([found.floor, found.upper]) * 3600
            rows.append(
                (
                    f"{matrix}, {axis.upper()}",
                    *(f"{value:.3f}" for value in values),
                    f"{found.probability:.2f}",
                    said,
                )
            )
    head = ("Column", "best floor (arcsec, 3σ)", "at most (95 %)", "probability", "a floor is")
    caption = (
        "A floor under the averages of Table IV, fitted to the six rows of a column jointly. "
        "The probability is that of so strong a preference for a floor where there is none."
    )
    return Study(caption, head, tuple(rows))


def _last_digit() -> float:
    return float(np.radians(0.01 / 3600))


def fit_floor(printed: FloatArray, noise: FloatArray, digit: float) -> FloorFit:
    """Fit a floor to accuracies that come from the same frames.

    The logarithms of the six accuracies are taken as jointly normal, with the mean and covariance
    of the simulated ones; the rounding of the print is added to the covariance.

    Parameters
    ----------
    printed : ndarray, shape (counts,)
        Accuracies as printed, in radians.
    noise : ndarray, shape (replicates, counts)
        Accuracies simulated without a floor, in radians.
    digit : float
        The last printed digit, in radians.

    Returns
    -------
    FloorFit
        Estimate, limit and probability.
    """
    single = float(noise[:, 0].mean())
    rounded = np.round(noise / digit) * digit
    surprise = np.empty((len(FLOORS), 1 + len(noise)))
    for row, share in zip(surprise, FLOORS, strict=True):
        model = np.log(averaged_error(1.0, noise, share * single))
        # Rounding spreads a number evenly over one digit.
        spread = np.diag((digit / printed) ** 2 / 12.0)
        inverse = np.linalg.inv(np.cov(model.T) + spread)
        penalty = -np.linalg.slogdet(inverse)[1]
        away = np.log(np.vstack([printed, rounded])) - model.mean(axis=0)
        row[...] = np.einsum("ri,ij,rj->r", away, inverse, away) + penalty
    gain = surprise[0] - surprise.min(axis=0)
    below = surprise[:, 0] - surprise[:, 0].min() <= 1.92 * 2
    return FloorFit(
        floor=float(FLOORS[surprise[:, 0].argmin()]) * single,
        upper=float(FLOORS[below].max()) * single,
        probability=float((gain[1:] >= gain[0]).mean()),
    )


def misfit() -> Study:
    """By how much the designed lasers miss the printed spots.

    Returns
    -------
    Study
        Three quantities.
    """
    found = twin.misfit(twin.bench(given(twin.READS)))
    rows = (
        ("miss of a spot after the best rotation (px, rms)", f"{found['residual']:.3f}"),
        ("size of the printed pattern over the designed one", f"{found['scale']:.4f}"),
        ("miss left if the pattern may shrink (px, rms)", f"{found['after_scale']:.3f}"),
    )
    return Study("The designed lasers against the printed spots.", ("Quantity", "value"), rows)


def roll() -> Study:
    """Roll error of the ground platform, and what it does on the ground away from the centre.

    Returns
    -------
    Study
        One row per number of frames.
    """
    door = given((*twin.READS, SMOOTHED, *SATELLITE))
    many = door.count(SMOOTHED)
    series = twin.two_groups(
        twin.bench(door), 40 * many, default_rng(seed_of("chen2023/roll"))
    ).misalignment
    height = altitude(door)
    rows = []
    for count in (1, many):
        spread = lasers.SIGMAS * moving_average(series, count, axis=0).std(axis=0)
        across = float(np.hypot(*spread[:2])) * height
        moved = [f"{np.hypot(across, spread[2] * off):.2f}" for off in OFF_CENTRE]
        arcsec = np.degrees(spread) * 3600
        angles = (f"{np.hypot(*arcsec[:2]) / np.sqrt(2):.2f}", f"{arcsec[2]:.1f}")
        rows.append((f"{count}", *angles, *moved))
    head = (
        "Frames",
        "about X or Y (arcsec, 3σ)",
        "about Z (arcsec, 3σ)",
        *(f"{off / 1e3:g} km off centre (m)" for off in OFF_CENTRE),
    )
    caption = (
        "Errors of the monitored misalignment with the spots of the ground platform, and the "
        f"three-sigma shift on the ground from {height / 1e3:.0f} km altitude."
    )
    return Study(caption, head, tuple(rows))


def altitude(door: Given) -> float:
    """Return the altitude that the panchromatic line of Table I implies, in metres."""
    focal, pixel, resolution = (door[address] for address in SATELLITE)
    return float(altitude_for_resolution(focal, pixel, resolution))


@dataclass(frozen=True, eq=False)
class CommonLength:
    """One focal length fitted to monitored angles that share their zero point.

    Attributes
    ----------
    length : float
        In metres.
    error : float
        Its standard deviation, in metres.
    chi_square : float
        Of the rows about it.
    freedom : int
        Rows less one.
    """

    length: float
    error: float
    chi_square: float
    freedom: int


def common_length(motions: FloatArray, angles: FloatArray, sigma: float) -> CommonLength:
    """Fit one focal length to angles that each carry the noise of the same zero state.

    Parameters
    ----------
    motions : ndarray, shape (n,)
        Of the stage, in metres.
    angles : ndarray, shape (n,)
        Monitored, in radians, negative for a positive motion.
    sigma : float
        Noise of the mean over one state, in radians; states and the zero state are alike.

    Returns
    -------
    CommonLength
        Generalised least squares of angle = -motion / f.
    """
    covariance = sigma**2 * (np.eye(len(angles)) + 1.0)
    inverse = np.linalg.inv(covariance)
    information = float(motions @ inverse @ motions)
    slope = -float(motions @ inverse @ angles) / information
    away = angles + slope * motions
    error = float(np.sqrt(1.0 / information))
    return CommonLength(
        length=1.0 / slope,
        error=error / slope**2,
        chi_square=float(away @ inverse @ away),
        freedom=len(angles) - 1,
    )


def focal_lengths() -> Study:
    """Focal lengths that the rows of Table V imply, as printed and with the columns exchanged.

    Returns
    -------
    Study
        One row per state and axis, then one for all monitored angles of an axis.
    """
    door = given((f"{stage.TABLE}#*", *lasers.READS, lasers.SCATTER, stage.FRAMES))
    rows = []
    for axis, turn in stage.TURNS.items():
        motions = {name: _motions(door, name) for name in stage.TURNS}
        other = motions[turn]
        for index, state in enumerate(stage.MOVED):
            angle = door[f"{stage.TABLE}#{state}.reference-{turn}"]
            found = [-m[index] / np.tan(angle) for m in (motions[axis], other)]
            rounding = _rounding(found[0], motions[axis][index], angle)
            said = [f"{value * 1e3:.1f} ± {rounding * 1e3:.1f}" for value in found]
            rows.append((f"reference about {turn.upper()}, state {state}", *said))
        sigma = _state_noise(door, turn)
        angles = np.array([door[f"{stage.TABLE}#{s}.monitoring-{turn}"] for s in stage.MOVED])
        fits = [common_length(m, angles, sigma) for m in (motions[axis], other)]
        said = [f"{f.length * 1e3:.1f} ± {f.error * 1e3:.1f} ({f.chi_square:.1f})" for f in fits]
        rows.append((f"all monitored about {turn.upper()} (χ² of {fits[0].freedom})", *said))
    caption = (
        "Focal length implied by Table V, in mm: by reference angles (± rounding of the print) and "
        "by all monitored angles of an axis together (± noise, the shared zero point included). "
        "Motions are differences of the printed positions, which mends the one digit."
    )
    head = ("Angle", "with the motion of its own axis", "with that of the other")
    return Study(caption, head, tuple(rows))


def _motions(door: Given, axis: str) -> FloatArray:
    """Return the motions as differences of the printed positions, which mends the one digit."""
    places = np.array([door[f"{stage.TABLE}#{s}.position-{axis}"] for s in stage.STATES])
    return np.asarray(places[1:] - places[0])


def _rounding(length: float, motion: float, angle: float) -> float:
    """Return half the width of focal lengths that the rounding of both numbers allows."""
    # A motion is the difference of two positions, each printed to a hundredth of a micrometre.
    half_motion, half_angle = 1e-8, float(np.radians(0.0005 / 3600))
    return abs(length) * (half_motion / abs(motion) + half_angle / abs(angle))


def _state_noise(door: Given, turn: str) -> float:
    response = lasers.angle_response(door)["xy".index(turn)]
    spots = lasers.scatter(door, 2)
    return float(np.sqrt((response**2 * spots**2).sum() / door.count(stage.FRAMES)))
