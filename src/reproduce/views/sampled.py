"""A posterior of the book, or the same model on a reader's data. Sampled when looked at."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING

from rich.console import RenderableType

from reproduce.views.markup import html_table
from reproduce.views.shown import Shown

if TYPE_CHECKING:
    import pandas as pd

    from reproduce.inference.posterior import Posterior as Draws
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
    steps, walkers, ensembles, seed : int, optional
        How it is sampled, in place of the book's own plan.
    """

    def __init__(
        self,
        name: str,
        data: str | Path | None = None,
        pivot: tuple[float, float] | None = None,
        **settings: int | None,
    ) -> None:
        from reproduce.papers.posteriors import posteriors

        if name not in posteriors():
            raise ValueError(f"unknown posterior {name!r}: expected one of {list(posteriors())}")
        self.name, self.data, self.pivot = name, data, pivot
        self.settings = {key: value for key, value in settings.items() if value is not None}
        if unknown := set(self.settings) - {"steps", "walkers", "ensembles", "seed"}:
            raise TypeError(f"unknown settings {sorted(unknown)}: steps, walkers, ensembles, seed")

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
        from reproduce.papers.posteriors import posteriors
        from reproduce.views import posterior as running
        from reproduce.views.posterior_data import from_file

        if not self.data and not self.settings:
            return running.book_posterior(self.name)
        model = (
            from_file(self.name, Path(self.data), self.pivot)
            if self.data
            else posteriors()[self.name].model()
        )
        return running.run(model, running.plan_for(self.name, **self.settings))

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
                "prior": str(in_unit(one.prior, one.shown, one.offset)),
                "why": one.prior.reason,
            }
            for one in self.draws_of.model.parameters
        }
        return pd.DataFrame.from_dict(rows, orient="index")

    @property
    def draws(self) -> pd.DataFrame:
        """All draws, one column per parameter, in the unit shown."""
        import pandas as pd

        found = self.draws_of
        shown = {
            f"{one.name} ({one.unit})": (column - one.offset) * one.shown
            for one, column in zip(found.model.parameters, found.draws.T, strict=True)
        }
        return pd.DataFrame(shown)

    def corner(self) -> Html:
        """Return the corner plot."""
        from reproduce.views.posterior_figures import corner

        return Html(corner(self.draws_of, f"Corner plot of the posterior of {self.name}"))

    def rerun(
        self,
        data: str | Path | None = None,
        pivot: tuple[float, float] | None = None,
        **settings: int | None,
    ) -> Posterior:
        """Return the same model on other data, or sampled in another way.

        Parameters
        ----------
        data, pivot
            A reader's CSV and its principal point; those of this object by default.
        **settings : int
            ``steps``, ``walkers``, ``ensembles`` or ``seed``.
        """
        kept = {**self.settings, **settings}
        return Posterior(self.name, data or self.data, pivot or self.pivot, **kept)

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
