"""Long work in parts: on any executor, in any order, and resumed after a kill.

A part is the argument of a function that returns a tuple of arrays. Results do not depend on who
carries the parts, on how many carry them, or on the order in which they end. With a store every
result is written as it comes, whole or not at all: a kill costs the parts that were at work.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any, TypeVar
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from reproduce.inference import Progress

Part = TypeVar("Part")
Result = tuple[NDArray[Any], ...]


class ResumeError(ValueError):
    """A folder holds the results of other work."""


@dataclass(frozen=True)
class Store:
    """A folder that keeps finished parts.

    - `folder`: it need not exist yet.
    - `note`: what the work is, in values that JSON has: a folder with another note is refused.
    """

    folder: Path
    note: Mapping[str, Any]

    @property
    def plan(self) -> Path:
        """The file with the note."""
        return self.folder / "plan.json"

    def opened(self, count: int) -> dict[int, Result]:
        """Write down what the folder is for, or refuse it, and return the finished parts in it."""
        self.folder.mkdir(parents=True, exist_ok=True)
        if not self.plan.exists():
            part = self.plan.with_suffix(".part")
            part.write_text(json.dumps(self.note, indent=2), encoding="utf-8")
            part.replace(self.plan)
            return {}
        try:
            found = dict(json.loads(self.plan.read_text(encoding="utf-8")))
        except ValueError as error:
            raise ResumeError(
                f"{self.plan}: expected the plan of a stored run in JSON, got something else; "
                "choose another folder"
            ) from error
        if found != self.note:
            different = sorted(k for k in self.note if found.get(k) != self.note[k])
            raise ResumeError(
                f"{self.folder}: expected an empty folder or the same run, got results that differ "
                f"in {', '.join(different)}; choose another folder"
            )
        stored = ((index, self._load(index)) for index in range(count))
        return {index: result for index, result in stored if result is not None}

    def _path(self, index: int) -> Path:
        return self.folder / f"part-{index}.npz"

    def _load(self, index: int) -> Result | None:
        """Return the result of a part; none where there is none, or half a file."""
        try:
            # Opened here: NumPy would leave half a file open.
            with self._path(index).open("rb") as raw, np.load(raw) as file:
                return tuple(file[f"arr_{i}"] for i in range(len(file.files)))
        except (FileNotFoundError, BadZipFile, EOFError, KeyError, ValueError):
            return None

    def save(self, index: int, result: Result) -> None:
        """Write the result of a part."""
        path = self._path(index)
        part = path.with_suffix(".part")
        with part.open("wb") as file:
            np.savez(file, *result)
        part.replace(path)


def run_parts(
    function: Callable[[Part], Sequence[Any]],
    parts: Sequence[Part],
    executor: Executor | None = None,
    store: Store | None = None,
    progress: Progress | None = None,
) -> list[Result]:
    """Return the result of every part, in their order; without an executor they run here."""
    found = {} if store is None else store.opened(len(parts))

    def keep(index: int, result: Sequence[Any]) -> None:
        found[index] = tuple(np.asarray(array) for array in result)
        if store is not None:
            store.save(index, found[index])
        if progress is not None:
            progress(len(found), len(parts))

    waiting = [index for index in range(len(parts)) if index not in found]
    if executor is None:
        for index in waiting:
            keep(index, function(parts[index]))
    else:
        futures = {executor.submit(function, parts[index]): index for index in waiting}
        try:
            for future in as_completed(futures):
                keep(futures[future], future.result())
        finally:
            for future in futures:  # after an error the others need not start
                future.cancel()
    return [found[index] for index in range(len(parts))]


def processes(workers: int | None = None) -> ProcessPoolExecutor:
    """Return an executor of fresh processes, one for each processor by default."""
    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"))
