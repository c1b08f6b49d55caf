"""The step before the pages: the numbers of sentences, and the files shipped beside the pages.

``python -m reproduce.views.book.build BOOK [PAPER]...`` writes ``_build/facts.json`` into the
folder of the book, with the facts of some papers alone where they are named; `make book` does all
that the book of this project needs, with ``tools/build_book.py``.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from reproduce.judge.studies import studies
from reproduce.locate import data_folder
from reproduce.printed.cells import anchor, library
from reproduce.views import computed, keys
from reproduce.views.book import facts
from reproduce.views.objects.study import StudyTable
from reproduce.views.writing.export import export, signed, table_files

__all__ = ["shipped", "write_facts", "write_tables"]


def write_facts(path: Path, *papers: str) -> bool:
    """Write all facts to a JSON file, unless it holds those of the present files."""
    key = " ".join((computed.fingerprint(), *papers))
    if path.is_file() and json.loads(path.read_text(encoding="utf-8"))["key"] == key:
        return False
    path.parent.mkdir(parents=True, exist_ok=True)
    found = {"key": key, "facts": facts.facts(*papers)}
    path.write_text(json.dumps(found, ensure_ascii=False, indent=0) + "\n", encoding="utf-8")
    return True


def shipped() -> dict[str, str]:
    """Return what the shipped files hold, by their path below the root of the book."""
    files = {
        "ledger.json": "one record per printed cell",
        "ledger.schema.json": "what each field of the ledger means",
    }
    titles = {key: keys.title(key) for key in library()}
    titles |= {key: study.title for key, study in studies().items()}
    return files | {f"tables/{anchor(key)}.csv": f"{key}, {what}" for key, what in titles.items()}


def write_tables(folder: Path) -> None:
    """Write the ledger and every table in all forms."""
    whole = computed.whole_ledger()
    schema = (data_folder() / "ledger.schema.json").read_text(encoding="utf-8")
    texts = {"ledger.json": signed(whole).model_dump_json(indent=2), "ledger.schema.json": schema}
    for key in library():
        texts |= {path: export(whole, key, form) for path, form in table_files(key).items()}
    for key in studies():
        table = StudyTable(key)
        texts |= {path: table.export(form) for path, form in table_files(key).items()}
    (folder / "tables").mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    write_facts(Path(sys.argv[1]) / "_build" / "facts.json", *sys.argv[2:])
