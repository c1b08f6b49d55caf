"""Checks of a registration: its residuals, its model and its stars.

Image points have shape (n, 2), in px, as in `fit`. One diagnosis serves arrays, tables and images.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from reproduce.physics import validate
from reproduce.physics.registration._least_squares import (
    Problem,
    gauss_newton,
    thinned,
)
from reproduce.physics.registration._similarity import as_complex, as_points, squared
from reproduce.physics.registration.fit import (
    FALSE_ALARM_ROBUST,
    RegistrationFit,
    _whitened,
    fit_problem,
)
from reproduce.physics.validate import Finding, FloatArray

# Probability of a warning of the model if it is right, and of the errors if they are right.
FALSE_ALARM = 0.05
# Number of stars from which wrong matches are sought only if a residual is large.
_LARGE_FIELD = 8_000
# Number of stars, spread over the rows, with which models are compared; duplicates are not sought
# among more stars.
_MAX_COMPARED = 100_000
# Largest number of stars in which many wrong matches are sought.
_MAX_SAMPLE = 200
# Smallest number of degrees of freedom with which the other stars can show a wrong match.
_MIN_FREEDOM = 4
# Smallest number of stars with which a robust fit can detect two wrong matches.
_MIN_STARS_TWO_WRONG = 8
# Rows that a warning names, at most.
_MAX_ROWS = 5
# Smallest span, in px, and largest ratio of the spans of two images in pixels.
_MIN_SPAN, _MAX_RATIO = 50.0, 20.0
# Largest distance of the pivot from the stars, in fields. Beyond, the shift loses digits.
_MAX_FIELDS = 100.0
# Ratio of width to length below which the stars lie in a line.
_LINE_RATIO = 1e-3
# Smallest independent fraction of a term.
_MIN_INDEPENDENT = 1e-4
# Product of the variances along and across, over the square of their mean: below, an interval is
# too narrow by a tenth.
_MIN_EVENNESS = 0.95
# Change of a parameter that exceeds the half of its 95 % interval, in standard deviations.
_MAX_CHANGE = 2.0
# Largest number of parameters of a model that all richer models contain, and those by their term.
_MAX_NESTED = 4
_RICHER_MODELS = {
    "rotation": "rigid",
    "scale": "similarity",
    "radial": "similarity+radial",
    "affine": "affine",
}
_TERM_TEXTS = {
    "model": "the {term} term improves the fit (p {p}) and changes {change}",
    "brightness": "bright and faint stars differ in {change}: do the centroids depend on the flux?",
    "sensitive": "the intervals assume no {term} term, which would change {change}. The intervals "
    'that allow it are interval(term="{term}")',
}


@dataclass(frozen=True, eq=False)
class Sensitivity:
    """Change of the parameters if the model had one more term.

    Attributes
    ----------
    term : str
        ``radial`` (about a centre near the pivot), ``decentring`` (if the model has a radial term,
        whose centre is not the pivot), ``tilt`` (of a detector), ``affine`` (axes that differ in
        scale or are not perpendicular), ``scale``, ``rotation``, or ``bright - faint`` (both halves
        of the stars).
    change : ndarray, shape (p,)
        Change of each parameter, in its standard error. For ``bright - faint``, the difference of
        the halves in the standard error of that difference.
    error : ndarray, shape (p,)
        Standard error of each parameter if the term is unknown, in its standard error.
    p_value : float
        Probability of such an improvement of the fit without the term.
    number : int
        Number of parameters of the term.
    """

    term: str
    change: FloatArray
    error: FloatArray
    p_value: float
    number: int


def sensitivities(
    fit: RegistrationFit, brightness: FloatArray | None = None
) -> list[Sensitivity]:
    """Return the change of each parameter under richer models.

    Each term adds columns to the Jacobian of the fit, so that the change is that of one
    Gauss-Newton step. Terms that the model contains or that the stars do not fix are left out. Tilt
    and radial term are centred on the pivot, and the radial term has two more columns for a small
    displacement of its centre. Of more than 100,000 stars, 100,000 are used.

    Parameters
    ----------
    fit : RegistrationFit
        Fit of one set of stars. Stars of zero weight are ignored.
    brightness : ndarray, shape (n,), optional
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
    jacobian = fit.transform.jacobian(problem.source)
    terms = _terms(fit, problem.source)
    if brightness is not None:
        flux = brightness[used]
        half = np.where(flux > np.median(flux), 0.5, -0.5)
        terms["bright - faint"] = half[:, None, None] * jacobian
    factor, residuals = _whitened(problem, fit.parameters, problem.source)
    rows, residuals = factor @ jacobian, residuals.ravel()

    def stepped(*added: FloatArray) -> tuple[FloatArray, FloatArray, float]:
        """Return a step of Gauss-Newton, its errors for unit noise, and the squares left."""
        used = np.concatenate([rows, *added], axis=-1).reshape(residuals.size, -1)
        step, cofactor = gauss_newton(used, residuals, used, _MIN_INDEPENDENT**2)
        rest = residuals - used @ step
        return step, np.sqrt(np.diagonal(cofactor)), float(rest @ rest)

    freedom, changes = 2 * np.count_nonzero(problem.counts) - count, []
    # Stars that do not fix the model or a term have no solution.
    with suppress(validate.DegenerateGeometryError):
        step, plain, squares = stepped()
        for term, added in terms.items():
            number = added.shape[-1]
            spare = freedom - number
            if spare <= 0:
                continue
            with suppress(validate.DegenerateGeometryError):
                moved, rich, left = stepped(factor @ added)
                noise = np.sqrt(left / spare)
                # The F test does not depend on the scale of the errors.
                gain = max(squares - left, 0.0) / number / noise**2
                change = (moved[:count] - step) / fit.standard_errors
                if term == "bright - faint":
                    change = moved[count:] / rich[count:] / noise
                error = rich[:count] / plain
                if not fit.errors_known:
                    error *= noise / np.sqrt(squares / freedom)
                p_value = float(fdtrc(number, spare, gain))
                changes.append(
                    Sensitivity(term, change.round(9), error, p_value, number)
                )
    return changes


