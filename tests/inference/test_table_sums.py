"""Posteriors summed without sampling: Table V, and those of one or two parameters."""

import numpy as np
import pytest

from reproduce.inference.diagnostics import mcse_deviation, mcse_quantile
from reproduce.inference.models import by_column, interchanged
from reproduce.inference.quadrature import summed
from reproduce.inference.sampling import Plan, sample
from reproduce.papers.posteriors import posteriors
from reproduce.views.objects.posterior import book_posterior


@pytest.fixture(scope="module")
def table():
    return posteriors()["table-5"].model()


@pytest.fixture(scope="module")
def found(table):
    return interchanged(table)


def test_coarser_sums_change_nothing(table, found):
    np.testing.assert_allclose(interchanged(table, 0.85).means, found.means, rtol=1e-5, atol=1e-12)


def test_sampled_moments_are_those_of_the_sums(found):
    """The likelihood that is sampled knows both orders, of which the printed one adds nothing."""
    posterior = book_posterior("table-5")
    assert posterior.model.likelihood.interchanged(posterior.draws).min() > 1 - 1e-6
    # Bias X belongs to motion along Y, whose angles are printed as those about Y, and the other
    # way round.
    for i, mean, deviation in zip((0, 1, 3, 2), found.means, found.deviations, strict=True):
        one, chain = posterior.diagnoses[i], posterior.chain[..., i]
        assert abs(chain.mean() - mean) < 4 * one.mcse
        np.testing.assert_allclose(chain.std(), deviation, rtol=0.06)


@pytest.mark.parametrize("name", ["frame-averaging", "centroid-noise"])
def test_sampled_moments_of_small_models_are_those_of_the_sums(name):
    plain = posteriors()[name].model()
    model = by_column(plain)[1] if name == "frame-averaging" else plain
    posterior = sample(model, Plan(5, steps=300, warmup=120))
    sums = summed(model, 0.7)
    # Smooth: the nodes play no part.
    np.testing.assert_allclose(sums.means, summed(model, 0.5).means, rtol=1e-6)
    for i, one in enumerate(posterior.diagnoses):
        chain = posterior.chain[..., i]
        assert abs(chain.mean() - sums.means[i]) < 4 * one.mcse
        assert abs(chain.std() - sums.deviations[i]) < 5 * mcse_deviation(chain)
        for probability in (0.1, 0.975):
            off = np.quantile(chain, probability) - sums.quantile(i, probability)
            assert abs(off) < 5 * mcse_quantile(chain, probability)
