"""Stars of images and of lists, their pairs, and the transform between two images."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from reproduce.physics.images import find_spots, shape_finding
from reproduce.physics.registration import (
    Finding,
    Registration,
    match_points,
    pair_weights,
)
from reproduce.physics.validate import FloatArray
from reproduce.printed.number import minus
from reproduce.store.files import FilePath
from reproduce.store.images import is_image, read_image, reading
from reproduce.store.points import (
    SIGMAS,
    STARS,
    brightness,
    covariances,
    read_table,
)
from reproduce.views._blocks import Block, Display, Grid, fold
from reproduce.views.measurements import RegistrationResult

# Default of the largest distance of a pair: in px, and as a fraction of the field.
_PAIR_PX, _PAIR_FRACTION = 2.0, 1e-3
# Smallest radius without a warning, in standard deviations of a coordinate: 1 % of pairs are wider.
_MIN_RADIUS = 3.0
# Largest number of stars in a display.
_MAX_SHOWN = 10
# Units of the facts of an image.
_UNITS = {
    "threshold": "standard deviations of the noise",
    "gain": "electrons per digital number",
    "background": "digital numbers",
    "noise": "digital numbers",
}
_CENTRE = ["x", "y"]
_COLUMNS = [*_CENTRE, "sigma_x", "sigma_y"]


def stars(
    source: FilePath | ArrayLike | pd.DataFrame | Mapping[str, Any],
    *,
    threshold: float | None = None,
    sep: str | None = None,
    name: str = "source",
) -> Stars:
    """Find the stars of an image, with Astropy and photutils.

    The errors of the centres assume that the noise of neighbouring pixels is independent. In a
    smoothed or resampled image they are too small, by a factor of 1.5 to 3 in simulations.

    Parameters
    ----------
    source : path, table or array_like, shape (height, width) or (n, 2)
        FITS file (``field.fits[SCI]`` if it contains several images), array, masked array or
        `CCDData`, whose mask and uncertainty apply, in any unit. The uncertainty may contain the
        photon noise of the stars. Also a list of stars in any order: an array of shape (n, 2), or
        a table as in `register` with the columns ``x`` and ``y``, in px. Optional columns are
        ``flux`` or ``mag`` (brighter stars have a lower magnitude), by which `match` selects
        stars, and ``sigma`` (or ``sigma_x``, ``sigma_y``), in px.
    threshold : float, optional
        Detection threshold of an image, in standard deviations of the noise. Default: 5.
    sep : str, optional
        Separator of the columns of a text file. Default: a comma.
    name : str
        Name of an array or table.

    Returns
    -------
    Stars
        Centres with covariance, and the dropped detections with the reasons.

    Raises
    ------
    ValueError
        If the image cannot be read or contains no stars.
    """
    has_pixels = is_image(source)
    if threshold is not None and not has_pixels:
        raise ValueError(
            "threshold: expected none for a list of stars, got one. Pass it to stars with an image"
        )
    if isinstance(source, Stars):
        # The role of an array is its name.
        return replace(source, name=name) if source.name == "source" else source
    name = str(source) if isinstance(source, FilePath) else name
    if has_pixels:
        with reading(name):
            pixels, saturation, noise = read_image(source)
            spots = find_spots(pixels, threshold, noise, saturation)
        covariance, shapes = spots.covariance, spots.shapes
        sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
        frame = pd.DataFrame(np.hstack([spots.centre, sigma]), columns=_COLUMNS)
        frame = frame.assign(dropped=spots.reasons, flux=spots.flux)
        middle = (np.array(pixels.shape[::-1]) - 1) / 2
        facts, findings = spots.facts, spots.findings
    else:
        optional = (*SIGMAS, "flux", "mag", "weight")
        table = read_table(source, _CENTRE, optional, sep, name)
        name, frame = table.path, pd.DataFrame(dict(table.numbers))
        if "weight" in table.numbers:
            raise ValueError(
                f"{name}: expected no column weight in the stars of one image, got one. Give sigma"
            )
        frame["dropped"] = ""
        shapes = np.full((len(frame), 2, 2), np.nan)
        given = covariances(table)
        covariance = np.zeros_like(shapes) if given is None else given
        middle, facts, findings = table.values.mean(axis=0), {}, ()
    if (flux := brightness(frame)) is not None:
        frame = frame.loc[flux.sort_values(ascending=False, kind="stable").index]
    is_dropped = frame["dropped"] != ""
    kept = frame[~is_dropped]
    found = Stars(
        name,
        kept.drop(columns="dropped").reset_index(drop=True),
        covariance[kept.index],
        middle,
        shapes[kept.index],
        frame[is_dropped],
        facts,
        findings,
    )
    if not len(found):
        raise ValueError(f"{name}: expected stars, got {found.log}")
    return found


def match(
    source: Any,
    target: Any,
    start: Any = None,
    radius: float | None = None,
    pivot: ArrayLike | None = None,
) -> pd.DataFrame:
    """Match the stars of two images or lists.

    Shifts are tried first, then triangles of the brightest stars, then triangles of the most
    isolated stars. Four common stars suffice if they agree to their errors. Matches that are not
    better than by chance are rejected, and ambiguous ones, as on a regular grid with missing stars.

    Parameters
    ----------
    source, target : Stars, or any `source` of `stars`
        Both images or lists, in any order of rows.
    start : Registration, RegistrationResult or array_like, shape (4,), optional
        Rough transform, under which the stars of a pair are neighbours. An array contains scale,
        rotation in radians and shift in px about the pivot, as in ``register(...).parameters``.
        Default: found from the stars.
    radius : float, optional
        Largest distance between the stars of a pair, in px. Default: 2 px and 1/1000 of the field.
    pivot : array_like, shape (2,), optional
        Pivot of an array `start`, in px. Default: middle of the image, or mean of the stars of a
        list.

    Returns
    -------
    DataFrame
        Pairs in the columns of `register`, with the rows of both stars. Its ``attrs`` contain
        ``mirrored``, whether the images mirror each other, the ``matrix`` of the affine transform
        under which the stars of a pair are neighbours, and the ``radius``.

    Raises
    ------
    ValueError
        If a list has fewer than four stars, or the stars do not agree better than by chance, or
        agree under several transforms.

    Examples
    --------
    >>> import numpy as np
    >>> target = np.array([[10.0, 20], [400, 30], [250, 300], [90, 410]])
    >>> match(target[::-1] - (5, 0), target)["row_reference"].tolist()
    [3, 2, 1, 0]
    """
    first, second = stars(source, name="source"), stars(target, name="target")
    # The lists may be far apart.
    field = max(np.ptp(one.points, axis=0).max() for one in (first, second))
    near = _PAIR_PX + _PAIR_FRACTION * field if radius is None else radius
    if isinstance(start, RegistrationResult):
        start = start.transform
    if start is not None and not isinstance(start, Registration):
        if np.shape(start) != (4,):
            raise ValueError(
                f"start: expected a transform or four numbers, got {start!r}. Give scale, rotation "
                "in radians, and shift in x and y in px"
            )
        middle = first.middle if pivot is None else pivot
        start = Registration("similarity", start, middle)
    with reading(f"{first.name} and {second.name}"):
        rows, transform = match_points(first.points, second.points, near, start)
    a, b = rows.T
    pairs = pd.DataFrame(np.hstack([first.points[a], second.points[b]]), columns=STARS)
    counts = f"{len(pairs)} pairs of {len(first)} and {len(second)} stars"
    pairs.attrs = {
        "log": f"{counts}, less than {near:.3g} px apart",
        "radius": near,
        "matrix": transform.matrix.tolist(),
        "mirrored": bool(np.linalg.det(transform.matrix) < 0),
    }
    return pairs.assign(row=a, row_reference=b)


@dataclass(frozen=True, eq=False, repr=False)
class Stars(Display):
    """Stars of one image or list: centres with covariance, and the dropped detections.

    Attributes
    ----------
    name : str
        Name of the image or list.
    table : DataFrame
        x and y in px, and the other known columns of each star, such as sigma_x and sigma_y. The
        brightest star comes first if the brightness is known.
    covariance : ndarray, shape (n, 2, 2)
        Covariance of the centres, in px^2; zero if unknown.
    middle : ndarray, shape (2,)
        Middle of the image or mean of the stars of a list, in px.
    shapes : ndarray, shape (n, 2, 2)
        Shapes of the spots of an image, as in `physics.images.finding.Detections`; NaN for a list.
    rejected : DataFrame
        Other detections, with the reason in the column ``dropped``.
    facts : dict of str to float
        Facts of an image, as in `physics.images.finding.Detections`.
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
        return self.table[_CENTRE].to_numpy(float)

    @property
    def log(self) -> str:
        """Warnings, facts, and numbers of dropped detections."""
        facts = {f"{key}, {_UNITS.get(key, 'px')}": n for key, n in self.facts.items()}
        reasons = self.rejected["dropped"].value_counts().add_prefix("dropped, ")
        numbers = (facts | reasons.to_dict()).items()
        lines = (f"{key}: {minus(f'{number:.5g}')}" for key, number in numbers)
        return "; ".join([*(finding.text for finding in self.findings), *lines])

    def __len__(self) -> int:
        """Return the number of stars."""
        return len(self.table)

    def frame(self) -> pd.DataFrame:
        """Return a copy of the table."""
        return self.table.copy()

    def blocks(self) -> Iterator[Block]:
        """Yield the first stars and the log."""
        title = f"{len(self)} stars of {self.name}, in px, of which {_MAX_SHOWN} or fewer are shown"
        yield Grid.of_frame(title, self.table.head(_MAX_SHOWN).rename_axis("star"))
        yield self.log


