"""The step before the pages: the numbers of sentences, and the files shipped beside the pages.

``python -m reproduce.views.book.build BOOK [PAPER]...`` writes ``_build/facts.json`` into the
folder of the book, with the facts of some papers alone where they are named, and all downloads to
``_extra`` where they are not.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from reproduce.locate import data_folder
from reproduce.printed.cells import library
from reproduce.views import computed, keys
from reproduce.views.book import facts
from reproduce.views.writing.export import export

__all__ = ["shipped", "write_downloads", "write_facts"]


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
    return files | {_path(key): f"{key}, {keys.title(key)}" for key in library()}


def _path(key: str) -> str:
    return f"tables/{key.replace('/', '-')}.csv"


def write_downloads(folder: Path) -> None:
    """Write the shipped files."""
    whole = computed.whole_ledger()
    schema = (data_folder() / "ledger.schema.json").read_text(encoding="utf-8")
    texts = {"ledger.json": whole.model_dump_json(indent=2), "ledger.schema.json": schema}
    texts |= {_path(key): export(whole, key, "csv") for key in library()}
    (folder / "tables").mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    book, papers = Path(sys.argv[1]), sys.argv[2:]
    if not papers:
        write_downloads(book / "_extra")
    write_facts(book / "_build" / "facts.json", *papers)
