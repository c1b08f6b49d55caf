"""Results of `reproduce.register`, and `reproduce.misalignment`."""

from __future__ import annotations

import inspect
from abc import abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict, replace
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics import registration
from reproduce.physics.registration import Finding, fit_registration
from reproduce.physics.validate import FloatArray
from reproduce.printed.number import minus
from reproduce.store.files import FilePath
from reproduce.store.points import brightness, computing, matched_stars
from reproduce.units import ARCSEC_PER_RADIAN
from reproduce.views._blocks import Block, Display, Grid
from reproduce.views._numbers import between, moments

if TYPE_CHECKING:
    import pandas as pd

    from reproduce.physics.attitude import Platform

_LEVEL = 0.95
_CONSISTENCY_TEXTS = {
    "noise": "Noise of one coordinate, from the residuals: {:.3g} px (95 % interval {:.3g} to "
    "{:.3g}).",
    "chi_square_per_freedom": "Chi-square per degree of freedom: {:.3g} (95 % of fields with these "
    "errors: {:.3g} to {:.3g}).",
}


def misalignment(
    spots: FilePath | pd.DataFrame | Mapping[str, Any] | ArrayLike,
    zero: ArrayLike | None = None,
    platform: Platform | FilePath | None = None,
    *,
    sep: str | None = None,
) -> MisalignmentResult:
    """Return the misalignment of your camera since the zero point, from spots of its lights.

    ``findings`` names a displaced light, a pattern of another size, a spot far from its place in
    other images, repeated images, correlated images and groups of unequal noise. The last two,
    and a chi-square above 1, change the standard errors. Few images show a correlation only in
    part: if a strong motion with a correlation of 0.7 is common to all spots, 95 % intervals about
    X and Y cover about 85 % for two groups of 8 images, 87 % for 12 and 90 % for 30.

    The lights define the axes of the camera. If three or more lights do not fit the platform at
    the zero point in any size, the errors of a large angle include the uncertain axes.

    Parameters
    ----------
    spots : path or array_like, shape (frames, lights, 2)
        Images at the present, in px. Or both groups as a table or a file, as in `register`: one
        spot per row, with the columns ``group`` (0 at the zero point, 1 at the present),
        ``laser``, ``x``, ``y``, and optionally ``frame`` (a number that the spots of an image
        share; without it no spot may be lost) and ``time``. A spot that is NaN or masked in an
        array is lost, and its image has a lower weight.
    zero : array_like, shape (frames, lights, 2), optional
        Images at the zero point, if `spots` is an array.
    platform : Platform or path, optional
        Lights and tracker, or a TOML file of the arguments of `Platform`. Default: the ground
        platform of chen2023 as designed.
    sep : str, optional
        Separator of the columns of a text file. Default: a comma.

    Returns
    -------
    MisalignmentResult
        Angles about the axes of the camera. ``frame()`` returns their means with errors, and
        ``images()`` the angles of each image.

    Raises
    ------
    ValueError
        If the spots are mirrored or belong to another platform, two lights are swapped or at one
        position, or a group has fewer than two lights.
    """
    return MisalignmentResult(spots, zero, platform, sep)


class _UserResult(Display):
    """Result for your data: numbers, warnings, and the same function for other arguments."""

    title: str
    inputs: tuple[str, ...] = ()
    findings: list[Finding]
    # The public function with the arguments of the result.
    call: partial[Any]
    _function: Callable[..., Any]
    _rows: str
    _facts: dict[str, Any]

    @property
    def source(self) -> str:
        """Source code of the function that computes it."""
        return inspect.getsource(self._function).rstrip()

    @property
    def remarks(self) -> list[str]:
        """Sentences of the findings."""
        return [finding.text for finding in self.findings]

    @abstractmethod
    def frame(self) -> pd.DataFrame:
        """Return the numbers as a table."""

    @property
    def grid(self) -> Grid:
        """The numbers in the displayed format."""
        return Grid.of_frame(self.title, self.frame())

    def blocks(self) -> Iterator[Block]:
        """Yield the numbers and the warnings."""
        yield self.grid
        for finding in self.findings:
            kind = "Note" if finding.kind == "sensitive" else "Warning"
            yield minus(f"{kind}: {finding.text}.")

    def record(self) -> dict[str, Any]:
        """Return the numbers and warnings for other programs; unknown numbers are None."""
        frame = self.frame().reset_index().astype(object)
        return {
            **self._facts,
            self._rows: frame.where(frame.notna(), None).to_dict("records"),
            "findings": [asdict(finding) for finding in self.findings],
            "remarks": self.remarks,
        }

    def export(self, form: str) -> str:
        """Return the numbers as csv, json, latex or markdown."""
        from reproduce.views import _export as export  # it loads the ledger

        return export.export_frame(self.frame(), form, export.provenance_of())

    def rerun(self, **changes: Any) -> Any:
        """Return the result of other arguments; the others stay the same."""
        return self.call(**changes)


