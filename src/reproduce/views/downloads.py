"""The files that are shipped beside the pages, under addresses that can be read and cited."""

from __future__ import annotations

import sys
from pathlib import Path

from reproduce.locate import data_folder
from reproduce.printed.cells import library
from reproduce.views import keys
from reproduce.views.build import whole_ledger
from reproduce.views.export import export

__all__ = ["shipped", "write"]


def shipped() -> dict[str, str]:
    """Return the names of the shipped files and what they hold.

    Path below the root of the book to a description.
    """
    files = {
        "ledger.json": "one record per printed cell",
        "ledger.schema.json": "what each field of the ledger means",
    }
    for key in library():
        files[f"tables/{key.replace('/', '-')}.csv"] = f"{key}, {keys.title(key)}"
    return files


def write(folder: Path) -> None:
    """Write the shipped files."""
    whole = whole_ledger()
    (folder / "tables").mkdir(parents=True, exist_ok=True)
    (folder / "ledger.json").write_text(whole.model_dump_json(indent=2), encoding="utf-8")
    schema = (data_folder() / "ledger.schema.json").read_text(encoding="utf-8")
    (folder / "ledger.schema.json").write_text(schema, encoding="utf-8")
    for key in library():
        path = folder / "tables" / f"{key.replace('/', '-')}.csv"
        path.write_text(export(whole, key, "csv"), encoding="utf-8")


if __name__ == "__main__":
    write(Path(sys.argv[1]))
