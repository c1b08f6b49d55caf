"""What the front door returns for a user's own stars, and for a user's own lasers."""

from __future__ import annotations

import inspect
import tomllib
from abc import abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics import registration
from reproduce.physics.registration import Finding, RegistrationFit, fit_registration
from reproduce.store import points
from reproduce.store.points import STARS, Table, TableFileError, is_table, read_images, table_of
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views.blocks import Block, Display, Grid
from reproduce.views.numbers import between, moments

if TYPE_CHECKING:
    import pandas as pd

    from reproduce.physics.attitude import Platform, Stability

FloatArray = NDArray[np.float64]
_LEVEL = 0.95
SIGMAS = ("sigma", "sigma_x", "sigma_y")
BRIGHTNESS = ("flux", "mag")
_ENDS = ("low (95 %)", "high (95 %)")


class Remade(Display):
    """What a function of the front door made, and makes again with some arguments changed."""

    _given: dict[str, Any]

    @abstractmethod
    def frame(self) -> pd.DataFrame:
        """Return the numbers, a row for each."""

    def export(self, form: str) -> str:
        """Return the numbers as csv, json, latex or markdown."""
        from reproduce.views.export import export_frame  # only now: it loads the ledger

        return export_frame(self.frame().reset_index(), form, getattr(self, "about", None))

    def rerun(self, **changes: Any) -> Self:
        """Return the same of other arguments; those that are not named stay."""
        if unknown := set(changes) - set(self._given):
            raise TypeError(f"unknown {sorted(unknown)}: expected {', '.join(self._given)}")
        make: Any = type(self)
        again: Self = make(**{**self._given, **changes})
        return again


class _Measured(Remade):
    """What results of a user's own measurements share."""

    title: str
    reads: tuple[str, ...] = ()
    findings: Sequence[Any]
    remarks: list[str]
    _function: Callable[..., Any]
    _rows: str
    _facts: dict[str, Any]

    @property
    def source(self) -> str:
        """The text of the function that computes it."""
        return inspect.getsource(inspect.unwrap(self._function)).rstrip()

    @property
    def grid(self) -> Grid:
        """The numbers as a reader sees them."""
        return _grid(self.title, self.frame())

    def blocks(self) -> Iterator[Block]:
        """Yield the numbers, the title and the remarks."""
        yield self.grid
        notes = {one.text for one in self.findings if one.kind == "sensitive"}
        for line in self.remarks:
            yield f"{'Note' if line in notes else 'Warning'}: {line}."

    def record(self) -> dict[str, Any]:
        """Return everything for other programs: `frame` by rows; what is not known is None."""
        frame = self.frame().reset_index()
        return {
            **self._facts,
            self._rows: frame.astype(object).where(frame.notna(), None).to_dict("records"),
            "findings": [asdict(one) for one in self.findings],
            "remarks": self.remarks,
        }


def _grid(title: str, frame: pd.DataFrame) -> Grid:
    rows = [(name, *(f"{value:.6g}" for value in row)) for name, *row in frame.itertuples()]
    return Grid(title, (str(frame.index.name), *frame.columns), rows)