def _terms(fit: RegistrationFit, source: FloatArray) -> dict[str, FloatArray]:
    """Return the displacements, (n, 2, columns), of the terms that the model does not contain."""
    apply, pivot = fit.transform.apply, fit.transform.pivot
    along = as_complex(apply(source) - apply(pivot[None]))
    squares = squared(along)
    # The change of a radial term if its centre moves along x, or along y.
    moved = [along**2 + 2 * squares, 1j * (2 * squares - along**2)]
    terms = {
        "rotation": [1j * along],
        "scale": [along],
        "radial": [along * squares, *moved],
        "tilt": [along * along.real, along * along.imag],
        "affine": [along.conj(), 1j * along.conj()],
    }
    if "radial" in fit.names:
        terms["decentring"] = moved
    # The affine model contains rotation and scale under other names: `sensitivities` finds it.
    return {
        name: np.stack([*map(as_points, term)], axis=-1)
        for name, term in terms.items()
        if name not in fit.names
    }


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
    middle = points.mean(axis=0)
    if pivot is None:
        return middle
    pivot = validate.number_array("pivot", pivot, shape=(2,), exact=True)
    # The fit itself rejects coincident stars.
    field = np.ptp(points, axis=0).max() or np.inf
    if not np.abs(middle - pivot).max() <= _MAX_FIELDS * field:  # also NaN
        raise ValueError(
            f"pivot: expected a point within {_MAX_FIELDS:g} fields of the stars, got {pivot}. "
            "Pass the principal point of the channel, in px"
        )
    return pivot


