"""The step before the pages: the numbers of sentences, and the files shipped beside the pages.

``python -m reproduce.views.book.build BOOK [PAPER]...`` writes ``_build/facts.json`` into the
folder of the book, with the facts of some papers alone where they are named, and all downloads to
``_extra`` where they are not.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

from reproduce.inference.parts import processes
from reproduce.locate import data_folder
from reproduce.papers.catalogue import drawings
from reproduce.printed.cells import anchor, library
from reproduce.views import computed, keys
from reproduce.views.book import facts
from reproduce.views.writing.export import export, signed, table_files
from reproduce.views.writing.figures import drawable, write_figure

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
    return files | {f"tables/{anchor(key)}.csv": f"{key}, {keys.title(key)}" for key in library()}


def write_downloads(folder: Path) -> None:
    """Write the shipped files: the ledger, and of each table and figure its data and pictures."""
    whole = computed.whole_ledger()
    schema = (data_folder() / "ledger.schema.json").read_text(encoding="utf-8")
    texts = {"ledger.json": signed(whole).model_dump_json(indent=2), "ledger.schema.json": schema}
    for key in library():
        texts |= {path: export(whole, key, form) for path, form in table_files(key).items()}
    for name in ("tables", "figures"):
        (folder / name).mkdir(parents=True, exist_ok=True)
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    with processes() as pool:
        drawn = [pool.submit(write_figure, key, folder) for key in (*drawable(), *drawings())]
        for one in drawn:
            one.result()


if __name__ == "__main__":
    book, papers = Path(sys.argv[1]), sys.argv[2:]
    if not papers:
        write_downloads(book / "_extra")
    write_facts(book / "_build" / "facts.json", *papers)
