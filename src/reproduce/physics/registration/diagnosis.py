"""Checks of a registration: its residuals, its model and its stars.

Image points have shape (n, 2), in px, as in `fit`. One diagnosis serves arrays, tables and images.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reproduce.physics import validate
from reproduce.physics.registration._least_squares import (
    information,
    local_matrix,
    model_jacobian,
    prepare,
    thinned,
)
from reproduce.physics.registration.fit import (
    _ALARM,
    _MEDIAN_LENGTH,
    RegistrationFit,
    fit_registration,
)
from reproduce.physics.validate import Finding, FloatArray

# Probability of a warning of the model if it is right, and of the errors if they are right.
FALSE_ALARM = 0.05
# Residuals below this fraction of the coordinates are rounding.
_EXACT_FRACTION = 1e-11
# Number of stars from which wrong matches are sought only if a residual is large.
_LARGE_FIELD = 8_000
# Number of stars, spread over the rows, with which models are compared.
_MAX_COMPARED = 100_000
# Smallest number of degrees of freedom with which the other stars can show a wrong match.
_MIN_FREEDOM = 4
# Smallest number of stars with which a robust fit can detect two wrong matches.
_MIN_STARS_ROBUST = 8
# Smallest span, in px, and largest ratio of the spans of two images in pixels.
_MIN_SPAN, _MAX_RATIO = 50.0, 20.0
# Largest distance of the pivot from the stars, in fields. Beyond, the shift loses digits.
_MAX_FIELDS = 100.0
# Ratio of width to length below which the stars lie in a line.
_LINE_RATIO = 1e-3
# Fraction of stars with equal displacements above which rounding hides the noise.
_MAX_TIED = 0.1
# Smallest independent fraction of a term, and the number added to the diagonal to measure it.
_MIN_INDEPENDENT, _RIDGE = 1e-4, 1e-12
# Terms that a model does not contain, and the model that does. No model contains a tilt.
_DISTORTIONS = ("radial", "tilt", "affine")
_RICHER = {
    "shift": ("rotation", "scale", *_DISTORTIONS),
    "rigid": ("scale", *_DISTORTIONS),
    "similarity": _DISTORTIONS,
    "similarity+radial": ("tilt", "affine"),
    "affine": ("radial", "tilt"),
}
# Change of a parameter that exceeds the half of its 95 % interval, in standard deviations.
_MAX_CHANGE = 2.0
_NAMES = {
    "radial": "a radial term",
    "tilt": "a tilt term",
    "affine": "an affine term",
    "scale": "a scale",
    "rotation": "a rotation",
}
_MODELS = {
    "rotation": "rigid",
    "scale": "similarity",
    "radial": "similarity+radial",
    "affine": "affine",
}

_Named = Callable[[Sequence[int]], str]


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Change of the parameters if the model had one more term.

    Attributes
    ----------
    term : str
        ``radial``, ``tilt`` (of a detector), ``affine`` (axes that differ in scale or are not
        perpendicular), ``scale``, ``rotation``, or ``brightness`` (bright minus faint half).
    change : ndarray, shape (p,)
        Change of each parameter, in its standard error. For ``brightness``, the difference of the
        halves in the standard error of that difference.
    p_value : float
        Probability of such an improvement of the fit without the term.
    """

    term: str
    change: FloatArray
    p_value: float


