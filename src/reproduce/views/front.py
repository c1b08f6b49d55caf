"""The front door: what a notebook, the command line and a user need, one object for each idea.

Every object shows itself in a notebook and in a terminal, gives its numbers as a DataFrame, says
which function makes it and what that reads, and can be rerun with something changed.
"""

from __future__ import annotations

import inspect
import io
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd
from rich.console import Console, RenderableType

from reproduce.judge import rerun as rerunning
from reproduce.judge.expected import reason, surprises
from reproduce.judge.ledger import Ledger, Record
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import Computation
from reproduce.printed.cells import Cell as PrintedCell
from reproduce.printed.cells import library
from reproduce.printed.units import symbol
from reproduce.views import cite as citing
from reproduce.views import export as exporting
from reproduce.views import figures, keys, pages, terminal, words
from reproduce.views.markup import html_table
from reproduce.views.sayings import item_ledger, whole_ledger

if TYPE_CHECKING:
    from matplotlib.figure import Figure as MatplotlibFigure

    from reproduce.inference.posterior import Posterior as Draws

WIDTH = 80


class _Shown(ABC):
    """What shows itself in a terminal by its parts, without colour in a notebook's text."""

    @abstractmethod
    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield what a terminal of this many columns shows."""

    def print(self, console: Console) -> None:
        """Write the parts on a terminal."""
        for part in self.parts(console.width):
            if isinstance(part, str):
                console.print(part, markup=False, highlight=False)
            else:
                console.print(part)

    def __repr__(self) -> str:
        """Return the parts as text."""
        text = io.StringIO()
        self.print(Console(file=text, width=WIDTH, no_color=True))
        return "\n".join(line.rstrip() for line in text.getvalue().splitlines())


class _Item(_Shown):
    """What tables, cells and figures share: where they come from."""

    def __init__(self, key: str) -> None:
        self.key = keys.check_key(key)

    @property
    def title(self) -> str:
        """What the item holds, in our words."""
        return keys.title(self.key)

    @property
    def place(self) -> str:
        """Where it stands in the paper."""
        return keys.place(self.key)

    @property
    def reads(self) -> tuple[str, ...]:
        """Addresses of all printed cells that it reads, directly or through other items."""
        return rerunning.changeable(self.key)

    @property
    def source(self) -> str:
        """The text of the functions that compute it."""
        return "\n\n".join(_text(one) for one in catalogue()[self.key].computations)

    def cite(self, form: str = "bibtex") -> str:
        """Return how to cite the item and its paper: bibtex, csl or text."""
        return citing.citation(self.key, form)


def _text(computation: Computation) -> str:
    return inspect.getsource(inspect.unwrap(computation.function)).rstrip()


class Table(_Item):
    """A table or a group of quoted numbers: printed beside computed, with verdicts.

    Parameters
    ----------
    key : str
        Such as ``niu2024/table-3``.
    """

    def __init__(self, key: str) -> None:
        super().__init__(key)
        if self.key not in library():
            raise ValueError(f"{key} holds no printed numbers; try figure({key!r})")

    @cached_property
    def _ledger(self) -> Ledger:
        return item_ledger(self.key)

    def __getitem__(self, name: str) -> Cell:
        """Return one cell by its name, such as ``scale.red``."""
        return Cell(library()[self.key][name].address)

    def frame(self) -> pd.DataFrame:
        """Return the table in its own shape.

        Returns
        -------
        pandas.DataFrame
            Rows as in print. A table has columns as in print, each with printed, computed and
            verdict; a group of quoted numbers has these and the unit.
        """
        table, wanted = library()[self.key], ("printed", "computed", "verdict")
        records = {record.cell.partition("#")[2]: record for record in self._ledger.of(self.key)}
        if len(table.columns) <= 1:
            rows = {name: (*_entry(one), symbol(one.unit) if one.unit else "")
                    for name, one in records.items()}  # fmt: skip
            return pd.DataFrame.from_dict(rows, orient="index", columns=[*wanted, "unit"])
        entries = {
            (column.id, what): [_entry(records[f"{row.id}.{column.id}"])[i] for row in table.rows]
            for column in table.columns
            for i, what in enumerate(wanted)
        }
        return pd.DataFrame(entries, index=[row.id for row in table.rows])

    def cells(self) -> pd.DataFrame:
        """Return one row per cell, with every field of the ledger."""
        return exporting.full_frame(self._ledger.of(self.key))

    def rerun(
        self,
        changes: Mapping[str, str | float] | None = None,
        *,
        seed: int | None = None,
        replicates: int | None = None,
    ) -> Changed:
        """Compute the table again with something changed.

        Parameters
        ----------
        changes : mapping, optional
            Address of any cell in `reads` to a value as in the print: ``"0.2 px"``.
        seed, replicates : int, optional
            Of the random numbers, where the table draws some.

        Returns
        -------
        Changed
            The computed values from the print and under the change, without a verdict.

        Raises
        ------
        ValueError
            If the table does not read the cell, or the value does not fit it.
        """
        return Changed(rerunning.rerun(self.key, changes, seed=seed, replicates=replicates))

    def export(self, form: str) -> str:
        """Return the table as csv, json, latex or markdown."""
        return exporting.export(self._ledger, self.key, form)

    def _repr_html_(self) -> str:
        return pages.table(self.key)._repr_html_()

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield what a terminal of this many columns shows."""
        yield f"{self.key}: {self.title}"
        yield self.place
        yield terminal.records_table(self._ledger.of(self.key), width)
        yield from terminal.remarks(self._ledger, self.key)