class RegistrationResult(_UserResult):
    """The transform that maps source stars onto the same stars of a target.

    A source point at the offset q from the pivot is mapped to pivot - shift + k R(rotation) q. The
    shift, in px, is the pivot minus its image: stars that moved by +3 have the shift -3. The
    rotation, in radians, is positive from x towards y.

    It has the ``model``, the ``parameters`` with their ``covariance``, the ``residuals``, target
    minus transformed source, the ``transform`` for other points, and as ``fit`` the result of
    `physics.registration.fit.fit_registration`. The warnings are ``findings``, each with its kind
    and its rows, and sentences in ``remarks``. The arguments are those of `reproduce.register`.
    """

    _function = staticmethod(fit_registration)
    _rows = "parameters"

    def __init__(
        self,
        source: Any,
        target: Any = None,
        pivot: Any = None,
        systematic: FloatArray | float = 0.0,
        **settings: Any,
    ) -> None:
        table, arguments = matched_stars(source, target, **settings)
        flux = brightness(table.numbers)
        with computing(table.path):
            pivot = registration.checked_pivot(pivot, arguments["source"])
            fit = fit_registration(pivot=pivot, **arguments)
            self.fit = fit = replace(fit, systematic=systematic)
            self.findings, terms = registration.diagnose_fit(fit, flux)
        self._sensitivities = {term.term: term for term in terms}
        self.model, self.transform = fit.transform.model, fit.transform
        self.parameters, self.residuals = fit.parameters, fit.residuals
        self.covariance, self.standard_errors = fit.covariance, fit.standard_errors
        self.title = (
            f"{self.model} from {len(fit.residuals)} stars, pivot ({pivot[0]:.6g}, "
            f"{pivot[1]:.6g}) px"
        )
        self._facts = {
            "model": self.model,
            "stars": len(fit.residuals),
            "pivot": pivot.tolist(),
            "residual_rms": float(np.sqrt(fit.squares.mean() / 2)),
            **self.consistency,
        }

    def interval(self, level: float = _LEVEL, term: str | None = None) -> FloatArray:
        """Return the lowest and highest value of each parameter.

        Parameters
        ----------
        level : float
            Probability of the interval.
        term : str, optional
            Term of `sensitivity` that may be present, such as "radial", but not ``bright - faint``.
            Default: no other term.

        Returns
        -------
        ndarray, shape (p, 2)
            Bounds, in the unit of each parameter.
        """
        if term is None:
            return self.fit.interval(level)
        # The difference of two halves is no term of a model.
        known = [name for name in self._sensitivities if name != "bright - faint"]
        if term not in known:
            raise ValueError(
                f"term: expected {', '.join(known) or 'none'}, got {term!r}. Leave it out"
            )
        one = self._sensitivities[term]
        centre = self.parameters + one.change * self.standard_errors
        ends = self.fit.interval(level, one.number) - self.parameters[:, None]
        return centre[:, None] + ends * one.error[:, None]

    @property
    def consistency(self) -> dict[str, float]:
        """Chi-square per degree of freedom, or the noise, and its range; empty if unknown.

        If errors are given, 95 % of fields with these errors have a ``chi_square_per_freedom``
        from ``low`` to ``high``. Otherwise ``noise`` is the standard deviation of one coordinate
        of weight one, in px, from the residuals, and its 95 % interval is ``low`` to ``high``.
        """
        freedom = float(self.fit.degrees_of_freedom)
        if np.isnan(self.fit.standard_errors).any() or not freedom:
            return {}
        ratio = float(self.fit.chi_square) / freedom
        low, high = self.fit.chi_square_range
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

        columns = {
            name: [*term.change, term.p_value]
            for name, term in self._sensitivities.items()
        }
        index = pd.Index([*self.fit.names, "p-value"], name="parameter")
        return pd.DataFrame(columns, index)

    def blocks(self) -> Iterator[Block]:
        """Yield the parameters, their consistency and sensitivity, and the warnings."""
        grid, *warnings = super().blocks()
        yield grid
        if consistency := self.consistency:
            yield _CONSISTENCY_TEXTS[next(iter(consistency))].format(
                *consistency.values()
            )
        if self._sensitivities:
            title = "change of each parameter with one more term, in its standard deviations"
            shown = self.sensitivity()
            if "radial" in shown:
                ends = map(_ends, self.interval(term="radial"), self.standard_errors)
                shown["95 % interval if a radial term is possible"] = [*ends, ""]
            yield Grid.of_frame(title, shown, digits=2)
        yield from warnings

    def record(self) -> dict[str, Any]:
        """Return the numbers and warnings for other programs, including the sensitivity."""
        return super().record() | {"sensitivity": self.sensitivity().to_dict()}

    def frame(self) -> pd.DataFrame:
        """Return one row per parameter: unit, value, standard deviation and 95 % interval.

        The standard deviation is NaN if the stars leave no degree of freedom, or fit exactly. The
        interval follows Student's t-distribution with the degrees of freedom.
        """
        import pandas as pd

        low, high = self.interval().T
        columns = {
            "unit": [registration.UNITS.get(name, "1") for name in self.fit.names],
            "value": self.parameters,
            "standard deviation": self.standard_errors,
            "low (95 %)": low,
            "high (95 %)": high,
        }
        return pd.DataFrame(columns, pd.Index(self.fit.names, name="parameter"))

    @property
    def grid(self) -> Grid:
        """The parameters, with two digits of their standard deviations."""
        rows = []
        for name, unit, value, error, low, high in self.frame().itertuples():
            # Further decimals of a fit without an error are rounding.
            texts = (f"{round(value, 12):z.10g}", "")
            if 0 < error < np.inf:
                texts = (moments(value, error), _ends((low, high), error))
            rows.append((name, unit, *texts))
        heads = ("parameter", "unit", "value ± standard deviation", "95 % interval")
        return Grid(self.title, heads, rows)


