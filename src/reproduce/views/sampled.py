"""A posterior of the book, or the same model on a reader's data. Sampled when looked at."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from rich.console import RenderableType

from reproduce.views.markup import html_table
from reproduce.views.shown import Shown

if TYPE_CHECKING:
    import pandas as pd

    from reproduce.inference.model import Model, Parameter
    from reproduce.inference.posterior import Posterior as Draws
    from reproduce.inference.priors import Prior
    from reproduce.views.pages import Html


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

    @property
    def reads(self) -> tuple[str, ...]:
        """Addresses of the printed cells that reach the model."""
        from reproduce.papers.posteriors import posteriors

        return () if self.data else posteriors()[self.name].given

    @property
    def where(self) -> str:
        """Where the data come from: print, our simulation, or a reader's file."""
        from reproduce.papers.posteriors import posteriors

        if self.data:
            return f"data of {Path(self.data).name}"
        simulated = posteriors()[self.name].simulated
        return "data simulated by us from printed settings" if simulated else "data as printed"

    @cached_property
    def draws_of(self) -> Draws:
        """The sampled posterior itself, for what this object does not offer."""
        from reproduce.views import posterior as running

        if not self.data and not self.settings and not self._priors:
            return running.book_posterior(self.name)
        return running.run(self.model, running.plan_for(self.name, **self.settings))

    @cached_property
    def model(self) -> Model:
        """What is sampled: parameters with their priors, and the likelihood of the data."""
        from reproduce.papers.posteriors import posteriors
        from reproduce.views.posterior_data import from_file

        model = (
            from_file(self.name, Path(self.data), self.pivot)
            if self.data
            else posteriors()[self.name].model()
        )
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
    def source(self) -> str:
        """The text of the function that makes the model."""
        from reproduce.papers.posteriors import posteriors

        build = posteriors()[self.name].build
        return inspect.getsource(inspect.unwrap(getattr(build, "func", build))).rstrip()

    def frame(self) -> pd.DataFrame:
        """Return the summary: one row per parameter and consequence, in the unit shown."""
        import pandas as pd

        from reproduce.views.posterior import all_rows

        rows = {row.name: vars(row) for row in all_rows(self.draws_of)}
        return pd.DataFrame.from_dict(rows, orient="index").drop(columns="name")

    summary = frame

    @property
    def priors(self) -> pd.DataFrame:
        """Every parameter with its unit, its prior and the reason for it."""
        import pandas as pd

        from reproduce.inference.priors import in_unit

        rows = {
            one.name: {
                "unit": one.unit,
                "prior": str(in_unit(one.prior, one.shown)),
                "why": one.prior.reason,
            }
            for one in self.model.parameters
        }
        return pd.DataFrame.from_dict(rows, orient="index")

    @property
    def draws(self) -> pd.DataFrame:
        """All draws, one column per parameter, in the unit shown."""
        import pandas as pd

        found = self.draws_of
        shown = {
            f"{one.name} ({one.unit})": column * one.shown
            for one, column in zip(found.model.parameters, found.draws.T, strict=True)
        }
        return pd.DataFrame(shown)

    def corner(self) -> Html:
        """Return the corner plot."""
        from reproduce.views.pages import Html
        from reproduce.views.posterior_figures import corner

        return Html(corner(self.draws_of, f"Corner plot of the posterior of {self.name}"))

    def export(self, form: str) -> str:
        """Return the summary as csv, json, latex or markdown."""
        from reproduce.views.export import export_frame

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
            self.draws_of.to_datatree().to_netcdf(path)
        elif path.suffix == ".npz":
            found = self.draws_of
            names = np.array(found.model.names)
            np.savez_compressed(
                path, names=names, chain=found.chain, log_posterior=found.log_posterior
            )
        else:
            raise ValueError(f"unknown ending {path.suffix!r}: expected .nc or .npz")
        return path

    def cite(self, form: str = "bibtex") -> str:
        """Return how to cite the paper that it rests on: bibtex, csl or text."""
        from reproduce.papers.posteriors import posteriors
        from reproduce.views import cite as citing

        declared = posteriors()[self.name]
        return citing.posterior(self.name, declared.paper, declared.title, form)

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

    def _repr_html_(self) -> str:
        from reproduce.views.posterior import all_rows, numbers

        head = ("Quantity", "mean", "sd", "95 % from", "to", "MCSE", "R-hat", "bulk", "tail")
        rows = [(f"{row.name} ({row.unit})", *numbers(row)) for row in all_rows(self.draws_of)]
        table_of = html_table(head, rows, f"Posterior {self.name}, {self.where}.")
        return f'<div class="rp-table">{table_of}</div>'

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the summary."""
        from reproduce.views.posterior import summary_table

        yield f"posterior {self.name}, {self.where}"
        yield summary_table(self.draws_of)


def _prior(parameter: Parameter, prior: Prior | tuple[float, float]) -> Prior:
    """Return a reader's prior; two ends are in the unit shown."""
    if not isinstance(prior, tuple | list):
        return prior
    from reproduce.inference.priors import Uniform

    low, high = (float(end) / parameter.shown for end in prior)
    return Uniform(low, high, "a reader's own")