def sensitivities(
    fit: RegistrationFit,
    source: FloatArray,
    target: FloatArray,
    brightness: ArrayLike | None = None,
    **covariances: ArrayLike | None,
) -> list[Sensitivity]:
    """Return the change of each parameter under richer models.

    Each term adds columns to the Jacobian of the fit, so that the change is that of one
    Gauss-Newton step. Terms that the model contains or that the stars do not fix are left out.
    Radial term and tilt are centred on the pivot. Of more than 100,000 stars, 100,000 are used.

    Parameters
    ----------
    fit : RegistrationFit
        Fit of one set of stars.
    source, target : ndarray, shape (n, 2)
        Points of the fit, in px. Stars of zero weight are ignored.
    brightness : array_like, shape (n,), optional
        Flux, or another number that increases with it.
    **covariances
        ``source_covariance`` and ``target_covariance`` of the fit.

    Returns
    -------
    list of Sensitivity

    Examples
    --------
    >>> grid = np.indices((5, 5)).reshape(2, -1).T * 9.0 - 18
    >>> bent = grid * (1 + 1e-4 * np.square(grid).sum(axis=1, keepdims=True))
    >>> target = bent + 1e-3 * np.sin(7 * grid[:, ::-1])
    >>> found = sensitivities(fit_registration(grid, target, (0, 0)), grid, target)
    >>> [one.term for one in found if one.p_value < 1e-9]
    ['radial']
    """
    some = thinned(len(source), _MAX_COMPARED)
    source, target, weights = source[some], target[some], fit.weights[some]
    model, parameters, pivot = fit.model, fit.parameters, fit.transform.pivot
    offsets = source - pivot
    jacobian = model_jacobian(model, parameters, offsets)
    terms = _terms(
        model, fit.transform.apply(source) - fit.transform.apply(pivot[None])
    )
    if brightness is not None:
        flux = np.asarray(brightness, dtype=np.float64)[some]
        terms["brightness"] = (
            np.where(flux > np.median(flux), 0.5, -0.5)[:, None, None] * jacobian
        )
    columns = np.concatenate(
        [jacobian, *terms.values(), fit.residuals[some, :, None]], axis=-1
    )
    weighted = weights[:, None, None] * columns
    if fit.errors_known:
        known = {name: _rows(one, some) for name, one in covariances.items()}
        problem = prepare(source, target, pivot, None, model, **known)
        weighted = (
            information(problem, local_matrix(model, parameters, offsets)) @ weighted
        )
    last = columns.shape[-1] - 1
    gram: FloatArray = columns.reshape(-1, last + 1).T @ weighted.reshape(-1, last + 1)
    scale = np.sqrt(np.maximum(np.diagonal(gram), np.finfo(float).tiny))
    gram = gram / np.outer(scale, scale)
    count = len(fit.names)
    freedom = 2 * int(np.count_nonzero(weights)) - count
    found, start = [], count
    for term, added in terms.items():
        stop = start + added.shape[-1]
        chosen = [*range(count), *range(start, stop), last]
        # Rows and columns: parameters, columns of the term, residuals.
        part = gram[np.ix_(chosen, chosen)] + _RIDGE * np.eye(len(chosen))
        units = fit.standard_errors * scale[:count] / scale[last]
        factor = np.asarray(np.linalg.cholesky(part), dtype=np.float64)
        found.append(_sensitivity(term, factor, units, freedom))
        start = stop
    return [one for one in found if one is not None]


def _sensitivity(
    term: str, factor: FloatArray, units: FloatArray, freedom: int
) -> Sensitivity | None:
    """Return the effect of a term, or None if the stars do not fix it.

    `factor` is the triangular factor of the products of parameters, term and residuals, `units` the
    standard errors of the parameters in its scale.
    """
    from scipy.special import fdtrc

    count, size = len(units), len(factor) - len(units) - 1
    own, pull = factor[count:-1, count:-1], factor[-1, count:-1]
    if freedom <= size or np.diagonal(own).min() < _MIN_INDEPENDENT:
        return None
    steps = np.linalg.solve(own.T, pull)
    noise = float(factor[-1, -1]) / np.sqrt(freedom - size)
    # The F test holds for a wrong scale of the errors too.
    p_value = float(fdtrc(size, freedom - size, pull @ pull / size / noise**2))
    if term == "brightness":
        return Sensitivity(
            term, steps / (noise * np.linalg.norm(np.linalg.inv(own), axis=0)), p_value
        )
    change = -np.linalg.solve(
        factor[:count, :count].T, factor[count:-1, :count].T @ steps
    )
    return Sensitivity(
        term, (change / units).round(9), p_value
    )  # zero without rounding errors


