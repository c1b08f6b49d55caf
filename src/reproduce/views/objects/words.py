"""A DataFrame of words, which a notebook shows whole."""

from __future__ import annotations

import pandas as pd


class Words(pd.DataFrame):
    """A DataFrame whose cells are sentences: pandas would cut them after fifty characters."""

    def _repr_html_(self) -> str:
        with pd.option_context("display.max_colwidth", None):
            return self.to_html(notebook=True)