def _ends(ends: Iterable[float], error: float) -> str:
    """Return the ends of an interval as text."""
    return " to ".join(between(end, error) for end in ends)


class MisalignmentResult(_UserResult):
    """Misalignment of your camera in each image, from the spots of its lights.

    The warnings are ``findings``, with sentences in ``remarks``. ``diagnosis`` contains
    the agreement of both groups. The arguments are those of `reproduce.misalignment`.
    """

    _rows = "angles"

    def __init__(self, spots: Any, zero: Any, platform: Any, sep: str | None) -> None:
        # These imports are slow, and a registration does not need them.
        from reproduce.papers.chen2023.platform import INSTRUMENT, platform_of
        from reproduce.physics.attitude import diagnosis, monitored
        from reproduce.store.spots import read_images

        self.call = partial(
            misalignment, spots=spots, zero=zero, platform=platform, sep=sep
        )
        self._function, self.inputs = monitored, INSTRUMENT if platform is None else ()
        self.platform = platform_of(platform)
        images, self._labels = read_images(len(self.platform.lasers), spots, zero, sep)
        self.diagnosis = result = diagnosis.diagnose_spots(self.platform, images)
        self.findings = result.findings
        self.found = monitored(
            *result.images,
            result.platform,
            result.widening,
            result.freedom,
            result.design_variance,
        )
        self.angles = self.found.angles
        self._facts = {
            "images": len(self.angles),
            "widening": result.widening,
            **result.agreement,
        }
        self.title = (
            "misalignment in {images} images since the zero point; chi-square per degree of "
            "freedom {chi_square:.2g}, expected {low:.2g} to {high:.2g}"
        ).format(**self._facts)

    def images(self) -> pd.DataFrame:
        """Return the angles of each image about X, Y and Z of the camera, in arcsec.

        They are NaN in an image of fewer than two lights. The index is the ``time`` or ``frame`` of
        a table, or counts from one.
        """
        import pandas as pd

        index = self._labels
        if index is None:
            index = pd.RangeIndex(1, len(self.angles) + 1, name="image")
        angles = self.angles * ARCSEC_PER_RADIAN
        return pd.DataFrame(angles, index, columns=list("XYZ"))

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
        import pandas as pd

        average, (low, high) = self.found, self.found.interval(_LEVEL)
        columns = {
            "mean (arcsec)": average.mean,
            "scatter (arcsec)": average.scatter,
            "error of the mean (arcsec)": average.error,
            "95% low (arcsec)": low,
            "95% high (arcsec)": high,
        }
        index = pd.Index(list("XYZ"), name="about")
        return pd.DataFrame(columns, index) * ARCSEC_PER_RADIAN
