"""Registration of your stars with the models and errors of `fit_registration`.

Chi-square at any parameters is that of the fit. If covariances are given, they are the noise.
Otherwise the noise of a star of weight one is a parameter. Parameters and their order are those of
`transforms.MODELS`, then the noise.

If the source has errors, the true place of a star has the Jeffreys prior for given parameters.
With a flat prior the estimate of the scale would be inconsistent (Neyman and Scott, 1948).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.random import Generator

from reproduce.inference import LogUniform, Model, Normal, Parameter, Prior, Uniform
from reproduce.inference.models.registration import (
    ComplexArray,
    GaussianRegistration,
    _registration_parameters,
)
from reproduce.physics.registration import (
    MODELS,
    UNITS,
    Problem,
    as_complex,
    fits_exactly,
    paired_points,
    prepare,
    residuals_at,
    robust_similarity,
)
from reproduce.physics.validate import FloatArray

# Bounds of the noise, as multiples of the residual of least squares.
_NOISE = (1e-9, 1e3)
# Half-widths of priors: of a shift in fields, of any parameter in standard errors, of a scale in
# ratios of the sizes of both patterns.
FIELDS, ERRORS, SCALES = 10.0, 1e3, 10.0
# Parameter vectors times stars that are evaluated together. This bounds the memory.
_TOGETHER = 1_000_000


@dataclass(frozen=True, eq=False)
class FittedRegistration(GaussianRegistration):
    """A registration with any model and any errors that `fit_registration` accepts.

    - `model`: a key of `MODELS`.
    - `weights`, optional, (n,): above zero.
    - `source_covariance`, `target_covariance`, optional, (n, 2, 2): of each star, in px^2.
    """

    model: str = "similarity"
    weights: FloatArray | None = None
    source_covariance: FloatArray | None = None
    target_covariance: FloatArray | None = None

    @property
    def settings(self) -> dict[str, Any]:
        """The arguments of `fit_registration` other than the points."""
        names = ("weights", "model", "source_covariance", "target_covariance")
        return {name: getattr(self, name) for name in names}

    @cached_property
    def problem(self) -> Problem:
        """The points with their errors."""
        return prepare(self.source, self.target, self.pivot, **self.settings)

    @cached_property
    def _own(self) -> FloatArray:
        """Inverse covariance of each star at the fit, without the noise, shape (n, 2, 2)."""
        own = residuals_at(self.problem, self.fit.parameters[None])[1].reshape(-1, 2, 2)
        return np.asarray(self.problem.counts[:, None, None] * own)

    @cached_property
    def _round(self) -> bool:
        """Whether three sums over all stars are sufficient."""
        if self.model != "similarity" or self.source_covariance is not None:
            return False
        return bool((self._own == self._own[:, :1, :1] * np.eye(2)).all())

    @cached_property
    def precision(self) -> FloatArray:
        """Reciprocal standard deviation of each star, without the noise, (n,)."""
        return np.sqrt(self._own[:, 0, 0])

    def _split(self, parameters: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the parameters of the transform, (n, p), and the noise, (n, 1)."""
        moved = parameters[:, : len(MODELS[self.model])]
        known = self.problem.errors_known
        return moved, np.ones((len(moved), 1)) if known else parameters[:, -1:]

    def __call__(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood, shape (n,)."""
        if self._round:
            return super().__call__(np.column_stack(self._split(parameters)))
        parts = np.array_split(
            parameters, -(-parameters.size * len(self.source) // _TOGETHER)
        )
        return np.concatenate([self.pointwise(part).sum(axis=-1) for part in parts])

    def pointwise(self, parameters: FloatArray) -> FloatArray:
        """Log likelihood of each star, shape (n, points)."""
        moved, noise = self._split(parameters)
        left, inverse = residuals_at(self.problem, moved)
        squares = self.problem.counts * np.vecdot(
            left, (inverse @ left[..., None])[..., 0]
        )
        constant = 0.5 * np.linalg.slogdet(self._own)[1] - np.log(2 * np.pi * noise**2)
        return np.asarray(constant - squares / (2 * noise**2))

    def predicted(self, parameters: FloatArray) -> ComplexArray:
        """Predicted target points about the pivot, shape (n, points)."""
        moved, _ = self._split(parameters)
        places = self.target - residuals_at(self.problem, moved)[0]
        return np.asarray(as_complex(places) - as_complex(self.pivot))

    def scatter(self, parameters: FloatArray, generator: Generator) -> FloatArray:
        """Noise of residuals, shape (n, points, 2), in px."""
        normal = generator.normal(size=(len(parameters), *self.source.shape, 1))
        # Any matrix whose product with its transpose is the covariance.
        root = np.linalg.inv(np.linalg.cholesky(self._own)).mT
        return np.asarray(
            self._split(parameters)[1][..., None] * (root @ normal)[..., 0]
        )

    def start(self) -> tuple[FloatArray, FloatArray]:
        """The fit and its standard errors."""
        known = self.problem.errors_known
        return (
            (self.fit.parameters, self.fit.standard_errors)
            if known
            else super().start()
        )


def fitted_model(likelihood: FittedRegistration) -> Model:
    """Return the registration of your stars, with priors on the scale of the data.

    A flat prior ends as far from the fit as the data allow. Points that fit without any error are
    a ValueError if the noise is unknown.

    Examples
    --------
    >>> points = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> moved = points + [[1, 0], [0, 1], [1, 1], [0, 0]]
    >>> model = fitted_model(FittedRegistration(points, moved, np.zeros(2)))
    >>> print(model.parameters[1].prior)
    uniform from -3.14159 to 3.14159
    """
    source, target = paired_points(likelihood.source, likelihood.target)
    known = likelihood.problem.errors_known
    names = MODELS[likelihood.model]
    least = (len(names) + 1) // 2 + (0 if known else 2)
    if len(source) < least:
        raise ValueError(
            f"source: expected at least {least} points, got {len(source)}. Add stars, or give "
            "their errors"
        )
    fit, priors = likelihood.fit, _priors(likelihood)
    usual = {one.name: one for one in _registration_parameters(source, target)}
    parameters = [
        replace(usual[name], prior=priors[name])
        if name in usual
        else Parameter(name, f"a_{{{name}}}", UNITS.get(name, "1"), priors[name])
        for name in names
    ]
    if not known and fits_exactly(fit, source, target):
        found = zip(parameters, fit.parameters.tolist(), strict=True)
        told = (
            f"{one.name} {value * one.shown:.10g} {one.unit}" for one, value in found
        )
        raise ValueError(
            "the points fit without any error, so there is no noise to sample; exactly: "
            + ", ".join(told).replace(" 1,", ",")
        )
    if not known:
        residual = float(likelihood.start()[0][-1])
        noise = LogUniform(
            _NOISE[0] * residual,
            _NOISE[1] * residual,
            "no scale preferred: from "
            "a billionth of the residuals of least squares to a thousand times "
            "them",
        )
        parameters.append(replace(usual["noise"], prior=noise))
    estimate = dict(zip(names, fit.parameters.tolist(), strict=True))
    return Model("registration", tuple(parameters), likelihood, estimate)


def _priors(likelihood: FittedRegistration) -> dict[str, Prior]:
    """Return the flat priors of the parameters of the transform."""
    source, target, fit = likelihood.source, likelihood.target, likelihood.fit
    robust = robust_similarity(source, target, likelihood.pivot)
    # No least-squares scale exceeds the ratio of the sizes of both patterns.
    wide, narrow = (
        float(np.linalg.norm(one - one.mean(axis=0))) for one in (target, source)
    )
    size = max(wide / narrow, float(robust.parameters[0]))
    width = float(np.ptp(target, axis=0).max())
    reach = {
        "scale": SCALES * size,
        "rotation": np.pi,
        "radial": likelihood.field**-2.0,
    }
    reach |= dict.fromkeys(("shift-x", "shift-y"), FIELDS * width)
    reach |= dict.fromkeys(MODELS["affine"][:4], SCALES * size)
    reasons = {
        "scale": "up to ten times the ratio of the sizes of both patterns; flat",
        "rotation": "any: the full turn, cut opposite to least squares",
    }
    found: dict[str, Prior] = {}
    errors = np.nan_to_num(fit.standard_errors)
    for name, value, error in zip(fit.names, fit.parameters, errors, strict=True):
        half = reach[name] if name in reasons else max(reach[name], ERRORS * error)
        low, high = (0.0, half) if name == "scale" else (value - half, value + half)
        place = "ten times the largest plausible value, or a thousand standard errors"
        found[name] = Uniform(float(low), float(high), reasons.get(name, place))
    return found


# Models that are linear, the similarity in k cos(theta) and k sin(theta).
_LINEAR = ("shift", "similarity", "affine")
# Draws that are made for each one that is asked for, since bounds of priors leave some out.
_SPARE = 10


def exact_draws(model: Model, count: int, generator: Generator) -> FloatArray:
    """Return independent draws of a registration in closed form, shape (count, d).

    The posterior of a linear model with flat priors is normal given the noise, and the noise has
    an inverse gamma distribution. Rejection carries the draws over to priors that are flat in
    scale and rotation, with their bounds. Other models and priors are a ValueError.
    """
    likelihood = model.likelihood
    settings = getattr(likelihood, "settings", {})
    name = settings.get("model", "similarity")
    if (
        type(likelihood) not in (GaussianRegistration, FittedRegistration)
        or settings.get("source_covariance") is not None
        or name not in _LINEAR
        or any(isinstance(one.prior, Normal) for one in model.parameters)
    ):
        raise ValueError(
            "exact: expected a shift, similarity or affine registration with uniform priors and no "
            f"errors of the source, got {model.name}, {name}. Use the draws of emcee"
        )
    fit, many = model.likelihood_of(GaussianRegistration).fit, _SPARE * count
    mean, turn, noise = (
        fit.parameters.copy(),
        np.eye(len(fit.parameters)),
        np.ones((many, 1)),
    )
    if not fit.errors_known:
        squares = fit.chi_square / generator.chisquare(
            float(fit.degrees_of_freedom), many
        )
        noise = np.sqrt(squares)[:, None]
    if name == "similarity":
        scale, angle = mean[:2]
        mean[:2] = scale * np.cos(angle), scale * np.sin(angle)
        turn[:2, :2] = [[np.cos(angle), -mean[1]], [np.sin(angle), mean[0]]]
    root = np.linalg.cholesky(turn @ fit.cofactor @ turn.T)
    rows = mean + noise * (generator.normal(size=(many, len(mean))) @ root.T)
    # Flat in scale and rotation is flat in the two parts divided by the scale.
    kept = np.ones(many)
    if name == "similarity":
        factors = rows[:, 0] + 1j * rows[:, 1]
        kept = np.abs(factors).min() / np.abs(factors)
        rows[:, 0], rows[:, 1] = (
            np.abs(factors),
            angle + np.angle(factors / np.exp(1j * angle)),
        )
    rows = np.hstack([rows, noise])[:, : model.dimension]
    # The prior of the noise is that of the closed form within its bounds.
    inside = np.isfinite(model.log_prior(rows)) & (generator.uniform(size=many) < kept)
    if inside.sum() < count:
        raise ValueError(
            f"exact: expected priors that hold most of the posterior, got {inside.mean():.2g} of "
            "it. Use the draws of emcee"
        )
    return rows[inside][:count]
