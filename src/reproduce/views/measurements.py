"""Results of `reproduce.register` and `reproduce.misalignment`."""

from __future__ import annotations

import inspect
import tomllib
from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics import registration
from reproduce.physics.registration import Finding, RegistrationFit, fit_registration
from reproduce.store import points
from reproduce.store.points import TableFileError, read_images
from reproduce.store.stars import brightness, matched_stars
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views.blocks import Block, Display, Grid
from reproduce.views.numbers import between, minus, moments

if TYPE_CHECKING:
    import pandas as pd

    from reproduce.physics.attitude import Platform, Stability

FloatArray = NDArray[np.float64]
_LEVEL = 0.95
_ENDS = ("low (95 %)", "high (95 %)")


class Remade(Display):
    """Result of a function of the public API that can be computed again with other arguments."""

    _given: dict[str, Any]

    @abstractmethod
    def frame(self) -> pd.DataFrame:
        """Return the numbers, a row for each."""

    def export(self, form: str) -> str:
        """Return the numbers as csv, json, latex or markdown."""
        from reproduce.views.export import export_frame  # only now: it loads the ledger

        return export_frame(
            self.frame().reset_index(), form, getattr(self, "about", None)
        )

    def rerun(self, **changes: Any) -> Self:
        """Return the same of other arguments; those that are not named stay."""
        if unknown := set(changes) - set(self._given):
            raise TypeError(
                f"unknown {sorted(unknown)}: expected {', '.join(self._given)}"
            )
        make: Any = type(self)
        again: Self = make(**{**self._given, **changes})
        return again


class _Measured(Remade):
    """Common parts of the results of your measurements."""

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
            self._rows: frame.astype(object)
            .where(frame.notna(), None)
            .to_dict("records"),
            "findings": [asdict(one) for one in self.findings],
            "remarks": self.remarks,
        }


def _grid(title: str, frame: pd.DataFrame, digits: int = 6) -> Grid:
    rows = [
        (str(name), *(minus(f"{value:z.{digits}g}") for value in row))
        for name, *row in frame.itertuples()
    ]
    return Grid(title, (str(frame.index.name), *frame.columns), rows)