def _rows(covariance: ArrayLike | None, some: Any) -> FloatArray | None:
    """Return the covariances of some of the stars."""
    if covariance is None or np.ndim(covariance) == 2:
        return covariance if covariance is None else np.asarray(covariance)
    return np.asarray(covariance)[some]


def _terms(model: str, offsets: FloatArray) -> dict[str, FloatArray]:
    """Return the displacements, (n, 2, columns), of the terms that a model does not contain.

    `offsets` are those of registered points from the registered pivot, in px.
    """
    x, y = (offsets / max(float(np.abs(offsets).max()), 1e-300)).T
    along, across = np.stack([x, y], axis=-1), np.stack([-y, x], axis=-1)
    terms = {
        "rotation": across[..., None],
        "scale": along[..., None],
        "radial": (along * np.square(along).sum(axis=-1, keepdims=True))[..., None],
        "tilt": along[..., None] * along[:, None, :],
        "affine": np.stack([along * (1, -1), along[:, ::-1]], axis=-1),
    }
    return {name: terms[name] for name in _RICHER[model]}


def chi_square_range(fit: RegistrationFit) -> tuple[float, float]:
    """Return the central 95 % of chi-square per degree of freedom if the errors are right.

    Parameters
    ----------
    fit : RegistrationFit
        Fit with at least one degree of freedom.

    Returns
    -------
    low, high : float

    Examples
    --------
    >>> square = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> [round(one, 2) for one in chi_square_range(fit_registration(square, square, (0, 0)))]
    [0.12, 2.79]
    """
    from scipy.special import chdtri

    freedom = float(fit.degrees_of_freedom)
    low, high = (
        float(chdtri(freedom, p)) / freedom
        for p in (1 - FALSE_ALARM / 2, FALSE_ALARM / 2)
    )
    return low, high


def fits_exactly(fit: RegistrationFit, source: FloatArray, target: FloatArray) -> bool:
    """Return whether the residuals of the stars of weight above zero are rounding.

    Parameters
    ----------
    fit : RegistrationFit
        Fit of one set of stars.
    source, target : ndarray, shape (n, 2)
        Points of the fit, in px.

    Returns
    -------
    bool

    Examples
    --------
    >>> square = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> fits_exactly(fit_registration(square, square + 1 / 3, (0, 0)), square, square + 1 / 3)
    True
    """
    largest = max(
        float(np.abs(one).max()) for one in (source, target, fit.transform.pivot)
    )
    return (
        float(np.abs(fit.residuals[fit.weights > 0]).max()) < _EXACT_FRACTION * largest
    )


def checked_pivot(pivot: ArrayLike, points: FloatArray) -> FloatArray:
    """Return the pivot as an array of shape (2,), in px.

    Parameters
    ----------
    pivot : array_like, shape (2,)
        Point of rotation and scale, in px.
    points : ndarray, shape (n, 2)
        Source points, in px.

    Returns
    -------
    ndarray, shape (2,), in px

    Raises
    ------
    ValueError
        If the pivot is further from the stars than a hundred fields.

    Examples
    --------
    >>> checked_pivot((1, 2), np.array([[0.0, 0], [9, 9]]))
    array([1., 2.])
    """
    pivot = validate.number_array("pivot", pivot, shape=(2,))
    distance = float(np.abs(points.mean(axis=0) - pivot).max())
    field = float(np.ptp(points, axis=0).max())
    # The fit itself rejects coincident stars.
    if field and not distance <= _MAX_FIELDS * field:
        raise ValueError(
            f"pivot: expected a point within {_MAX_FIELDS:g} fields of the stars, got "
            f"{pivot[0]:g}, {pivot[1]:g}. Pass the principal point of the channel, in px"
        )
    return pivot