def _entry(record: Record) -> tuple[str, str, str]:
    return record.printed, words.computed(record), record.verdict


class Cell(_Shown):
    """One printed number: what the paper prints, what we compute, the verdict and why.

    Parameters
    ----------
    address : str
        Such as ``niu2024/table-3#scale.red``.
    """

    def __init__(self, address: str) -> None:
        key, _, name = address.partition("#")
        self.table = Table(key)
        self._cell: PrintedCell = library()[self.table.key][name]

    @property
    def address(self) -> str:
        """The cell's only name."""
        return self._cell.address

    @cached_property
    def record(self) -> Record:
        """Everything that the ledger says of it."""
        return item_ledger(self.table.key).cell(self.address)

    @property
    def printed(self) -> str:
        """As a reader sees it, with its unit."""
        return self._cell.shown

    @property
    def computed(self) -> float | None:
        """Recomputed value or median of the prediction, in the unit of print."""
        return self.record.computed

    @property
    def verdict(self) -> str:
        """The verdict in one word."""
        return self.record.verdict

    @property
    def reads(self) -> tuple[str, ...]:
        """Addresses that the function that makes it reads itself."""
        made = rerunning.maker(self.address)
        return () if made is None else rerunning.reads(made)

    @property
    def source(self) -> str:
        """The text of the function that makes it, empty for an input."""
        made = rerunning.maker(self.address)
        return "" if made is None else _text(made)

    def frame(self) -> pd.DataFrame:
        """Return its record as a column."""
        return pd.DataFrame({self.address: self.record.model_dump()})

    def rerun(
        self, changes: Mapping[str, str | float] | None = None, **settings: int | None
    ) -> Changed:
        """Compute the cell again with something changed, as `Table.rerun` does."""
        whole = rerunning.rerun(self.table.key, changes, **settings)
        return Changed(whole, self._cell.name)

    def cite(self, form: str = "bibtex") -> str:
        """Return how to cite the cell's table and its paper."""
        return citing.citation(self.table.key, form, self.address)

    def _lines(self) -> list[tuple[str, str]]:
        record = self.record
        value = words.computed(record, extra=1)
        unit = words.unit(record)
        lines = [
            ("printed", self.printed),
            ("computed", f"{value} {unit}".strip() if value else ""),
            ("allowed or predicted", words.interval(record)),
            ("probability", words.probability(record)),
            ("verdict", ", ".join((record.verdict, *record.flags))),
            ("why", reason(self.address) or record.why),
            ("function", record.function or ""),
            ("equations", ", ".join(f"({one})" for one in record.equations)),
            ("seed", ", ".join(map(str, record.seed or ()))),
            ("reads", ", ".join(self.reads)),
        ]
        lines += [
            (f"if {reading.name}", words.read(record, reading)) for reading in record.readings
        ]
        return [(name, text) for name, text in lines if text]

    def _repr_html_(self) -> str:
        return html_table(("", self.address), self._lines(), self._cell.label)

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the cell with all that is known of it, a line each."""
        yield f"{self.address}: {self._cell.label}"
        yield from (f"  {name}: {text}" for name, text in self._lines())


@dataclass(frozen=True, repr=False)
class Changed(_Shown):
    """A table or cell computed again under a reader's own change. It has no verdict.

    Parameters
    ----------
    result : reproduce.judge.rerun.Rerun
        What was computed.
    name : str
        The one cell that is asked for; all of them by default.
    """

    result: rerunning.Rerun
    name: str = ""

    @property
    def changes(self) -> dict[str, str]:
        """What was changed: addresses, ``seed``, ``replicates``."""
        return self.result.changes

    @property
    def replaced(self) -> dict[str, float]:
        """Printed inputs whose place a recomputed value took, in the unit of print."""
        return self.result.replaced

    def frame(self) -> pd.DataFrame:
        """Return printed, computed from the print, value under the change and difference.

        Returns
        -------
        pandas.DataFrame
            One row per computed cell, in the unit of print, with the central 99 % where it is a
            prediction.
        """
        rows = [
            {
                "cell": one.cell.name,
                "reading": one.reading,
                "printed": one.cell.text,
                "unchanged": one.unchanged,
                "changed": one.value,
                "changed - printed": None
                if one.value is None or not one.cell.is_number
                else one.value - one.cell.number.value,
                "low": one.interval[0] if one.interval else None,
                "high": one.interval[1] if one.interval else None,
                "unit": symbol(one.cell.unit) if one.cell.unit else "",
            }
            for one in self.result.cells
            if self.name in {"", one.cell.name}
        ]
        frame = pd.DataFrame(rows).set_index("cell")
        return frame if frame["reading"].any() else frame.drop(columns="reading")

    def _told(self) -> str:
        changed = ", ".join(f"{name} = {text}" for name, text in self.changes.items()) or "nothing"
        told = f"{self.result.key} with {changed}: a reader's own setting, without a verdict."
        if self.replaced:
            told += f" Recomputed values took the place of: {', '.join(self.replaced)}."
        return told

    def _shown(self) -> list[tuple[str, ...]]:
        rows = []
        for one in self.result.cells:
            if self.name not in {"", one.cell.name} or not one.cell.is_number:
                continue
            number = one.cell.number
            values = [one.unchanged, one.value, *(one.interval or (None, None))]
            digits = ["" if v is None else number.format(v, extra=1) for v in values]
            name = f"{one.cell.name} if {one.reading}" if one.reading else one.cell.name
            rows.append((name, one.cell.text, *digits, symbol(one.cell.unit)))
        return rows

    _HEAD = ("cell", "printed", "from the print", "changed", "from", "to", "unit")

    def _repr_html_(self) -> str:
        rows = [tuple(text.replace("-", "−") if i else text for i, text in enumerate(row))
                for row in self._shown()]  # fmt: skip
        return f'<div class="rp-table">{html_table(self._HEAD, rows, self._told())}</div>'

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the cells and what was changed."""
        yield terminal.aligned(self._HEAD, self._shown())
        yield self._told()