class Registered(_Measured):
    """The transform that maps source stars onto the same stars of a target.

    A source point at the offset q from the pivot is mapped to pivot - shift + k R(rotation) q. The
    shift, in px, is the pivot minus its image: stars that moved by +3 have the shift -3. The
    rotation, in radians, is positive from x towards y.

    It has the ``model``, the ``parameters`` with their ``covariance``, the ``residuals``, target
    minus transformed source, the ``transform`` for other points, and as ``fit`` the result of
    `physics.registration.fit.fit_registration`. The warnings are ``findings``, each with its kind
    and its rows, and sentences in ``remarks``. ``systematic`` is a covariance that the residuals do
    not show, zero for lists of stars. The arguments are those of `reproduce.register`.
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
        flux = settings.pop("brightness", None)
        table, settings = matched_stars(source, target, settings)
        flux = brightness(table.optional) if flux is None else flux
        # Arrays are C-contiguous for the quick path of the fit.
        source, target = (table.values[:, i : i + 2].copy() for i in (0, 2))
        middle = source.mean(axis=-2)
        if pivot is not None:
            middle = registration.checked_pivot(pivot, source)
        known = {
            name: one for name, one in settings.items() if name.endswith("covariance")
        }
        with points.computing(table.path):
            self.fit: RegistrationFit = fit_registration(
                source, target, middle, **settings
            )
            self.findings: list[Finding] = registration.diagnose(
                source, target, middle, table.named, self.fit, flux, **settings
            )
            exact = registration.fits_exactly(self.fit, source, target)
            errors = self.fit.standard_errors
            if exact and not self.fit.errors_known:
                errors = np.full_like(errors, np.nan)
            self._errors: FloatArray = errors
            self._sensitivities: list[registration.Sensitivity] = []
            if not exact:
                self._sensitivities = registration.sensitivities(
                    self.fit, source, target, flux, **known
                )
        self.remarks = [*table.notes, *(one.text for one in self.findings)]
        self.systematic: FloatArray = np.zeros(2 * errors.shape)
        self.model, self.transform = str(self.fit.model), self.fit.transform
        self.parameters, self.residuals = self.fit.parameters, self.fit.residuals
        x, y = pivot = self.transform.pivot.tolist()
        count, rms = (
            len(self.residuals),
            float(np.sqrt(np.square(self.residuals).mean())),
        )
        self._facts = {
            "model": self.model,
            "stars": count,
            "pivot": pivot,
            "residual_rms": rms,
        }
        self._facts |= self.consistency
        self.title = f"{self.model} from {count} stars, pivot ({x:.6g}, {y:.6g}) px"

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the parameters, with the systematic covariance, shape (p, p)."""
        return self.fit.covariance + self.systematic

    @property
    def standard_errors(self) -> FloatArray:
        """Standard deviations of the parameters, shape (p,); NaN if unknown."""
        return np.sqrt(self._errors**2 + np.diagonal(self.systematic))

    def interval(self, level: float = _LEVEL) -> FloatArray:
        """Return the lowest and highest value of each parameter, shape (p, 2)."""
        half = (self.fit.interval(level) - self.parameters[:, None]) / self._errors[
            :, None
        ]
        return self.parameters[:, None] + half * self.standard_errors[:, None]

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
            "bright - faint" if one.term == "brightness" else one.term: [
                *one.change,
                one.p_value,
            ]
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
        yield from (
            text.format(**found) for name, text in texts.items() if name in found
        )
        if self._sensitivities:
            title = "change of each parameter with one more term, in its standard deviations"
            yield _grid(title, self.sensitivity(), digits=2)
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
            "standard deviation": self.standard_errors,
            **dict(zip(_ENDS, self.interval().T, strict=True)),
        }
        return pd.DataFrame(columns, index=pd.Index(self.fit.names, name="parameter"))

    @property
    def grid(self) -> Grid:
        """The parameters as a reader sees them, with two digits of their standard deviations."""
        rows = [
            (
                name,
                unit,
                moments(value, error),
                f"{between(low, error)} to {between(high, error)}",
            )
            if 0 < error < np.inf
            # Further decimals of a fit without an error are rounding.
            else (name, unit, f"{round(value, 12):z.10g}", "")
            for name, unit, value, error, low, high in self.frame().itertuples()
        ]
        heads = ("parameter", "unit", "value ± standard deviation", "95 % interval")
        return Grid(self.title, heads, rows)


