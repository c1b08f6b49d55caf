"""What the optimum of Figure 11 depends on, and what better estimators would reach."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.random import Generator

from reproduce.papers.chen2023 import resolution
from reproduce.papers.declare import seed_of
from reproduce.papers.study import Study
from reproduce.physics.attitude.averaging import attitude_accuracy
from reproduce.physics.images.centroids import centre_of_gravity, windowed_centre
from reproduce.physics.images.detector import Detector, expose
from reproduce.physics.images.phase_study import (
    Light,
    biased_bound,
    bound,
    even_phases,
    predicted_errors,
    predicted_scatter,
)
from reproduce.physics.images.spot_fit import fitted_centre
from reproduce.physics.images.spots import spot_windows
from reproduce.physics.optics.simulate import spawned_streams
from reproduce.physics.validate import FloatArray
from reproduce.printed.given import Given, given
from reproduce.units import ARCSEC_PER_RADIAN, RADIANS_PER_ARCSEC

STUDY = resolution.STUDY
TRIALS = 40
STEPS = 12
# Angles per pixel at which the estimators are compared, in arc seconds; and the errors of one.
COMPARED = (20, 30, 43, 57, 80)
TAKEN_APART = (10, *COMPARED)


@dataclass(frozen=True)
class Variant:
    """One way to read the study: spot and noise, the window, and where the spot may lie."""

    case: resolution.Case
    window: int
    name: str = ""
    whole_pixel: bool = True
    scatter_only: bool = False


def readings() -> Study:
    """Where the optimum lies under other readings of the text, from the closed form."""
    door = given(resolution.READS)
    rows = tuple(_row(door, variant) for variant in _variants(door))
    head = ("Reading", "optimum (arcsec)", "error there (px)", "limit of gain (arcsec)")
    caption = (
        "The optimum of Figure 11 under every reading of the text that was tried; below the first "
        f"{len(resolution.CASES)}, the first with one thing changed. The limit of gain is that of "
        f"{resolution.CHOSEN:g} standard errors."
    )
    return Study(caption, head, rows)


def _variants(door: Given) -> list[Variant]:
    size, first = resolution.window(door), resolution.LITERAL
    found = [Variant(case, size, case.name) for case in resolution.CASES]
    literal = found[0]
    for share in (0.25, 0.5, 0.75, 0.95):
        case = replace(first, read_share=share)
        found.append(replace(literal, name=f"read noise is {share:.0%} of variance", case=case))
    for factor in (0.5, 2.0):
        case = replace(first, brighter=factor)
        found.append(replace(literal, name=f"{factor:g} times the light", case=case))
    for window in (3, 7):
        found.append(replace(literal, name=f"window of {window} × {window} px", window=window))
    found.append(replace(literal, name="spot within ±6.5 µm always", whole_pixel=False))
    return [*found, replace(literal, name="scatter without bias", scatter_only=True)]


def _row(door: Given, reading: Variant) -> tuple[str, ...]:
    angles = resolution.resolutions(door)
    radius = resolution.radii(door, angles, reading.case)
    phases = even_phases(door.count(f"{STUDY}#phases"))
    if reading.whole_pixel:
        light = resolution.light_for_table(door, reading.case)
        law = predicted_scatter(predicted_errors(phases, light, radius, reading.window))
        error = law.within if reading.scatter_only else law.total
    else:
        error = np.array([_fixed_travel(door, reading, phases, float(one)) for one in radius])
    monitoring = attitude_accuracy(error, door.count(f"{STUDY}#lasers"), angles)
    limit = angles[resolution.saturation(monitoring, resolution.relative_error(door))]
    best = int(error.argmin())
    arcsec = np.array([angles[best], limit]) * ARCSEC_PER_RADIAN
    return reading.name, f"{arcsec[0]:.0f}", f"{error[best]:.4f}", f"{arcsec[1]:.0f}"


def _fixed_travel(door: Given, reading: Variant, phases: FloatArray, radius: float) -> float:
    """Return the total error where the spot's travel is the tracker's pixel, whatever its size."""
    pitch = door[f"{STUDY}#spot-radius"] / reading.case.width / radius
    travel = phases * door[resolution.PIXEL] / pitch
    nearest = travel - np.floor(travel + 0.5)
    light = resolution.light_for_table(door, reading.case)
    law = predicted_errors(nearest, light, radius, reading.window)
    return float(predicted_scatter(law).total)


def errors() -> Study:
    """Errors of the centre of gravity taken apart, against both bounds, from the closed form."""
    door = given(resolution.READS)
    light, size = resolution.light_for_table(door), resolution.window(door)
    phases = even_phases(door.count(f"{STUDY}#phases"))
    radius = resolution.radii(door, np.array(TAKEN_APART) * RADIANS_PER_ARCSEC)
    law = predicted_errors(phases, light, radius, size)
    parts, least = predicted_scatter(law), bound(phases, light, radius, size)
    lines = {
        "standard deviation at one place": parts.within,
        "bias, root mean square over the places": parts.bias,
        "root-mean-square error": np.sqrt(law.mean_square.mean(axis=-1)),
        "bound without bias": least,
        "bound for the bias that it has": biased_bound(phases, light, radius, size),
        "standard deviation over the bound without bias": parts.within / least,
    }
    rows = tuple((name, *(f"{value:.4f}" for value in values)) for name, values in lines.items())
    caption = (
        "The centre of gravity in the fixed window, in px, for pixels of the given angle (arcsec), "
        "with the light of the study and photon noise alone."
    )
    return Study(caption, ("Quantity", *(f"{angle}" for angle in TAKEN_APART)), rows)


def estimators() -> Study:
    """Errors of four estimators over all phases, against the bound, by simulation."""
    door = given(resolution.READS)
    # Half of the variance at the tracker's own pixel from the readout: a middle case.
    light = resolution.light_for_table(door, replace(resolution.LITERAL, read_share=0.5))
    size, phases = resolution.window(door), even_phases(door.count(f"{STUDY}#phases"))
    radius = resolution.radii(door, np.array(COMPARED) * RADIANS_PER_ARCSEC)
    streams = list(spawned_streams(seed_of("chen2023/estimators"), len(radius)))
    columns = [
        _errors(phases, light, float(one), size, stream)
        for one, stream in zip(radius, streams, strict=True)
    ]
    rows = [(name, *(f"{column[name]:.4f}" for column in columns)) for name in columns[0]]
    least = bound(phases, light, radius, size)
    rows.append(("unbiased bound", *(f"{value:.4f}" for value in least)))
    caption = (
        "Root-mean-square error over all phases, in px, for pixels of the given angle (arcsec). "
        f"Light {light.signal:.0f} electrons, read noise {light.read_noise:.1f} electrons: half "
        "of the variance that Table III implies is read noise."
    )
    return Study(caption, ("Estimator", *(f"{angle}" for angle in COMPARED)), tuple(rows))


def _errors(
    phases: FloatArray, light: Light, radius: float, size: int, generator: Generator
) -> dict[str, float]:
    points = np.stack([phases, np.zeros_like(phases)], axis=-1)
    corner = np.full(2, -(size // 2))
    mean = spot_windows(points, light.signal, radius, corner, size)
    sensor = Detector(read_noise=light.read_noise)
    seen = expose(np.broadcast_to(mean, (TRIALS, *mean.shape)), sensor, generator)
    found: dict[str, Callable[[], FloatArray]] = {
        "centre of gravity": lambda: centre_of_gravity(seen, corner),
        "Gaussian weight that follows": lambda: windowed_centre(seen, corner, radius, STEPS),
        "matched filter": lambda: (
            fitted_centre(seen, corner, radius, light.read_noise, "uniform").centre
        ),
        "maximum likelihood": lambda: (
            fitted_centre(seen, corner, radius, light.read_noise, "likelihood").centre
        ),
    }
    return {
        name: float(np.sqrt(np.mean((centre()[..., 0] - phases) ** 2)))
        for name, centre in found.items()
    }
