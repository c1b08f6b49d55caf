"""Checks of a registration: its residuals, its model and its stars.

Image points have shape (n, 2), in px, as in `fit`. One diagnosis serves arrays, tables and images.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.registration._least_squares import Problem, thinned
from reproduce.physics.registration.fit import (
    FALSE_ALARM_ROBUST,
    RegistrationFit,
    _whitened,
    fit_problem,
)
from reproduce.physics.validate import Finding, FloatArray, row_numbers

# Probability of a warning of the model if it is right, and of the errors if they are right.
FALSE_ALARM = 0.05
# Residuals below this fraction of the coordinates are rounding errors.
_EXACT_FRACTION = 1e-11
# Number of stars from which wrong matches are sought only if a residual is large.
_LARGE_FIELD = 8_000
# Number of stars, spread over the rows, with which models are compared; duplicates are not sought
# among more stars.
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
# Smallest independent fraction of a term.
_MIN_INDEPENDENT = 1e-4
# Change of a parameter that exceeds the half of its 95 % interval, in standard deviations.
_MAX_CHANGE = 2.0
# Models that contain a term.
_RICHER_MODELS = {
    "rotation": "rigid",
    "scale": "similarity",
    "radial": "similarity+radial",
    "affine": "affine",
}


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
    error : ndarray, shape (p,)
        Standard error of each parameter if the term is unknown, in its standard error.
    p_value : float
        Probability of such an improvement of the fit without the term.
    """

    term: str
    change: FloatArray
    error: FloatArray
    p_value: float


def sensitivities(
    fit: RegistrationFit, brightness: ArrayLike | None = None
) -> list[Sensitivity]:
    """Return the change of each parameter under richer models.

    Each term adds columns to the Jacobian of the fit, so that the change is that of one
    Gauss-Newton step. Terms that the model contains or that the stars do not fix are left out.
    Radial term and tilt are centred on the pivot. Of more than 100,000 stars, 100,000 are used.

    Parameters
    ----------
    fit : RegistrationFit
        Fit of one set of stars. Stars of zero weight are ignored.
    brightness : array_like, shape (n,), optional
        Flux, or another number that increases with it.

    Returns
    -------
    list of Sensitivity
        One per richer model, with the changes in units of the standard errors.

    Examples
    --------
    >>> from reproduce.physics.registration import fit_registration
    >>> grid = np.indices((5, 5)).reshape(2, -1).T * 9.0 - 18
    >>> bent = grid * (1 + 1e-4 * np.square(grid).sum(axis=1, keepdims=True))
    >>> target = bent + 1e-3 * np.sin(7 * grid[:, ::-1])
    >>> terms = sensitivities(fit_registration(grid, target, (0, 0)))
    >>> [term.term for term in terms if term.p_value < 1e-9]
    ['radial']
    """
    from scipy.special import fdtrc

    used = thinned(len(fit.residuals), _MAX_COMPARED)
    problem, count = fit.problem.rows(used), len(fit.names)
    jacobian = problem.jacobian(fit.parameters, problem.source)
    terms = _terms(fit, problem.source)
    if brightness is not None:
        flux = np.asarray(brightness, dtype=np.float64)[used]
        half = np.where(flux > np.median(flux), 0.5, -0.5)
        terms["brightness"] = half[:, None, None] * jacobian
    factor, residuals = _whitened(problem, fit.parameters, problem.source)
    freedom = 2 * int(np.count_nonzero(problem.counts)) - count
    changes = []
    for term, added in terms.items():
        spare = freedom - added.shape[-1]
        if spare <= 0:
            continue
        # Columns: parameters, term, residuals; each of length one.
        rows = factor @ np.concatenate([jacobian, added], axis=-1)
        rows = np.column_stack([rows.reshape(residuals.size, -1), residuals.ravel()])
        lengths = np.maximum(np.linalg.norm(rows, axis=0), np.finfo(float).tiny)
        triangle: FloatArray = np.asarray(np.linalg.qr(rows / lengths, mode="r"))
        independent, pull = triangle[count:-1, count:-1], triangle[count:-1, -1]
        if np.abs(np.diagonal(independent)).min() < _MIN_INDEPENDENT:
            continue
        steps = np.linalg.solve(independent, pull)
        noise = abs(float(triangle[-1, -1])) / np.sqrt(spare)
        # The F test does not depend on the scale of the errors.
        p_value = float(fdtrc(len(pull), spare, pull @ pull / len(pull) / noise**2))
        # Standard errors of the parameters without and with the term, over the noise.
        plain, rich = (
            np.linalg.norm(np.linalg.inv(part)[:count], axis=1)
            for part in (triangle[:count, :count], triangle[:-1, :-1])
        )
        if term == "brightness":
            change = steps / noise / np.linalg.norm(np.linalg.inv(independent), axis=1)
        else:
            pulled = triangle[:count, count:-1] @ steps
            moved = -np.linalg.solve(triangle[:count, :count], pulled)
            change = moved * lengths[-1] / lengths[:count] / fit.standard_errors
        if not fit.errors_known:
            rich *= noise * np.sqrt(freedom) / np.linalg.norm(triangle[count:, -1])
        changes.append(Sensitivity(term, change.round(9), rich / plain, p_value))
    return changes


