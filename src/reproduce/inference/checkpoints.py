"""Chains on disk: emcee's HDF5 backend, written a block at a time, never half.

emcee opens its file at every step. Here steps are collected and written together at a checkpoint,
into a working copy; only a whole, closed file takes the checkpoint's place. A kill at any moment
costs the steps since the last checkpoint and never the file, which emcee itself can read.
"""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import Any

import emcee
import numpy as np


class CheckpointBackend(emcee.backends.HDFBackend):  # type: ignore[misc]
    """emcee's backend on a working copy of the last checkpoint.

    Parameters
    ----------
    path : pathlib.Path
        The checkpoint, which need not exist yet.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.part = path.with_suffix(".part")
        self.part.unlink(missing_ok=True)
        if path.exists():
            shutil.copyfile(path, self.part)
        self.steps: list[tuple[Any, Any, Any]] = []
        self.random: Any = None
        super().__init__(str(self.part))

    def save_step(self, state: emcee.State, accepted: Any) -> None:
        """Collect a step; `store` writes it."""
        self.steps.append((state.coords.copy(), np.array(state.log_prob), accepted.copy()))
        self.random = state.random_state

    def store(self) -> None:
        """Write the collected steps, and put the file in the checkpoint's place."""
        coords, log_prob, accepted = (np.array(column) for column in zip(*self.steps, strict=True))
        with self.open("a") as file:
            group = file[self.name]
            first = group.attrs["iteration"]
            group["chain"][first : first + len(coords)] = coords
            group["log_prob"][first : first + len(coords)] = log_prob
            group["accepted"][:] += accepted.sum(axis=0)
            for position, value in enumerate(self.random):
                group.attrs[f"random_state_{position}"] = value
            group.attrs["iteration"] = first + len(coords)
        self.steps = []
        whole = self.path.with_suffix(".whole")
        shutil.copyfile(self.part, whole)
        with whole.open("rb") as file:
            os.fsync(file.fileno())
        whole.replace(self.path)

    def close(self) -> emcee.backends.HDFBackend:
        """Remove the working copy and return a reader of the checkpoint."""
        self.part.unlink(missing_ok=True)
        return emcee.backends.HDFBackend(str(self.path), read_only=True)
