"""Compute the numbers and run the pages of the book, on every core.

Ledger, posteriors and figures come first, then the facts of the sentences and the pages. Each runs
in a new process. The executed pages are stored in the cache of Jupyter Book. With the argument
``numbers``, only the ledger and the facts are computed.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from multiprocessing import get_all_start_methods, get_context
from multiprocessing.connection import Connection
from pathlib import Path
from time import perf_counter
from traceback import format_exc
from typing import Any

from jupyter_cache import get_cache
from jupyter_cache.base import CacheBundleIn

import page_cells
from page_cells import BOOK, execute, notebooks

# A fork server imports the libraries once; every task starts as a fork of it.
START = "forkserver" if "forkserver" in get_all_start_methods() else "spawn"
PRELOADED = (
    "build_book run_notebooks book_facts matplotlib.pyplot matplotlib.backends.backend_pdf "
    "matplotlib.backends.backend_svg pandas.io.formats.style emcee erfa scipy.optimize "
    "scipy.stats scipy.spatial pydantic rich.table reproduce.views.table "
    "reproduce.views.posterior reproduce.views.figure"
)
context: Any = get_context(START)
Task = Callable[[], Any]


def write_ledger(downloads: Path) -> None:
    """Judge every cell, and write tables and cards."""
    from book_facts import write_cards, write_tables

    write_tables(downloads)
    write_cards(downloads.parent / "_build" / "cards.json")


def run_page(page: Path) -> Any:
    """Return a page with its outputs."""
    return execute(page)[0]


def call(module: str, function: str, *arguments: Any) -> None:
    """Import a module in the new process, and call its function."""
    getattr(import_module(module), function)(*arguments)


def numbers(book: Path) -> dict[str, Task]:
    """Return the tasks that compute the numbers, by name; none if the facts exist."""
    from reproduce.papers.posteriors import posteriors
    from reproduce.views.figure import drawable

    if (book / "_build" / "facts.json").is_file():
        return {}
    downloads = book / "_extra"
    tasks: dict[str, Task] = {"ledger": partial(write_ledger, downloads)}
    for name in posteriors():
        sample = partial(call, "reproduce.views.posterior", "book_posterior", name)
        tasks[f"posterior {name}"] = sample
    for key in drawable():
        draw = partial(call, "book_facts", "write_figure", key, downloads)
        tasks[f"figure {key}"] = draw
    return tasks


def pages(book: Path) -> dict[str, Task]:
    """Return the tasks that run the pages outside of the cache and write the facts, by name."""
    facts, tasks = book / "_build" / "facts.json", dict[str, Task]()
    with cache_of(book) as cache:
        missing = [page for page in notebooks(book) if outputs(cache, page) is None]
    if missing or not facts.is_file():
        tasks["facts"] = partial(call, "book_facts", "write_facts", facts)
    # The facts and the pages of posteriors take the longest.
    for page in sorted(missing, key=lambda page: page.parent.name != "posteriors"):
        tasks[page.relative_to(book).as_posix()] = partial(run_page, page)
    return tasks


@contextmanager
def cache_of(book: Path) -> Iterator[Any]:
    """Open the cache of a book's executed pages."""
    cache = get_cache(book / "_build" / ".jupyter_cache")
    try:
        yield cache
    finally:
        cache.db.dispose()


def outputs(cache: Any, page: Path) -> list[Any] | None:
    """Return the cached outputs of the cells of a page, or None."""
    try:
        _, notebook = cache.merge_match_into_notebook(page_cells.read(page))
    except KeyError:
        return None
    return [cell.outputs for cell in page_cells.code(notebook)]


def prepare() -> None:
    """Set the environment of the tasks, and the modules that the fork server imports."""
    # One thread each: as many processes work as there are cores.
    os.environ.update({"OPENBLAS_NUM_THREADS": "1", "OMP_NUM_THREADS": "1"})
    # Python 3.11 does not pass `sys.path` to the fork server, which skips a module that it misses.
    known = (str(BOOK.parent / "tools"), os.environ.get("PYTHONPATH", ""))
    os.environ["PYTHONPATH"] = os.pathsep.join(filter(None, known))
    context.set_forkserver_preload(PRELOADED.split())


def compute(book: Path, workers: int, *, only_numbers: bool = False) -> bool:
    """Compute missing results, print the times, and return whether all tasks succeeded."""
    os.environ["REPRODUCE_BUILD"] = str(book / "_build" / "computed")
    prepare()
    kinds = {"ledger", "posterior", "facts"}
    for stage in (numbers, pages):
        tasks = stage(book)
        if only_numbers:
            tasks = {n: task for n, task in tasks.items() if n.split()[0] in kinds}
        if not run_tasks(tasks, book, workers):
            return False
    return True


def run_tasks(tasks: dict[str, Task], book: Path, workers: int) -> bool:
    """Run tasks in parallel, and store the pages that they return."""
    succeeded = True
    with ThreadPoolExecutor(workers) as pool, cache_of(book) as cache:
        for name, future in {
            n: pool.submit(apart, t) for n, t in tasks.items()
        }.items():
            if error := future.exception():
                print(f"{name}: {error}", file=sys.stderr, flush=True)
                succeeded = False
                continue
            seconds, notebook = future.result()
            print(f"{seconds:6.1f} s  {name}", flush=True)
            if notebook is not None:
                data = {"execution_seconds": seconds}
                bundle = CacheBundleIn(notebook, str(book / name), data=data)
                cache.cache_notebook_bundle(
                    bundle, check_validity=False, overwrite=True
                )
    return succeeded


def apart(task: Task) -> tuple[float, Any]:
    """Run a task in a new process, and return the seconds and its result.

    Raises
    ------
    RuntimeError
        If it fails, with its traceback.
    """
    begin = perf_counter()
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=_send, args=(sender, task))
    process.start()
    sender.close()
    try:
        error, result = receiver.recv()
    except EOFError:
        error, result = "the process was killed", None
    process.join()
    if error:
        raise RuntimeError(error)
    return perf_counter() - begin, result


def _send(sender: Connection, task: Task) -> None:
    try:
        sender.send(("", task()))
    except Exception:
        sender.send((format_exc(), None))


def cores() -> int:
    """Return the number of processes that may work at once."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


if __name__ == "__main__":
    only_numbers = sys.argv[1:] == ["numbers"]
    sys.exit(0 if compute(BOOK, cores(), only_numbers=only_numbers) else 1)
