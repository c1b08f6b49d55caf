"""Results that a build of the book computes once and stores for its pages.

The environment variable ``REPRODUCE_BUILD`` names the folder, which a build removes if the code or
the data have changed. Without it nothing is stored. The files contain JSON or arrays: to read them
executes no code.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import TypeVar

from reproduce.judge import ledger
from reproduce.judge.ledger import Ledger
from reproduce.store.files import replacing

FOLDER = "REPRODUCE_BUILD"
Result = TypeVar("Result")


def kept() -> Path | None:
    """Return the folder for results, None outside of a build."""
    folder = os.environ.get(FOLDER)
    return Path(folder) if folder else None


def cached(
    name: str,
    compute: Callable[[], Result],
    dump: Callable[[Result], str | bytes],
    load: Callable[[bytes], Result],
) -> Result:
    """Return a result that only one process of a build computes.

    `dump` makes the content of the file `name`, and `load` the result of this content. A file that
    cannot be read is computed again.
    """
    folder = kept()
    if folder is None:
        return compute()
    path = folder / name
    try:
        return load(path.read_bytes())
    except Exception:  # readers of damaged files raise many types
        result = compute()
    folder.mkdir(parents=True, exist_ok=True)
    content = dump(result)
    # On Windows a file that another process reads cannot be replaced; its content is the same.
    with suppress(PermissionError), replacing(path) as part:
        part.write_bytes(content.encode() if isinstance(content, str) else content)
    return result


@cache
def whole_ledger() -> Ledger:
    """Return the ledger of all items."""
    return cached(
        "ledger.json", ledger.build, Ledger.model_dump_json, Ledger.model_validate_json
    )
