"""The judgement of a paper in the forms of other registers, from templates in ``data/reports``."""

from __future__ import annotations

import json
import re
from collections import Counter
from dataclasses import dataclass
from typing import TYPE_CHECKING

from reproduce import version
from reproduce.judge.ledger import Record, item_ledger
from reproduce.judge.rerun import options
from reproduce.judge.verdicts import AGREES, CENTRAL
from reproduce.papers.declare import computations
from reproduce.printed.cells import library
from reproduce.printed.inputs import load_inputs
from reproduce.printed.number import si_factor
from reproduce.views import citations, keys
from reproduce.views.blocks import rendered
from reproduce.views.verdicts import weak

if TYPE_CHECKING:
    import pandas as pd

# Files of each form.
FORMS = {
    "codecheck": ("codecheck.yml",),
    "rescience": ("metadata.yaml", "article.tex"),
    "nanopublications": ("nanopublications.trig",),
    "decisions": ("astra.yaml",),
}


@dataclass(frozen=True)
class Item:
    """A table, figure or group of quoted numbers with its judgement."""

    key: str
    records: tuple[Record, ...]

    @property
    def counts(self) -> Counter[str]:
        """Number of results of each verdict."""
        return Counter(one.verdict for one in self.records if one.role == "result")

    @property
    def text(self) -> str:
        """The counts in words."""
        counts = {**self.counts, "weak agreements": weak(self.records)}
        listed = ", ".join(f"{word}: {n}" for word, n in counts.items() if n)
        return listed or "inputs only"

    @property
    def outcome(self) -> str:
        """Outcome as a replication. Weak agreement validates nothing."""
        judged = {*self.counts} - {"unpublished"}
        agrees = sum(self.counts[word] for word in AGREES) > weak(self.records)
        if not judged:
            return "not tested"
        if agrees:
            return "validated" if judged <= {*AGREES} else "partially supported"
        return "contradicted" if judged == {"differs"} else "inconclusive"


def report(paper: str, form: str) -> dict[str, str]:
    """Return the files of a report on a paper, by name.

    Parameters
    ----------
    paper : str
        Name of the paper, such as ``niu2024``.
    form : {"codecheck", "rescience", "nanopublications", "decisions"}
        `codecheck` is the configuration of a CODECHECK, without the parts of the codechecker.
        `rescience` is metadata and the body of an article for ReScience C. `nanopublications` are
        unsigned. `decisions` are the options of the text with their alternatives, for ASTRA.

    Returns
    -------
    dict
        Name of each file to its text.

    Raises
    ------
    ValueError
        If the paper is unknown.

    Examples
    --------
    >>> list(report("niu2024", "decisions"))
    ['astra.yaml']
    """
    keys.check_paper(paper)
    named = [key for key in library() if key.startswith(f"{paper}/")]
    whole, cited = json.loads(citations.cite(named[0], "csl"))
    values = {
        "central": f"{CENTRAL:.0%}",
        "cited": cited,
        "commit": version.package_commit(),
        "items": [Item(key, item_ledger(key).records) for key in named],
        "keys": keys,
        "name": _name,
        "options": {key: options(key) for key in named},
        "open": {"differs", "ambiguous", "unpublished"},
        "paper": paper,
        "version": version,
        "whole": whole,
    }
    return {file: rendered(file, **values) for file in FORMS[form]}


def covariance(key: str) -> pd.DataFrame:
    """Return the covariance of the predicted cells of a table, in printed units.

    The prediction is that of the literal reading. The table is empty without predicted cells.
    Computations with different random numbers have no common entries.
    """
    import pandas as pd

    parts = []
    for made in computations(key):
        if made.replicates:
            draws = made(load_inputs(made.inputs))
            factors = [si_factor(library()[key][name].unit) for name in draws]
            parts.append((pd.DataFrame(draws) / factors).cov())
    whole = pd.concat(parts) if parts else pd.DataFrame()
    whole.insert(0, "unit", [library()[key][str(name)].unit for name in whole.index])
    return whole.rename_axis("cell").reset_index()


def _name(text: str) -> str:
    """Return an identifier of ASTRA."""
    plain = re.sub(r"\W", "_", text.lower())
    return plain if plain[:1].isalpha() else f"n{plain}"
