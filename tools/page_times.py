"""How long each page of the book takes to run, as a reader runs it: alone, in a fresh kernel.

``python tools/page_times.py`` runs all notebooks one after the other, so that none waits
for another, and stores the seconds. The numbers are those of one machine.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path
from time import perf_counter

import pandas as pd

import reproduce
from run_notebooks import cores, executed, pages_of, read

NAME = "page-times"
COMMAND = "python tools/page_times.py"
BOOK = Path(__file__).resolve().parent.parent / "book"


def study(book: Path) -> pd.DataFrame:
    """Run every notebook of a book: its address, and the seconds from an empty kernel on."""
    rows = []
    for page in pages_of(book):
        if (notebook := read(page)) is None:
            continue
        begin = perf_counter()
        executed(notebook, page)
        address = page.relative_to(book).with_suffix("").as_posix()
        rows.append((address, round(perf_counter() - begin, 1)))
    return pd.DataFrame(rows, columns=["page", "seconds"])


if __name__ == "__main__":
    os.environ.pop(
        "REPRODUCE_BUILD", None
    )  # a reader has none of what a build has computed
    note = {"command": COMMAND, "version": reproduce.__version__, "cores": cores()}
    sys.path.append(str(Path(__file__).parent / "evidence"))
    from keep import write_table

    write_table(NAME, study(BOOK), note)