class Registered(_Measured):
    """The transform that lays a user's own stars, the source, on the same stars of a target.

    A source point at q from the pivot lands at pivot - shift + k R(rotation) q. So the shift, in
    px, is where the pivot was minus where it lands: stars that moved by +3 have the shift -3. The
    rotation, in radians, is positive from x towards y.

    It has the ``model``, the ``parameters`` with their ``covariance``, the ``residuals``, target
    minus transformed source, the ``transform`` for other points, and as ``fit`` all that
    `physics.registration.fit.fit_registration` returns. What is doubtful stands in ``findings``,
    each with its kind and its rows, and as sentences in ``remarks``. It is made from the arguments
    of `reproduce.register`.
    """

    _function = staticmethod(fit_registration)
    _rows = "parameters"

    def __init__(
        self,
        source: str | Path | ArrayLike,
        target: ArrayLike | None = None,
        pivot: ArrayLike | None = None,
        **settings: Any,
    ) -> None:
        self._given = {"source": source, "target": target, "pivot": pivot, **settings}
        brightness = settings.pop("brightness", None)
        table, settings = _stars(source, target, settings)
        if brightness is None:
            brightness = _brightness(table.optional)
        # Arrays are C-contiguous for the quick path of the fit.
        source, target = (table.values[:, i : i + 2].copy() for i in (0, 2))
        middle = source.mean(axis=-2)
        if pivot is not None:
            middle = registration.checked_pivot(pivot, source)
        known = {name: one for name, one in settings.items() if name.endswith("covariance")}
        with points.computing(table.path):
            self.fit: RegistrationFit = fit_registration(source, target, middle, **settings)
            self.findings: list[Finding] = registration.diagnose(
                source, target, middle, table.named, self.fit, brightness, **settings
            )
            exact = registration.fits_exactly(self.fit, source, target)
            errors = self.fit.standard_errors
            if exact and not self.fit.errors_known:
                errors = np.full_like(errors, np.nan)
            self._errors: FloatArray = errors
            self._sensitivities: list[registration.Sensitivity] = []
            if not exact:
                self._sensitivities = registration.sensitivities(
                    self.fit, source, target, brightness, **known
                )
        self.remarks = [*table.notes, *(one.text for one in self.findings)]
        self.model, self.transform = str(self.fit.model), self.fit.transform
        self.parameters, self.residuals = self.fit.parameters, self.fit.residuals
        x, y = pivot = self.transform.pivot.tolist()
        count, rms = len(self.residuals), float(np.sqrt(np.square(self.residuals).mean()))
        self._facts = {"model": self.model, "stars": count, "pivot": pivot, "residual_rms": rms}
        self._facts |= self.consistency
        self.title = f"{self.model} from {count} stars, pivot ({x:.6g}, {y:.6g}) px"

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the parameters."""
        return self.fit.covariance

    def interval(self, level: float = _LEVEL) -> FloatArray:
        """Return the lowest and highest value of each parameter, shape (p, 2)."""
        found = self.fit.interval(level)
        found[np.isnan(self._errors)] = np.nan
        return found

    @property
    def consistency(self) -> dict[str, float]:
        """Chi-square per degree of freedom, or the noise, and its range; empty if unknown.

        If errors are given, 95 % of fields with these errors have a ``chi_square_per_freedom``
        from ``low`` to ``high``. Otherwise ``noise`` is the standard deviation of one coordinate
        of weight one, in px, from the residuals, and its 95 % interval is ``low`` to ``high``.
        """
        if np.isnan(self._errors).any() or not self.fit.degrees_of_freedom:
            return {}
        ratio = float(self.fit.chi_square) / float(self.fit.degrees_of_freedom)
        low, high = registration.chi_square_range(self.fit)
        if self.fit.errors_known:
            return {"chi_square_per_freedom": ratio, "low": low, "high": high}
        noise = ratio**0.5
        return {"noise": noise, "low": noise / high**0.5, "high": noise / low**0.5}

    def sensitivity(self) -> pd.DataFrame:
        """Return the change of each parameter under richer models, in its standard deviations.

        Returns
        -------
        pandas.DataFrame
            Rows: parameters, and ``p-value``, the probability of such an improvement of the fit if
            the term is absent. Columns: terms of `physics.registration.sensitivities`; ``bright -
            faint`` is the difference of both halves of the stars if ``flux`` or ``mag`` is known.
        """
        import pandas as pd

        columns = {
            "bright - faint" if one.term == "brightness" else one.term: [*one.change, one.p_value]
            for one in self._sensitivities
        }
        index = pd.Index([*self.fit.names, "p-value"], name="parameter")
        return pd.DataFrame(columns, index)

    def blocks(self) -> Iterator[Block]:
        """Yield the parameters, their consistency and sensitivity, and the warnings."""
        mean, *others = super().blocks()
        yield mean
        texts = {
            "noise": "Noise of one coordinate, from the residuals: {noise:.3g} px (95 % interval "
            "{low:.3g} to {high:.3g}).",
            "chi_square_per_freedom": "Chi-square per degree of freedom: "
            "{chi_square_per_freedom:.3g} (95 % of fields with these errors: {low:.3g} to "
            "{high:.3g}).",
        }
        found = self.consistency
        yield from (text.format(**found) for name, text in texts.items() if name in found)
        if self._sensitivities:
            frame = self.sensitivity()
            rows = [
                (
                    name,
                    *(
                        f"{round(value, 2) if name in self.fit.names else value:z.2g}"
                        for value in row
                    ),
                )
                for name, *row in frame.itertuples()
            ]
            title = "change of each parameter with one more term, in its standard deviations"
            yield Grid(title, ("parameter", *frame.columns), rows)
        yield from others

    def record(self) -> dict[str, Any]:
        """Return everything for other programs, including the sensitivity."""
        return super().record() | {"sensitivity": self.sensitivity().to_dict()}

    def frame(self) -> pd.DataFrame:
        """Return one row per parameter: unit, value, standard deviation and 95 % interval.

        Returns
        -------
        pandas.DataFrame
            The deviation is NaN where the stars leave none to spare, or fit without any error. The
            interval follows Student's t with the degrees of freedom.
        """
        import pandas as pd

        columns = {
            "unit": [registration.UNITS.get(name, "1") for name in self.fit.names],
            "value": self.parameters,
            "standard deviation": self._errors,
            **dict(zip(_ENDS, self.interval().T, strict=True)),
        }
        return pd.DataFrame(columns, index=pd.Index(self.fit.names, name="parameter"))

    @property
    def grid(self) -> Grid:
        """The parameters as a reader sees them, with two digits of their standard deviations."""
        rows = [
            (name, unit, moments(value, error), f"{between(low, error)} to {between(high, error)}")
            if 0 < error < np.inf
            # Of a fit without an error further decimals are rounding.
            else (name, unit, f"{round(value, 12):z.10g}", "")
            for name, unit, value, error, low, high in self.frame().itertuples()
        ]
        heads = ("parameter", "unit", "value ± standard deviation", "95 % interval")
        return Grid(self.title, heads, rows)


def _stars(
    source: Any, target: ArrayLike | None, settings: dict[str, Any]
) -> tuple[Table, dict[str, Any]]:
    """Read both images, and turn columns of sigma and weight into settings of the fit."""
    sep = settings.pop("sep", None)
    if is_table(source) and target is None:
        table = points.read_table(source, STARS, (*SIGMAS, "weight", *BRIGHTNESS), sep)
        return table, settings | _known(table, settings)
    if isinstance(source, str | Path):
        raise ValueError("target: expected nothing beside a file, which holds both images")
    if target is None:
        raise ValueError("target: expected the stars of the other image, or a file of both")
    both = {name: _places(name, one, sep) for name, one in (("source", source), ("target", target))}
    table = table_of(STARS, *both.items())
    if table.notes:  # what is given of each star goes with it
        sizes = {"weights": 1, "source_covariance": 3, "target_covariance": 3}
        for name, axes in sizes.items():
            value = settings.get(name)
            if value is not None and np.ndim(value) == axes:
                settings = settings | {name: np.asarray(value)[table.rows]}
    return table, settings


def _brightness(columns: Mapping[str, FloatArray]) -> FloatArray | None:
    """Return a number that increases with the flux of each star, or None if none is known."""
    return columns["flux"] if "flux" in columns else -columns["mag"] if "mag" in columns else None


def _places(name: str, source: Any, sep: str | None) -> Any:
    """Return an array, or the columns x and y of a table without a mask."""
    if not is_table(source):
        return source
    table = points.read_table(source, ("x", "y"), sep=sep, name=name)
    if table.notes:
        raise TableFileError(
            f"{table.path}, column mask: expected no masked rows in two tables. Put the stars of "
            f"both into one table with the columns {', '.join(STARS)}"
        )
    return table.values


def _known(table: Table, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return weights and the covariance of the target that the columns of a table give."""
    found: dict[str, Any] = {}
    given = table.optional
    if "weight" in given:
        found["weights"] = given["weight"]
    if {*SIGMAS} & {*given}:
        found["target_covariance"] = deviations(table)[..., None] ** 2 * np.eye(2)
    for name in found:
        if settings.get(name) is not None:
            raise ValueError(f"{name}: expected none beside a column of the table; leave one out")
    return found


