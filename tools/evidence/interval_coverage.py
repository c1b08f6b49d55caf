"""Fraction of simulated fields in which an interval of a registration is wrong without a warning.

``wrong`` counts the fields in which any of the four 95 % intervals misses the true value, and
``silent`` those of them with no finding. Four right intervals give 15 to 19 % wrong.
`python tools/evidence/interval_coverage.py 300` takes some minutes.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np
from numpy.typing import NDArray

import reproduce as rp
from reproduce.physics.registration import Registration

FloatArray = NDArray[np.float64]
SIDE, NOISE = 2000.0, 0.07
PIVOT = np.array([SIDE / 2, SIDE / 2])
TRUTH = Registration.similarity(0.9976, 0.01, (3.0, -2.0), PIVOT)
COUNTS = (3, 5, 8, 20, 80, 1000)
# Distortion at half the field in px, ratio of the stated to the true errors, fraction of wrong
# matches.
CASES: dict[str, dict[str, Any]] = {
    "right": {},
    "right, robust": {"robust": True},
    "20 % wrong matches, robust": {"wrong": 0.2, "robust": True},
    "sigma right": {"sigma": 1.0},
    "sigma half": {"sigma": 0.5},
    "sigma double": {"sigma": 2.0},
    **{f"radial {size} px": {"radial": size} for size in (0.05, 0.1, 0.2)},
    "tilt 0.5 px": {"tilt": 0.5},
}


def field(
    generator: np.random.Generator,
    count: int,
    radial: float = 0,
    tilt: float = 0,
    wrong: float = 0,
) -> tuple[FloatArray, FloatArray]:
    """Return the same stars in both images, distorted, some of them matched wrongly."""
    source = generator.uniform(0, SIDE, (count, 2))
    offset = (source - PIVOT) / (SIDE / 2)
    target = TRUTH.apply(source) + radial * offset * np.square(offset).sum(
        axis=1, keepdims=True
    )
    target = (
        target
        + tilt * offset * offset[:, :1]
        + generator.normal(0, NOISE, source.shape)
    )
    false = generator.random(count) < wrong
    target[false] = generator.uniform(0, SIDE, (np.count_nonzero(false), 2))
    return source, target


def fractions(count: int, fields: int, case: dict[str, Any]) -> tuple[float, float]:
    """Return the fractions of fields with a wrong interval, and with a wrong one in silence."""
    settings: dict[str, Any] = {"robust": case.get("robust", False)}
    if sigma := case.get("sigma"):
        settings["target_covariance"] = np.square(sigma * NOISE) * np.eye(2)
    shape = {name: one for name, one in case.items() if name not in ("robust", "sigma")}
    found = []
    for seed in range(fields):
        pair = field(np.random.default_rng([36, count, seed]), count, **shape)
        fit: Any = rp.register(*pair, PIVOT, **settings)
        low, high = fit.interval().T
        wrong = bool(((TRUTH.parameters < low) | (TRUTH.parameters > high)).any())
        found.append((wrong, wrong and not fit.findings))
    wrong, silent = np.mean(found, axis=0)
    return float(wrong), float(silent)


if __name__ == "__main__":
    number = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    print(f"{'case':28}" + "".join(f"{count:>12}" for count in COUNTS))
    for name, case in CASES.items():
        cells = [
            "{:.2f} {:.2f}".format(*fractions(count, number, case))
            if count > 3 or not case.get("robust")
            else ""
            for count in COUNTS
        ]
        print(f"{name:28}" + "".join(f"{cell:>12}" for cell in cells), flush=True)
