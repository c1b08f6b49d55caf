"""Rivals of the similarity: their evidence against other ways, and what hangs on the prior."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad
from scipy.special import gammaln

from reproduce.inference.model import UnsuitableModelError
from reproduce.inference.models.radial import (
    TERMS,
    WIDTH,
    WIDTHS,
    linear_log_evidence,
    linear_model,
)
from reproduce.inference.models.registration import registration_model
from reproduce.inference.models.variants import distortion_model
from reproduce.inference.priors import Uniform
from reproduce.papers.posteriors import posteriors
from reproduce.views.book import posteriors as pages


@pytest.fixture(scope="module")
def few():
    """Ten noisy stars, stretched by more than a narrow prior allows and less than a wide one."""
    generator = np.random.default_rng(3)
    source = generator.uniform(0, 1000, (10, 2))
    target = (source - 500) * [1.004, 0.997] + 500 + 0.8 * generator.normal(size=source.shape)
    return registration_model(source, target, (500, 500))


def scipys_log_evidence(model, wide=600.0):
    """The data are Gaussian given the noise: flat priors as very wide Gaussians, noise by steps."""
    likelihood, noise = model.likelihood, model.parameters[-1].prior
    moved = (likelihood.target - likelihood.source).T.ravel()
    flat, volume = 0.0, []
    for parameter in model.parameters[:-1]:
        if isinstance(parameter.prior, Uniform):
            volume.append(wide**2)
            flat += np.log(np.sqrt(2 * np.pi) * wide / (parameter.prior.high - parameter.prior.low))
        else:
            volume.append(parameter.prior.sigma**2)
    spread = likelihood.design * volume @ likelihood.design.T

    def logs(log_noise):
        covariance = spread + np.exp(2 * log_noise) * np.eye(len(moved))
        return stats.multivariate_normal.logpdf(moved, cov=covariance)

    middle = np.log(likelihood.start()[0][-1])
    top = logs(middle)
    total, _ = quad(lambda x: np.exp(logs(x) - top), middle - 2, middle + 3, epsrel=1e-8, limit=200)
    return top + np.log(total) + flat - np.log(np.log(noise.high / noise.low))


@pytest.mark.parametrize("shape", list(TERMS))
@pytest.mark.parametrize("width", WIDTHS)
def test_evidence_against_scipys_normal(few, shape, width):
    model = linear_model(few, shape, width)
    assert abs(linear_log_evidence(model) - scipys_log_evidence(model)) < 2e-4


def test_evidence_without_terms_is_the_gamma_function(few):
    model = linear_model(few, "similarity")
    best, root, least = model.likelihood.reduced
    half = (len(model.likelihood.design) - len(best)) / 2
    noise = model.parameters[-1].prior
    expected = gammaln(half) - np.log(2) - half * np.log(np.pi * least)
    expected -= np.log(np.abs(np.diagonal(root))).sum() + 4 * np.log(100)
    expected -= np.log(np.log(noise.high / noise.low))
    assert abs(linear_log_evidence(model) - expected) < 1e-6


def test_wide_prior_costs_the_logarithm_of_its_width(registration):
    """Where the estimate is near nothing and sharp; and a needed term pays for itself."""
    for shape, terms in TERMS.items():
        narrow, wide = (linear_log_evidence(linear_model(registration, shape, w)) for w in (1, 5))
        assert abs(narrow - wide - len(terms) * np.log(5)) < 0.02


def test_terms_have_the_prior_of_the_distortion(registration):
    """The same quantity, the same prior: a displacement at the edge that the optics leave."""
    distortion = distortion_model(registration).parameters[-1]
    assert distortion.unit == "px"
    for shape, terms in TERMS.items():
        found = {p.name: p for p in linear_model(registration, shape).parameters}
        for name in terms:
            prior = found[name].prior
            assert (prior.mean, prior.sigma) == (distortion.prior.mean, distortion.prior.sigma)
            assert found[name].unit == "px"
    assert WIDTH in WIDTHS


@pytest.mark.parametrize(
    ("matrix", "term"),
    [([[1.003, 0], [0, 0.997]], "stretch"), ([[1, 0.003], [0.003, 1]], "shear"),
     ([[1.003, 0], [0, 1.003]], "dilation"), ([[1, -0.003], [0.003, 1]], "turn")],
)  # fmt: skip
def test_affine_coefficients_are_displacements_at_the_edge(few, matrix, term):
    plain = few.likelihood
    offsets = plain.source - plain.pivot
    model = linear_model(few.given(offsets @ np.transpose(matrix) + plain.pivot), "affine")
    best, _, least = model.likelihood.reduced
    expected = np.zeros(6)
    expected[model.names.index(term)] = 0.003 * np.hypot(*offsets.T).max()
    np.testing.assert_allclose(best, expected, atol=1e-9)
    assert least < 1e-12


def test_other_priors_are_refused(few):
    model = linear_model(few, "radial")
    for place in (0, 4, 5):
        wrong = Uniform(0.1, 1.0, "a test") if place else model.parameters[4].prior
        parameters = list(model.parameters)
        parameters[place] = replace(parameters[place], prior=wrong)
        with pytest.raises(
            UnsuitableModelError, match=f"{parameters[place].name}: expected a prior"
        ):
            linear_log_evidence(replace(model, parameters=tuple(parameters)))


def test_table_shows_every_width_and_whose_data_they_are():
    base = posteriors()["registration"].model()
    table = pages.transform_choice().text
    rows = [re.sub("<[^>]+>", " ", row).split() for row in table.split("<tr>")]
    for shape in TERMS:
        row = next(row for row in rows if row[:1] == [f"registration-{shape}"])
        assert row[1:] == [
            f"{linear_log_evidence(linear_model(base, shape, width)):.3f}" for width in WIDTHS
        ]
    assert "our own simulation" in table