def _terms(fit: RegistrationFit, source: FloatArray) -> dict[str, FloatArray]:
    """Return the displacements, (n, 2, columns), of the terms that the model does not contain."""
    apply, pivot = fit.transform.apply, fit.transform.pivot
    offsets = apply(source) - apply(pivot[None])
    along = offsets / max(float(np.abs(offsets).max()), 1e-300)
    across = along[:, ::-1]
    terms = {
        "rotation": (across * (-1, 1))[..., None],
        "scale": along[..., None],
        "radial": (along * np.square(along).sum(axis=-1, keepdims=True))[..., None],
        "tilt": along[..., None] * along[:, None, :],
        "affine": np.stack([along * (1, -1), across], axis=-1),
    }
    # The affine model contains rotation and scale under other names: `sensitivities` finds it.
    return {name: term for name, term in terms.items() if name not in fit.names}


def chi_square_range(fit: RegistrationFit) -> tuple[float, float]:
    """Return the central 95 % of chi-square per degree of freedom if the errors are right.

    Parameters
    ----------
    fit : RegistrationFit
        Fit with at least one degree of freedom.

    Returns
    -------
    low, high : float
        Bounds of the interval.

    Examples
    --------
    >>> from reproduce.physics.registration import fit_registration
    >>> square = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> np.round(chi_square_range(fit_registration(square, square, (0, 0))), 2)
    array([0.12, 2.79])
    """
    from scipy.special import chdtri

    freedom = float(fit.degrees_of_freedom)
    ends = chdtri(freedom, np.array([1 - FALSE_ALARM / 2, FALSE_ALARM / 2])) / freedom
    return float(ends[0]), float(ends[1])


def fits_exactly(fit: RegistrationFit) -> bool:
    """Return whether the residuals of the stars of weight above zero are rounding errors.

    Parameters
    ----------
    fit : RegistrationFit
        Fit of one set of stars.

    Returns
    -------
    bool
        True if no noise remains.

    Examples
    --------
    >>> from reproduce.physics.registration import fit_registration
    >>> square = np.array([[0.0, 0], [9, 0], [0, 9], [9, 9]])
    >>> fits_exactly(fit_registration(square, square + 1 / 3, (0, 0)))
    True
    """
    problem, used = fit.problem, (fit.weights > 0)[:, None]
    residual, *largest = (
        np.linalg.norm(np.ravel(values), np.inf)
        for values in (
            fit.residuals * used,
            problem.source,
            problem.target,
            problem.pivot,
        )
    )
    return bool(residual < _EXACT_FRACTION * max(largest))


def checked_pivot(pivot: ArrayLike | None, points: FloatArray) -> FloatArray:
    """Return the pivot as an array of shape (2,), in px.

    Parameters
    ----------
    pivot : array_like, shape (2,), optional
        Centre of rotation and scale, in px. Default: mean of the points.
    points : ndarray, shape (n, 2)
        Source points, in px.

    Returns
    -------
    ndarray, shape (2,), in px
        Pivot of the transform.

    Raises
    ------
    ValueError
        If the pivot is further from the stars than a hundred fields.

    Examples
    --------
    >>> checked_pivot((1, 2), np.array([[0.0, 0], [9, 9]]))
    array([1., 2.])
    """
    middle = np.asarray(points.mean(axis=0))
    if pivot is None:
        return middle
    pivot = validate.number_array("pivot", pivot, shape=(2,))
    # The fit itself rejects coincident stars.
    field = float(np.ptp(points, axis=0).max()) or np.inf
    if not np.abs(middle - pivot).max() <= _MAX_FIELDS * field:
        raise ValueError(
            f"pivot: expected a point within {_MAX_FIELDS:g} fields of the stars, got {pivot}. "
            "Pass the principal point of the channel, in px"
        )
    return pivot


