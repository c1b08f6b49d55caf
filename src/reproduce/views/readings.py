"""The readings of a table: all of them, and a summary for each cell."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from markupsafe import Markup

from reproduce.judge.ledger import Record
from reproduce.judge.readings import Evaluation, evaluate
from reproduce.papers.catalogue import catalogue
from reproduce.papers.declare import unpublished
from reproduce.printed.cells import library
from reproduce.views import verdicts
from reproduce.views.blocks import Block, Display, Entry, Grid
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
        made = [evaluate(one) for one in catalogue()[key].computations if one.options]
        made.sort(key=lambda found: len(found.computation.options), reverse=True)
        self._found = [(one, names) for one in made if (names := _open_cells(one))]
        options = (name for one, _ in self._found for name in one.computation.options)
        self._options = list(dict.fromkeys(options))

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

    def blocks(self) -> list[Block]:
        """Return the table of all readings, which a page can sort."""
        frame = self.frame()
        if frame.empty:
            return [f"{self.key} has one reading."]
        columns: dict[str, list[Entry]] = {n: [*frame[n]] for n in self._options}
        for name in (name for _, names in self._found for name in names):
            number, drawn = library()[self.key][name].number, f"{name} p"
            columns[name] = [
                f"{value:.3g}" if drawn in frame else minus(number.format(value, 1))
                for value in frame[drawn if drawn in frame else name].fillna(0)
            ]
            known, agrees = frame[name].notna(), frame[f"{name} agrees"].eq(True)
            for row, text in enumerate(columns[name]):
                bold = Markup("<b>{}</b>").format(text) if agrees[row] else text
                columns[name][row] = bold if known[row] else ""
        columns["cells that agree"] = [*frame["agreeing"].map(str)]
        if "joint p" in frame:
            columns["joint p"] = [*frame["joint p"].map("{:.2g}".format)]
        caption = (
            f"All {len(frame)} readings of {library()[self.key].place}. Bold: the printed number "
            "agrees. A predicted cell has its probability, any other cell its computed value."
        )
        rows, kind = [*zip(*columns.values(), strict=True)], "rp-readings-all"
        return [Grid(caption, [*columns], rows, kind=f"rp-small rp-sortable {kind}")]


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
    """Return a summary of the readings of each cell."""
    columns = ("cell", "printed", "readings that agree", "agrees with")
    return Grid.of(
        f"Readings of {place}, cell by cell",
        (*columns, "closest reading"),
        [verdicts.texts(record) for record in records if record.readings],
        kind="rp-small rp-readings",
    )
