"""Number of stars for a calibration, from the posteriors of niu2024.

No sampler is needed: the registration has a closed form, and the distortions are small enough for
a linear one. The stars are those of the printed design. Other numbers of stars have the same
distribution.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chndtrix

from reproduce.inference import models
from reproduce.papers.charts import (
    LEVELS,
    Figure,
    legend_below,
    plot_band,
    set_log_ticks,
    set_size,
)
from reproduce.papers.declare import Results, Rows, by_cell, draws, studied
from reproduce.papers.niu2024 import posteriors, simulation
from reproduce.papers.niu2024.simulation import NOISE
from reproduce.physics.ground import circular_error
from reproduce.physics.registration import Registration, fit_registration
from reproduce.physics.validate import FloatArray
from reproduce.printed.inputs import Inputs

INPUTS = simulation.INPUTS
_COUNT = "niu2024/text-simulation#angle-count"
_MODELS = ("similarity", "distortions free")
_STAR_COUNTS = (10, 20, 50, 100, 200, 500, 1000)
_MAX_STARS = 1e5
_STARS_TRIED = np.geomspace(4, _MAX_STARS, 60)


def _at_edge(inputs: Inputs, counts: FloatArray) -> tuple[FloatArray, ...]:
    """Return the covariance of the registered position of the outermost star, and its bias.

    Covariances under both models, (n, 2, 2), in px^2, in linear approximation at the true
    parameters. The stars have the distribution of the printed design and the given numbers, (n,).
    The bias of a similarity is the distortion that it neglects, (2,), in px.
    """
    green, red, _ = posteriors.true_centroids(inputs)
    middle, true = posteriors.pivot(inputs), posteriors.truth(inputs)
    fit = fit_registration(red, green, middle)
    straight = Registration("similarity+radial", [*fit.parameters, 0.0], middle)
    response = straight.jacobian(red)
    radii = np.hypot(*(red - middle).T)
    outermost = radii.argmax()
    # Both distortions move the stars alike. The radial term is k^2 d_t - d_s over the cubed radius.
    spread = models.DISTORTION_PRIOR.sigma * np.hypot(1, true["scale"] ** 2)
    # The other parameters have flat priors.
    prior = np.diag([0.0] * 4 + [(radii[outermost] ** 3 / spread) ** 2])
    flat = response.reshape(-1, len(prior)) / true["noise"]
    normal = flat.T @ flat * counts[:, None, None] / len(red) + prior
    edge = response[outermost]
    # A similarity has the first four parameters.
    plain, free = (
        edge[:, :size] @ np.linalg.inv(normal[:, :size, :size]) @ edge[:, :size].T
        for size in (4, 5)
    )
    return plain, free, fit.residuals[outermost]


def _edge_errors(inputs: Inputs, counts: FloatArray) -> FloatArray:
    """Return low end, median and high end of the error of the outermost star, in px.

    Shape (2, 3, n), in the order of `_MODELS`. The scatter of a similarity is equal in all
    directions, about a position that the neglected distortion shifts.
    """
    plain, free, neglected = _at_edge(inputs, counts)
    variance = np.trace(plain, axis1=1, axis2=2) / 2
    bias = np.sum(neglected**2) / variance
    return np.array(
        [
            # The square of a Rice variable is noncentral chi-squared.
            [np.sqrt(variance * chndtrix(level, 2, bias)) for level in LEVELS],
            [circular_error(free, level) for level in LEVELS],
        ]
    )


def _sufficient(inputs: Inputs) -> FloatArray:
    """Return the number of stars for an error below the noise in 97.5 % of calibrations, (2,).

    In the order of `_MODELS`; infinite if `_MAX_STARS` are not sufficient.
    """
    # Without a bias the inverse variance is proportional to the number.
    precisions = _edge_errors(inputs, _STARS_TRIED)[:, 2] ** -2
    needed = inputs[NOISE] ** -2
    found = [np.interp(needed, each, _STARS_TRIED, right=np.inf) for each in precisions]
    return np.ceil(found)


def _star_facts(inputs: Inputs) -> Results:
    """Return sufficient numbers of stars, and the number for which both models are equal.

    The error of a similarity by the distortion that it neglects has the name left-out.
    """
    count = inputs.count(_COUNT)
    [plain], [free], neglected = _at_edge(inputs, np.array([count]))
    left_out = np.hypot(*neglected)
    return {
        "level": 100 * LEVELS[2],
        "left-out": left_out,
        **by_cell("{}-enough", _sufficient(inputs), ("similarity", "distortions")),
        # Equal mean squares: the one of the similarity includes the neglected distortion.
        "free-from": count * np.trace(free - plain) / left_out**2,
    }


@studied("niu2024/stars", inputs=INPUTS, named=_star_facts)
def _stars(inputs: Inputs) -> Rows:
    """Compute the error at the edge of the field by the number of stars."""
    counts = sorted({*_STAR_COUNTS, inputs.count(_COUNT)})
    plain, free = _edge_errors(inputs, np.array(counts))
    yield from zip(counts, *plain[1:], *free[1:], strict=True)


@draws("niu2024/drawing-stars", inputs=INPUTS)
def _draw_stars(figure: Figure, printed: Inputs, inputs: Inputs) -> None:
    """Draw the error at the edge of the field against the number of stars."""
    counts = np.geomspace(10, 1000, 30)
    set_size(figure, 3.6, 4.2, width=6.0)
    axes = figure.subplots()
    errors = _edge_errors(inputs, counts)
    for name, ends, look in zip(_MODELS, errors, ("C0-", "C1--"), strict=True):
        plot_band(axes, counts, ends, look, f"{name}, with 95 %")
    axes.axvline(
        inputs[_COUNT], color="#777777", linestyle=":", label="stars of the paper"
    )
    axes.set(xlabel="stars of the calibration (count)", ylabel="error at the edge (px)")
    set_log_ticks(axes, (10, 30, 100, 300, 1000), (0.001, 0.01, 0.1))
    legend_below(figure, 2)
