"""What the posteriors of niu2024 decide: with how many stars to calibrate.

No sampler is needed: the registration has a closed form, and the distortions are small enough for
a linear one. The stars are those of the printed design; other numbers of stars lie as they do.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

import numpy as np
from scipy.special import chndtrix

from reproduce.inference import Normal, models
from reproduce.papers.charts import banded, logarithmic, named_below, sized
from reproduce.papers.declare import Fact, draws, studied
from reproduce.papers.niu2024 import posteriors, simulation
from reproduce.papers.niu2024.simulation import NOISE
from reproduce.physics.ground import circular_error
from reproduce.physics.registration import fit_registration
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs

if TYPE_CHECKING:
    from collections.abc import Iterator, Mapping

    from matplotlib.figure import Figure

_QUANTILES = (0.025, 0.5, 0.975)
READS = simulation.READS
_COUNT = f"{simulation.SETTINGS}#angle-count"
_MODELS = {"similarity": "registration", "distortions free": "registration-distortion"}
_STAR_COUNTS = (10, 20, 50, 100, 200, 500, 1000)
# Steps of the derivatives: scale, rotation, two shifts, two distortions.
_DERIVATIVE_STEPS = np.array([1e-6, 1e-6, 1e-3, 1e-3, 1e-3, 1e-3])
_MAX_STARS = 1e5
_STARS_TRIED = np.geomspace(4, _MAX_STARS, 60)


@dataclass(frozen=True, eq=False)
class _Design:
    """A registration about its truth, as far as it is linear.

    - `information`, (p, p): of the transform's parameters, from all stars of the design.
    - `held`, (p, p): information of the priors.
    - `edge`, (2, p): response of the outermost star's registered place.
    - `count`: stars of the design.
    """

    information: FloatArray
    held: FloatArray
    edge: FloatArray
    count: int

    def at_edge(self, count: FloatArray) -> FloatArray:
        """Covariance of the outermost star's registered place, (n, 2, 2), in px^2.

        For so many stars that lie as those of the design.
        """
        more = np.asarray(count, dtype=float)[:, None, None] / self.count
        covariance = np.linalg.inv(self.information * more + self.held)
        return np.asarray(self.edge @ covariance @ self.edge.T)


@cache
def _designs(inputs: Inputs) -> dict[str, _Design]:
    """Return the printed design under both models of the transform."""
    green, red, _ = posteriors.true_centroids(inputs)
    middle, true = posteriors.pivot(inputs, "red"), posteriors.truth(inputs)
    plain = models.registration_model(red, green, middle)
    known = [true[name] for name in (*models.TRANSFORM, "noise")]
    found = {}
    for name, model in zip(
        _MODELS, (plain, models.distortion_model(plain)), strict=True
    ):
        likelihood = model.likelihood_of(models.GaussianRegistration)
        priors = [one.prior for one in model.parameters[5:]]
        sigmas = [prior.sigma for prior in priors if isinstance(prior, Normal)]
        steps = _DERIVATIVE_STEPS[: 4 + len(sigmas)]
        centre = np.array([*known, *np.zeros(len(sigmas))])
        # The fifth parameter is the noise, which moves no star.
        moves = np.insert(np.diag(steps), 4, 0.0, axis=1)
        ahead, behind = (likelihood.places(centre + sign * moves) for sign in (1, -1))
        response = (ahead - behind) / (2 * steps[:, None, None])
        flat = response.reshape(len(steps), -1)
        found[name] = _Design(
            flat @ flat.T / true["noise"] ** 2,
            np.diag([0.0] * 4 + [sigma**-2 for sigma in sigmas]),
            response[:, _outermost(red, middle)].T,
            len(red),
        )
    return found


def _outermost(points: FloatArray, middle: FloatArray) -> int:
    """Return the index of the star farthest from the middle."""
    return int(np.hypot(*(points - middle).T).argmax())


def _edge_errors(inputs: Inputs, counts: FloatArray) -> dict[str, FloatArray]:
    """How far the outermost star is misplaced: low end, median, high end by model, (3, n), px.

    A similarity scatters alike in all directions, about a place that the neglected distortion
    shifts.
    """
    plain, free = (one.at_edge(counts) for one in _designs(inputs).values())
    variance = np.trace(plain, axis1=1, axis2=2) / 2
    off = np.sum(_left_out(inputs) ** 2) / variance
    found = [
        # The square of a Rice variable is noncentral chi-squared.
        [np.sqrt(variance * chndtrix(share, 2, off)) for share in _QUANTILES],
        [circular_error(free, share) for share in _QUANTILES],
    ]
    return dict(zip(_MODELS, map(np.stack, found), strict=True))


def _left_out(inputs: Inputs) -> FloatArray:
    """How a similarity misplaces the outermost star for the distortion that it leaves out, (2,)."""
    green, red, _ = posteriors.true_centroids(inputs)
    middle = posteriors.pivot(inputs, "red")
    left = fit_registration(red, green, middle).residuals
    return np.asarray(left[_outermost(red, middle)])


def _enough(inputs: Inputs) -> dict[str, float]:
    """Stars with which 97.5 % of calibrations misplace the outermost one less than the noise.

    By model; infinite where as many as `_MAX_STARS` are not enough.
    """
    found = {}
    for name, (_, _, high) in _edge_errors(inputs, _STARS_TRIED).items():
        falling = -np.log(high)
        place = np.interp(
            -np.log(inputs[NOISE]), falling, np.log(_STARS_TRIED), right=np.inf
        )
        found[name] = float(np.ceil(np.exp(place)))
    return found


def _star_facts(inputs: Inputs) -> dict[str, Fact]:
    """Return errors at the edge for the printed number of stars, and how many suffice."""
    count = inputs.count(_COUNT)
    found, needed = {"all": Fact(count, "d")}, _enough(inputs)
    for name, ends in _edge_errors(inputs, np.array([count])).items():
        kind, (_, middle, high) = name.split()[0], ends[:, 0].tolist()
        found[f"{kind}-enough"] = Fact(needed[name], ".0f")
        found[f"{kind}-all"] = Fact(middle, ".3f", "px")
        found[f"{kind}-all-high"] = Fact(high, ".3f", "px")
    left = float(np.hypot(*_left_out(inputs)))
    found["left-out"] = Fact(left, ".2g", "px")
    # Equal mean squares: the one of the similarity includes the neglected distortion.
    plain, free = (
        np.trace(one.at_edge(np.array([count]))[0]) for one in _designs(inputs).values()
    )
    found["free-from"] = Fact(float(count * (free - plain) / left**2), ".0f")
    return found


@studied("niu2024/stars", inputs=READS, named=_star_facts)
def _stars(inputs: Inputs) -> Iterator[tuple[float, ...]]:
    """With how many stars to calibrate."""
    counts = sorted({*_STAR_COUNTS, inputs.count(_COUNT)})
    plain, free = _edge_errors(inputs, np.array(counts)).values()
    yield from zip(counts, *plain[1:].tolist(), *free[1:].tolist(), strict=True)


@draws("niu2024/drawing-stars", inputs=READS)
def _draw_stars(figure: Figure, printed: Mapping[str, float], inputs: Inputs) -> None:
    """Error at the edge of the field against the stars of a calibration."""
    counts = np.geomspace(10, 1000, 30)
    sized(figure, 6.0, 3.6, 4.2)
    axes = figure.subplots()
    looks = (("#0072B2", "-"), ("#D55E00", "--"))
    for (name, ends), look in zip(
        _edge_errors(inputs, counts).items(), looks, strict=True
    ):
        banded(axes, counts, ends, *look, label=f"{name}, with 95 %")
    axes.axvline(
        inputs.count(_COUNT), color="#777777", linestyle=":", label="stars of the paper"
    )
    axes.set(xlabel="stars of the calibration (count)", ylabel="error at the edge (px)")
    logarithmic(axes, (10, 30, 100, 300, 1000), (0.001, 0.01, 0.1))
    named_below(figure, 2)