class PairedRegistration(RegistrationResult):
    """Registration of images or separate lists, whose stars are matched first.

    It also has the ``source_stars`` and ``target_stars``, their ``pairs`` with residuals, the
    ``extra_scatter`` beyond the errors of the centres, in px, and a ``log``.
    ``reproduce.posterior("registration", data=fit.pairs)`` samples the posterior of the same model.
    """

    def __init__(
        self,
        source: Any,
        target: Any,
        pivot: Any = None,
        start: Any = None,
        radius: float | None = None,
        threshold: float | None = None,
        sep: str | None = None,
        **settings: Any,
    ) -> None:
        settings = {"robust": True, **settings}
        first = stars(source, threshold=threshold, sep=sep, name="source")
        second = stars(target, threshold=threshold, sep=sep, name="target")
        self.source_stars, self.target_stars = first, second
        pivot = first.middle if pivot is None else pivot
        pairs = match(first, second, start, radius, pivot)
        row, other = pairs[["row", "row_reference"]].to_numpy().T
        weights, self.extra_scatter = pair_weights(
            first.points[row],
            second.points[other],
            pivot,
            np.stack([first.covariance[row], second.covariance[other]]),
            pairs.attrs["matrix"],
            **settings,
        )
        known: Any = first.table.filter(["flux", "mag"]).iloc[row].to_dict("list")
        pairs = pairs.assign(weight=weights, **known)
        found, systematic = shape_finding(
            first.shapes[row], second.shapes[other], np.array(pairs.attrs["matrix"])
        )
        # An unknown displacement of the centres widens the interval of the shift.
        super().__init__(pairs, None, pivot, systematic, **settings)
        used, (x, y) = self.fit.weights > 0, self.residuals.T
        self.pairs = pairs.assign(
            residual_x=x, residual_y=y, used=used, weight=self.fit.weights
        )
        self.log = [
            *(f"{image.name}: {image.log}" for image in (first, second)),
            pairs.attrs["log"],
            f"scatter of the pairs beyond the errors of the centres: {self.extra_scatter:.2g} px",
            f"pairs that are dropped because they do not fit the others: {np.sum(~used)}",
        ]
        self.findings += [*first.findings, *second.findings, *found]
        radius, noise = pairs.attrs["radius"], self.residuals[used].std()
        if radius < _MIN_RADIUS * noise:
            text = (
                f"the stars of a pair scatter by {noise:.2g} px, and pairs beyond the radius of "
                f"{radius:.3g} px are left out: the intervals are too narrow. Pass a larger radius"
            )
            self.findings.append(Finding("radius", text))
        self.title = f"{first.name} on {second.name}: {self.title}"
        self._facts |= {
            "source": first.name,
            "target": second.name,
            "log": self.log,
            "beyond_px": self.extra_scatter,
        }

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks of a registration, and the log."""
        yield from super().blocks()
        yield fold("Detection of the stars, and dropped pairs", *self.log)