def deviations(table: Table) -> FloatArray:
    """Return the standard deviations along x and y that the columns of a table give, (n, 2)."""
    given = table.optional
    axes = [next((one for one in (f"sigma_{axis}", "sigma") if one in given), "") for axis in "xy"]
    if not all(axes):
        raise TableFileError(f"{table.path}: expected sigma, or both sigma_x and sigma_y")
    for name in axes:
        for row in np.flatnonzero(given[name] <= 0)[:1].tolist():
            raise table.wrong(row, name, "expected a standard deviation above zero")
    return np.stack([given[name] for name in axes], axis=-1)


class Monitored(_Measured):
    """The misalignment of a user's own camera, image by image.

    What is doubtful about the spots stands in ``findings``, and with what the reading says in
    ``remarks``. It is made from the arguments of `reproduce.misalignment`.
    """

    _rows = "angles"

    def __init__(
        self,
        spots: str | Path | ArrayLike,
        zero: ArrayLike | None = None,
        platform: Platform | str | Path | None = None,
        times: ArrayLike | None = None,
        sep: str | None = None,
    ) -> None:
        # Only now: a user's own stars need no attitude and no paper.
        from reproduce.papers.chen2023.platform import INSTRUMENT, as_designed
        from reproduce.physics.attitude import diagnosis, monitored
        from reproduce.printed.given import given

        self._function = monitored
        self._given = {
            "spots": spots,
            "zero": zero,
            "platform": platform,
            "times": times,
            "sep": sep,
        }
        self.reads = INSTRUMENT if platform is None else ()
        self.platform = (
            as_designed(given(INSTRUMENT)) if platform is None else platform_of(platform)
        )
        images, self.times, notes = read_images(spots, zero, len(self.platform.lasers), times, sep)
        chosen, images, lights = diagnosis.seen(self.platform, images)
        self.findings = diagnosis.diagnose(chosen, images, numbers=lights)
        name = str(spots) if isinstance(spots, str | Path) else "the spots"
        diagnosis.refuse(self.findings, name)
        self.found = monitored(*images, chosen)
        self.angles = self.found.angles
        self.remarks = [*(one.text for one in self.findings), *notes]
        self.stability = self._over_time()
        self._facts = {"images": len(self.angles)}
        self.title = f"misalignment in {len(self.angles)} images since the zero point"

    def _over_time(self) -> Stability | None:
        """Return drift and averages of the images in the order of their times, where there are."""
        from reproduce.physics.attitude import stability

        if self.times is None:
            return None
        order = np.argsort(self.times, kind="stable")
        told = order[np.isfinite(self.angles[order]).all(axis=1)]
        try:
            return stability(self.times[told], self.angles[told])
        except ValueError as error:
            self.remarks.append(f"drift and averages are not told: {error}")
            return None

    def over_time(self) -> pd.DataFrame:
        """Return the drift in a unit of time, and what averages of images err by at the least.

        In arcsec, without rows where no times are known. The drift is a straight line; the least
        is the lowest Allan deviation without it, with its 95 % interval and the images averaged.
        """
        found = self.stability
        if found is None:
            return _by_axis({})[:0]
        ends = found.floor_interval(_LEVEL)
        columns = {"drift": found.rate, "its error": found.rate_error, "least": found.floor,
                   _ENDS[0]: ends[0], _ENDS[1]: ends[1]}  # fmt: skip
        return _by_axis(columns).assign(**{"images averaged": found.reached})

    def blocks(self) -> Iterator[Block]:
        """Yield the numbers, those of a series where times are known, and the remarks."""
        mean, *others = super().blocks()
        yield mean
        if self.stability is not None:
            title = "drift in a unit of time, and the least error of an average beside it"
            yield _grid(title, self.over_time())
        yield from others

    def record(self) -> dict[str, Any]:
        """Return everything for other programs, what averages reach over time too."""
        series = self.over_time().reset_index().to_dict("records")
        return super().record() | {"over_time": series}

    def images(self) -> pd.DataFrame:
        """Return the angles of every image about X, Y and Z of the camera, in arcsec.

        They are NaN where fewer than two lights are seen. A column ``time`` goes with them where
        times are known.
        """
        import pandas as pd

        index = pd.RangeIndex(1, len(self.angles) + 1, name="image")
        found = pd.DataFrame(self.angles * ARCSEC_PER_RADIAN, index, columns=list("XYZ"))
        return found if self.times is None else found.assign(time=self.times)

    def covariance(self) -> FloatArray:
        """Return the covariance of the angles of every image, (images, 3, 3), in arcsec squared.

        From the scatter of the images, which is taken for noise of the spots alone.
        """
        return self.found.covariance() * ARCSEC_PER_RADIAN**2

    def frame(self) -> pd.DataFrame:
        """Return mean, scatter of one image, error and interval of the mean, in arcsec.

        The error counts both groups: the zero point is itself a mean over images. The interval is
        by Student's law: the scatter of the images is estimated.
        """
        found = self.found
        columns = {"mean": found.mean, "scatter": found.scatter, "error of the mean": found.error}
        low, high = found.interval(_LEVEL)
        return _by_axis(columns | {f"{_LEVEL:.0%} low": low, f"{_LEVEL:.0%} high": high})


