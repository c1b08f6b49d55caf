"""What the book shows of the simulation study of niu2024: readings, precision, sentences."""

from __future__ import annotations

import functools
from typing import Any

import jinja2
import numpy as np
from numpy.typing import NDArray

from reproduce.judge import readings as judged
from reproduce.judge.verdicts import CENTRAL
from reproduce.papers.niu2024 import angles, counting, precision, simulation, study
from reproduce.printed.given import given
from reproduce.store import studies
from reproduce.views import numbers
from reproduce.views.pages import Html
from reproduce.views.studies import READINGS

Array = NDArray[np.float64]
SHORT = ("k", "θ", "Δx", "Δy", "before", "after")
CHOICES = ("shifts", "draws", "noise in", "test points", "RMSE of")
TOGETHER = (*judged.GROUPS, "all, corrected")
# Orders of magnitude below this are not told apart: the law is an extrapolation so far out.
LEAST_ORDER = -12
SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@functools.cache
def _study() -> studies.Study:
    return studies.read(READINGS)


def templates() -> jinja2.Environment:
    """Return the project's templates, strict about what they are given."""
    return jinja2.Environment(
        loader=jinja2.PackageLoader("reproduce.views"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
    )


def plain_table(caption: str, heads: list[str], rows: list[list[str]]) -> Html:
    """Show a table of texts; the first of each row is its label."""
    template = templates().get_template("plain.html")
    return Html(template.render(caption=caption, heads=heads, rows=rows))


def readings() -> Html:
    """Show the tail probability of each printed number under every reading."""
    door = given(study.READS)
    every, used = study.readings(door), study.literal(door)
    blocks = []
    for place, found in enumerate(angles.candidates(door)):
        rows = [
            _row(number, way, one, one == used and way == 0)
            for number, one in enumerate(every)
            if one.arrangement == place
            for way in range(len(counting.COUNTED))
        ]
        blocks.append({"name": found.name, "used": place == used.arrangement, "rows": rows})
    template = templates().get_template("readings.html")
    return Html(template.render(blocks=blocks, choices=CHOICES, cells=SHORT * 2, groups=TOGETHER))


def _row(number: int, way: int, one: study.Reading, used: bool) -> dict[str, Any]:
    arrays, replicates = _study().arrays, int(_study().note["replicates"])
    tails, together = _tails()[number, way], _joint()[number, way]
    texts = [
        chance(*pair, replicates)
        for pair in zip(arrays["tails"][number, way], arrays["law_tails"][number, way], strict=True)
    ]
    joint = [
        chance(*pair, replicates)
        for pair in zip(arrays["joint"][number, way], arrays["law_joint"][number, way], strict=True)
    ]
    return {
        "choices": (one.shifts, one.repeats, one.noisy, one.tests, counting.COUNTED[way]),
        "tails": list(zip(texts, tails < 1 - CENTRAL, strict=True)),
        "joint": [*joint, corrected(float(together[-1]))],
        "outside": int((tails < 1 - CENTRAL).sum()),
        "used": used,
    }


@functools.cache
def _tails() -> Array:
    """Return the probability of every cell, shape (readings, ways, cells)."""
    arrays, replicates = _study().arrays, int(_study().note["replicates"])
    return judged.resolved(arrays["tails"], arrays["law_tails"], replicates)


@functools.cache
def _joint() -> Array:
    """Return the probability of every group, shape (readings, ways, groups)."""
    arrays, replicates = _study().arrays, int(_study().note["replicates"])
    return judged.resolved(arrays["joint"], arrays["law_joint"], replicates)


def chance(counted: float, law: float, replicates: int) -> str:
    """Write a probability: by count where the draws can tell, else its order by their law.

    Examples
    --------
    >>> chance(0.4312, -0.4, 10_000), chance(0.0, -7.9, 10_000)
    ('0.43', '10⁻⁸')
    """
    if counted * replicates < judged.LEAST:
        return order(10.0**law)
    return numbers.chance(counted, float(np.sqrt(counted * max(2 - counted, 0) / replicates)))


def order(probability: float, least: int = LEAST_ORDER) -> str:
    """Write a probability as a power of ten where it is small.

    Examples
    --------
    >>> order(0.3), order(2e-9), order(1e-99)
    ('0.3', '10⁻⁹', '<\u202f10⁻¹²')
    """
    if probability >= 1e-3:
        return f"{probability:.1g}"
    power = round(float(np.log10(max(probability, 1e-300))))
    text = f"10{str(max(power, least)).translate(SUPERSCRIPTS)}"
    return text if power >= least else f"<\u202f{text}"


def corrected(probability: float) -> str:
    """Write a joint probability corrected for the number of readings tried."""
    tried = _joint()[..., 0].size
    larger = float(judged.corrected(np.array([probability]), tried)[0])
    return order(larger, LEAST_ORDER + int(np.ceil(np.log10(tried))))


def closest() -> Html:
    """Show the literal reading beside those that come closest to the print."""
    every = study.readings(given(study.READS))
    picked = {"the literal one": (every.index(study.literal(given(study.READS))), 0)}
    picked["fewest cells outside"] = _fewest()[0]
    for place, group in enumerate(judged.GROUPS):
        log = _study().arrays["law_joint"][..., place]
        best = int(log.argmax())
        picked[f"best for: {group}"] = divmod(best, log.shape[1])
    names = [found.name for found in angles.candidates(given(study.READS))]
    rows = []
    for label, (number, way) in picked.items():
        row = _row(number, way, every[number], False)
        far = _study().arrays["distance"][number, way]
        choices = [names[every[number].arrangement], *(str(c) for c in row["choices"])]
        rows.append([label, *choices, str(row["outside"])])
        rows[-1] += [f"{p} ({d:.0f}\u202fσ)" for p, d in zip(row["joint"][:-1], far, strict=True)]
        rows[-1].append(row["joint"][-1])
    heads = ["Reading", "Angles", *(c.capitalize() for c in CHOICES), "Cells outside", *TOGETHER]
    heads[-len(TOGETHER) :] = [f"p, {name}" for name in TOGETHER]
    caption = "Readings that come closest to the print; in brackets the Mahalanobis distance."
    return plain_table(caption, heads, rows)


def _fewest() -> list[tuple[int, int]]:
    """Return the readings that leave the fewest cells outside, the likeliest as a whole first."""
    outside = (_tails() < 1 - CENTRAL).sum(axis=-1)
    places = [(int(r), int(w)) for r, w in np.argwhere(outside == outside.min())]
    law = _study().arrays["law_joint"][..., -1]
    return sorted(places, key=lambda place: -float(law[place]))


def precision_table() -> Html:
    """Show bias, scatter, Cramér-Rao bound and efficiency of the literal reading."""
    arrays, replicates = _study().arrays, int(_study().note["replicates"])
    door = given(study.READS)
    row = study.readings(door).index(study.literal(door))
    lines = []
    for place, channel in enumerate(simulation.REGISTERED):
        theory = precision.of_channel(door, channel)
        for cell, name in enumerate(counting.CELLS[:4]):
            mean, sd = arrays["mean"][row, place, cell], arrays["sd"][row, place, cell]
            bound = theory.bound[cell]
            efficiency = (bound / sd) ** 2
            lines.append(
                [
                    f"{name}, {channel}",
                    _signed(mean - theory.truth[cell], sd / np.sqrt(replicates)),
                    _signed(theory.bias[cell], 0.0),
                    f"{sd:.3g}",
                    f"{bound:.3g}",
                    f"{efficiency:.3f} ± {efficiency * np.sqrt(2 / replicates):.3f}",
                ]
            )
    heads = ["Parameter (px, rad)", "Bias", "Bias by theory", "Scatter", "Bound", "Efficiency"]
    caption = f"The calibration scheme over {replicates:,} replicates of the literal reading."
    return plain_table(caption, heads, lines)


def _signed(value: float, error: float) -> str:
    # What the distortion leaves of a parameter that it cannot move is rounding.
    text = f"{value:.2e}" if error or abs(value) > 1e-9 else "0"
    return (f"{text} ± {error:.0e}" if error else text).replace("-", "−")


def sayings() -> dict[str, str]:
    """Return what sentences may say of the study: label to text."""
    note, tails, joint = _study().note, _tails(), _joint()
    outside = (tails < 1 - CENTRAL).sum(axis=-1)
    every = study.readings(given(study.READS))
    least = _fewest()
    green = [place for place, one in enumerate(every) if one.noisy == "green"]
    groups = {name: place for place, name in enumerate(judged.GROUPS)}
    far = _study().arrays["distance"]
    but_scales = joint[..., groups["all but the scales"]]
    return {
        "readings": str(outside.size),
        "cells": str(tails.shape[-1]),
        "replicates": f"{int(note['replicates']):,}",
        "seconds": f"{float(note['processor_seconds']):.0f}\u202fs",
        "fewest-outside": str(outside.min()),
        "ledger-outside": str(outside[every.index(study.literal(given(study.READS))), 0]),
        "closest": str(len(least)),
        "closest-shifts": _common(every[r].shifts for r, _ in least),
        "closest-noise": _common(every[r].noisy for r, _ in least),
        "closest-draws": _common(str(every[r].repeats) for r, _ in least),
        "closest-tests": _common(every[r].tests for r, _ in least),
        "closest-axes": _common(counting.COUNTED[w] for _, w in least),
        "closest-before-far": f"{min(far[r, w, groups['residuals']] for r, w in least):.0f}",
        "closest-before": order(max(float(joint[r, w, groups["residuals"]]) for r, w in least)),
        "best-joint": order(float(joint[..., groups["all"]].max())),
        "best-corrected": corrected(float(joint[..., groups["all"]].max())),
        "best-but-scales": order(float(but_scales.max())),
        "best-but-scales-corrected": corrected(float(but_scales.max())),
        "best-green": order(float(but_scales[green].max())),
        "best-scale": order(float(tails[..., judged.SCALE].max())),
        "least-counted": f"{judged.LEAST}",
    }


def _common(values: Any) -> str:
    return " or ".join(sorted(set(values)))