def diagnose_fit(
    fit: RegistrationFit, brightness: ArrayLike | None = None
) -> tuple[list[Finding], list[Sensitivity]]:
    """Return the warnings of a registration, and its sensitivities.

    The kinds are ``unit``, ``duplicate`` (up to 100,000 stars), ``line``, ``few`` (too few stars),
    ``exact``, ``errors``, ``model`` (a term improves the fit), ``sensitive`` (a term that
    the stars do not exclude would change a parameter by more than 2 standard errors),
    ``brightness``, ``mismatched`` and ``dropped`` (by a robust fit).

    Parameters
    ----------
    fit : RegistrationFit
        Fit of one set of stars.
    brightness : array_like, shape (n,), optional
        As in `sensitivities`.

    Returns
    -------
    findings : list of Finding
        Warnings with the cure.
    sensitivities : list of Sensitivity
        Sensitivities of the stars that fit each other. Empty if the fit is exact.

    Raises
    ------
    MirroredPointsError
        If the target mirrors the source except for wrong matches.

    Examples
    --------
    >>> from reproduce.physics.registration import fit_registration
    >>> square = np.array([[0.0, 0], [90, 0], [0, 90], [90, 90]])
    >>> findings, _ = diagnose_fit(fit_registration(square, square + 1 / 3, (0, 0)))
    >>> [finding.kind for finding in findings]
    ['exact']
    """
    problem, unmatched = fit.problem, None
    findings = [*_stars(fit), *_errors(fit), *_dropped(fit)]
    if fits_exactly(fit):
        # Without a degree of freedom the residuals are zero by construction.
        if not fit.errors_known and fit.degrees_of_freedom > 0:
            text = "the residuals are zero, so the errors cannot be estimated"
            findings.append(Finding("exact", text))
        return findings, []
    if not fit.robust and _any_far(fit):
        # Wrong matches must not hide a distortion.
        unmatched = _robust(problem)
    right = unmatched or fit
    if fits_exactly(right):
        return [*findings, *_mismatched(right)], []
    # A few stars that fit each other may be too few for any term.
    terms = sensitivities(right, brightness) or sensitivities(fit, brightness)
    if terms:
        doubtful = min(terms, key=lambda term: term.p_value)
        if doubtful.p_value < FALSE_ALARM / len(terms):
            findings.append(_model_finding(doubtful, right))
            # A distortion must not be taken for wrong matches.
            richer = _RICHER_MODELS.get(doubtful.term)
            if unmatched and richer:
                unmatched = _robust(replace(problem, model=richer))
        else:
            findings += _sensitive(terms, right)
    return findings + (_mismatched(unmatched) if unmatched else []), terms


def _robust(problem: Problem) -> RegistrationFit | None:
    """Return the robust fit, or None if the stars are too few or coincide."""
    try:
        return fit_problem(problem, robust=True)
    except validate.MirroredPointsError:
        raise
    except (validate.DegenerateGeometryError, np.linalg.LinAlgError):
        return None


def _stars(fit: RegistrationFit) -> Iterator[Finding]:
    """Yield the warnings of the positions of the stars."""
    both, count = [fit.problem.source, fit.problem.target], len(fit.residuals)
    part = np.stack(both)[:, thinned(count, _LARGE_FIELD)]
    span = float(np.ptp(part, axis=1).max())
    # Wrong matches do not change the medians.
    centred = np.abs(part - np.median(part, axis=1, keepdims=True))
    small, large = np.sort(np.median(centred, axis=(1, 2)))
    if span < _MIN_SPAN:
        yield Finding("unit", f"the stars span {span:.4g} px: are these pixels?")
    elif large > _MAX_RATIO * small > 0:
        ratio = f"{large / small:.3g} times the other"
        yield Finding("unit", f"one image spans {ratio}: are both in pixels?")
    if count <= _MAX_COMPARED:
        first, other = (np.unique(one, axis=0, return_index=True)[1] for one in both)
        rows = np.setdiff1d(np.arange(count), np.intersect1d(first, other)).tolist()
        text = f"{len(rows)} of {count} rows repeat a star of an earlier row"
        if rows:
            yield Finding("duplicate", f"{text} ({row_numbers(rows)})", tuple(rows))
    length, width = np.linalg.svd(part[0] - part[0].mean(axis=0), compute_uv=False)
    if count > 2 and width <= _LINE_RATIO * length:
        text = "the stars lie in a line: their mirror image would fit as well"
        yield Finding("line", text)


