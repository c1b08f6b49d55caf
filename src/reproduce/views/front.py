"""The front door: what a notebook, the command line and a user need, one object for each idea.

Every object shows itself in a notebook and in a terminal, gives its numbers as a DataFrame, says
which function makes it and what that reads, and can be rerun with something changed.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from markupsafe import Markup
from rich.console import RenderableType

from reproduce.judge.expected import surprises
from reproduce.judge.ledger import build
from reproduce.judge.studies import studies
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import PAPERS, library
from reproduce.views import keys, record_text, terminal
from reproduce.views.build import item_ledger
from reproduce.views.items import Cell, Figure, Panels, Table
from reproduce.views.shown import Shown

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import ArrayLike

    from reproduce.audit.report import Audit
    from reproduce.judge.ledger import Ledger
    from reproduce.views.own import Monitored, Registered
    from reproduce.views.sampled import Posterior
    from reproduce.views.study import StudyTable

__all__ = [
    *("check", "cite", "contents", "contradictions", "figure", "item"),
    *("misalignment", "posterior", "register", "table"),
]


class Contents(Shown):
    """All items of a paper or of all, in order of print, with the verdicts of their cells.

    Parameters
    ----------
    paper : str, optional
        One paper; all by default.
    """

    def __init__(self, paper: str | None = None) -> None:
        self.paper = paper if paper is None else _known(paper)
        self.keys = [key for key in catalogue() if paper in {None, key.partition("/")[0]}]
        self._papers = PAPERS if paper is None else (paper,)

    @cached_property
    def _ledger(self) -> Ledger:
        return item_ledger(*self.keys)

    def entries(self) -> list[dict[str, Any]]:
        """Return what is known of each item without computing anything."""
        return [
            {
                "key": key,
                "place": keys.place(key),
                "title": keys.title(key),
                "functions": [one.name for one in catalogue()[key].computations],
                "draws": catalogue()[key].draw is not None,
            }
            for key in self.keys
        ]

    def frame(self) -> pd.DataFrame:
        """Return one row per item: place, title and the number of cells by verdict."""
        import pandas as pd

        rows = {
            key: {
                "place": keys.place(key),
                "title": keys.title(key),
                **record_text.tally(self._ledger.of(key)),
            }
            for key in self.keys
        }
        return pd.DataFrame.from_dict(rows, orient="index")

    def listed(self, width: int) -> RenderableType:
        """Return the list of items for a terminal, without the score."""
        return terminal.items_table(
            ((key, keys.place(key), keys.title(key)) for key in self.keys), width
        )

    def _repr_html_(self) -> str:
        from reproduce.views.wall import legend, wall

        records = self._ledger.records
        parts = [wall(r for r in records if r.key.startswith(f"{one}/")) for one in self._papers]
        heads = [Markup('<p class="rp-wall-paper">{}</p>').format(one) for one in self._papers]
        pictures = [text for pair in zip(heads, parts, strict=True) for text in pair]
        return str(Markup("\n").join([*pictures, legend(records)]))

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the list of items and the score."""
        yield self.listed(width)
        yield terminal.score_table(self._ledger)