def _by_axis(columns: Mapping[str, FloatArray]) -> pd.DataFrame:
    """Return columns in arcsec, a row for each axis of the camera."""
    import pandas as pd

    shown = {f"{name} (arcsec)": one * ARCSEC_PER_RADIAN for name, one in columns.items()}
    return pd.DataFrame(shown, pd.Index(list("XYZ"), name="about"))


def platform_of(source: Platform | str | Path) -> Platform:
    """Return a platform, as it is or from a TOML file of the arguments that make one.

    Beside the tracker's numbers stand ``lasers`` and ``camera_focal_length``, or ``directions``, or
    ``spots`` alone.
    """
    from reproduce.physics.attitude import Platform

    if isinstance(source, Platform):
        return source
    try:
        table = tomllib.loads(Path(source).read_text(encoding="utf-8"))
    except (ValueError, RecursionError) as error:  # no TOML, no text, or lists in lists
        raise TableFileError(f"{source}: expected TOML ({error})") from error
    make: Any = Platform if "lasers" in table else Platform.of_spots
    make = Platform.of_directions if "directions" in table else make
    try:
        platform: Platform = make(**table)
    except (TypeError, ValueError) as error:
        known = ", ".join(inspect.signature(make).parameters)
        raise TableFileError(f"{source}: expected {known} ({error})") from error
    return platform