def _errors(fit: RegistrationFit) -> list[Finding]:
    """Return the warning of residuals that contradict the given errors, or of too few stars."""
    freedom = float(fit.degrees_of_freedom)
    if freedom <= 0:
        text = "the stars leave no degree of freedom to estimate the errors"
        return [] if fit.errors_known else [Finding("few", text)]
    ratio, (low, high) = float(fit.chi_square) / freedom, chi_square_range(fit)
    text = (
        f"the residuals are {np.sqrt(ratio):.3g} times the given errors. To estimate the errors "
        "from the residuals, pass weights 1 / sigma^2 instead"
    )
    wrong = fit.errors_known and not low < ratio < high
    return [Finding("errors", text)] if wrong else []


def _dropped(fit: RegistrationFit) -> Iterator[Finding]:
    """Yield the warnings of a robust fit: the stars that it left out, and too few stars."""
    rows, count = np.flatnonzero(fit.rejected).tolist(), len(fit.weights)
    if rows:
        text = f"{len(rows)} of {count} stars have zero weight ({row_numbers(rows)})"
        yield Finding("dropped", text, tuple(rows))
    if fit.robust and count < _MIN_STARS_ROBUST:
        text = f"with {count} stars a robust fit can detect one wrong match, not two"
        yield Finding("few", text)


def _any_far(fit: RegistrationFit) -> bool:
    """Return whether a field is small, or has a residual far above the median."""
    lengths, count = np.hypot(*fit.residuals.T), len(fit.residuals)
    # The median of a two-dimensional Gaussian residual is sqrt(2 log 2) standard deviations.
    limit = np.sqrt(np.log2(count / FALSE_ALARM_ROBUST)) * np.median(lengths)
    return bool(count < _LARGE_FIELD or lengths.max() > limit)


def _mismatched(fit: RegistrationFit) -> list[Finding]:
    """Return the warning that names the stars that a robust fit left out."""
    rows, lengths = np.flatnonzero(fit.rejected), np.hypot(*fit.residuals.T)
    if fit.degrees_of_freedom < _MIN_FREEDOM or not len(rows):
        return []
    rows = rows[np.argsort(-lengths[rows])]
    named = row_numbers(rows.tolist())
    if fits_exactly(fit):
        text = f", which fit exactly ({named}): wrong matches, or too few digits?"
    else:
        squares = np.square(lengths[fit.weights > 0]).sum()
        rms = np.sqrt(squares / float(fit.degrees_of_freedom))
        furthest = f"up to {lengths[rows[0]] / rms:.3g} standard deviations"
        text = f" ({named}; {furthest}): wrong matches?"
    text = (
        f"{len(rows)} of {len(lengths)} stars do not fit the others{text} Pass robust=True, or use "
        "registration-mixture"
    )
    return [Finding("mismatched", text, tuple(rows.tolist()))]


def _sensitive(terms: list[Sensitivity], fit: RegistrationFit) -> list[Finding]:
    """Return the note on the term that would change a parameter most."""
    largest = max(terms, key=lambda term: np.abs(term.change).max())
    if np.abs(largest.change).max() <= _MAX_CHANGE or largest.term == "brightness":
        return []
    text = f"the intervals assume no {largest.term} term, which would change "
    return [Finding("sensitive", text + _largest_change(largest, fit))]


def _largest_change(term: Sensitivity, fit: RegistrationFit) -> str:
    """Return the largest change of a parameter as text, with the model that has the term."""
    worst = int(np.abs(term.change).argmax())
    model = _RICHER_MODELS.get(term.term)
    remedy = f'. Pass model="{model}"' if model else ""
    return f"{fit.names[worst]} by {term.change[worst]:.2g} standard deviations{remedy}"


def _model_finding(term: Sensitivity, fit: RegistrationFit) -> Finding:
    """Return the warning of a significant term."""
    change = _largest_change(term, fit)
    if term.term == "brightness":
        text = f"bright and faint stars differ in {change}: do the centroids depend on the flux?"
        return Finding("brightness", text)
    text = f"the {term.term} term improves the fit (p = {term.p_value:.1g}) and changes {change}"
    return Finding("model", text)
