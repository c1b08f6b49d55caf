"""Build the book, doing again only what has to be done: ``make book``.

1. `drop_stale_pages` removes what was made of other files; if nothing has changed, that is all.
2. `run_notebooks` computes numbers and notebooks on every core.
3. Jupyter Book reads and writes the pages that have changed.
4. `pack_book` puts wheel, lock and notebooks into one archive.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path

from drop_stale_pages import ROOT, State
from pack_book import build_wheel, pack

# As Jupyter Book's own command line: every warning is an error, all of them are shown.
STRICT = ("-W", "--keep-going", "-n")
JUPYTER_BOOK = Path(sys.executable).with_name("jupyter-book")


def build(root: Path) -> int:
    """Build the book of a checkout and return the exit code."""
    book = root / "book"
    os.environ["REPRODUCE_BUILD"] = str(book / "_build" / "computed")
    # One thread each: as many processes work as there are cores.
    os.environ.update({"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"})
    state = State(root)
    if state.drop_stale():
        print("Nothing has changed since the last build.")
        return 0
    from run_notebooks import cores, run_all

    begin = time.perf_counter()
    if not run_all(book, cores()):
        return 1
    print(f"Numbers and notebooks: {time.perf_counter() - begin:.0f} s", flush=True)
    begin = time.perf_counter()
    command = (sys.executable, str(JUPYTER_BOOK), "build", str(book), *STRICT)
    if code := subprocess.run(command, check=False).returncode:
        return code
    wheel = book / "_build" / "wheel"
    if not wheel.is_dir():
        build_wheel(root, wheel)
    pack(root)
    print(f"Pages: {time.perf_counter() - begin:.0f} s", flush=True)
    state.remember()
    return 0


if __name__ == "__main__":
    if code := build(ROOT):
        sys.exit(code)
    print(f"\nThe book is ready. Open {ROOT / 'book/_build/html/index.html'}")
