"""A posterior of the book, or the same model on a reader's data. Sampled when looked at."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from concurrent.futures import Executor
from dataclasses import asdict, replace
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from rich.console import RenderableType
from rich.table import Table

from reproduce.views import computed
from reproduce.views.objects.base import Shown, by_row, text_of
from reproduce.views.writing.cite import beside
from reproduce.views.writing.display import Grid, Html, columns
from reproduce.views.writing.export import export_frame
from reproduce.views.writing.numbers import digits, percent

if TYPE_CHECKING:
    import pandas as pd

    from reproduce.inference.calibration import Ranks
    from reproduce.inference.model import Model, Parameter
    from reproduce.inference.parts import Progress
    from reproduce.inference.posterior import Sampled, Summary
    from reproduce.inference.priors import Prior
    from reproduce.inference.sampling import Plan
    from reproduce.papers.declare_posterior import Declaration, Supplied

__all__ = ["Posterior", "book_posterior", "coverage_rows", "entries", "named", "spread"]

PRECISION = ("MCSE", "R-hat", "bulk", "tail")


@cache
def book_posterior(name: str) -> Sampled:
    """Return the posterior of the book, sampled once in a process, and once in a build."""
    from reproduce.inference import sampling
    from reproduce.papers.posteriors import posteriors

    declared, kept = posteriors()[name], computed.kept()
    return sampling.sample(declared.model(), declared.plan(), folder=kept and kept / name)


class Posterior(Shown):
    """A posterior of the book, or the same model on a reader's data. Sampled when looked at.

    Parameters
    ----------
    name : str
        Such as ``registration``.
    data : str or Path, optional
        A reader's CSV in place of the book's data.
    pivot : tuple of float, optional
        Principal point of these data, in px.
    priors : mapping, optional
        Name of a parameter to its lowest and highest value in the unit shown, between which the
        prior is even, or to a prior of `reproduce.inference.priors`.
    steps, walkers, ensembles, seed : int, optional
        How it is sampled, in place of the book's own plan.
    """

    def __init__(
        self,
        name: str,
        data: str | Path | None = None,
        pivot: tuple[float, float] | None = None,
        priors: Mapping[str, Prior | tuple[float, float]] | None = None,
        **settings: int | None,
    ) -> None:
        from reproduce.papers.posteriors import posteriors

        if name not in posteriors():
            raise ValueError(f"unknown posterior {name!r}: expected one of {list(posteriors())}")
        self.name, self.data, self.pivot = name, data, pivot
        self._priors = dict(priors or {})
        self.settings = {key: value for key, value in settings.items() if value is not None}
        if unknown := set(self.settings) - {"steps", "walkers", "ensembles", "seed"}:
            raise TypeError(f"unknown settings {sorted(unknown)}: steps, walkers, ensembles, seed")
        if self._priors:
            _ = self.model  # so that a wrong one is refused here, not when it is looked at

    @cached_property
    def declared(self) -> Declaration:
        """How the posterior is declared: its data, rivals, published numbers."""
        from reproduce.papers.posteriors import posteriors

        return posteriors()[self.name]

    @property
    def reads(self) -> tuple[str, ...]:
        """Addresses of the printed cells that reach the model."""
        return () if self.data else self.declared.given

    @property
    def where(self) -> str:
        """Where the data come from: print, our simulation, or a reader's file."""
        if self.data:
            return f"data of {Path(self.data).name}"
        simulated = self.declared.simulated
        return "data simulated by us from printed settings" if simulated else "data as printed"

    @cached_property
    def _supplied(self) -> Supplied | None:
        return self.declared.from_file(Path(self.data), self.pivot) if self.data else None

    @cached_property
    def model(self) -> Model:
        """What is sampled: parameters with their priors, and the likelihood of the data."""
        model = self._supplied.model if self._supplied else self.declared.model()
        if strays := sorted(set(self._priors) - set(model.names)):
            raise ValueError(
                f"{self.name} has no parameter {', '.join(strays)}; it has {', '.join(model.names)}"
            )
        parameters = (
            replace(one, prior=_prior(one, self._priors[one.name]))
            if one.name in self._priors
            else one
            for one in model.parameters
        )
        return replace(model, parameters=tuple(parameters))

    @property
    def plan(self) -> Plan:
        """How it is sampled."""
        return self.declared.plan(**self.settings)

    @cached_property
    def sampled(self) -> Sampled:
        """The sampled posterior itself, for what this object does not offer."""
        if not self.data and not self.settings and not self._priors:
            return book_posterior(self.name)
        return self.sample()

    def sample(
        self,
        executor: Executor | None = None,
        folder: Path | None = None,
        progress: Progress | None = None,
    ) -> Sampled:
        """Sample now: on an executor, with its chains kept in a folder and continued from there."""
        from reproduce.inference import sampling

        self.sampled = sampling.sample(
            self.model, self.plan, executor=executor, folder=folder, progress=progress
        )
        return self.sampled

    @property
    def provenance(self) -> dict[str, Any]:
        """What the data are, for programs: their kind, and the paper, the truth or the file."""
        if self._supplied:
            data = {"kind": "file", "file": str(self.data), "rows": self._supplied.rows}
            return data | ({"pivot": self._supplied.pivots} if self._supplied.pivots else {})
        paper = self.declared.paper
        if not self.declared.simulated:
            return {"kind": "printed", "paper": paper}
        factors = {one.name: one.shown for one in self.model.parameters}
        truth = {name: value * factors[name] for name, value in self.declared.true_values().items()}
        return {"kind": "simulated", "paper": paper, "truth": truth}

    @property
    def told(self) -> str:
        """What the data are, in one line."""
        found = self.provenance
        if found["kind"] == "printed":
            return f"as printed in {found['paper']}"
        if found["kind"] == "simulated":
            units = {one.name: one.unit for one in self.model.parameters}
            shown = ", ".join(
                f"{name} {value:.6g}" + ("" if units[name] == "1" else f" {units[name]}")
                for name, value in found["truth"].items()
            )
            return f"simulated by us with printed settings of {found['paper']}; truth: {shown}"
        line = f"your file {found['file']}, {found['rows']} lines"
        if "pivot" in found:
            places = dict.fromkeys("({:.6g}, {:.6g})".format(*one) for one in found["pivot"])
            line += f", pivot {' and '.join(places)} px"
            line += "" if self.pivot else ", the mean of the stars"
        return line

    @property
    def remarks(self) -> tuple[str, ...]:
        """What a reader should hear of the data of a file."""
        return self._supplied.remarks if self._supplied else ()

    @property
    def source(self) -> str:
        """The text of the function that makes the model."""
        function = self.declared.build
        return text_of(getattr(function, "func", function))

    def frame(self) -> pd.DataFrame:
        """Return the summary: one row per parameter and consequence, in the unit shown."""
        rows = {row.name: vars(row) for row in self.sampled.summaries()}
        return by_row(rows).drop(columns="name")

    summary = frame

    @property
    def priors(self) -> pd.DataFrame:
        """Every parameter with its unit, its prior and the reason for it."""
        rows = {
            one.name: (one.unit, str(one.prior.in_unit(one.shown)), one.prior.reason)
            for one in self.model.parameters
        }
        return by_row(rows, ["unit", "prior", "why"])

    @property
    def draws(self) -> pd.DataFrame:
        """All draws, one column per parameter, in the unit shown."""
        import pandas as pd

        found = self.sampled
        shown = {
            f"{one.name} ({one.unit})": column * one.shown
            for one, column in zip(found.model.parameters, found.draws.T, strict=True)
        }
        return pd.DataFrame(shown)

    def corner(self) -> Html:
        """Return the corner plot."""
        from reproduce.views.writing.posterior_figures import corner

        return Html(corner(self.sampled, f"Corner plot of the posterior of {self.name}"))

    def export(self, form: str) -> str:
        """Return the summary as csv, json, latex or markdown."""
        return export_frame(self.frame().rename_axis("parameter").reset_index(), form)

    def save(self, path: str | Path) -> Path:
        """Write the chains: ``.nc`` for ArviZ (the extra ``netcdf``), ``.npz`` for NumPy alone.

        Raises
        ------
        ValueError
            If the ending is another one.
        """
        path = Path(path)
        if path.suffix == ".nc":
            self.sampled.to_datatree().to_netcdf(path)
        elif path.suffix == ".npz":
            found = self.sampled
            names = np.array(found.model.names)
            np.savez_compressed(
                path, names=names, chain=found.chain, log_posterior=found.log_posterior
            )
        else:
            raise ValueError(f"unknown ending {path.suffix!r}: expected .nc or .npz")
        return path

    def cite(self, form: str = "bibtex") -> str:
        """Return how to cite the paper that it rests on: bibtex, csl or text."""
        return beside("Posterior", self.name, self.declared.paper, self.declared.title, form)

    def rerun(
        self,
        data: str | Path | None = None,
        pivot: tuple[float, float] | None = None,
        priors: Mapping[str, Prior | tuple[float, float]] | None = None,
        **settings: int | None,
    ) -> Posterior:
        """Return the same model on other data, under other priors, or sampled in another way.

        Parameters
        ----------
        data, pivot
            A reader's CSV and its principal point; those of this object by default.
        priors : mapping, optional
            As for `Posterior`; those of other parameters stay.
        **settings : int
            ``steps``, ``walkers``, ``ensembles`` or ``seed``.

        Returns
        -------
        Posterior
            Not yet sampled.
        """
        kept = {**self.settings, **settings}
        changed = {**self._priors, **(priors or {})}
        return Posterior(self.name, data or self.data, pivot or self.pivot, changed, **kept)

    def record(self) -> dict[str, Any]:
        """Return everything of the summary for other programs."""
        from reproduce.inference.sensitivity import leanings

        found = self.sampled
        return {
            "model": found.model.name,
            "seed": found.seed,
            "ensembles": found.chain.shape[0],
            "steps": found.chain.shape[1],
            "walkers": found.chain.shape[2],
            "acceptance": list(found.acceptance),
            "at_prior_end": [asdict(one) for one in leanings(found)],
            "parameters": [asdict(row) for row in found.rows()],
            "consequences": [asdict(row) for row, _ in found.consequences()],
            "data": self.provenance,
            "remarks": list(self.remarks),
        }

    def _repr_html_(self) -> str:
        head = ("Quantity", "mean", "sd", "95 % from", "to", *PRECISION)
        rows = [(f"{row.name} ({row.unit})", *entries(row)) for row in self.sampled.summaries()]
        return str(Grid(f"Posterior {self.name}, {self.where}.", head, rows).html)

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the summary."""
        yield f"posterior {self.name}, {self.where}"
        yield self.table()

    def table(self) -> Table:
        """Return the summary for a terminal, every number with the digits its error allows."""
        heads = ("parameter", "mean", "sd", "2.5 %", "97.5 %", *PRECISION)
        rows = [(named(row), *entries(row)) for row in self.sampled.summaries()]
        table = columns(heads, rows, whole=range(1, len(heads)))
        table.columns[0].min_width = 12
        return table


def named(row: Any) -> str:
    """Write a name with its unit, if it has one."""
    return str(row.name) if row.unit == "1" else f"{row.name} ({row.unit})"


def spread(row: Summary) -> tuple[str, str, str, str]:
    """Write the mean of a summary, its standard deviation and the ends of its 95 %."""
    ends = (digits(row.low, row.mcse_end), digits(row.high, row.mcse_end))
    return (digits(row.mean, row.mcse), f"{row.deviation:.2g}", *ends)


def entries(row: Summary) -> tuple[str, ...]:
    """Write the numbers of a summary: those of `spread`, MCSE, R-hat, bulk and tail ESS."""
    precision = (f"{row.mcse:.1g}", f"{row.rhat:.3f}", f"{row.bulk:.0f}", f"{row.tail:.0f}")
    return (*spread(row), *precision)


def coverage_rows(stored: Ranks) -> list[tuple[str, ...]]:
    """Write evenness and coverage of every quantity, with binomial standard errors."""
    return [
        (
            row.name,
            digits(row.chance.value, row.chance.error),
            percent(row.half),
            percent(row.wide),
            "none" if row.published is None else percent(row.published),
        )
        for row in stored.coverages()
    ]


def _prior(parameter: Parameter, prior: Prior | tuple[float, float]) -> Prior:
    """Return a reader's prior; two ends are in the unit shown."""
    if not isinstance(prior, tuple | list):
        return prior
    from reproduce.inference.priors import Uniform

    low, high = (float(end) / parameter.shown for end in prior)
    return Uniform(low, high, "a reader's own")
