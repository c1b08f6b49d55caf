"""Every number that a sentence of the book may say, by name, computed once before the pages.

``python -m reproduce.views.facts FILE`` writes them, those of single papers where their keys
follow; the roles of the book only look them up. A
printed cell has a name for each of its sides (``niu2024/table-3#scale.red computed``); an item, a
paper and ``all`` have their counts (``niu2024/table-3 differs``); a study names its own results
(``niu2024/readings#best-joint``), and so does a posterior (``posterior/registration#noise-mean``).
"""

from __future__ import annotations

import json
import sys
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from reproduce.judge.expected import erratum
from reproduce.judge.studies import studies
from reproduce.papers.catalogue import catalogue
from reproduce.printed.cells import PAPERS, library
from reproduce.views import build, numbers
from reproduce.views.build import item_ledger, whole_ledger
from reproduce.views.record_text import facts_of

__all__ = ["facts", "of_posteriors", "unsampled", "write"]


def facts(*papers: str) -> dict[str, str]:
    """Compute every fact, or those of the cells, items and studies of some papers alone."""
    from reproduce.papers.posteriors import posteriors

    return unsampled(*papers) | ({} if papers else of_posteriors(posteriors()))


def of_posteriors(names: Iterable[str]) -> dict[str, str]:
    """Compute the facts of posteriors, which are sampled for it."""
    from reproduce.views.posterior_facts import posterior_facts
    from reproduce.views.sampled import book_posterior

    return {
        f"posterior/{name}#{label}": numbers.powers(text)
        for name in names
        for label, text in posterior_facts(name, book_posterior(name)).items()
    }


def unsampled(*papers: str) -> dict[str, str]:
    """Compute the facts of the ledger, the studies and the audit, or of some papers alone."""
    if papers:
        keys = [key for key in catalogue() if key.partition("/")[0] in papers and key in library()]
        records = tuple(record for key in keys for record in item_ledger(key).records)
    else:
        records = whole_ledger().records
        keys = list(dict.fromkeys(record.key for record in records))
    names = [*(record.cell for record in records), *keys, *(() if papers else (*PAPERS, "all"))]
    found = {f"{name} {what}": text for name in names for what, text in facts_of(name).items()}
    for key, study in studies().items():
        if not papers or key.partition("/")[0] in papers:
            quoted = study.facts().items()
            found |= {f"{key}#{name}": numbers.fact(one) for name, one in quoted}
    causes = Counter(erratum(r.cell) for r in records if r.verdict in {"differs", "blocked"})
    found |= {f"erratum/{name} cells": str(count) for name, count in causes.items() if name}
    if not papers:
        from reproduce.views.audit_pages import audit_facts
        from reproduce.views.evidence import evidence_facts

        found |= {f"audit#{label}": text for label, text in audit_facts().items()}
        found |= {f"evidence#{label}": text for label, text in evidence_facts().items()}
    return {name: numbers.powers(text) for name, text in found.items()}


def write(path: Path, *papers: str) -> bool:
    """Write all facts to a JSON file, unless it holds those of the present files."""
    key = " ".join((build.fingerprint(), *papers))
    if path.is_file() and json.loads(path.read_text(encoding="utf-8"))["key"] == key:
        return False
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"key": key, "facts": facts(*papers)}, ensure_ascii=False, indent=0)
    path.write_text(text + "\n", encoding="utf-8")
    return True


if __name__ == "__main__":
    write(Path(sys.argv[1]), *sys.argv[2:])
