"""The readings of a table: in short, cell by cell, and all of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from reproduce.judge.ledger import Record
from reproduce.judge.readings import Evaluation, evaluate
from reproduce.judge.verdicts import Reading
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import unpublished
from reproduce.printed.cells import anchor, library
from reproduce.views import verdicts
from reproduce.views.blocks import Block, Display, Entry, Grid, grid, link
from reproduce.views.numbers import minus

if TYPE_CHECKING:
    import pandas as pd


class Readings(Display):
    """All readings of a table: every combination of the options of its text.

    Parameters
    ----------
    key : str
        Such as ``niu2024/table-3``.
    """

    def __init__(self, key: str) -> None:
        self.key = key
        made = (evaluate(one) for one in catalogue()[key].computations if one.options)
        open_cells = ((one, _open_cells(one)) for one in made)
        self._found = [(one, names) for one, names in open_cells if names]
        self._found.sort(
            key=lambda pair: len(pair[0].computation.options), reverse=True
        )
        self._options = list(
            dict.fromkeys(
                name for one, _ in self._found for name in one.computation.options
            )
        )

    def frame(self) -> pd.DataFrame:
        """Return one row per reading.

        Returns
        -------
        pandas.DataFrame
            A column for each option; for each cell its computed value in the printed unit,
            its probability if it is predicted, and whether it agrees; the number of cells that
            agree; the joint probability of the predicted cells.
        """
        import pandas as pd

        frame = pd.DataFrame({})
        for found, names in self._found:
            own = _frame(found, names)
            shared = [name for name in found.computation.options if name in frame]
            frame = frame.merge(own, how="left", on=shared) if len(frame) else own
        agrees = [name for name in frame if str(name).endswith(" agrees")]
        frame["agreeing"] = frame[agrees].eq(True).sum(axis=1)
        # Readings that differ only in options without effect on the results are one reading.
        effects = frame.drop(columns=self._options).round(12)
        return frame[~effects.duplicated()].reset_index(drop=True)

    def blocks(self) -> Iterator[Block]:
        """Yield all readings, as a table that a page sorts."""
        frame = self.frame()
        if frame.empty:
            yield f"{self.key} has one reading."
            return
        cells, options = (
            [name for _, names in self._found for name in names],
            self._options,
        )
        head = [
            *options,
            *cells,
            "cells that agree",
            *["joint p"] * ("joint p" in frame),
        ]
        rows = [self._texts(row, options, cells) for _, row in frame.iterrows()]
        place = library()[self.key].place
        caption = (
            f"All {len(rows)} readings of {place}. Bold: the printed number agrees. A predicted "
            "cell has its probability, any other cell its computed value."
        )
        yield Grid(
            caption,
            head,
            rows,
            kind="rp-small rp-sortable rp-readings-all",
            words=len(options),
        )

    def _texts(
        self, row: pd.Series[Any], options: list[str], cells: list[str]
    ) -> list[Entry]:
        texts: list[Entry] = [row[name] for name in options]
        for name in cells:
            if (
                row[name] != row[name]
            ):  # an alternative that the computation of a cell lacks
                texts.append("")
                continue
            number = library()[self.key][name].number
            chance = row.get(f"{name} p")
            text = (
                minus(number.format(row[name], extra=1))
                if chance is None
                else f"{chance:.3g}"
            )
            texts.append(
                Markup("<b>{}</b>").format(text) if row[f"{name} agrees"] else text
            )
        texts.append(str(row["agreeing"]))
        return [*texts, f"{row['joint p']:.2g}"] if "joint p" in row else texts


def _open_cells(found: Evaluation) -> list[str]:
    """Return the cells of a computation whose result depends on the reading."""
    key = found.computation.key
    return [
        n for n in found.cells if not unpublished(key, n) and len(found.distinct(n)) > 1
    ]


def _frame(found: Evaluation, names: Iterable[str]) -> pd.DataFrame:
    """Return the choices and the results of one computation under all its readings."""
    import pandas as pd

    frame = pd.DataFrame(found.computation.readings)
    for name in names:
        readings = found.cells[name]
        frame[name] = [float(f"{one.computed:.9g}") for one in readings]
        if readings[0].probability is not None:
            frame[f"{name} p"] = [one.probability for one in readings]
            frame["joint p"] = found.joint[:, 0]
        frame[f"{name} agrees"] = [one.agrees for one in readings]
    return frame


def summary(place: str, records: Iterable[Record]) -> Grid:
    """Return the readings of each cell in short."""
    return grid(
        f"Readings of {place}, cell by cell",
        _SHORT,
        [r for r in records if r.readings],
        kind="rp-small rp-readings",
        words=5,
    )


def _closest(record: Record, closest: Reading) -> str:
    """Write the closest reading with its computed value, verdict and probability."""
    chance = verdicts.probability(closest)
    found = (
        f"{verdicts.choices_text(closest.choices)}: {verdicts.read(record, closest)}"
    )
    return f"{found}, p = {chance}".replace("= <", "<") if chance else found


def _short(write: Callable[[Record, Any], Entry]) -> Callable[[Record], Entry]:
    return lambda record: write(record, record.readings)


_SHORT: dict[str, Callable[[Record], Entry]] = {
    "cell": lambda one: link(
        anchor(one.cell), Markup("<code>{}</code>").format(verdicts.name_of(one))
    ),
    "printed": lambda one: verdicts.cell_of(one).shown,
    "readings that agree": _short(
        lambda one, found: f"{found.agreeing} of {found.count}"
    ),
    "agrees with": _short(lambda one, found: verdicts.deciding(found)),
    "closest reading": _short(lambda one, found: _closest(one, found.closest)),
}