class Check(Shown):
    """The verdicts against the frozen ones. True if they and the printed files are the same.

    Parameters
    ----------
    wanted : tuple of str
        The items; all by default.
    progress : callable, optional
        Called with the key of each item when it is done.
    """

    def __init__(
        self, wanted: tuple[str, ...] = (), progress: Callable[[str], None] | None = None
    ) -> None:
        from reproduce.views.double_entry import disagreements

        chosen = [keys.check_key(key) for key in wanted]
        self.ledger = build(chosen or None, progress)
        self.surprises = surprises(self.ledger)
        self.disagreements = disagreements(self.ledger)

    def __bool__(self) -> bool:
        """Tell whether verdicts are as frozen, files as summed, and second entries agree."""
        return not (self.surprises or self.ledger.altered or self.disagreements)

    def frame(self) -> pd.DataFrame:
        """Return the cells whose verdict is not the frozen one."""
        import pandas as pd

        columns = ("cell", "expected", "found")
        rows = [tuple(getattr(one, name) for name in columns) for one in self.surprises]
        return pd.DataFrame(rows, columns=list(columns))

    def score(self) -> RenderableType:
        """Return the number of cells by verdict for a terminal, item by item."""
        return terminal.score_table(self.ledger)

    def remarks(self) -> list[str]:
        """Return what is to be said of the score: weak agreement, and the outcome if it is good."""
        weak = terminal.weak_line(self.ledger.records)
        good = f"All {len(self.ledger.records)} verdicts are as frozen." if self else ""
        return [line for line in (weak, good) if line]

    def faults(self) -> list[str]:
        """Return what is not as frozen, and what to do about it."""
        lines = [f"{s.cell}: expected {s.expected}, found {s.found}" for s in self.surprises]
        if lines:
            lines.append(
                f"{len(lines)} verdicts differ from data/verdicts.toml; find the cause, or change "
                "that file with the reason"
            )
        lines += [
            f"data/printed/{name}: not the file of its checksum in data/printed/SHA256SUMS; "
            "restore the printed digits, or enter them twice and renew the checksum"
            for name in self.ledger.altered
        ]
        return lines + self.disagreements

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the score, and what is not as frozen."""
        yield self.score()
        yield from (*self.remarks(), *self.faults())


class Contradictions(Shown):
    """What the printed numbers of papers or of a table say of each other, and the errata.

    Parameters
    ----------
    paper : str, optional
        One paper; all by default.
    table, relations : path, optional
        A table of a reader's own in the form of ``data/README.md``, and what its numbers keep.
    """

    def __init__(
        self,
        paper: str | None = None,
        table: str | Path | None = None,
        relations: str | Path | None = None,
    ) -> None:
        if (table is None) != (relations is None) or (table is not None and paper is not None):
            raise ValueError("give a PAPER, or both table and relations, or nothing")
        self.paper = paper if paper is None else _known(paper)
        self._files = [Path(one) for one in (table, relations) if one is not None]

    @cached_property
    def audits(self) -> list[Audit]:
        """What the cross-examination found, an audit for each paper or table."""
        from reproduce.views.audit_text import audits

        return audits(self.paper, *self._files)

    def frame(self) -> pd.DataFrame:
        """Return the register: one row per entry, with what is printed and why it is there."""
        import pandas as pd

        from reproduce.audit.errata import register
        from reproduce.locate import data_folders

        texts = [(one / "errata.toml").read_text(encoding="utf-8") for one in data_folders()]
        entries = [one for text in texts for one in register(text) if not self._files]
        wanted = ["paper", "place", "printed", "problem", "conclusion", "status", "extraction"]
        rows = {
            one.id: [getattr(one, name) for name in wanted]
            for one in entries
            if self.paper in {None, one.paper}
        }
        return pd.DataFrame.from_dict(rows, orient="index", columns=wanted)

    def relations(self) -> pd.DataFrame:
        """Return every relation that the printed numbers should keep, and what became of it."""
        import pandas as pd

        rows = {
            one.relation.name: [one.outcome, ", ".join(one.relation.addresses)]
            for audit in self.audits
            for one in audit.findings
        }
        return pd.DataFrame.from_dict(rows, orient="index", columns=["outcome", "cells"])

    def as_json(self) -> list[dict[str, Any]]:
        """Return everything that was found, for other programs."""
        from reproduce.views.audit_text import as_json

        return [as_json(one) for one in self.audits]

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the audit line by line."""
        from reproduce.views.audit_text import lines, wrapped

        for audit in self.audits:
            yield from (wrapped(line, width) for line in lines(audit))


def _known(paper: str) -> str:
    if paper not in PAPERS:
        raise ValueError(f"unknown paper {paper!r}: expected one of {', '.join(PAPERS)}")
    return paper


def contents(paper: str | None = None) -> Contents:
    """Return all items of a paper, or of all, in order of print, with their score."""
    return Contents(paper)


