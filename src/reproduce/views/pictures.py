"""Stars of images and of lists, their pairs, and the transform between two images."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reproduce.physics.images import THRESHOLD, find_spots, shape_finding
from reproduce.physics.registration import (
    Finding,
    Registration,
    match_points,
    pair_weights,
)
from reproduce.store.images import Image, ImageError, is_image, read_image, reading
from reproduce.store.points import (
    SIGMAS,
    STARS,
    Table,
    brightness,
    deviations,
    read_table,
)
from reproduce.views.blocks import Block, Display, Fold
from reproduce.views.measurements import Registered, Remade, _grid
from reproduce.views.numbers import minus

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from reproduce.views.posterior import Posterior

FloatArray = NDArray[np.float64]
# Default distance of the stars of a pair, at most: in px, and as a fraction of the field.
_NEAR, _FRACTION = 2.0, 1e-3
# Pairs of a robust fit, at least.
_FEWEST = 4
# Stars that a display contains, at most.
_SHOWN = 10
# Units of the facts of an image.
_UNITS = {
    "threshold": " standard deviations",
    "radius": " px",
    "angle": " rad",
    "hot": " px",
    "gain": " electrons per digital number",
    "background": " digital numbers",
    "noise": " digital numbers",
    "missing": " px",
    "saturated": " px",
}
_CENTRE = ("x", "y", "sigma_x", "sigma_y")


class Stars(Display):
    """Stars of one image or list: centres with covariance, and the dropped detections.

    Attributes
    ----------
    name : str
    points : ndarray, shape (n, 2)
        Centres, in px, the brightest first if the brightness is known.
    covariance : ndarray, shape (n, 2, 2)
        Covariance of the centres, in px^2; zero if unknown.
    dropped : DataFrame
        Other detections, with the reason.
    log : list of str
        Facts and remarks, and numbers of dropped detections.
    middle : ndarray, shape (2,)
        Middle of the image or mean of the stars of a list, in px.
    facts : dict of str to float
        Of an image: radius of a spot in px, background, noise, gain, and numbers of pixels.
    shapes : ndarray, shape (n, 5)
        Shapes of the spots of an image, as `physics.images.finding.Found`; NaN for a list.
    findings : tuple of Finding
        Warnings about an image.
    """

    def __init__(
        self,
        name: str,
        table: pd.DataFrame,
        covariance: FloatArray,
        middle: FloatArray,
        notes: Sequence[str] = (),
        shapes: FloatArray | None = None,
        findings: tuple[Finding, ...] = (),
        **facts: float,
    ) -> None:
        if "flux" in table:
            table = table.sort_values("flux", ascending=False, kind="stable")
        elif "mag" in table:
            table = table.sort_values("mag", kind="stable")
        used = table["dropped"] == ""
        self.name, self.facts, self.middle = name, facts, middle
        rows = table.index[used]
        self.covariance: FloatArray = covariance[rows]
        self.shapes = (
            np.full((len(rows), 5), np.nan) if shapes is None else shapes[rows]
        )
        self.findings = findings
        self._kept = table[used].drop(columns="dropped").reset_index(drop=True)
        self.dropped = table[~used].reset_index(drop=True)
        self.points: FloatArray = self._kept[["x", "y"]].to_numpy(float)
        reasons = self.dropped["dropped"].value_counts()
        self.log = [
            *notes,
            *(one.text for one in findings),
            *(
                minus(f"{key}: {value:.5g}{_UNITS.get(key, '')}")
                for key, value in facts.items()
            ),
            *(f"dropped, {key}: {value}" for key, value in reasons.items()),
        ]

    def __len__(self) -> int:
        """Return the number of stars."""
        return len(self.points)

    def frame(self) -> pd.DataFrame:
        """Return x, y, sigma_x and sigma_y in px, and the other known columns of each star."""
        return self._kept.copy()

    def blocks(self) -> Iterator[Block]:
        """Yield the first stars and the log."""
        title = f"{len(self)} stars of {self.name}, in px, of which {_SHOWN} or fewer are shown"
        yield _grid(title, self._kept.head(_SHOWN).rename_axis("star"))
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
        columns = (*SIGMAS, "flux", "mag", "weight")
        table = read_table(source, _CENTRE[:2], columns, sep, "source")
        known = {*SIGMAS} & {*table.optional}
        sigma = deviations(table) if known else np.zeros_like(table.values)
        return _listed(table, sigma)
    return _detected(image, name, threshold)


def _listed(table: Table, sigma: FloatArray) -> Stars:
    """Return the stars of a table of positions with their standard deviations."""
    import pandas as pd

    frame = pd.DataFrame(np.hstack([table.values, sigma]), columns=_CENTRE)
    frame = frame.assign(dropped="", **table.optional)
    frame = frame.drop(columns="sigma", errors="ignore")
    covariance = sigma[:, :, None] ** 2 * np.eye(2)
    middle = table.values.mean(axis=0)
    return Stars(table.path, frame, covariance, middle, table.notes)


def _detected(image: Image, name: str, threshold: float | None) -> Stars:
    """Return the stars that are found in an image."""
    import pandas as pd

    cut = THRESHOLD if threshold is None else threshold
    with reading(name):
        found = find_spots(image.light, image.full, cut, image.step, image.sigma)
    covariance = found.spots.covariance
    sigma = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    table = pd.DataFrame(np.hstack([found.spots.centre, sigma]), columns=_CENTRE)
    table = table.assign(
        flux=found.spots.light / found.facts["gain"], dropped=found.reasons
    )
    facts = {
        "threshold": cut,
        **found.facts,
        "missing": np.isnan(image.light).sum(),
        "saturated": image.full.sum(),
        "hot": found.hot,
    }
    middle = (np.array(image.light.shape[::-1]) - 1) / 2
    result = Stars(
        name, table, covariance, middle, (), found.shapes, found.remarks, **facts
    )
    if not len(result):
        raise ImageError(f"{name}: expected stars, got {'; '.join(result.log)}")
    return result


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
    near = radius or _NEAR + _FRACTION * float(field)
    start = getattr(start, "transform", start)
    if start is not None and not isinstance(start, Registration):
        if np.shape(start) != (4,):
            raise ValueError(
                f"start: expected a transform or four numbers, got {start!r}. Give scale, rotation "
                "in radians, and shift in x and y in px"
            )
        start = Registration(
            "similarity", start, source.middle if pivot is None else pivot
        )
    with reading(f"{source.name} and {target.name}"):
        rows, found = match_points(source.points, target.points, near, start)
    a, b = rows.T
    pairs = pd.DataFrame(np.hstack([source.points[a], target.points[b]]), columns=STARS)
    counts = f"{len(pairs)} pairs of {len(source)} and {len(target)} stars"
    pairs.attrs["log"] = f"{counts}, less than {near:.3g} px apart"
    pairs.attrs["mirrored"] = bool(np.linalg.det(found.matrix) < 0)
    return pairs.assign(row=a, row_reference=b), found


class RegisteredPictures(Registered):
    """The transform that maps the stars of one image onto the stars of another image.

    In addition to `Registered`, it has the ``source_stars`` and ``target_stars``, their ``pairs``
    with residuals, their scatter ``beyond`` the errors of the centres, in px, and a ``log``.
    """

    def __init__(
        self, source: Stars, target: Stars, pivot: Any = None, **settings: Any
    ) -> None:
        given = {"source": source, "target": target, "pivot": pivot, **settings}
        start, radius = (settings.pop(name, None) for name in ("start", "radius"))
        pairs, found = paired(source, target, start, radius, pivot)
        if pairs.attrs["mirrored"] and settings.get("model") != "affine":
            raise ValueError(
                f"{source.name} and {target.name} mirror each other: flip one, or take the model "
                "affine"
            )
        pivot = source.middle if pivot is None else pivot
        self.source_stars, self.target_stars = source, target
        a, b = pairs["row"], pairs["row_reference"]
        points = source.points[a], target.points[b]
        settings["robust"] = settings.get("robust", True) and len(pairs) >= _FEWEST
        known = np.stack([source.covariance[a], target.covariance[b]])
        weights, self.beyond = pair_weights(*points, pivot, known, found, **settings)
        for stars, rows in ((source, a), (target, b)):
            if "weight" in stars.frame():
                weights = weights * stars.frame()["weight"].to_numpy()[rows]
        known_flux = brightness(
            {str(name): one.to_numpy()[a] for name, one in source.frame().items()}
        )
        super().__init__(
            *points, pivot, weights=weights, brightness=known_flux, **settings
        )
        self._given = given
        self._compare_shapes(source.shapes[a], target.shapes[b])
        self.title = f"{source.name} on {target.name}: {self.title}"
        used, (x, y) = self.fit.weights > 0, self.residuals.T
        self.pairs = pairs.assign(residual_x=x, residual_y=y, used=used)
        self.log = [
            *(f"{one.name}: {'; '.join(one.log)}" for one in (source, target)),
            pairs.attrs["log"],
            f"scatter of the pairs beyond the errors of the centres: {self.beyond:.2g} px",
            f"pairs that are dropped because they do not fit the others: {np.sum(~used)}",
        ]
        self._facts |= {
            "source": source.name,
            "target": target.name,
            "log": self.log,
            "beyond_px": self.beyond,
        }

    def _compare_shapes(self, source: FloatArray, target: FloatArray) -> None:
        """Widen the intervals of the shift if the spots of the images differ in shape."""
        finding, covariance = shape_finding(source, target, self.transform.matrix)
        warnings = [*self.source_stars.findings, *self.target_stars.findings]
        warnings += [finding] if finding else []
        self.findings += warnings
        self.remarks += [one.text for one in warnings]
        shift = [self.fit.names.index(f"shift-{axis}") for axis in "xy"]
        self.systematic[np.ix_(shift, shift)] = covariance

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
        from reproduce.views.figure import painted, save

        save(painted(self._paint), Path(path))
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


class RegisteredChannels(Remade):
    """Several images of one field, each registered to the reference: a `Registered` by name."""

    def __init__(self, fits: Mapping[str, RegisteredPictures], reference: str) -> None:
        self.fits, self.reference = fits, reference
        self._given = {"fits": fits, "reference": reference}

    def __getitem__(self, name: str) -> RegisteredPictures:
        """Return the registration of one image."""
        return self.fits[name]

    def frame(self) -> pd.DataFrame:
        """Return the parameters of all images."""
        import pandas as pd

        return pd.concat(
            {name: fit.frame() for name, fit in self.fits.items()}, names=["picture"]
        )

    def record(self) -> dict[str, Any]:
        """Return the reference and the record of each image."""
        pictures = {name: fit.record() for name, fit in self.fits.items()}
        return {"reference": self.reference, "pictures": pictures}

    def blocks(self) -> Iterator[Block]:
        """Yield the blocks of each registration."""
        for fit in self.fits.values():
            yield from fit.blocks()


def registered(
    sources: Sequence[Any],
    pivot: Any,
    reference: str | None,
    threshold: float | None,
    progress: Callable[[int, int], None] | None = None,
    sep: str | None = None,
    **settings: Any,
) -> RegisteredPictures | RegisteredChannels:
    """Register images to one of them. Default: the second one.

    The arguments are those of `reproduce.register`; `settings` are of `RegisteredPictures`.
    """
    if len(sources) < 2:
        raise ValueError("target: expected a second image")
    names: list[str] = []
    for number, source in enumerate(sources, start=1):
        name = str(Path(source)) if isinstance(source, str | Path) else ""
        names.append(name if name and name not in names else f"image {number}")
    chosen = str(Path(reference or names[1]))
    if chosen not in names:
        raise ValueError(
            f"reference: expected one of {', '.join(names)}, got {reference!r}"
        )
    found: dict[str, Stars] = {}
    for number, (name, source) in enumerate(zip(names, sources, strict=True), start=1):
        found[name] = stars_of(source, threshold, sep, name)
        if progress is not None:
            progress(number, len(sources))
    target = found.pop(chosen)
    fits = {
        name: RegisteredPictures(one, target, pivot, **settings)
        for name, one in found.items()
    }
    return (
        next(iter(fits.values()))
        if len(fits) == 1
        else RegisteredChannels(fits, chosen)
    )
