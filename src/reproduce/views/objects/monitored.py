"""What the front door returns for a user's own lasers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.judge.rerun import in_si, refuse_strays
from reproduce.papers.chen2023.posteriors.simulated_spots import READS, platform
from reproduce.papers.chen2023.posteriors.users_spots import COLUMNS, from_table, moving
from reproduce.physics.attitude.monitoring import mean_misalignment, monitored_angles
from reproduce.printed.given import given
from reproduce.store.points import is_table, measured, read_table
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views.objects.base import text_of
from reproduce.views.objects.measurements import _Measured

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Monitored"]

FloatArray = NDArray[np.float64]


def _images(spots: Any, zero: ArrayLike | None) -> tuple[FloatArray, FloatArray, list[str]]:
    """Read the images at the zero point and at the present, and say which are left out."""
    if is_table(spots) and zero is None:
        table = read_table(spots, COLUMNS)
        before, now = from_table(table)
        return before, now, list(table.notes)
    if isinstance(spots, str | Path):
        raise ValueError("zero: expected nothing beside a file, which holds both groups")
    if zero is None:
        raise ValueError("zero: expected the images at the zero point, or a file of both")
    names, kept, notes = ("zero", "spots"), [], []
    for name, (images, mask) in zip(names, measured(("zero", zero), ("spots", spots)), strict=True):
        lost = np.asarray(mask.any(axis=tuple(range(1, mask.ndim))))
        if lost.all():
            raise ValueError(f"{name}: expected images that are not masked, got all masked")
        if lost.any():
            notes.append(f"{lost.sum()} of {len(lost)} images of {name} have a masked spot and are "
                         "left out")  # fmt: skip
        kept.append(images[~lost])
    return kept[0], kept[1], notes


class Monitored(_Measured):
    """The misalignment of a user's own camera, image by image.

    It is made from the arguments of `reproduce.misalignment`.
    """

    def __init__(
        self,
        spots: str | Path | ArrayLike,
        zero: ArrayLike | None = None,
        changes: Mapping[str, str | float] | None = None,
    ) -> None:
        door = given(READS)
        self.reads = tuple(door.cells)
        self._spots, self._zero = spots, zero
        self.changes = dict(changes or {})
        refuse_strays("the instrument", self.changes, self.reads)
        values = {a: in_si(door.cells[a], text) for a, text in self.changes.items()}
        design = platform(door.changed(values))
        before, now, notes = _images(spots, zero)
        design = replace(design, spots=before.mean(axis=0))
        tracker = (design.principal_point, design.pixel_pitch, design.tracker_focal_length)
        instrument = (design.lasers, design.camera_focal_length, tracker)
        self.angles: FloatArray = monitored_angles(before, now, *instrument)
        self.remarks = [*moving({0: before, 1: now}), *notes]
        self._mean = mean_misalignment(self.angles, monitored_angles(before, before, *instrument))
        self.title = f"misalignment in {len(self.angles)} images since the zero point"

    @property
    def source(self) -> str:
        """The text of the function that computes the angles."""
        return text_of(monitored_angles)

    def images(self) -> pd.DataFrame:
        """Return the angles of every image about X, Y and Z of the camera, in arcsec."""
        import pandas as pd

        index = pd.RangeIndex(1, len(self.angles) + 1, name="image")
        return pd.DataFrame(self.angles * ARCSEC_PER_RADIAN, index, columns=list("XYZ"))

    def frame(self) -> pd.DataFrame:
        """Return mean, scatter of one image and error of the mean about each axis, in arcsec.

        The error counts both groups: the zero point is itself a mean over images.
        """
        import pandas as pd

        columns = ("mean (arcsec)", "scatter (arcsec)", "error of the mean (arcsec)")
        index = pd.Index(list("XYZ"), name="about")
        values = np.stack(self._mean, axis=-1) * ARCSEC_PER_RADIAN
        return pd.DataFrame(values, index, columns=columns)

    def rerun(
        self,
        changes: Mapping[str, str | float] | None = None,
        *,
        spots: str | Path | ArrayLike | None = None,
        zero: ArrayLike | None = None,
    ) -> Monitored:
        """Return the same with other spots, or with an instrument of other printed numbers."""
        zero_of = self._zero if spots is None and zero is None else zero
        chosen = self._spots if spots is None else spots
        return Monitored(chosen, zero_of, {**self.changes, **(changes or {})})