class Figure(_Item):
    """A figure, drawn from its caption and the text.

    Parameters
    ----------
    key : str
        Such as ``chen2023/fig-11a``.
    """

    def __init__(self, key: str) -> None:
        super().__init__(key)
        if catalogue()[self.key].draw is None:
            known = ", ".join(figures.drawable())
            raise ValueError(f"{key} has no figure; these have one: {known}")

    @cached_property
    def drawn(self) -> MatplotlibFigure:
        """The matplotlib figure."""
        return figures.draw(self.key)

    @cached_property
    def data(self) -> pd.DataFrame:
        """The lines and points that are drawn, in the units of the axes."""
        return figures.data(self.drawn)

    def save(self, path: str | Path) -> Path:
        """Write the figure; the ending chooses svg, pdf or png."""
        figures.save(self.key, Path(path))
        return Path(path)

    def _repr_html_(self) -> str:
        return pages.figure(self.key, self.title)._repr_html_()

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield what the figure shows and how to look at it."""
        curves = self.data["curve"].nunique() if len(self.data) else 0
        yield f"{self.key}: {self.title}"
        yield f"{self.place}; {curves} curves, {len(self.data)} points in .data"
        yield f"Draw it with `reproduce figure {self.key} --out FILE.svg`."


class Contents(_Shown):
    """All items of both papers, in order of print, with the verdicts of their cells."""

    def frame(self) -> pd.DataFrame:
        """Return one row per item: place, title and the number of cells by verdict."""
        ledger = whole_ledger()
        rows = {
            key: {"place": keys.place(key), "title": keys.title(key), **words.tally(ledger.of(key))}
            for key in catalogue()
        }
        return pd.DataFrame.from_dict(rows, orient="index")

    def _repr_html_(self) -> str:
        return pages.score()._repr_html_()

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the list of items and the score."""
        yield terminal.items_table(list(catalogue().values()), width)
        yield terminal.score_table(whole_ledger())


