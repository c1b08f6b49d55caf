"""Compute all that the pages of the book show, on every core, before the pages are made.

Ledger and posteriors come first, then the sentences' facts and the notebooks, each in a process of
its own. Executed notebooks go into the cache in which Jupyter Book looks for them, by their text;
`drop_stale_pages` sees to it that it holds nothing of other code, data or packages.
"""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from time import perf_counter
from typing import Any

from jupyter_cache import get_cache
from jupyter_cache.base import CacheBundleIn
from myst_nb.core.read import read_myst_markdown_notebook
from nbclient import NotebookClient

import warm_kernels

TIMEOUT = 1800  # seconds that a cell may take
NOTEBOOK = "---\nfile_format: mystnb\n"
SAMPLES = "posterior"  # a page whose cells speak of one waits until all are sampled


@dataclass(frozen=True)
class Task:
    """One thing to compute, and the tasks that come before it."""

    name: str
    compute: Callable[[], Any]
    needs: frozenset[str] = frozenset()


def in_order(
    tasks: Iterable[Task], workers: int
) -> Iterator[tuple[Task, Future[Any], float]]:
    """Run tasks, the first ready one first, and yield each as it ends, with its seconds.

    A task is ready when all that it needs is done well; one that needs what failed never is.
    """
    waiting, running = list(tasks), dict[Future[Any], tuple[Task, float]]()
    done: set[str] = set()
    with ThreadPoolExecutor(workers) as pool:
        while True:
            for task in [task for task in waiting if task.needs <= done]:
                if len(running) < workers:
                    waiting.remove(task)
                    running[pool.submit(task.compute)] = (task, perf_counter())
            if not running:
                return
            ended, _ = wait(running, return_when=FIRST_COMPLETED)
            for future in ended:
                task, begin = running.pop(future)
                if future.exception() is None:
                    done.add(task.name)
                yield task, future, perf_counter() - begin


def compute_ledger(downloads: Path) -> None:
    """Judge every cell, and write the tables that readers download."""
    from book_facts import write_cards, write_tables

    write_tables(downloads)
    write_cards(downloads.parent / "_build" / "cards.json")


def compute_figure(key: str, downloads: Path) -> None:
    """Draw a figure, and write the pictures that readers download."""
    from reproduce.views.figure import write_figure

    write_figure(key, downloads)


def compute_posterior(name: str) -> None:
    """Sample a posterior."""
    from reproduce.views.posterior import book_posterior

    book_posterior(name)


def compute_facts(path: Path) -> None:
    """Write what the sentences say."""
    from book_facts import write_facts

    write_facts(path)


def read(page: Path) -> Any:
    """Return a page as a notebook, or None if it is none."""
    text = page.read_text(encoding="utf-8")
    return read_myst_markdown_notebook(text) if text.startswith(NOTEBOOK) else None


def executed(notebook: Any, page: Path) -> Any:
    """Run a notebook's cells in a fresh kernel, in the folder of its page, and return it."""
    beside = {"metadata": {"path": str(page.parent)}}
    # Times in the cells' metadata would become part of the key in the cache, and where a stream is
    # cut hangs on the moment.
    client = NotebookClient(
        notebook,
        timeout=TIMEOUT,
        resources=beside,
        record_timing=False,
        coalesce_streams=True,
    )
    return asyncio.run(client.async_execute())


def pages_of(book: Path) -> list[Path]:
    """Return all pages of the book."""
    return sorted(page for page in book.rglob("*.md") if "_build" not in page.parts)


def computing(book: Path) -> list[Task]:
    """Return the tasks that write the numbers; none where they stand already."""
    facts, downloads = book / "_build" / "facts.json", book / "_extra"
    if facts.is_file() and (downloads / "ledger.json").is_file():
        return []
    from reproduce.papers.catalogue import drawings
    from reproduce.papers.posteriors import posteriors
    from reproduce.views.figure import drawable

    run = partial(partial, warm_kernels.run)
    tasks = [Task("ledger", run(compute_ledger, downloads))]
    tasks += [
        Task(f"posterior {name}", run(compute_posterior, name)) for name in posteriors()
    ]
    needed = frozenset(task.name for task in tasks)
    keys = (*drawable(), *drawings())
    drawn = [Task(f"figure {key}", run(compute_figure, key, downloads)) for key in keys]
    return [*tasks, *drawn, Task("facts", run(compute_facts, facts), needed)]


def executing(book: Path, cache: Any, before: frozenset[str]) -> Iterator[Task]:
    """Yield the tasks that run the notebooks which the cache does not hold, longest first."""
    tasks = []
    for page in pages_of(book):
        notebook = read(page)
        if notebook is None or held(cache, notebook):
            continue
        samples = any(
            SAMPLES in cell.source
            for cell in notebook.cells
            if cell.cell_type == "code"
        )
        needs = frozenset(
            one for one in before if samples or not one.startswith(SAMPLES)
        )
        name = page.relative_to(book).as_posix()
        tasks.append(Task(name, partial(executed, notebook, page), needs))
    yield from sorted(tasks, key=lambda task: -len(task.needs))


def held(cache: Any, notebook: Any) -> bool:
    """Tell whether a cache holds a notebook, executed."""
    try:
        cache.match_cache_notebook(notebook)
    except KeyError:
        return False
    return True


@contextmanager
def cache_of(book: Path) -> Iterator[Any]:
    """Open the cache of a book's executed notebooks."""
    cache = get_cache(book / "_build" / ".jupyter_cache")
    try:
        yield cache
    finally:
        cache.db.dispose()


def run_all(book: Path, workers: int) -> bool:
    """Compute what is missing, say how long each took, and return whether all went well."""
    first = computing(book)
    before = frozenset(task.name for task in first) - {"facts"}
    with cache_of(book) as cache:
        return carried([*first, *executing(book, cache, before)], book, cache, workers)


def carried(tasks: list[Task], book: Path, cache: Any, workers: int) -> bool:
    """Carry out tasks, keep the notebooks that they return, and tell whether all went well."""
    warm_kernels.start()
    done = 0
    for task, future, seconds in in_order(tasks, workers):
        if (error := future.exception()) is not None:
            print(f"{task.name}: {error}", file=sys.stderr, flush=True)
            continue
        done += 1
        print(f"{seconds:6.1f} s  {task.name}", flush=True)
        if (notebook := future.result()) is not None:
            data = {"execution_seconds": seconds}
            bundle = CacheBundleIn(notebook, str(book / task.name), data=data)
            cache.cache_notebook_bundle(bundle, check_validity=False, overwrite=True)
    return done == len(tasks)


def cores() -> int:
    """Return how many processes may work at once."""
    return (
        len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count() or 1
    )
