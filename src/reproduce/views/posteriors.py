"""All posteriors of the book: results, diagnostics, and the tables that they accept."""

from __future__ import annotations

from collections.abc import Iterator

import pandas as pd
from markupsafe import Markup

from reproduce.inference import ConvergenceCriteria
from reproduce.papers.declare import item_text
from reproduce.papers.posteriors import posteriors
from reproduce.printed.cells import find
from reproduce.printed.number import UNITS, symbol
from reproduce.store import studies
from reproduce.views.blocks import Block, Blocks, Display, Entry, Grid, badge, link
from reproduce.views.computed import item_ledger
from reproduce.views.numbers import digits, minus, percent
from reproduce.views.posterior import Posterior, book_posterior, interval
from reproduce.views.verdicts import quantity

# Standard deviations too small by 10 and 5 %: columns of the calibrations with their power.
_POWERS = {"10": "narrow_10", "5": "narrow_5"}
# The fraction of right curves that leave their own band.
_OUTSIDE = 0.05


class Posteriors(Display):
    """Every posterior of the book, with the printed values and their verdicts."""

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
        rows = [
            _summarised(key, name, text)
            for key, one in posteriors().items()
            for name, text in one.summary.items()
        ]
        yield Grid(item_text("posteriors/all").caption, head, rows, "posteriors")

    @property
    def models(self) -> Blocks:
        """Titles of the models, and the columns of a table of your data."""
        provenance = [
            (name, one.paper, one.title) for name, one in posteriors().items()
        ]
        files: dict[tuple[str, str], list[str]] = {}
        for key, one in posteriors().items():
            known = ("none", one.file) if isinstance(one.file, str) else one.file.texts
            files.setdefault(known, []).append(key)
        columns = [(", ".join(keys), *known) for known, keys in files.items()]
        heads = ("Models", "Columns", "What they hold")
        models = ("Model", "Paper", "About")
        return Blocks(
            (
                Grid("The models.", models, provenance),
                Grid(item_text("posteriors/models").caption, heads, columns),
            )
        )

    def titles(self) -> dict[str, str]:
        """Return the titles by name."""
        return {name: one.title for name, one in posteriors().items()}

    def diagnostics(self, paper: str) -> Blocks:
        """Return chains and calibration of each posterior of a paper."""
        stored = studies.table("calibrations")
        trials = stored.attrs["trials"]
        names = [name for name, one in posteriors().items() if one.paper == paper]
        stored = stored[stored["posterior"].isin(names)]
        models = stored.groupby("posterior", sort=False)
        rows = [_diagnosed(str(name), one, trials) for name, one in models]
        least, count, limits = stored["even"].min(), len(stored), ConvergenceCriteria
        powers = (f"sd {share} % too small leaves its band" for share in _POWERS)
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
            *powers,
        )
        caption = item_text("posteriors/diagnostics").caption.format(
            paper=paper,
            rhat=limits.rhat,
            times=limits.times,
            size=limits.size,
            acceptance=limits.acceptance,
            count=count,
            band=100 * (1 - _OUTSIDE),
            outside=(stored["even"] < _OUTSIDE).sum(),
            chance=count * _OUTSIDE,
            least=least,
            as_small=count * least,
        )
        return Blocks((Grid(caption, head, rows),))


def _summarised(key: str, name: str, text: str) -> tuple[Entry, ...]:
    """Return the row of a quantity: label, print, mean ± sd, interval, truth, verdict.

    `text` is the address of the printed cell, or a label.
    """
    row = next(row for row in book_posterior(key).summaries() if row.name == name)
    mark = symbol(row.unit) if row.unit in UNITS else row.unit
    mean, ends = (quantity(one, mark) for one in interval(row))
    truth = Posterior(key).truth.get(name)
    known = "" if truth is None else minus(quantity(f"{truth:.6g}", mark))
    printed, verdict = Markup(""), Markup("")
    if "#" in text:
        (cell,) = find(text)
        printed = link(cell.anchor, cell.shown)
        verdict = badge(item_ledger(text.partition("#")[0]).cell(text).verdict)
        text = cell.label
    return link(f"posterior-{key}", text), printed, mean, ends, known, verdict


def _diagnosed(name: str, stored: pd.DataFrame, trials: int) -> tuple[str, ...]:
    """Return the row of a posterior: chains, then calibration."""
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
        *(percent(least[column], trials) for column in _POWERS.values()),
    )