def tied(source: FloatArray, target: FloatArray) -> bool:
    """Return whether equal displacements show that rounding hides the noise.

    Parameters
    ----------
    source, target : ndarray, shape (n, 2)
        The same stars in both images, in px.

    Returns
    -------
    bool

    Examples
    --------
    >>> field = np.arange(40.0).reshape(20, 2) ** 1.5 // 1
    >>> tied(field, field + 3)
    True
    """
    some = thinned(len(source), _LARGE_FIELD)
    source, moved = source[some], (target - source)[some].round(9)
    steps, counts = np.unique(moved, axis=0, return_counts=True)
    if counts.max() <= max(2, _MAX_TIED * len(moved)):
        return False
    scale, rotation = robust_similarity(
        source, source + moved, source.mean(axis=0)
    ).parameters[:2]
    change = max(abs(scale - 1), abs(rotation)) * float(np.ptp(source, axis=0).max())
    digits = np.diff(np.unique(steps.round(9)))
    # A scale or rotation distributes the displacements over the digits.
    return bool(change < digits.min(initial=np.inf) / 2)


def diagnose(
    source: FloatArray,
    target: FloatArray,
    pivot: ArrayLike,
    named: _Named = lambda rows: f"rows {', '.join(map(str, rows))}",
    fit: RegistrationFit | None = None,
    brightness: ArrayLike | None = None,
    **settings: Any,
) -> list[Finding]:
    """Return the warnings of a registration.

    The kinds are ``unit``, ``duplicate``, ``line``, ``few`` (too few stars), ``exact``, ``tied``,
    ``errors``, ``model`` (a term improves the fit), ``sensitive`` (a term that the stars do not
    exclude would change a parameter by more than 2 standard errors), ``brightness``,
    ``mismatched`` and ``dropped`` (by a robust fit).

    Parameters
    ----------
    source, target : ndarray, shape (n, 2)
        The same stars in both images, in px.
    pivot : array_like, shape (2,)
        As in `fit_registration`, in px.
    named : callable
        Function that returns the numbers of rows as text: "rows 3, 4".
    fit : RegistrationFit, optional
        The fit with these settings. Default: computed.
    brightness : array_like, shape (n,), optional
        As in `sensitivities`.
    **settings
        Parameters of `fit_registration`: model, robust, weights, covariances.

    Returns
    -------
    list of Finding

    Raises
    ------
    ValueError
        If the stars do not fix the model.

    Examples
    --------
    >>> square = np.array([[0.0, 0], [90, 0], [0, 90], [90, 90]])
    >>> [one.kind for one in diagnose(square, square + 1 / 3, (0, 0))]
    ['exact']
    """
    settings = {"model": "similarity", "robust": False, **settings}
    fit = fit or fit_registration(source, target, pivot, **settings)
    found = [
        *_units(source, target),
        *_duplicates(source, target, named),
        *_line(source),
    ]
    if fit.errors_known:
        found += _errors(fit)
    elif fit.degrees_of_freedom <= 0:
        found.append(
            Finding(
                "few", "the stars leave no degree of freedom to estimate the errors"
            )
        )
    if settings["robust"]:
        found += _dropped(fit, settings, named)
    if fits_exactly(fit, source, target):
        exact = Finding(
            "exact", "the residuals are zero, so the errors cannot be estimated"
        )
        # Without a degree of freedom the residuals are zero by construction.
        return (
            found
            if fit.errors_known or fit.degrees_of_freedom <= 0
            else [*found, exact]
        )
    if tied(source, target):
        text = "many stars have exactly equal displacements: rounding hides their noise"
        return [*found, Finding("tied", text)]
    return found + _misfits(source, target, pivot, named, settings, fit, brightness)


