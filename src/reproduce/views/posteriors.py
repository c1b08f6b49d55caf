"""All posteriors of the book: results, diagnostics, and the format of your data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd
from numpy.typing import ArrayLike

from reproduce.inference import ConvergenceCriteria, Prior, Summary
from reproduce.judge.ledger import record_of
from reproduce.papers.declare import item_text
from reproduce.papers.posteriors import posteriors
from reproduce.physics.attitude import Platform
from reproduce.physics.validate import without_none
from reproduce.printed.cells import find
from reproduce.printed.number import UNITS, quantity, symbol
from reproduce.store import studies
from reproduce.store.files import FilePath
from reproduce.views._blocks import Block, Blocks, Display, Entry, Grid, badge, link
from reproduce.views._numbers import digits, percent
from reproduce.views.posterior import Posterior, book_posterior, interval

_COLUMNS = ("Quantity", "Printed", "Posterior, mean ± sd", "95 % interval", "Verdict")
# Columns of the calibrations with their power: standard deviations too small by 10 and 5 %.
_POWERS = {"10": "narrow_10", "5": "narrow_5"}
# Fraction of correct curves that leave their own band.
_OUTSIDE_FRACTION = 0.05


def posterior(
    name: str | None = None,
    data: FilePath | pd.DataFrame | Mapping[str, Any] | None = None,
    pivot: tuple[float, float] | None = None,
    priors: Mapping[str, Prior | tuple[float, float]] | None = None,
    *,
    model: str | None = None,
    weights: ArrayLike | None = None,
    source_covariance: ArrayLike | None = None,
    target_covariance: ArrayLike | None = None,
    platform: Platform | FilePath | None = None,
    sep: str | None = None,
    data_seed: int | None = None,
    steps: int | None = None,
    walkers: int | None = None,
    seed: int | None = None,
) -> Posterior | Posteriors:
    """Return a posterior of the book, the same model for your data, or all posteriors.

    Parameters
    ----------
    name : str, optional
        Name of a model, such as ``registration``. ``rp.posterior().models`` lists all names.
        Default: all posteriors of the book.
    data : path or table, optional
        Your data, as in `register`. ``rp.posterior().models`` lists the columns.
    pivot : tuple of float, optional
        Principal point of your stars, in px. Default: their mean.
    priors : mapping, optional
        Name of a parameter to the bounds of a uniform prior, or to a prior of
        `reproduce.inference`. All numbers are in the displayed unit of the parameter.
    model : str, optional
        Transform of your stars, as in `register`, for ``registration`` and
        ``registration-mixture``. Default: a similarity.
    weights, source_covariance, target_covariance : array_like, optional
        Errors of your stars, as in `register`, for the same models.
    platform : Platform or path, optional
        Fiducial lights and tracker of your laser spots, as in `misalignment`.
    sep : str, optional
        Separator of the columns of a text file. Default: a comma.
    data_seed : int, optional
        Seed of the simulated data of the book.
    steps, walkers, seed : int, optional
        Kept steps and walkers of each ensemble, and seed of the sampler. Default: the plan of the
        book.

    Returns
    -------
    Posterior or Posteriors
        One posterior, not yet sampled, or all posteriors of the book.

    Raises
    ------
    ValueError
        If the model does not accept an argument, or the data are wrong.
    """
    arguments = without_none(locals())
    if name is not None:
        return Posterior(**arguments)
    if arguments:
        raise TypeError(
            f"name: expected a model for {min(arguments)}, such as 'registration', got none. Add it"
        )
    return Posteriors()


class Posteriors(Display):
    """Every posterior of the book, with the printed values and their verdicts."""

    def blocks(self) -> Iterator[Block]:
        """Yield one table of all posteriors."""
        rows = [
            _summarised(key, row, declared.summary[row.name])
            for key, declared in posteriors().items()
            for row in book_posterior(key).summaries
            if row.name in declared.summary
        ]
        yield Grid.of(
            item_text("posteriors/all").caption,
            _COLUMNS,
            rows,
            identifier="posteriors",
        )

    @property
    def models(self) -> Blocks:
        """Titles of the models, and the columns of a table of your data."""
        models = []
        files = dict[tuple[str, str], list[str]]()
        for key, declared in posteriors().items():
            models.append((key, declared.paper, declared.title))
            texts = ", ".join(declared.columns) or "none", declared.meaning
            files.setdefault(texts, []).append(key)
        columns = [(", ".join(keys), *texts) for texts, keys in files.items()]
        return Blocks(
            (
                Grid("The models.", ("Model", "Paper", "Title"), models),
                Grid(
                    item_text("posteriors/models").caption,
                    ("Models", "Columns", "Meaning"),
                    columns,
                ),
            )
        )

    def diagnostics(self, paper: str) -> Grid:
        """Return chains and calibration of each posterior of a paper.

        Parameters
        ----------
        paper : str
            Name of the paper, such as ``niu2024``.

        Returns
        -------
        Grid
            A table with a row per posterior.
        """
        stored = studies.table("calibrations")
        trials = stored.attrs["trials"]
        names = [name for name, one in posteriors().items() if one.paper == paper]
        stored = stored[stored["posterior"].isin(names)]
        models = stored.groupby("posterior", sort=False)
        rows = [_diagnosed(str(name), one, trials) for name, one in models]
        least = stored["even"].min()
        count = len(stored)
        caption = item_text("posteriors/diagnostics").caption.format(
            paper=paper,
            limits=ConvergenceCriteria,
            count=count,
            band=100 * (1 - _OUTSIDE_FRACTION),
            outside=(stored["even"] < _OUTSIDE_FRACTION).sum(),
            chance=count * _OUTSIDE_FRACTION,
            least=least,
            as_small=count * least,
        )
        return Grid.of(caption, rows[0], rows)


def _summarised(key: str, row: Summary, text: str) -> dict[str, Entry]:
    """Return the row of a quantity; `text` is the address of its printed cell, or a label."""
    mark = symbol(row.unit) if row.unit in UNITS else row.unit
    mean, ends = (quantity(text_, mark) for text_ in interval(row))
    found: dict[str, Entry] = {"Posterior, mean ± sd": mean, "95 % interval": ends}
    if "#" in text:
        (cell,) = find(text)
        found["Printed"] = link(cell.anchor, cell.shown)
        found["Verdict"] = badge(record_of(text).verdict)
        text = f"{cell.place.partition(',')[0]}: {cell.label}"
    return {**found, "Quantity": link(f"posterior-{key}", text)}


def _diagnosed(name: str, stored: pd.DataFrame, trials: int) -> dict[str, Entry]:
    """Return the row of a posterior: chains, then calibration."""
    samples = book_posterior(name)
    chains = pd.DataFrame(samples.rows)
    least = stored.sort_values("even").iloc[0]
    wide = 100 * stored["covers_95"]
    return {
        "Model": name,
        "R-hat, largest": f"{chains['rhat'].max():.4f}",
        "steps / τ, fewest": f"{samples.chain.shape[1] / samples.time:.0f}",
        "ESS, smallest": f"{chains[['bulk', 'tail']].to_numpy().min():,.0f}",
        "acceptance": f"{min(samples.acceptance):.2f} to {max(samples.acceptance):.2f}",
        "replicates": f"{least['replicates']:,}",
        "failed": str(least["failed"]),
        "quantities": str(len(stored)),
        "smallest p (uniform)": digits(least["even"], least["even_error"]),
        "95 % covers": f"{wide.min():.1f} to {wide.max():.1f} %",
        **{
            f"sd {percentage} % too small leaves its band": percent(
                least[column], trials
            )
            for percentage, column in _POWERS.items()
        },
    }