class Check:
    """All verdicts against the frozen ones. True if they are the same."""

    def __init__(self) -> None:
        self.surprises = surprises(whole_ledger())

    def __bool__(self) -> bool:
        """Tell whether every verdict is as frozen."""
        return not self.surprises

    def frame(self) -> pd.DataFrame:
        """Return the cells whose verdict is not the frozen one."""
        columns = ("cell", "expected", "found")
        rows = [tuple(getattr(one, name) for name in columns) for one in self.surprises]
        return pd.DataFrame(rows, columns=list(columns))

    def __repr__(self) -> str:
        """Return the outcome in one line, and the surprises below it."""
        cells = len(whole_ledger().records)
        if self:
            return f"All {cells} verdicts are as frozen."
        return f"{len(self.surprises)} of {cells} verdicts are not as frozen:\n{self.frame()}"


def contents() -> Contents:
    """Return all items of both papers, in order of print, with their score."""
    return Contents()


def table(address: str) -> Table | Cell:
    """Return a table, a group of quoted numbers, or one cell of it.

    Parameters
    ----------
    address : str
        A key such as ``niu2024/table-3``, or a cell such as ``niu2024/table-3#scale.red``.

    Returns
    -------
    Table or Cell
        Printed beside computed, with verdicts.

    Examples
    --------
    >>> table("niu2024/table-2")["scale.red"].verdict
    'exact'
    """
    return Cell(address) if "#" in address else Table(address)


def figure(key: str) -> Figure:
    """Return a figure by its key, such as ``chen2023/fig-11a``."""
    return Figure(key)


def check() -> Check:
    """Recompute and judge everything, and compare the verdicts with the frozen ones."""
    return Check()


def cite(address: str, form: str = "bibtex") -> str:
    """Return how to cite an item or a cell and its paper: bibtex, csl or text."""
    key, _, name = address.partition("#")
    return citing.citation(keys.check_key(key), form, address if name else "")


