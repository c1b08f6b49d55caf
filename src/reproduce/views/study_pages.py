"""What the book shows of the simulation study of niu2024: readings, precision, sentences."""

from __future__ import annotations

import functools
from typing import Any

import jinja2
import numpy as np
from numpy.typing import NDArray

from reproduce.judge import readings as judged
from reproduce.judge.verdicts import CENTRAL
from reproduce.papers.niu2024 import angles, precision, simulation, study
from reproduce.printed.given import given
from reproduce.store import studies
from reproduce.views import words
from reproduce.views.pages import Html
from reproduce.views.studies import READINGS

Array = NDArray[np.float64]
SHORT = ("k", "θ", "Δx", "Δy", "before", "after")
CHOICES = ("shifts", "draws", "noise in", "test points", "RMSE of")
TOGETHER = ("Table 3", "residuals", "all", "all, corrected")


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
    """Show the tail probability of each printed number under every reading.

    Returns
    -------
    Html
        A table for each arrangement of angles; the ledger's is open, the others fold out.
    """
    door = given(study.READS)
    every, used = study.readings(door), study.literal(door)
    blocks = []
    for place, found in enumerate(angles.candidates(door)):
        rows = [
            _row(number, way, one, one == used and way == 0)
            for number, one in enumerate(every)
            if one.arrangement == place
            for way in range(len(study.COUNTED))
        ]
        blocks.append({"name": found.name, "used": place == used.arrangement, "rows": rows})
    template = templates().get_template("readings.html")
    return Html(template.render(blocks=blocks, choices=CHOICES, cells=SHORT * 2, groups=TOGETHER))


def _row(number: int, way: int, one: study.Reading, used: bool) -> dict[str, Any]:
    arrays, replicates = _study().arrays, int(_study().note["replicates"])
    tails, joint = arrays["tails"][number, way], arrays["joint"][number, way]
    tried = arrays["joint"].shape[0] * arrays["joint"].shape[1]
    outside = tails < 1 - CENTRAL
    together = [*joint, judged.corrected(joint[-1:], tried)[0]]
    return {
        "choices": (one.shifts, one.repeats, one.noisy, one.tests, study.COUNTED[way]),
        "tails": [(_tail(t, replicates), o) for t, o in zip(tails, outside, strict=True)],
        "joint": [_joint(float(p), replicates) for p in together],
        "outside": int(outside.sum()),
        "used": used,
    }


def _tail(value: float, replicates: int) -> str:
    return words.chance(
        value, float(np.sqrt(max(value * (2 - value), 1 / replicates) / replicates))
    )


def _joint(value: float, replicates: int) -> str:
    return f"< {1.5 / replicates:.1g}" if value < 1.5 / replicates else f"{value:.1g}"


def precision_table() -> Html:
    """Show bias, scatter, Cramér-Rao bound and efficiency of the ledger's reading.

    Returns
    -------
    Html
        A row for each parameter of each channel.
    """
    arrays, replicates = _study().arrays, int(_study().note["replicates"])
    door = given(study.READS)
    row = study.readings(door).index(study.literal(door))
    lines = []
    for place, channel in enumerate(simulation.REGISTERED):
        theory = precision.of_channel(door, channel)
        for cell, name in enumerate(study.CELLS[:4]):
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
    caption = f"The calibration scheme over {replicates:,} replicates of the ledger's reading."
    return plain_table(caption, heads, lines)


def _signed(value: float, error: float) -> str:
    # What the distortion leaves of a parameter that it cannot move is rounding.
    text = f"{value:.2e}" if error or abs(value) > 1e-9 else "0"
    return (f"{text} ± {error:.0e}" if error else text).replace("-", "−")


def sayings() -> dict[str, str]:
    """Return what sentences may say of the study.

    Returns
    -------
    dict
        Label to text, each label beginning with ``niu2024-study-``.
    """
    arrays, note = _study().arrays, _study().note
    tails, joint = arrays["tails"], arrays["joint"]
    outside = (tails < 1 - CENTRAL).sum(axis=-1)
    scales = [i for i, address in enumerate(judged.ADDRESSES) if "#scale" in address]
    every = study.readings(given(study.READS))
    least = [divmod(int(i), outside.shape[1]) for i in np.flatnonzero(outside == outside.min())]
    said = {
        "readings": str(outside.size),
        "cells": str(tails.shape[-1]),
        "replicates": f"{int(note['replicates']):,}",
        "seconds": f"{float(note['seconds']):.0f}\u202fs",
        "fewest-outside": str(outside.min()),
        "ledger-outside": str(outside[every.index(study.literal(given(study.READS))), 0]),
        "most-outside": str(outside.max()),
        "closest": str(len(least)),
        "closest-shifts": _common(every[r].shifts for r, _ in least),
        "closest-noise": _common(every[r].noisy for r, _ in least),
        "closest-draws": _common(str(every[r].repeats) for r, _ in least),
        "closest-axes": _common(study.COUNTED[w] for _, w in least),
        "best-joint": f"{joint[..., 2].max():.1g}",
        "best-scale": _tail(float(tails[..., scales].max()), int(note["replicates"])),
    }
    return {f"niu2024-study-{label}": text for label, text in said.items()}


def _common(values: Any) -> str:
    return " or ".join(sorted(set(values)))


def glue_study() -> None:
    """Make the study's numbers available to the sentences of a page; see `sayings`."""
    from myst_nb import glue as glue_one

    for label, text in sayings().items():
        glue_one(label, text, display=False)