class Monitored(_Measured):
    """Misalignment of your camera in each image, from the spots of its lights.

    The warnings are in ``findings``, and with remarks on the input in ``remarks``. ``diagnosis``
    contains the agreement of both groups. The arguments are those of `reproduce.misalignment`.
    """

    _rows = "angles"

    def __init__(self, **given: Any) -> None:
        # These imports are slow, and a registration does not need them.
        from reproduce.papers.chen2023.platform import INSTRUMENT, as_designed
        from reproduce.physics.attitude import monitored, stability
        from reproduce.physics.attitude.diagnosis import diagnose
        from reproduce.printed.given import given as printed

        self._function, self._given = monitored, given
        own, *arguments = (
            given[name] for name in ("platform", "spots", "zero", "times", "sep")
        )
        self.reads = INSTRUMENT if own is None else ()
        self.platform = (
            as_designed(printed(INSTRUMENT)) if own is None else platform_of(own)
        )
        images, self.times, notes = read_images(len(self.platform.lasers), *arguments)
        self.diagnosis = found = diagnose(self.platform, images)
        self.findings = found.findings
        self.found = monitored(
            *found.images, found.platform, found.widening, found.freedom
        )
        self.angles = self.found.angles
        self.remarks = [*(one.text for one in self.findings), *notes]
        self.stability: Stability | None = None
        if self.times is not None:
            rows = np.argsort(self.times, kind="stable")
            rows = rows[np.isfinite(self.angles[rows]).all(axis=1)]
            try:
                self.stability = stability(self.times[rows], self.angles[rows])
            except ValueError as error:
                self.remarks.append(f"drift and averages are unknown: {error}")
        self._facts = {
            "images": len(self.angles),
            "widening": found.widening,
            **found.agreement,
            "over_time": self.over_time().reset_index().to_dict("records"),
        }
        self.title = (
            "misalignment in {images} images since the zero point; chi-square per degree of "
            "freedom {chi_square:.2g}, expected {low:.2g} to {high:.2g}"
        ).format(**self._facts)

    def over_time(self) -> pd.DataFrame:
        """Return the drift per unit of time and the smallest error of an average, in arcsec.

        The table is empty without times. The drift is a straight line. The smallest error is the
        lowest Allan deviation without the drift, with its 95 % interval and the number of images.
        """
        if (found := self.stability) is None:
            return _by_axis(())[:0]
        ends = found.floor_interval(_LEVEL)
        names = ("drift", "its error", "least", *_ENDS)
        table = _by_axis(names, found.rate, found.rate_error, found.floor, *ends)
        return table.assign(**{"images averaged": found.reached})

    def blocks(self) -> Iterator[Block]:
        """Yield the angles, the remarks, and the drift if times are known."""
        yield from super().blocks()
        if self.stability is not None:
            yield _grid(
                "drift in a unit of time, and error of an average", self.over_time()
            )

    def images(self) -> pd.DataFrame:
        """Return the angles of each image about X, Y and Z of the camera, in arcsec.

        They are NaN in an image of fewer than two lights. A column ``time`` contains known times.
        """
        import pandas as pd

        index = pd.RangeIndex(1, len(self.angles) + 1, name="image")
        found = pd.DataFrame(
            self.angles * ARCSEC_PER_RADIAN, index, columns=list("XYZ")
        )
        return found if self.times is None else found.assign(time=self.times)

    def covariance(self) -> FloatArray:
        """Return the covariance of the angles of each image, (images, 3, 3), in arcsec squared.

        It attributes the scatter between images to the noise of the spots.
        """
        return self.found.covariance * ARCSEC_PER_RADIAN**2

    def frame(self) -> pd.DataFrame:
        """Return mean, scatter of one image, error and interval of the mean, in arcsec.

        The error includes the zero point, the correlation of images and the misfit of the pattern.
        The interval uses Student's t-distribution, because the scatter is an estimate.
        """
        found, names = (
            self.found,
            ("mean", "scatter", "error of the mean", "95% low", "95% high"),
        )
        return _by_axis(
            names, found.mean, found.scatter, found.error, *found.interval(_LEVEL)
        )


def _by_axis(names: Sequence[str], *columns: FloatArray) -> pd.DataFrame:
    """Return columns in arcsec, a row for each axis of the camera."""
    import pandas as pd

    shown = {
        name + " (arcsec)": one * ARCSEC_PER_RADIAN
        for name, one in zip(names, columns, strict=True)
    }
    return pd.DataFrame(shown, pd.Index(list("XYZ"), name="about"))


def platform_of(source: Platform | str | Path) -> Platform:
    """Return a platform, as given or from a TOML file of its arguments.

    The file contains ``lasers`` and ``camera_focal_length``, or ``directions``, or only ``spots``.
    """
    from reproduce.physics.attitude import Platform

    if isinstance(source, Platform):
        return source
    make: Callable[..., Platform] = Platform
    try:
        table = tomllib.loads(Path(source).read_text(encoding="utf-8"))
        if "lasers" not in table:
            make = (
                Platform.of_directions if "directions" in table else Platform.of_spots
            )
        return make(**table)
    except (TypeError, ValueError, RecursionError) as error:
        known = ", ".join(inspect.signature(make).parameters)
        raise TableFileError(f"{source}: expected TOML of {known} ({error})") from error
