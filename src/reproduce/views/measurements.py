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
from numpy.typing import NDArray

from reproduce.physics import registration
from reproduce.physics.registration import fit_registration
from reproduce.store.points import (
    TableFileError,
    brightness,
    computing,
    matched_stars,
)
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views.blocks import Block, Display, Grid
from reproduce.views.numbers import between, minus, moments

if TYPE_CHECKING:
    import pandas as pd

    from reproduce.physics.attitude import Platform, Stability

FloatArray = NDArray[np.float64]
_LEVEL = 0.95
_ENDS = ("low (95 %)", "high (95 %)")


class UserResult(Display):
    """Result of a function of the public API that can be computed again with other arguments."""

    _given: dict[str, Any]

    @abstractmethod
    def frame(self) -> pd.DataFrame:
        """Return the numbers as a table."""

    def export(self, form: str) -> str:
        """Return the numbers as csv, json, latex or markdown."""
        from reproduce.views.export import export_frame  # it loads the ledger

        return export_frame(
            self.frame().reset_index(), form, getattr(self, "provenance", None)
        )

    def rerun(self, **changes: Any) -> Self:
        """Return the result of other arguments; the others stay the same."""
        if unknown := set(changes) - set(self._given):
            raise TypeError(
                f"{sorted(unknown)[0]}: expected {', '.join(self._given)}, got another name"
            )
        make: Any = type(self)
        again: Self = make(**{**self._given, **changes})
        return again


class _Measured(UserResult):
    """Common parts of the results of your measurements."""

    title: str
    inputs: tuple[str, ...] = ()
    findings: list[Any]
    remarks: list[str]
    _function: Callable[..., Any]
    _rows: str
    _facts: dict[str, Any]

    @property
    def source(self) -> str:
        """Source text of the function that computes it."""
        return inspect.getsource(inspect.unwrap(self._function)).rstrip()

    @property
    def grid(self) -> Grid:
        """The numbers in the displayed format."""
        return _grid(self.title, self.frame())

    def blocks(self) -> Iterator[Block]:
        """Yield the numbers, the title and the remarks."""
        yield self.grid
        notes = {one.text for one in self.findings if one.kind == "sensitive"}
        for line in self.remarks:
            yield f"{'Note' if line in notes else 'Warning'}: {line}."

    def record(self) -> dict[str, Any]:
        """Return everything for other programs: `frame` by rows; unknown numbers are None."""
        frame = self.frame().reset_index().astype(object)
        return {
            **self._facts,
            self._rows: frame.where(frame.notna(), None).to_dict("records"),
            "findings": [asdict(one) for one in self.findings],
            "remarks": self.remarks,
        }


def _grid(title: str, frame: pd.DataFrame, digits: int = 6) -> Grid:
    rows = [
        (str(name), *(minus(f"{value:z.{digits}g}") for value in row))
        for name, *row in frame.itertuples()
    ]
    return Grid(title, (str(frame.index.name), *frame.columns), rows)


