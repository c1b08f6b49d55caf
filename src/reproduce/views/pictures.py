"""From a user's own pictures to stars, to pairs of them, to the transform between two pictures."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from reproduce.physics.images import THRESHOLD, find_spots
from reproduce.physics.registration import match_points, pair_weights, registered_image
from reproduce.store.files import check_target, replacing
from reproduce.store.images import Image, ImageError, is_image, read_image, reading
from reproduce.store.points import STARS, is_table, read_table, table_of
from reproduce.views.blocks import Block, Display, Fold, Grid
from reproduce.views.measurements import SIGMAS, Registered, Remade, deviations

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from reproduce.physics.registration import Registration
    from reproduce.views.posterior import Posterior

FloatArray = NDArray[np.float64]
# How far stars of a pair may land apart: px, and a share of the field.
_NEAR, _SHARE = 2.0, 1e-3
# Fewer pairs do not make a robust fit.
_FEWEST = 4
_CENTRE = ("x", "y", "sigma_x", "sigma_y")


class Stars(Display):
    """The stars of one picture: centres with covariance, and what was dropped and why.

    Attributes
    ----------
    name : str
    points : ndarray, shape (n, 2), in px, the brightest first
    covariance : ndarray, shape (n, 2, 2), in px^2; zero where nothing is known of it
    dropped : DataFrame
        What else was found, with the reason.
    log : list of str
        How the picture was read, the cuts, and how many were dropped why.
    facts : dict of str to float
        Radius of a spot in px, background, noise and gain.
    picture : Image or None
    """

    def __init__(
        self, name: str, table: pd.DataFrame, covariance: FloatArray, log: Sequence[str],
        picture: Image | None = None, **facts: float,
    ) -> None:  # fmt: skip
        order = np.argsort(-table["flux"].to_numpy(), kind="stable")
        table, covariance = table.iloc[order], covariance[order]
        used = (table["dropped"] == "").to_numpy()
        self.name, self.facts, self.picture = name, facts, picture
        self.covariance = covariance[used]
        self._kept = table[used].drop(columns="dropped").reset_index(drop=True)
        self.dropped = table[~used].reset_index(drop=True)
        self.points: FloatArray = self._kept[["x", "y"]].to_numpy(float)
        reasons = self.dropped["dropped"].value_counts().items()
        self.log = [*log, *(f"dropped {count}: {reason}" for reason, count in reasons)]

    @property
    def middle(self) -> FloatArray:
        """The middle of the picture, in px; where there is none that of the stars."""
        if self.picture is None:
            return np.asarray(self.points.mean(axis=0))
        return (np.array(self.picture.light.shape[::-1]) - 1) / 2

    def __len__(self) -> int:
        """How many stars there are."""
        return len(self.points)

    def frame(self) -> pd.DataFrame:
        """Return x, y, sigma_x and sigma_y in px, flux and what else is known of each star."""
        return self._kept.copy()

    def blocks(self) -> Iterator[Block]:
        """Yield the brightest stars and the log."""
        some = self._kept.head(10)
        rows = [[str(i), *(f"{one:.6g}" for one in row)] for i, *row in some.itertuples()]
        title = f"{len(self)} stars of {self.name}, in px" + ", the brightest" * (len(self) > 10)
        yield Grid(title, ("star", *some.columns), rows)
        yield from self.log


def stars_of(source: Any, threshold: float | None = None, sep: str | None = None) -> Stars:
    """Return the stars of an image, or of a table of centroids."""
    return _found(read_image(source), threshold) if is_image(source) else _listed(source, sep)


def _listed(source: Any, sep: str | None = None) -> Stars:
    """Return the stars of a table with the columns x and y, or of an array."""
    import pandas as pd

    table = (
        read_table(source, _CENTRE[:2], (*SIGMAS, "flux", "weight"), sep)
        if is_table(source)
        else table_of(_CENTRE[:2], ("source", source))
    )
    if not len(table.values):
        raise ValueError("source: expected an image or stars, got no star")
    none = np.zeros(len(table.values))
    wide = deviations(table) if {*SIGMAS} & {*table.optional} else np.column_stack([none, none])
    frame = pd.DataFrame(np.column_stack([table.values, wide]), columns=_CENTRE)
    own = {name: one for name, one in table.optional.items() if name not in SIGMAS}
    frame = frame.assign(**{"flux": none, **own}, dropped="")
    return Stars(table.path, frame, wide[:, :, None] ** 2 * np.eye(2), table.notes)


def _found(picture: Image, threshold: float | None) -> Stars:
    """Find the stars of a picture."""
    import pandas as pd

    cut = THRESHOLD if threshold is None else threshold
    with reading(picture.name):
        found = find_spots(picture.light, picture.full, cut, picture.step, picture.sigma)
    centres = np.column_stack([found.spots.centre, _sigma(found.spots.covariance)])
    table = pd.DataFrame(centres, columns=_CENTRE)
    log = [
        f"{np.isnan(picture.light).sum()} pixels are missing, "
        f"{picture.full.sum()} are saturated, {found.hot} are hot",
        "background {background:.5g}, noise {noise:.3g}, gain {gain:.3g} electrons per number, "
        "spots of radius {radius:.3g} px".format(**found.facts),
        f"{len(table)} things above {cut:g} standard deviations",
    ]
    table = table.assign(flux=found.spots.light / found.facts["gain"], dropped=found.reasons)
    result = Stars(picture.name, table, found.spots.covariance, log, picture, **found.facts)
    if not len(result):
        causes = "; ".join(result.log[len(log) - 1 :])
        raise ImageError(f"{picture.name}: expected stars, got {causes}")
    return result


def _sigma(covariance: FloatArray) -> FloatArray:
    """Return the standard deviations of x and y, (n, 2)."""
    return np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))


def paired(
    source: Stars, target: Stars, start: Any = None, radius: float | None = None
) -> tuple[pd.DataFrame, Registration]:
    """Return the pairs of `reproduce.match`, and the transform under which they are neighbours."""
    import pandas as pd

    field = max(float(np.ptp(one.points, axis=0).max()) for one in (source, target))
    near = radius or max(_NEAR, source.facts.get("radius", 0.0)) + _SHARE * field
    start = getattr(start, "transform", start)
    if not (start is None or hasattr(start, "apply")):
        raise TypeError(f"start: expected a result of rp.register, got {start!r}")
    with reading(f"{source.name} and {target.name}"):
        rows, found = match_points(source.points, target.points, near, start)
    a, b = rows.T
    places = np.column_stack([source.points[a], target.points[b]])
    pairs = pd.DataFrame(places, columns=STARS).assign(row=a, row_reference=b)
    counts = f"{len(pairs)} pairs of {len(source)} and {len(target)} stars"
    how = "triangles of neighbours" if start is None else "the start"
    pairs.attrs["log"] = f"{counts}, by {how}, less than {near:.3g} px apart"
    pairs.attrs["mirrored"] = bool(np.linalg.det(found.matrix) < 0)
    return pairs, found


class RegisteredPictures(Registered):
    """The transform that lays one picture on another, from their stars.

    As `Registered`, and further the ``source_stars`` and ``target_stars``, their ``pairs`` with
    residuals, how far these scatter ``beyond`` the errors of the centres, and a
    ``log`` of how they were found and of what was dropped and why.
    """

    def __init__(self, source: Stars, target: Stars, pivot: Any = None, **settings: Any) -> None:
        given = {"source": source, "target": target, "pivot": pivot, **settings}
        places = (settings.pop(name, None) for name in ("start", "radius"))
        self.pairs, found = paired(source, target, *places)
        if self.pairs.attrs["mirrored"] and settings.get("model") != "affine":
            both = f"{source.name} and {target.name}"
            raise ValueError(f"{both} mirror each other: flip one, or take the model affine")
        pivot = source.middle if pivot is None else pivot
        self.source_stars, self.target_stars = source, target
        a, b = self.pairs[["row", "row_reference"]].to_numpy().T
        points = source.points[a], target.points[b]
        settings["robust"] = settings.get("robust", True) and len(a) >= _FEWEST
        known = np.stack([source.covariance[a], target.covariance[b]])
        weights, self.beyond = pair_weights(*points, pivot, known, found, **settings)
        for stars, rows in ((source, a), (target, b)):  # a user's own weights
            weights = weights * np.asarray(stars.frame().get("weight", np.ones(len(stars))))[rows]
        super().__init__(*points, pivot, weights=weights, **settings)
        self._given = given
        self.title = f"{source.name} on {target.name}: {self.title}"
        used, (x, y) = self.fit.weights > 0, self.residuals.T
        self.pairs = self.pairs.assign(residual_x=x, residual_y=y, used=used)
        out = np.count_nonzero(~used)
        self.log = [
            *(f"{one.name}: {line}" for one in (source, target) for line in one.log),
            self.pairs.attrs["log"],
            f"beyond the errors of the centres the pairs scatter by {self.beyond:.2g} px",
            *[f"dropped {out} pairs that do not fit the others"] * bool(out),
        ]
        facts = {"source": source.name, "target": target.name, "log": self.log}
        self._facts = {**facts, **self._facts, "beyond_px": self.beyond}

    def blocks(self) -> Iterator[Block]:
        """Yield the parameters, the remarks, and how the pairs were found."""
        yield from super().blocks()
        yield Fold("How the stars were found, and what was dropped", tuple(self.log))

    def landed(self) -> pd.DataFrame:
        """Return where all stars of the source land, with deviations and covariance, in px."""
        import pandas as pd

        stars = self.source_stars
        spread = self.fit.landed_covariance(stars.points, stars.covariance)
        landed = self.transform.apply(stars.points)
        columns = np.column_stack([landed, _sigma(spread), spread[:, 0, 1]])
        return pd.DataFrame(columns, columns=[*_CENTRE, "covariance_xy"])

    def posterior(self, **plan: Any) -> Posterior:
        """Return the posterior of the same transform over the pairs that are used, by emcee.

        It is that of a similarity, with the weights of the fit and the noise of a pair of mean
        weight; `plan` holds steps, walkers, seed and priors.
        """
        from reproduce.views.posterior import Posterior

        if self.model != "similarity":
            raise ValueError(f"posterior: expected the model similarity, got {self.model}")
        used = self.pairs.assign(weight=self.fit.weights)[self.pairs["used"]]
        pivot = tuple(self.transform.pivot.tolist())
        return Posterior("registration", data=used.reset_index(drop=True), pivot=pivot, **plan)

    def save(self, path: str | Path) -> Path:
        """Write the picture of the residual vectors before and after: .svg, .pdf or .png."""
        from reproduce.views.figure import painted, save

        save(painted(self._paint), Path(path))
        return Path(path)

    def _paint(self, figure: Figure) -> None:
        """Draw the pairs before and after, each with a scale of its own; those dropped in red."""
        used, source = self.pairs["used"].to_numpy(), self.pairs[["x", "y"]].to_numpy()
        before = self.pairs[["x_reference", "y_reference"]].to_numpy() - source
        figure.set_size_inches(6.4, 3.4)
        both = figure.subplots(1, 2, sharex=True, sharey=True)
        colours, span = np.where(used, "#0072B2", "#D55E00"), float(np.ptp(source, axis=0).max())
        panels = zip(both, ("before", "after"), (before, self.residuals), strict=True)
        for axes, title, arrows in panels:
            length = float(np.median(np.hypot(*arrows[used].T))) or 1.0
            axes.quiver(*source.T, *arrows.T, color=colours, angles="xy", scale_units="xy",
                        scale=20 * length / span)  # fmt: skip
            axes.set(title=f"{title}: median {length:.2g} px", aspect="equal")
            axes.set(xlabel="x (px)", ylabel="y (px)")
        both[0].invert_yaxis()

    def write(self, path: str | Path) -> Path:
        """Write the registered picture as FITS, background taken away, the transform in its header.

        Pixels that come from none of the source are NaN. A file that is there is not overwritten.
        """
        from astropy.io import fits

        if Path(path).exists():
            raise ValueError(f"path: expected a new file, got {path}. Remove it or choose another")

        picture = self.source_stars.picture
        if picture is None:
            raise ValueError("write: expected an image as the source, got a table")
        light = picture.light - self.source_stars.facts["background"]
        image = registered_image(np.nan_to_num(light), self.transform)
        inside = registered_image(1.0 * np.isfinite(light), self.transform, order=1)
        image[inside < inside.max() * (1 - 1e-9)] = np.nan
        unit = fits.PrimaryHDU(image.astype(np.float32))
        x, y = self.transform.pivot.tolist()
        entries = {"source": self.source_stars.name, "target": self.target_stars.name,
                   "model": self.model, "stars": int(self.pairs["used"].sum()),
                   "pivot-x": x, "pivot-y": y}  # fmt: skip
        for name, _, value, deviation, *_ in self.frame().itertuples():
            entries |= {name: value, f"{name}-sd": np.nan_to_num(deviation)}
        for key, entry in entries.items():
            unit.header[f"HIERARCH register {key}"] = entry
        with replacing(check_target(path, (".fits", ".fit", ".fts", ".gz"))) as part:
            unit.writeto(part)
        return Path(path)


class RegisteredChannels(Remade):
    """Several pictures of one field, each laid on the reference: a `Registered` by name."""

    def __init__(self, fits: Mapping[str, RegisteredPictures], reference: str) -> None:
        self.fits, self.reference = dict(fits), reference
        self._given = {"fits": fits, "reference": reference}

    def __getitem__(self, name: str) -> RegisteredPictures:
        """Return the registration of one picture."""
        return self.fits[name]

    def frame(self) -> pd.DataFrame:
        """Return the parameters of all, by picture."""
        import pandas as pd

        return pd.concat({name: fit.frame() for name, fit in self.fits.items()}, names=["picture"])

    def record(self) -> dict[str, Any]:
        """Return everything for other programs."""
        pictures = {name: fit.record() for name, fit in self.fits.items()}
        return {"reference": self.reference, "pictures": pictures}

    def blocks(self) -> Iterator[Block]:
        """Yield what each registration shows."""
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
    found: dict[str, Stars] = {}
    shapes: dict[str, tuple[int, ...]] = {}
    for number, source in enumerate(sources, start=1):
        own = str(source) if isinstance(source, str | Path) else getattr(source, "name", "")
        name = own if own and own not in found else f"image {number}"
        if isinstance(source, Stars):
            found[name] = source
        elif is_image(source):
            image = read_image(source, name)
            found[name], shapes[name] = _found(image, threshold), image.light.shape
        else:
            found[name] = _listed(source, sep)
        if progress is not None:
            progress(number, len(sources))
    if len(found) < 2:
        raise ValueError("target: expected a second image")
    wanted = Path(str(reference or list(found)[1]))
    chosen = next((name for name in found if Path(name) == wanted), None)
    if chosen is None:
        raise ValueError(f"reference: expected one of {', '.join(found)}, got {reference!r}")
    for name, shape in shapes.items():
        if shape != shapes.get(chosen, shape):
            raise ImageError(
                f"{name}: expected shape {shapes[chosen]} as {chosen}, got {shape}; pictures that "
                "differ are registered by rp.register(rp.stars(a), rp.stars(b))"
            )
    fits = {name: RegisteredPictures(one, found[chosen], pivot, **settings)
            for name, one in found.items() if name != chosen}  # fmt: skip
    return next(iter(fits.values())) if len(fits) == 1 else RegisteredChannels(fits, chosen)
