"""The judgement of a paper in the forms of other registers, from templates in ``data/reports``."""

from __future__ import annotations

import json
import re
from collections.abc import Collection
from typing import Any

import pandas as pd

from reproduce.judge.ledger import Record, item_ledger
from reproduce.judge.rerun import options
from reproduce.judge.verdicts import CENTRAL
from reproduce.papers.declare import computations
from reproduce.printed.cells import PAPERS, library
from reproduce.printed.inputs import load_inputs
from reproduce.printed.number import si_factor
from reproduce.views import _keys as keys
from reproduce.views import _verdicts as verdicts
from reproduce.views import citations
from reproduce.views._blocks import written

# Files of each form.
FORMS = {
    "codecheck": ("codecheck.yml",),
    "rescience": ("metadata.yaml", "article.tex"),
    "nanopublications": ("nanopublications.trig",),
    "decisions": ("astra.yaml",),
}


def outcome(results: Collection[Record]) -> str:
    """Return the outcome of an item as a replication. Weak agreement validates nothing."""
    judged = [record.verdict for record in results if record.verdict != "unpublished"]
    agreeing = sum(record.agrees for record in results)
    if not judged:
        return "not tested"
    if agreeing > verdicts.weak(results):
        return "validated" if agreeing == len(judged) else "partially supported"
    return "contradicted" if {*judged} == {"differs"} else "inconclusive"


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
    keys.check_choice("paper", paper, PAPERS)
    named = [key for key in library() if key.startswith(f"{paper}/")]
    results = {
        key: [record for record in item_ledger(key).records if record.role == "result"]
        for key in named
    }
    whole, cited = json.loads(citations.cite(named[0], "csl"))
    values = {
        "central": f"{CENTRAL:.0%}",
        "cited": cited,
        "keys": keys,
        "name": _name,
        "options": {key: options(key) for key in named},
        "outcomes": {key: outcome(found) for key, found in results.items()},
        "paper": paper,
        "results": results,
        "verdicts": verdicts,
        "whole": whole,
    }
    return {file: written(file, **values) for file in FORMS[form]}


def covariance(key: str) -> pd.DataFrame:
    """Return the covariance of the predicted cells of a table, in printed units.

    The prediction is that of the literal reading.
    """
    draws: dict[str, Any] = {}
    for made in computations(key):
        if made.replicates:
            draws |= made(load_inputs(made.inputs))
    units = [library()[key][name].unit for name in draws]
    whole = (pd.DataFrame(draws) / [*map(si_factor, units)]).cov()
    whole.insert(0, "unit", units)
    return whole.rename_axis("cell")


def _name(text: str) -> str:
    """Return an identifier of ASTRA, which starts with a letter."""
    return re.sub("^(?![a-z])", "n", re.sub(r"\W", "_", text.lower()))