def _misfits(
    source: FloatArray,
    target: FloatArray,
    pivot: ArrayLike,
    named: _Named,
    settings: dict[str, Any],
    fit: RegistrationFit,
    brightness: ArrayLike | None,
) -> list[Finding]:
    """Return the warnings of the model and of single stars."""
    searched = not settings["robust"] and not _none_far(fit, settings)
    # Wrong matches must not hide a distortion.
    robust = _robustly(source, target, pivot, **settings) if searched else None
    right = robust or fit
    known = {name: one for name, one in settings.items() if name.endswith("covariance")}
    terms = sensitivities(right, source, target, brightness, **known)
    limit = FALSE_ALARM / max(len(terms), 1)
    doubtful = sorted(
        (one for one in terms if one.p_value < limit), key=lambda one: one.p_value
    )
    found = [_warning(one, right.names, True) for one in doubtful[:1]]
    if terms and not doubtful:
        most = max(
            terms, key=lambda one: np.abs(one.change).max() * (one.term != "brightness")
        )
        if np.abs(most.change).max() > _MAX_CHANGE:
            found.append(_warning(most, right.names, False))
    # A distortion must not be taken for wrong matches.
    model = next(filter(None, (_MODELS.get(one.term) for one in doubtful)), None)
    if robust and model:
        robust = _robustly(source, target, pivot, **settings | {"model": model})
    return found + _wrong_matches(robust, settings, named) if robust else found


def _warning(term: Sensitivity, names: Sequence[str], significant: bool) -> Finding:
    """Return what a term changes, as a warning if it is significant, otherwise as a note."""
    worst = int(np.abs(term.change).argmax())
    change = f"{names[worst]} by {term.change[worst]:.2g} standard deviations"
    if term.term == "brightness":
        text = f"bright and faint stars differ in {change}: do the centroids depend on the flux?"
        return Finding("brightness", text)
    model = _MODELS.get(term.term)
    remedy = f'. Pass model="{model}"' if model else ""
    if significant:
        text = f"{_NAMES[term.term]} improves the fit (p = {term.p_value:.1g})"
        return Finding("model", f"{text} and changes {change}{remedy}")
    text = (
        f"the intervals assume no {term.term} term, which would change {change}{remedy}"
    )
    return Finding("sensitive", text)


def _none_far(fit: RegistrationFit, settings: dict[str, Any]) -> bool:
    """Return whether no residual of a large field without weights is far above the median."""
    keys = ("weights", "source_covariance", "target_covariance")
    if len(fit.residuals) < _LARGE_FIELD or any(
        settings.get(key) is not None for key in keys
    ):
        return False
    lengths = np.hypot(*fit.residuals.T)
    limit = np.sqrt(2 * np.log(len(lengths) / _ALARM))
    return bool(lengths.max() < limit * np.median(lengths) / _MEDIAN_LENGTH)


def _robustly(
    source: FloatArray, target: FloatArray, pivot: ArrayLike, **settings: Any
) -> RegistrationFit | None:
    """Return the robust fit, or None if the stars are too few or coincide."""
    try:
        return fit_registration(source, target, pivot, **settings | {"robust": True})
    except validate.MirroredPointsError:
        raise
    except (validate.DegenerateGeometryError, np.linalg.LinAlgError):
        return None


def _wrong_matches(
    fit: RegistrationFit, settings: dict[str, Any], named: _Named
) -> list[Finding]:
    """Return the warning that names the stars that a robust fit left out."""
    out = _left_out(fit, settings)
    if fit.degrees_of_freedom < _MIN_FREEDOM or not out.any():
        return []
    lengths = np.hypot(*fit.residuals.T)
    noise = np.sqrt(
        np.square(lengths[fit.weights > 0]).sum() / float(fit.degrees_of_freedom)
    )
    rows = np.flatnonzero(out)
    rows = rows[np.argsort(-lengths[rows])]
    furthest = lengths[rows[0]] / max(float(noise), np.finfo(float).tiny)
    text = (
        f"{len(rows)} of {len(out)} stars do not fit the others ({named(rows.tolist())}; up to "
        f"{furthest:.3g} standard deviations): wrong matches? Pass robust=True, or use "
        "registration-mixture"
    )
    return [Finding("mismatched", text, tuple(rows.tolist()))]


def _left_out(fit: RegistrationFit, settings: dict[str, Any]) -> NDArray[np.bool_]:
    """Return the stars that a robust fit left out, (n,)."""
    given = settings.get("weights")
    return np.asarray(
        (fit.weights == 0) & (np.asarray(1.0 if given is None else given) > 0)
    )


