"""What the front door returns for a user's own stars and lasers."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from rich.console import RenderableType

from reproduce.judge.rerun import CannotChangeError, in_si
from reproduce.papers.chen2023.posteriors.simulated_spots import READS, platform
from reproduce.papers.chen2023.posteriors.users_spots import COLUMNS, from_table
from reproduce.physics.attitude.monitoring import mean_misalignment, monitored_angles
from reproduce.physics.registration.fit import RegistrationFit, fit_registration
from reproduce.printed.given import given
from reproduce.store.points import read_table
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views.objects.base import text_of
from reproduce.views.writing.display import Display, Grid
from reproduce.views.writing.export import export_frame

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["Monitored", "Registered"]

FloatArray = NDArray[np.float64]


class _Measured(Display):
    """What results of a user's own measurements share."""

    title: str
    reads: tuple[str, ...] = ()

    @abstractmethod
    def frame(self) -> pd.DataFrame:
        """Return the numbers, a row for each."""

    def export(self, form: str) -> str:
        """Return the numbers as csv, json, latex or markdown."""
        return export_frame(self.frame().reset_index(), form)

    @property
    def grid(self) -> Grid:
        """The numbers as a reader sees them."""
        frame = self.frame()
        rows = [
            [f"{value:.6g}" if isinstance(value, float) else str(value) for value in row]
            for row in frame.itertuples()
        ]
        return Grid(self.title, [str(frame.index.name), *map(str, frame.columns)], rows)

    def _repr_html_(self) -> str:
        return self.grid._repr_html_()

    def parts(self, width: int) -> Iterator[RenderableType]:
        """Yield the numbers and the title."""
        yield from self.grid.parts(width)


class Registered(_Measured):
    """The transform that lays a user's own stars over each other.

    It has the ``model``, the ``parameters`` in px and radians with their ``covariance``, the
    ``residuals``, target minus transformed source, and the ``transform`` for other points. It is
    made from the arguments of `reproduce.register`.
    """

    def __init__(
        self, source: ArrayLike, target: ArrayLike, pivot: ArrayLike | None = None, **settings: Any
    ) -> None:
        self._given = {"source": source, "target": target, "pivot": pivot, **settings}
        middle = np.mean(np.asarray(source, dtype=float), axis=0) if pivot is None else pivot
        self.fit: RegistrationFit = fit_registration(source, target, middle, **settings)
        self.model, self.transform = str(self.fit.model), self.fit.transform
        self.parameters, self.covariance = self.fit.parameters, self.fit.covariance
        self.residuals = self.fit.residuals
        self.title = f"{self.model} of {len(self.residuals)} stars"

    @property
    def source(self) -> str:
        """The text of the function that fits."""
        return text_of(fit_registration)

    def frame(self) -> pd.DataFrame:
        """Return one row per parameter: value and standard deviation, in px and radians.

        Returns
        -------
        pandas.DataFrame
            The deviation is NaN where the points leave none to spare.
        """
        import pandas as pd

        columns = {"value": self.parameters, "standard deviation": self.fit.standard_errors}
        return pd.DataFrame(columns, index=pd.Index(self.fit.names, name="parameter"))

    def rerun(self, **settings: Any) -> Registered:
        """Return the fit with other stars or settings: ``model="affine"``, ``robust=True``."""
        return Registered(**{**self._given, **settings})


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
        if strays := [address for address in self.changes if address not in self.reads]:
            raise CannotChangeError(
                f"the instrument does not read {', '.join(strays)}; it reads: "
                f"{', '.join(self.reads)}"
            )
        values = {a: in_si(door.cells[a], text) for a, text in self.changes.items()}
        design = platform(door.changed(values))
        if isinstance(spots, str | Path):
            if zero is not None:
                raise ValueError("zero: expected nothing beside a file, which holds both groups")
            before, now = from_table(read_table(Path(spots), COLUMNS))
        else:
            if zero is None:
                raise ValueError("zero: expected the images at the zero point, or a file of both")
            before, now = (np.asarray(one, dtype=float) for one in (zero, spots))
        design = replace(design, spots=before.mean(axis=0))
        tracker = (design.principal_point, design.pixel_pitch, design.tracker_focal_length)
        instrument = (design.lasers, design.camera_focal_length, tracker)
        self.angles: FloatArray = monitored_angles(before, now, *instrument)
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