class RegistrationResult(_Measured):
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
        self, source: Any, target: Any = None, pivot: Any = None, **settings: Any
    ) -> None:
        self._given = {"source": source, "target": target, "pivot": pivot, **settings}
        table, settings = matched_stars(source, target, settings)
        flux = settings.pop("brightness", brightness(table.numbers))
        points = table.points("x", "y"), table.points("x_reference", "y_reference")
        with computing(table.path):
            pivot = registration.checked_pivot(pivot, points[0])
            self.fit = fit = fit_registration(*points, pivot, **settings)
            found, terms = registration.diagnose_fit(fit, flux, table.named)
        self.findings, self._sensitivities = found, terms
        self.remarks = [*table.notes, *(one.text for one in found)]
        exact = any(one.kind == "exact" for one in found)
        self._errors: FloatArray = np.where(exact, np.nan, fit.standard_errors)
        self.systematic: FloatArray = np.zeros(fit.cofactor.shape)
        self.model, self.transform = str(fit.model), fit.transform
        self.parameters, self.residuals = fit.parameters, fit.residuals
        self._facts = {
            "model": self.model,
            "stars": len(fit.residuals),
            "pivot": pivot.tolist(),
            "residual_rms": float(np.sqrt(np.square(fit.residuals).mean())),
            **self.consistency,
        }
        self.title = (
            "{model} from {stars} stars, pivot ({pivot[0]:.6g}, {pivot[1]:.6g}) px"
        ).format(**self._facts)

    @property
    def covariance(self) -> FloatArray:
        """Covariance of the parameters, with the systematic covariance, shape (p, p)."""
        return self.fit.covariance + self.systematic

    @property
    def standard_errors(self) -> FloatArray:
        """Standard errors of the parameters, shape (p,); NaN if unknown."""
        return np.sqrt(self._errors**2 + np.diagonal(self.systematic))

    def interval(self, level: float = _LEVEL) -> FloatArray:
        """Return the lowest and highest value of each parameter, shape (p, 2)."""
        centre = self.parameters[:, None]
        wider = self.standard_errors / self._errors
        return centre + (self.fit.interval(level) - centre) * wider[:, None]

    @property
    def consistency(self) -> dict[str, float]:
        """Chi-square per degree of freedom, or the noise, and its range; empty if unknown.

        If errors are given, 95 % of fields with these errors have a ``chi_square_per_freedom``
        from ``low`` to ``high``. Otherwise ``noise`` is the standard deviation of one coordinate
        of weight one, in px, from the residuals, and its 95 % interval is ``low`` to ``high``.
        """
        freedom = float(self.fit.degrees_of_freedom)
        if np.isnan(self._errors).any() or not freedom:
            return {}
        ratio = float(self.fit.chi_square) / freedom
        low, high = registration.chi_square_range(self.fit)
        if self.fit.errors_known:
            return {"chi_square_per_freedom": ratio, "low": low, "high": high}
        noise = ratio**0.5
        return {"noise": noise, "low": noise / high**0.5, "high": noise / low**0.5}

    def sensitivity(self) -> pd.DataFrame:
        """Return the change of each parameter under richer models, in its standard errors.

        Returns
        -------
        pandas.DataFrame
            Rows: parameters, and ``p-value``, the probability of such an improvement of the fit if
            the term is absent. Columns: terms of `physics.registration.sensitivities`; ``bright -
            faint`` is the difference of both halves of the stars if ``flux`` or ``mag`` is known.
        """
        import pandas as pd

        columns = {one.term: [*one.change, one.p_value] for one in self._sensitivities}
        index = pd.Index([*self.fit.names, "p-value"], name="parameter")
        return pd.DataFrame(columns, index).rename(
            columns={"brightness": "bright - faint"}
        )

    def blocks(self) -> Iterator[Block]:
        """Yield the parameters, their consistency and sensitivity, and the warnings."""
        mean, *others = super().blocks()
        yield mean
        found = self.consistency
        if "noise" in found:
            yield (
                "Noise of one coordinate, from the residuals: {noise:.3g} px (95 % interval "
                "{low:.3g} to {high:.3g})."
            ).format(**found)
        elif found:
            yield (
                "Chi-square per degree of freedom: {chi_square_per_freedom:.3g} (95 % of fields "
                "with these errors: {low:.3g} to {high:.3g})."
            ).format(**found)
        if self._sensitivities:
            title = "change of each parameter with one more term, in its standard deviations"
            yield _grid(title, self.sensitivity(), digits=2)
        yield from others

    def record(self) -> dict[str, Any]:
        """Return everything for other programs, including the sensitivity."""
        return super().record() | {"sensitivity": self.sensitivity().to_dict()}

    def frame(self) -> pd.DataFrame:
        """Return one row per parameter: unit, value, standard deviation and 95 % interval.

        The standard deviation is NaN if the stars leave no degree of freedom, or fit exactly. The
        interval follows Student's t-distribution with the degrees of freedom.
        """
        import pandas as pd

        names = pd.Index(self.fit.names, name="parameter")
        columns = {
            "unit": [registration.UNITS.get(name, "1") for name in names],
            "value": self.parameters,
            "standard deviation": self.standard_errors,
        }
        ends = dict(zip(_ENDS, self.interval().T, strict=True))
        return pd.DataFrame(columns | ends, names)

    @property
    def grid(self) -> Grid:
        """The parameters, with two digits of their standard deviations."""
        rows = []
        for name, unit, value, error, low, high in self.frame().itertuples():
            # Further decimals of a fit without an error are rounding.
            texts = (f"{round(value, 12):z.10g}", "")
            if 0 < error < np.inf:
                ends = f"{between(low, error)} to {between(high, error)}"
                texts = (moments(value, error), ends)
            rows.append((name, unit, *texts))
        heads = ("parameter", "unit", "value ± standard deviation", "95 % interval")
        return Grid(self.title, heads, rows)


class MisalignmentResult(_Measured):
    """Misalignment of your camera in each image, from the spots of its lights.

    The warnings are in ``findings``, and with remarks on the input in ``remarks``. ``diagnosis``
    contains the agreement of both groups. The arguments are those of `reproduce.misalignment`.
    """

    _rows = "angles"

    def __init__(self, **given: Any) -> None:
        # These imports are slow, and a registration does not need them.
        from reproduce.papers.chen2023.platform import INSTRUMENT, as_designed
        from reproduce.physics.attitude import diagnosis, monitored, stability
        from reproduce.printed.inputs import load_inputs as printed
        from reproduce.store.spots import read_images

        self._function, self._given = monitored, given
        own, *arguments = (
            given[name] for name in ("platform", "spots", "zero", "times", "sep")
        )
        self.inputs = INSTRUMENT if own is None else ()
        self.platform = (
            as_designed(printed(INSTRUMENT)) if own is None else platform_of(own)
        )
        images, self.times, notes = read_images(len(self.platform.lasers), *arguments)
        self.diagnosis = found = diagnosis.diagnose_spots(self.platform, images)
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