def table(address: str) -> Table | Cell | StudyTable:
    """Return a table, a group of quoted numbers, one cell of it, or a table of our own.

    Parameters
    ----------
    address : str
        A key such as ``niu2024/table-3``, a cell such as ``niu2024/table-3#scale.red``, or a
        study such as ``chen2023/heat``.

    Returns
    -------
    Table, Cell or StudyTable
        Printed beside computed, with verdicts; our own numbers, without.

    Examples
    --------
    >>> table("niu2024/table-2")["scale.red"].verdict
    'exact'
    """
    if address in studies():
        from reproduce.views.study import StudyTable

        return StudyTable(address)
    return Cell(address) if "#" in address else Table(address)


def figure(key: str) -> Figure | Panels:
    """Return a figure by its key.

    Parameters
    ----------
    key : str
        A panel such as ``chen2023/fig-11a``, or all panels of a figure, ``chen2023/fig-11``.

    Returns
    -------
    Figure or Panels
        Drawn when it is looked at.
    """
    panels = [one for one in catalogue() if one[:-1] == key and one[-1].isalpha()]
    return Panels(key, tuple(map(Figure, panels))) if panels else Figure(key)


def item(address: str) -> Table | Cell | StudyTable | Figure | Panels:
    """Return what an address of the command line names: `table` or `figure`."""
    known = address.partition("#")[0]
    return table(address) if known in library() or known in studies() else figure(address)


def check(*keys: str, progress: Callable[[str], None] | None = None) -> Check:
    """Recompute and judge items, or everything, and compare the verdicts with the frozen ones."""
    return Check(keys, progress)


def cite(address: str, form: str = "bibtex") -> str:
    """Return how to cite an item, a cell or a study and its paper: bibtex, csl or text."""
    from reproduce.views import cite as citing

    if address in studies():
        from reproduce.views.study import StudyTable

        return StudyTable(address).cite(form)
    key, _, name = address.partition("#")
    return citing.citation(keys.check_key(key), form, address if name else "")


def posterior(name: str, data: str | Path | None = None, **settings: Any) -> Posterior:
    """Return a posterior of the book, or the same model on a reader's data.

    Parameters
    ----------
    name : str
        Such as ``registration``; ``reproduce posterior --list`` names all.
    data : str or Path, optional
        A reader's CSV.
    **settings
        ``pivot``, ``steps``, ``walkers``, ``ensembles``, ``seed``, ``priors``.
    """
    from reproduce.views.sampled import Posterior

    return Posterior(name, data, **settings)


def contradictions(
    paper: str | None = None,
    *,
    table: str | Path | None = None,
    relations: str | Path | None = None,
) -> Contradictions:
    """Return what printed numbers say of each other, and the errata.

    Parameters
    ----------
    paper : str, optional
        Such as ``chen2023``; all by default.
    table, relations : path, optional
        A table of your own, and what its numbers should keep, in its place.

    Returns
    -------
    Contradictions
        The cross-examination.
    """
    return Contradictions(paper, table, relations)


def register(
    source: ArrayLike, target: ArrayLike, pivot: ArrayLike | None = None, **settings: Any
) -> Registered:
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
    Registered
        Parameters, covariance, residuals and the transform.
    """
    from reproduce.views.own import Registered

    return Registered(source, target, pivot, **settings)


def misalignment(
    spots: str | Path | ArrayLike,
    zero: ArrayLike | None = None,
    changes: Mapping[str, str | float] | None = None,
) -> Monitored:
    """Return how far a user's own camera has turned since the zero point, from laser spots.

    Parameters
    ----------
    spots : path or array_like, shape (frames, lasers, 2)
        Images at the present, in px, or a CSV file of both groups in the format of
        ``reproduce posterior misalignment --data``.
    zero : array_like, shape (frames, lasers, 2), optional
        Images at the zero point, where `spots` is an array.
    changes : mapping, optional
        Printed cells of chen2023's ground platform, which is the instrument, to values of yours.

    Returns
    -------
    Monitored
        Angles about the camera's axes, image by image.
    """
    from reproduce.views.own import Monitored

    return Monitored(spots, zero, changes)
