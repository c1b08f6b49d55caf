"""Stars of images and of lists, their pairs, and the transform between two images."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reproduce.physics.images import find_spots, shape_finding
from reproduce.physics.registration import (
    Finding,
    Registration,
    match_points,
    pair_weights,
)
from reproduce.store.images import ImageError, is_image, read_image, reading
from reproduce.store.points import (
    SIGMAS,
    STARS,
    DataTable,
    brightness,
    deviations,
    read_table,
)
from reproduce.views.blocks import Block, Display, Fold
from reproduce.views.measurements import RegistrationResult, _grid
from reproduce.views.numbers import minus

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from reproduce.views.posterior import Posterior

FloatArray = NDArray[np.float64]
# Default distance of the stars of a pair, at most: in px, and as a fraction of the field.
_PAIR_PX, _PAIR_FRACTION = 2.0, 1e-3
# Pairs of a robust fit, at least.
_MIN_PAIRS_ROBUST = 4
# Stars that a display contains, at most.
_MAX_SHOWN = 10
# Units of the facts of an image.
_UNITS = {
    "threshold": "standard deviations of the noise",
    "gain": "electrons per digital number",
    "background": "digital numbers",
    "noise": "digital numbers",
}
_CENTRE = ["x", "y", "sigma_x", "sigma_y"]


@dataclass(frozen=True, eq=False, repr=False)
class Stars(Display):
    """Stars of one image or list: centres with covariance, and the dropped detections.

    Attributes
    ----------
    name : str
        Name of the image or list.
    table : DataFrame
        x, y, sigma_x and sigma_y in px, and the other known columns of each star. The brightest
        star comes first if the brightness is known.
    covariance : ndarray, shape (n, 2, 2)
        Covariance of the centres, in px^2; zero if unknown.
    middle : ndarray, shape (2,)
        Middle of the image or mean of the stars of a list, in px.
    shapes : ndarray, shape (n, 3, 2)
        Shapes of the spots of an image, as in `physics.images.finding.Found`; NaN for a list.
    dropped : DataFrame
        Other detections, with the reason.
    facts : dict of str to float
        Facts of an image, as in `physics.images.finding.Found`.
    findings : tuple of Finding
        Warnings about an image.
    """

    name: str
    table: pd.DataFrame
    covariance: FloatArray
    middle: FloatArray
    shapes: FloatArray
    rejected: pd.DataFrame
    facts: dict[str, float]
    findings: tuple[Finding, ...]

    @property
    def points(self) -> FloatArray:
        """Centres, in px, shape (n, 2)."""
        return self.table[["x", "y"]].to_numpy(float)

    @property
    def log(self) -> list[str]:
        """Warnings, facts, and numbers of dropped detections."""
        reasons = self.rejected["dropped"].value_counts()
        facts = {
            f"{key}, {_UNITS.get(key, 'px')}": one for key, one in self.facts.items()
        }
        counts = {f"dropped, {key}": count for key, count in reasons.items()}
        lines = [
            f"{key}: {minus(f'{one:.5g}')}" for key, one in (facts | counts).items()
        ]
        return [one.text for one in self.findings] + lines

    def __len__(self) -> int:
        """Return the number of stars."""
        return len(self.table)

    def frame(self) -> pd.DataFrame:
        """Return a copy of the table."""
        return self.table.copy()

    def blocks(self) -> Iterator[Block]:
        """Yield the first stars and the log."""
        title = f"{len(self)} stars of {self.name}, in px, of which {_MAX_SHOWN} or fewer are shown"
        yield _grid(title, self.table.head(_MAX_SHOWN).rename_axis("star"))
        yield "; ".join(self.log)


def stars_of(
    source: Any,
    threshold: float | None = None,
    sep: str | None = None,
    name: str = "array",
) -> Stars:
    """Return the stars of an image, or of a table or array of positions."""
    if isinstance(source, Stars):
        return source
    name = str(source) if isinstance(source, str | Path) else name
    image = read_image(source, name) if is_image(source) else None
    if image is None:
        name = "source" if name == "array" else name
        columns = (*SIGMAS, "flux", "mag", "weight")
        table = read_table(source, _CENTRE[:2], columns, sep, name)
        known = {*SIGMAS} & {*table.optional}
        sigma = deviations(table) if known else np.zeros_like(table.values)
        return _stars_of_list(table, sigma)
    return _stars_of_image(*image, name, threshold)


def _stars_of_image(
    light: NDArray[Any],
    saturation: float,
    noise: NDArray[Any] | None,
    name: str,
    threshold: float | None,
) -> Stars:
    """Return the stars that are detected in an image."""
    import pandas as pd

    with reading(name):
        found = find_spots(light, threshold, noise, saturation)
    sigma = np.sqrt(np.diagonal(found.covariance, axis1=1, axis2=2))
    table = pd.DataFrame(np.hstack([found.centre, sigma]), columns=_CENTRE)
    table = table.assign(flux=found.flux, dropped=found.reasons)
    order = np.argsort(-found.flux, kind="stable")
    kept = order[found.reasons[order] == ""]
    stars = Stars(
        name,
        table.iloc[kept].drop(columns="dropped").reset_index(drop=True),
        found.covariance[kept],
        (np.array(light.shape[::-1]) - 1) / 2,
        found.shapes[kept],
        table[found.reasons != ""],
        found.facts,
        found.findings,
    )
    if not len(kept):
        raise ImageError(f"{name}: expected stars, got {'; '.join(stars.log)}")
    return stars


def _stars_of_list(table: DataTable, sigma: FloatArray) -> Stars:
    """Return the stars of a table of positions with their standard deviations."""
    import pandas as pd

    count = len(table.values)
    frame = pd.DataFrame(np.hstack([table.values, sigma]), columns=_CENTRE)
    frame = frame.assign(**table.optional).drop(columns="sigma", errors="ignore")
    flux = brightness(table.optional)
    order = np.arange(count) if flux is None else np.argsort(-flux, kind="stable")
    return Stars(
        table.path,
        frame.iloc[order].reset_index(drop=True),
        (sigma[:, :, None] ** 2 * np.eye(2))[order],
        table.values.mean(axis=0),
        np.full((count, 3, 2), np.nan),
        frame[:0].assign(dropped=""),
        {},
        tuple(Finding("masked", note) for note in table.notes),
    )


def paired(
    source: Stars,
    target: Stars,
    start: Any = None,
    radius: float | None = None,
    pivot: Any = None,
) -> tuple[pd.DataFrame, Registration]:
    """Return the pairs of `reproduce.match`, and the transform under which they are neighbours."""
    import pandas as pd

    field = np.ptp(np.vstack([source.points, target.points]), axis=0).max()
    near = radius or _PAIR_PX + _PAIR_FRACTION * float(field)
    start = getattr(start, "transform", start)
    if start is not None and not isinstance(start, Registration):
        if np.shape(start) != (4,):
            raise ValueError(
                f"start: expected a transform or four numbers, got {start!r}. Give scale, rotation "
                "in radians, and shift in x and y in px"
            )
        pivot = source.middle if pivot is None else pivot
        start = Registration("similarity", start, pivot)
    with reading(f"{source.name} and {target.name}"):
        rows, found = match_points(source.points, target.points, near, start)
    a, b = rows.T
    pairs = pd.DataFrame(np.hstack([source.points[a], target.points[b]]), columns=STARS)
    counts = f"{len(pairs)} pairs of {len(source)} and {len(target)} stars"
    pairs.attrs["log"] = f"{counts}, less than {near:.3g} px apart"
    pairs.attrs["mirrored"] = bool(np.linalg.det(found.matrix) < 0)
    return pairs.assign(row=a, row_reference=b), found


class RegisteredPictures(RegistrationResult):
    """The transform that maps the stars of one image onto the stars of another image.

    In addition to `Registered`, it has the ``source_stars`` and ``target_stars``, their ``pairs``
    with residuals, their scatter ``beyond`` the errors of the centres, in px, and a ``log``.
    """

    def __init__(
        self,
        source: Stars,
        target: Stars,
        pivot: Any = None,
        start: Any = None,
        radius: float | None = None,
        robust: bool = True,
        **settings: Any,
    ) -> None:
        pairs, found = paired(source, target, start, radius, pivot)
        if pairs.attrs["mirrored"] and settings.get("model") != "affine":
            raise ValueError(
                f"{source.name} and {target.name} mirror each other: flip one, or take the model "
                "affine"
            )
        pivot = source.middle if pivot is None else pivot
        used = settings | {"robust": robust and len(pairs) >= _MIN_PAIRS_ROBUST}
        both = [(source, pairs["row"]), (target, pairs["row_reference"])]
        points, other = (stars.points[rows] for stars, rows in both)
        known = np.stack([stars.covariance[rows] for stars, rows in both])
        weights, self.extra_scatter = pair_weights(
            points, other, pivot, known, found, **used
        )
        frames = [stars.frame().iloc[rows] for stars, rows in both]
        for frame in frames:
            weights = weights * frame.get("weight", 1.0)
        flux = brightness({str(key): one.to_numpy() for key, one in frames[0].items()})
        super().__init__(
            points, other, pivot, weights=np.array(weights), brightness=flux, **used
        )
        self._given = {
            "source": source,
            "target": target,
            "pivot": pivot,
            "start": start,
        }
        self._given |= {"radius": radius, "robust": robust, **settings}
        self.source_stars, self.target_stars = source, target
        shapes, others = (stars.shapes[rows] for stars, rows in both)
        finding, covariance = shape_finding(shapes, others, self.transform.matrix)
        warnings = [*source.findings, *target.findings, *([finding] if finding else [])]
        self.findings += warnings
        self.remarks += [one.text for one in warnings]
        # An unknown displacement of the centres widens the interval of the shift.
        shift = [self.fit.names.index(f"shift-{axis}") for axis in "xy"]
        self.systematic[np.ix_(shift, shift)] = covariance
        self.title = f"{source.name} on {target.name}: {self.title}"
        fitted, (x, y) = self.fit.weights > 0, self.residuals.T
        self.pairs = pairs.assign(residual_x=x, residual_y=y, used=fitted)
        self.log = [
            *(f"{one.name}: {'; '.join(one.log)}" for one in (source, target)),
            pairs.attrs["log"],
            f"scatter of the pairs beyond the errors of the centres: {self.extra_scatter:.2g} px",
            f"pairs that are dropped because they do not fit the others: {np.sum(~fitted)}",
        ]
        self._facts |= {"source": source.name, "target": target.name}
        self._facts |= {"log": self.log, "beyond_px": self.extra_scatter}

    def blocks(self) -> Iterator[Block]:
        """Yield the parameters, the remarks, and the log."""
        yield from super().blocks()
        yield Fold("How the stars were found, and what was dropped", tuple(self.log))

    def posterior(self, **plan: Any) -> Posterior:
        """Return the posterior of the same model over the pairs that are used, by emcee.

        The weights are those of the fit, and the noise is that of a pair of mean weight. `plan`
        contains steps, walkers, seed and priors.
        """
        from reproduce.views.posterior import Posterior

        used = self.pairs.assign(weight=self.fit.weights)[self.pairs["used"]]
        pivot = tuple(self.transform.pivot.tolist())
        plan = {"pivot": pivot, "model": self.model, **plan}
        return Posterior("registration", data=used.reset_index(drop=True), **plan)

    def save(self, path: str | Path) -> Path:
        """Draw the residuals of the pairs that are used: .svg, .pdf or .png."""
        from reproduce.views.figure import save, styled_figure

        save(styled_figure(self._paint), Path(path))
        return Path(path)

    def _paint(self, figure: Figure) -> None:
        used = self.pairs[self.pairs["used"]]
        columns = used[["x", "y", "residual_x", "residual_y"]].to_numpy().T
        axes = figure.subplots()
        axes.quiver(*columns, angles="xy")
        length = float(np.median(np.hypot(*columns[2:])))
        axes.set(
            title=f"residuals, median {length:.2g} px",
            xlabel="x (px)",
            ylabel="y (px)",
            aspect="equal",
        )
        axes.invert_yaxis()


def registered(
    source: Any,
    target: Any,
    pivot: Any,
    threshold: float | None,
    sep: str | None = None,
    **settings: Any,
) -> RegisteredPictures:
    """Register an image or list of stars to another one.

    The arguments are those of `reproduce.register`; `settings` are of `RegisteredPictures`.
    """
    first = stars_of(source, threshold, sep, "source")
    second = stars_of(target, threshold, sep, "target")
    return RegisteredPictures(first, second, pivot, **settings)
