"""The readings of a table: all of them, and a summary for each cell."""

from __future__ import annotations

import pandas as pd
from markupsafe import Markup

from reproduce.judge.readings import evaluate
from reproduce.judge.rerun import options
from reproduce.papers.declare import computations
from reproduce.printed.cells import library
from reproduce.printed.number import minus
from reproduce.views._blocks import Block, Display, Grid


class Readings(Display):
    """All readings of a table: every combination of the options of its text.

    Parameters
    ----------
    key : str
        Such as ``niu2024/table-3``.
    """

    def __init__(self, key: str) -> None:
        self.key = key

    def frame(self) -> pd.DataFrame:
        """Return one row per reading.

        Returns
        -------
        pandas.DataFrame
            A column for each option; for each cell its computed value in the printed unit,
            its probability if it is predicted, and whether it agrees; the number of cells that
            agree; the joint probability of the predicted cells.
        """
        frame = pd.DataFrame({})
        table = library()[self.key]
        for computation in sorted(
            computations(self.key), key=lambda each: len(each.options), reverse=True
        ):
            evaluation = evaluate(computation)
            part = pd.DataFrame(computation.readings)
            for name, readings in evaluation.cells.items():
                if table[name].unpublished or len(evaluation.distinct(name)) == 1:
                    continue
                part[name] = [float(f"{reading.computed:.9g}") for reading in readings]
                if computation.replicates:
                    part[f"{name} p"] = [reading.probability for reading in readings]
                    part["joint p"] = evaluation.joint[:, 0]
                part[f"{name} agrees"] = [reading.agrees for reading in readings]
            if len(part.columns) > len(computation.options):
                frame = frame.merge(part, how="left") if len(frame) else part
        frame["agreeing"] = frame.filter(regex=" agrees$").eq(True).sum(axis=1)
        # Readings that differ only in options without effect on the results are one reading.
        effects = frame.drop(columns=options(self.key), errors="ignore").round(12)
        return frame[~effects.duplicated()].reset_index(drop=True)

    def blocks(self) -> list[Block]:
        """Return the table of all readings, which a page can sort."""
        frame = self.frame()
        table = library()[self.key]
        if frame.empty:
            return [f"{self.key} has one reading."]
        caption = (
            f"All {len(frame):,} readings of {table.place}. Bold: the printed number agrees. A "
            "predicted cell has its probability, any other cell its computed value."
        )
        columns = {name: frame[name] for name in options(self.key) if name in frame}
        for name in (name for name in map(str, frame) if f"{name} agrees" in frame):
            texts = frame[name].map(table[name].number.format).map(minus)
            if f"{name} p" in frame:
                texts = frame[f"{name} p"].map("{:.3g}".format)
            texts = texts.where(frame[name].notna(), "")
            bold = texts.map(Markup("<b>{}</b>").format)
            columns[name] = texts.mask(frame[f"{name} agrees"].eq(True), bold)
        columns["cells that agree"] = frame["agreeing"].map(str)
        if "joint p" in frame:
            columns["joint p"] = frame["joint p"].map("{:.2g}".format)
            caption += (
                " A probability of 0, and a joint p of 1/(n + 1), mean that none of n simulations "
                "is as far from the prediction."
            )
        return [
            Grid.of(
                caption,
                columns,
                pd.DataFrame(columns).to_dict("records"),
                kind="rp-small rp-sortable rp-readings-all",
            )
        ]
