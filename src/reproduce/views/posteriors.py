"""All posteriors of the book at once: what they say, how far to trust them, files they take."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import pandas as pd
from markupsafe import Markup

from reproduce.inference import Gates
from reproduce.papers.declare import words
from reproduce.papers.posteriors import posteriors
from reproduce.printed.cells import find
from reproduce.printed.number import UNITS, symbol
from reproduce.store import studies
from reproduce.views.blocks import Block, Blocks, Display, Entry, Grid, badge, link
from reproduce.views.computed import item_ledger
from reproduce.views.numbers import digits, minus, percent
from reproduce.views.posterior import Posterior, book_posterior, interval
from reproduce.views.verdicts import quantity

# Standard deviations too small by a share in %: columns of the calibrations that tell their power.
_NARROW = {"10": "narrow_10", "5": "narrow_5"}
# The share of right curves that leave their own band.
_OUTSIDE = 0.05


class _Said(NamedTuple):
    """A quantity of `_SAID`: a label, a posterior, its name there, the cell that prints it.

    What a cell prints has the label of the cell.
    """

    label: str
    posterior: str
    name: str
    cell: str = ""


_SAID = (
    *(
        _Said(
            "",
            "registration-joint",
            f"{channel}-{row.replace('translation', 'shift')}",
            f"niu2024/table-3#{row}.{channel}",
        )
        for channel in ("red", "blue")
        for row in ("scale", "rotation", "translation-x", "translation-y")
    ),
    _Said("", "registration-joint", "noise", "niu2024/text-simulation#noise"),
    *(
        _Said(f"Misalignment about {axis.upper()}", "misalignment", f"angle-{axis}")
        for axis in "xyz"
    ),
    *(
        _Said(f"Drift about {axis.upper()}", "misalignment-drift", f"drift-{axis}")
        for axis in "xyz"
    ),
    _Said("Position on the ground, corrected", "misalignment", "position error"),
)


class Posteriors(Display):
    """Every posterior of the book: what all say, beside the print and the verdict of the print."""

    def blocks(self) -> Iterator[Block]:
        """Yield one table of all."""
        head = (
            "Quantity",
            "Printed",
            "Posterior, mean ± sd",
            "95 % interval",
            "Truth of our simulation",
            "Verdict of the print",
        )
        yield Grid(
            words("posteriors/all").caption,
            head,
            list(map(_summarised, _SAID)),
            "posteriors",
        )

    @property
    def models(self) -> Blocks:
        """What each is about, and the columns of a file of one's own that it takes."""
        about = [(name, one.paper, one.title) for name, one in posteriors().items()]
        heads = ("Models", "Columns", "What they hold")
        return Blocks(
            (
                Grid(
                    "The models.",
                    ("Model", "Paper", "About"),
                    about,
                    words=3,
                    whole=(0, 1),
                ),
                Grid(words("posteriors/models").caption, heads, _files(), words=3),
            )
        )

    def titles(self) -> dict[str, str]:
        """Return what each is about, by its name."""
        return {name: one.title for name, one in posteriors().items()}

    def diagnostics(self, paper: str) -> Blocks:
        """Show how far the posteriors of a paper can be trusted: chains and calibration of each."""
        stored = studies.table("calibrations")
        trials = stored.attrs["trials"]
        names = [name for name, one in posteriors().items() if one.paper == paper]
        stored = stored[stored["posterior"].isin(names)]
        models = stored.groupby("posterior", sort=False)
        rows = [_trusted(str(name), one, trials) for name, one in models]
        least, count, gates = stored["even"].min(), len(stored), Gates()
        found_out = (f"sd {share} % too small leaves its band" for share in _NARROW)
        head = (
            "Model",
            "R-hat, largest",
            "steps / τ, fewest",
            "ESS, smallest",
            "acceptance",
            "replicates",
            "failed",
            "quantities",
            "smallest p (even)",
            "95 % covers",
            *found_out,
        )
        caption = words("posteriors/diagnostics").caption.format(
            paper=paper,
            rhat=gates.rhat,
            times=gates.times,
            size=gates.size,
            acceptance=gates.acceptance,
            count=count,
            band=100 * (1 - _OUTSIDE),
            outside=(stored["even"] < _OUTSIDE).sum(),
            chance=count * _OUTSIDE,
            least=least,
            as_small=count * least,
        )
        return Blocks((Grid(caption, head, rows),))


def _summarised(one: _Said) -> tuple[Entry, ...]:
    """Return the row of a quantity: label, print, mean ± sd, interval, truth, verdict."""
    row = next(
        row for row in book_posterior(one.posterior).summaries() if row.name == one.name
    )
    mark = symbol(row.unit) if row.unit in UNITS else row.unit
    mean, ends = (quantity(text, mark) for text in interval(row))
    truth = Posterior(one.posterior).truth.get(one.name)
    known = "" if truth is None else minus(quantity(f"{truth:.6g}", mark))
    label, printed, verdict = one.label, Markup(""), Markup("")
    if one.cell:
        (cell,) = find(one.cell)
        label, printed = cell.label, link(cell.anchor, cell.shown)
        verdict = badge(item_ledger(one.cell.partition("#")[0]).cell(one.cell).verdict)
    return (
        link(f"posterior-{one.posterior}", label),
        printed,
        mean,
        ends,
        known,
        verdict,
    )


def _trusted(name: str, stored: pd.DataFrame, trials: int) -> tuple[str, ...]:
    """Return the line of a posterior: its chains, then its calibration."""
    found = book_posterior(name)
    least, wide = stored.sort_values("even").iloc[0], 100 * stored["covers_95"]
    return (
        name,
        f"{max(one.rhat for one in found.rows):.4f}",
        f"{found.chain.shape[1] / found.time:.0f}",
        f"{min(min(one.bulk, one.tail) for one in found.rows):,.0f}",
        f"{min(found.acceptance):.2f} to {max(found.acceptance):.2f}",
        f"{least['replicates']:,}",
        str(least["failed"]),
        str(len(stored)),
        digits(least["even"], least["even_error"]),
        f"{wide.min():.1f} to {wide.max():.1f} %",
        *(percent(least[column], trials) for column in _NARROW.values()),
    )


def _files() -> list[tuple[str, str, str]]:
    """Say for a user's own files: models, their columns, what these hold, or why there are none."""
    found: dict[tuple[str, str], list[str]] = {}
    for key, declared in posteriors().items():
        file = declared.file
        known = (
            ("none", file)
            if isinstance(file, str)
            else (", ".join(file.columns), file.meaning)
        )
        found.setdefault(known, []).append(key)
    return [(", ".join(keys), *known) for known, keys in found.items()]