def _units(source: FloatArray, target: FloatArray) -> list[Finding]:
    """Return the warning of coordinates that are perhaps not in pixels."""
    spans = [
        np.ptp(one[thinned(len(one), _LARGE_FIELD)], axis=0).max()
        for one in (source, target)
    ]
    if max(spans) < _MIN_SPAN:
        return [
            Finding("unit", f"the stars span {max(spans):.4g} px: are these pixels?")
        ]
    sizes = [
        np.median(np.abs(one - np.median(one, axis=0))) for one in (source, target)
    ]
    ratio = max(sizes) / max(min(sizes), np.finfo(float).tiny)
    if min(sizes) > 0 and ratio > _MAX_RATIO:
        text = f"one image spans {ratio:.3g} times the other: are both in pixels?"
        return [Finding("unit", text)]
    return []


def _duplicates(source: FloatArray, target: FloatArray, named: _Named) -> list[Finding]:
    """Return the warning of rows that repeat a star of an earlier row."""
    rows = np.union1d(_repeated(source), _repeated(target)).tolist()
    if not rows:
        return []
    text = f"{len(rows)} of {len(source)} rows repeat a star of an earlier row ({named(rows)})"
    return [Finding("duplicate", text, tuple(rows))]


def _repeated(stars: FloatArray) -> NDArray[np.intp]:
    """Return the rows that repeat an earlier one."""
    sums = np.sort(stars[:, 0] + np.pi * stars[:, 1])  # equal rows have equal sums
    if (sums[1:] > sums[:-1]).all():
        return np.empty(0, dtype=np.intp)
    first = np.unique(stars, axis=0, return_index=True)[1]
    return np.setdiff1d(np.arange(len(stars)), first)


def _line(source: FloatArray) -> list[Finding]:
    """Return the warning of stars in a line, which a mirror image fits as well."""
    if len(source) < 3:
        return []
    some = source[thinned(len(source), _LARGE_FIELD)]
    length, width = np.linalg.svd(some - some.mean(axis=0), compute_uv=False)
    if width > _LINE_RATIO * length:
        return []
    return [
        Finding("line", "the stars lie in a line: their mirror image would fit as well")
    ]


def _errors(fit: RegistrationFit) -> list[Finding]:
    """Return the warning of residuals that contradict the given errors."""
    if fit.degrees_of_freedom <= 0:
        return []
    ratio = float(fit.chi_square) / float(fit.degrees_of_freedom)
    low, high = chi_square_range(fit)
    if low < ratio < high:
        return []
    text = (
        f"the residuals are {np.sqrt(ratio):.3g} times the given errors. To estimate the errors "
        "from the residuals, pass weights 1 / sigma^2 instead"
    )
    return [Finding("errors", text)]


def _dropped(
    fit: RegistrationFit, settings: dict[str, Any], named: _Named
) -> list[Finding]:
    """Return the warnings of a robust fit: the stars that it left out, and too few stars."""
    rows, found = tuple(np.flatnonzero(_left_out(fit, settings)).tolist()), []
    if rows:
        text = (
            f"{len(rows)} of {len(fit.weights)} stars have zero weight ({named(rows)})"
        )
        found.append(Finding("dropped", text, rows))
    if len(fit.weights) < _MIN_STARS_ROBUST:
        text = f"with {len(fit.weights)} stars a robust fit can detect one wrong match, not two"
        found.append(Finding("few", text))
    return found


def robust_similarity(
    source: FloatArray, target: FloatArray, pivot: FloatArray
) -> RegistrationFit:
    """Return the robust similarity, or the plain one if the stars are too few or coincide.

    Parameters
    ----------
    source, target, pivot
        As in `fit_registration`.

    Returns
    -------
    RegistrationFit

    Examples
    --------
    >>> square = np.array([[0.0, 0], [90, 0], [0, 90], [90, 90]])
    >>> float(robust_similarity(square, 2 * square, np.zeros(2)).transform.scale.round(9))
    2.0
    """
    return _robustly(source, target, pivot) or fit_registration(source, target, pivot)