class Posterior(_Shown):
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
        from reproduce.views.posterior import all_rows

        rows = {row.name: vars(row) for row in all_rows(self.draws_of)}
        return pd.DataFrame.from_dict(rows, orient="index").drop(columns="name")

    summary = frame

    @property
    def priors(self) -> pd.DataFrame:
        """Every parameter with its unit, its prior and the reason for it."""
        from reproduce.inference.priors import in_unit

        rows = {
            one.name: {
                "unit": one.unit,
                "prior": str(in_unit(one.prior, one.shown)),
                "why": one.prior.reason,
            }
            for one in self.draws_of.model.parameters
        }
        return pd.DataFrame.from_dict(rows, orient="index")

    @property
    def draws(self) -> pd.DataFrame:
        """All draws, one column per parameter, in the unit shown."""
        found = self.draws_of
        shown = {
            f"{one.name} ({one.unit})": column * one.shown
            for one, column in zip(found.model.parameters, found.draws.T, strict=True)
        }
        return pd.DataFrame(shown)

    def corner(self) -> pages.Html:
        """Return the corner plot."""
        from reproduce.views.posterior_figures import corner

        return pages.Html(corner(self.draws_of, f"Corner plot of the posterior of {self.name}"))

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


class Contradictions:
    """What the printed numbers of a paper say of each other, and the register of errata.

    Parameters
    ----------
    paper : str
        ``niu2024`` or ``chen2023``.
    """

    def __init__(self, paper: str) -> None:
        from reproduce.printed.cells import PAPERS

        if paper not in PAPERS:
            raise ValueError(f"unknown paper {paper!r}: expected one of {', '.join(PAPERS)}")
        self.paper = paper

    def frame(self) -> pd.DataFrame:
        """Return the register: one row per entry, with what is printed and why it is there."""
        from reproduce.audit.errata import register
        from reproduce.locate import data_folder

        text = (data_folder() / "errata.toml").read_text(encoding="utf-8")
        entries = [one for one in register(text) if one.paper == self.paper]
        wanted = ("place", "printed", "problem", "conclusion", "status", "extraction")
        rows = {one.id: {name: getattr(one, name) for name in wanted} for one in entries}
        return pd.DataFrame.from_dict(rows, orient="index")

    def relations(self) -> pd.DataFrame:
        """Return every relation that the printed numbers should keep, and what became of it."""
        from reproduce.audit.report import audit_paper

        found = audit_paper(self.paper)
        rows = {
            one.relation.name: {"outcome": one.outcome, "cells": ", ".join(one.relation.addresses)}
            for one in found.findings
        }
        return pd.DataFrame.from_dict(rows, orient="index")

    def __repr__(self) -> str:
        """Return the audit as the terminal shows it."""
        from reproduce.audit.report import audit_paper
        from reproduce.views.audit_terminal import lines, wrapped

        return "\n".join(wrapped(line, WIDTH) for line in lines(audit_paper(self.paper)))


def posterior(name: str, data: str | Path | None = None, **settings: Any) -> Posterior:
    """Return a posterior of the book, or the same model on a reader's data.

    Parameters
    ----------
    name : str
        Such as ``registration``; ``reproduce posterior --list`` names all.
    data : str or Path, optional
        A reader's CSV.
    **settings
        ``pivot``, ``steps``, ``walkers``, ``ensembles``, ``seed``.
    """
    return Posterior(name, data, **settings)


def contradictions(paper: str) -> Contradictions:
    """Return what the printed numbers of a paper say of each other, and its errata."""
    return Contradictions(paper)


def register(source: Any, target: Any, pivot: Any = None, **settings: Any) -> Any:
    """Fit the transform that lays a user's own stars over each other.

    Parameters
    ----------
    source, target : array_like, shape (n, 2)
        The same stars in both images, in px.
    pivot : array_like, shape (2,), optional
        The point turned and scaled about, in px; the middle of the source points by default.
    **settings
        Those of `physics.registration.fit.fit_registration`: ``model``, ``weights``, ``robust``,
        ``source_covariance``, ``target_covariance``.

    Returns
    -------
    reproduce.physics.registration.fit.RegistrationFit
        Parameters, covariance, residuals and the transform.
    """
    import numpy as np

    from reproduce.physics.registration.fit import fit_registration

    middle = np.mean(np.asarray(source, dtype=float), axis=0) if pivot is None else pivot
    return fit_registration(source, target, middle, **settings)
