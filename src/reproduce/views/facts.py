"""Every number that a sentence of the book may say, by name, computed once before the pages.

``python -m reproduce.views.facts FILE`` writes them; the roles of the book only look them up. A
printed cell has a name for each of its sides (``niu2024/table-3#scale.red computed``); an item, a
paper and ``all`` have their counts (``niu2024/table-3 differs``); a study names its own results
(``niu2024/readings#best-joint``).
"""

from __future__ import annotations

import hashlib
import json
import sys
from importlib import import_module
from pathlib import Path

from reproduce.locate import data_folder
from reproduce.printed.cells import PAPERS, anchor
from reproduce.views import words
from reproduce.views.sayings import sayable, whole_ledger

# Study, or the audit -> the module of `views` that says its results.
STUDIES = {
    "niu2024/readings": "study_pages",
    "niu2024/approximations": "cost_pages",
    "niu2024/fusion": "fusion_pages",
    "audit": "audit_pages",
}


def facts() -> dict[str, str]:
    """Compute every fact.

    Name to text, as a sentence shows it.
    """
    found = {}
    ledger = whole_ledger()
    keys = dict.fromkeys(record.key for record in ledger.records)
    for name in (*(record.cell for record in ledger.records), *keys, *PAPERS, "all"):
        start = len(anchor(name)) + 1
        for label, text in sayable(name).items():
            found[f"{name} {label[start:]}"] = words.powers(text)
    for study, module in STUDIES.items():
        sayings = import_module(f"reproduce.views.{module}").sayings()
        found |= {f"{study}#{label}": words.powers(text) for label, text in sayings.items()}
    return found


def fingerprint() -> str:
    """Return a hash of what the facts depend on: the package's own files, the data, the lock."""
    data = data_folder()
    package = Path(__file__).resolve().parent.parent
    files = [*package.rglob("*.py"), *(path for path in data.rglob("*") if path.is_file())]
    digest = hashlib.sha256()
    for path in [*sorted(files), data.parent / "environment.txt"]:
        if path.is_file():
            digest.update(path.name.encode() + path.read_bytes())
    return digest.hexdigest()


def write(path: Path) -> bool:
    """Write all facts to a JSON file, unless it holds those of the present files."""
    key = fingerprint()
    if path.is_file() and json.loads(path.read_text(encoding="utf-8"))["key"] == key:
        return False
    path.parent.mkdir(parents=True, exist_ok=True)
    text = json.dumps({"key": key, "facts": facts()}, ensure_ascii=False, indent=0)
    path.write_text(text + "\n", encoding="utf-8")
    return True


if __name__ == "__main__":
    write(Path(sys.argv[1]))