def diagnose_fit(
    fit: RegistrationFit, brightness: FloatArray | None = None
) -> tuple[list[Finding], list[Sensitivity]]:
    """Return the warnings of a registration, and its sensitivities.

    The kinds are ``unit``, ``duplicate`` (up to 100,000 stars), ``line``, ``few`` (too few stars),
    ``exact``, ``errors``, ``model`` (a term improves the fit), ``sensitive`` (a term that
    the stars do not exclude would change a parameter by more than 2 standard errors),
    ``brightness``, ``uneven`` (the noise depends on the direction), ``unmatched`` (the rows are
    not the same stars), ``mismatched`` (wrong matches) and ``dropped`` (by a robust fit).

    Parameters
    ----------
    fit : RegistrationFit
        Fit of one set of stars.
    brightness : ndarray, shape (n,), optional
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
    findings = [*_stars(fit), *_errors(fit)]
    if fit.robust:
        findings += _rejected(fit, "dropped", ". They have no weight")
    if fit.is_exact:
        # Without a degree of freedom the residuals are zero by construction.
        if not fit.errors_known and fit.degrees_of_freedom > 0:
            findings.append(
                Finding(
                    "exact", "the residuals are zero, so the errors cannot be estimated"
                )
            )
        return findings, []
    findings += _unrelated(fit)
    # Wrong matches must not hide a distortion.
    others = _robust(fit.problem) if not fit.robust and _any_far(fit) else None
    right, terms = others or fit, list[Sensitivity]()
    if not (others and others.is_exact):
        # A few stars that fit each other may be too few for any term.
        terms = sensitivities(right, brightness) or sensitivities(fit, brightness)
    if terms:
        found, richer = _term_finding(terms, right)
        findings += found
        # A distortion must not be taken for wrong matches.
        if others and richer:
            others = _robust(replace(fit.problem, model=richer))
        if all(one.kind == "sensitive" for one in found):
            findings += _uneven(right)
    if others and others.degrees_of_freedom >= _MIN_FREEDOM:
        remedy = ": wrong matches? Fit with robust=True, or use registration-mixture"
        findings += _rejected(others, "mismatched", remedy)
    return findings, terms


def _robust(problem: Problem) -> RegistrationFit | None:
    """Return the robust fit, or None if the stars are too few or coincide."""
    try:
        return fit_problem(problem, robust=True)
    except (validate.DegenerateGeometryError, np.linalg.LinAlgError):
        return None


def _stars(fit: RegistrationFit) -> Iterator[Finding]:
    """Yield the warnings of the positions of the stars."""
    both, count = [fit.problem.source, fit.problem.target], len(fit.residuals)
    part = np.stack([image[thinned(count, _LARGE_FIELD)] for image in both])
    span = np.ptp(part, axis=1).max()
    # Wrong matches do not change the medians.
    centred = np.abs(part - np.median(part, axis=1, keepdims=True))
    small, large = np.sort(np.median(centred, axis=(1, 2)))
    if span < _MIN_SPAN:
        yield Finding("unit", f"the stars span {span:.4g} px: are these pixels?")
    elif large > _MAX_RATIO * small > 0:
        yield Finding(
            "unit",
            f"one image spans {large / small:.3g} times the other: are both in pixels?",
        )
    if count <= _MAX_COMPARED:
        first, other = (np.unique(one, axis=0, return_index=True)[1] for one in both)
        rows = np.setdiff1d(np.arange(count), np.intersect1d(first, other)).tolist()
        if rows:
            yield Finding(
                "duplicate",
                f"{len(rows)} of {count} rows repeat a star of an earlier row "
                f"({_row_numbers(rows)})",
                tuple(rows),
            )
    sides = np.linalg.svd(part[0] - part[0].mean(axis=0), compute_uv=False)
    if count > 2 and sides[1] <= _LINE_RATIO * sides[0]:
        yield Finding(
            "line", "the stars lie in a line: their mirror image would fit as well"
        )


def _errors(fit: RegistrationFit) -> Iterator[Finding]:
    """Yield the warnings of too few stars, and of residuals that contradict the given errors."""
    freedom = fit.degrees_of_freedom
    count = np.count_nonzero(fit.rejected | (fit.weights > 0))
    if fit.robust and count < _MIN_STARS_TWO_WRONG:
        yield Finding(
            "few",
            f"with {count} stars a robust fit can detect one wrong match, not two",
        )
    if freedom <= 0 and not fit.errors_known:
        yield Finding(
            "few", "the stars leave no degree of freedom to estimate the errors"
        )
    if freedom > 0 and fit.errors_known:
        ratio, (low, high) = fit.chi_square / freedom, fit.chi_square_range
        if not low < ratio < high:
            yield Finding(
                "errors",
                f"the residuals are {np.sqrt(ratio):.3g} times the given errors. To estimate the "
                "errors from the residuals, pass weights 1 / sigma^2 instead",
            )


def _uneven(fit: RegistrationFit) -> Iterator[Finding]:
    """Yield the warning of an unknown noise that differs between directions."""
    count = fit.degrees_of_freedom / 2
    if fit.errors_known or count <= 1:
        return
    weighted = np.sqrt(fit.weights)[:, None] * fit.residuals
    squares = np.linalg.eigvalsh(weighted.T @ weighted / count)
    squares = np.maximum(squares, 0)  # rounding errors may be negative
    evenness = squares.prod() / squares.mean() ** 2
    # Mauchly's test of two variances.
    if evenness < min(_MIN_EVENNESS, FALSE_ALARM_ROBUST ** (2 / (count - 1))):
        across, along = np.sqrt(squares)
        yield Finding(
            "uneven",
            f"the residuals scatter by {along:.2g} px in one direction and {across:.2g} px "
            "across, but the intervals assume equal noise. Pass errors, such as sigma_x and "
            "sigma_y",
        )


def _unrelated(fit: RegistrationFit) -> Iterator[Finding]:
    """Yield the warning of rows that are not the same stars: the scale agrees with zero."""
    from scipy.special import fdtrc

    freedom = fit.degrees_of_freedom
    if "scale" in fit.names and freedom > 1:
        scale, error = fit.parameters[0], fit.standard_errors[0]
        if fdtrc(2, freedom, (scale / error) ** 2 / 2) > FALSE_ALARM_ROBUST:
            yield Finding(
                "unmatched",
                f"the scale is {scale:.2g} ± {error:.2g}: are the rows the same stars? "
                "Match them first, with rp.match",
            )


def _any_far(fit: RegistrationFit) -> bool:
    """Return whether a field is small, or has a residual that does not fit the others."""
    count = len(fit.residuals)
    if count < _LARGE_FIELD:
        return True
    # Many wrong matches increase the median of all stars.
    part = _robust(fit.problem.rows(thinned(count, _MAX_SAMPLE))) or fit
    # The median square of a two-dimensional Gaussian residual is 2 log 2 variances.
    limit = np.log2(count / FALSE_ALARM_ROBUST) * np.median(part.squares)
    return bool(fit.squares.max() > limit)


def _rejected(fit: RegistrationFit, kind: str, remedy: str) -> Iterator[Finding]:
    """Yield the warning that names the stars that a robust fit left out."""
    rows, lengths = np.flatnonzero(fit.rejected), np.sqrt(fit.squares)
    if len(rows):
        rows = rows[np.argsort(-lengths[rows])]
        named = f"{_row_numbers(rows.tolist())}, up to {lengths[rows[0]]:.3g} px"
        exact = ", which fit exactly" * fit.is_exact
        text = f"{len(rows)} of {len(lengths)} stars do not fit the others{exact} ({named})"
        yield Finding(kind, text + remedy, tuple(rows.tolist()))


def _row_numbers(rows: Sequence[int]) -> str:
    """Return the numbers of rows as text, the first five of them."""
    shown = ", ".join(map(str, rows[:_MAX_ROWS])) + ", ..." * (len(rows) > _MAX_ROWS)
    return f"row{'s' * (len(rows) > 1)} {shown}"


def _term_finding(
    terms: list[Sensitivity], fit: RegistrationFit
) -> tuple[list[Finding], str | None]:
    """Return the warning of a significant term with the model that has it, or a note on a term."""
    term = min(terms, key=lambda term: term.p_value)
    kind = "brightness" if term.term == "bright - faint" else "model"
    if term.p_value >= FALSE_ALARM / len(terms):
        kind = "sensitive"
        # The difference of two halves is no term of a model.
        models = [one for one in terms if one.term != "bright - faint"]
        changes = [np.abs(one.change).max() for one in models]
        if max(changes, default=0.0) <= _MAX_CHANGE:
            return [], None
        term = models[np.argmax(changes)]
    worst = np.abs(term.change).argmax()
    largest = term.change[worst]
    change = f"{fit.names[worst]} by {largest:z.2g} standard deviations"
    # A probability may underflow.
    p = f"= {term.p_value:.1g}" if term.p_value > 0 else "< 1e-300"
    text = _TERM_TEXTS[kind].format(term=term.term, p=p, change=change)
    model = None
    # No model contains both a radial and an affine term.
    if kind == "model" and len(fit.names) <= _MAX_NESTED:
        model = _RICHER_MODELS.get(term.term)
    if model:
        text += f'. Pass model="{model}"'
    return [Finding(kind, text)], model
