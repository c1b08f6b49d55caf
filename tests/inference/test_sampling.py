"""Sampling: seeds, executors, a cluster."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest
import xarray
from scipy.stats import norm

from reproduce.inference import UnconvergedError, sampling
from reproduce.inference.sampling import Plan, sample
from reproduce.papers.posteriors import posteriors

PLAN = Plan(3, steps=300, warmup=120)


@pytest.fixture(scope="module")
def alone(registration):
    return sample(registration, PLAN)


def test_seed_alone_decides(registration, alone):
    np.random.seed(1)  # noqa: NPY002 - emcee must not look at the global state
    again = sample(registration, PLAN)
    np.testing.assert_array_equal(again.chain, alone.chain)
    with pytest.raises(ValueError, match="walkers: "):
        sample(registration, replace(PLAN, walkers=31))
    other = sample(registration, replace(PLAN, seed=4))
    assert not np.array_equal(other.chain, alone.chain)
    assert len({tuple(ensemble[0, 0]) for ensemble in alone.chain}) == PLAN.ensembles


@pytest.mark.parametrize("kind", ["threads", "processes"])
def test_executors_give_identical_draws(registration, alone, kind):
    if kind == "threads":
        pool = ThreadPoolExecutor(2)
    else:
        pool = ProcessPoolExecutor(2, mp_context=get_context("spawn"))
    with pool:
        np.testing.assert_array_equal(
            sample(registration, PLAN, executor=pool).chain, alone.chain
        )


def test_short_chains_are_run_again_as_long_as_they_need(registration, monkeypatch):
    """With the steps that the refusal names, and once is enough here."""
    short = replace(PLAN, steps=60, warmup=10)
    with pytest.raises(UnconvergedError) as refused:
        sample(registration, short)
    needed = refused.value.steps
    monkeypatch.setattr(sampling, "_MAX_STEPS", 61)
    with pytest.raises(UnconvergedError):
        sample(registration, short, longer=True)
    monkeypatch.undo()
    found = sample(registration, short, longer=True)
    assert found.chain.shape[1] == needed > 60
    whole = sample(registration, replace(short, steps=needed, warmup=needed // 4))
    np.testing.assert_array_equal(found.chain, whole.chain)


def test_saved_groups_are_those_of_arviz(alone, registration, tmp_path):
    """Names, dimensions, and numbers that belong together."""
    alone.to_datatree().to_netcdf(tmp_path / "p.nc")
    tree = xarray.open_datatree(tmp_path / "p.nc")
    assert set(tree.children) == {
        *("posterior", "sample_stats", "log_likelihood", "posterior_predictive"),
        *("prior", "prior_predictive", "observed_data"),
    }
    for parameter, row in zip(registration.parameters, alone.rows, strict=True):
        found = tree["posterior"][parameter.name]
        assert found.dims == ("chain", "draw")
        assert found.attrs["prior"] == str(parameter.prior.in_unit(parameter.shown))
        assert found.attrs["units"] == parameter.unit
        assert abs(found.values.mean() - row.mean) < 0.1 * row.deviation
    data = registration.likelihood
    np.testing.assert_array_equal(tree["observed_data"]["target"], data.target)
    for group in ("posterior_predictive", "prior_predictive"):
        assert tree[group]["target"].dims == ("chain", "draw", "star", "axis")
    log = tree["log_likelihood"]["target"]
    assert log.dims == ("chain", "draw", "star")
    # The draws are some of those of the posterior, by number.
    some = tree["posterior"].sel(draw=log["draw"])
    rows = np.stack(
        [some[p.name].values.ravel() / p.shown for p in registration.parameters], -1
    )
    whole = log.sum("star").values.ravel()
    np.testing.assert_allclose(whole, data(rows), rtol=1e-9)
    flat = registration.log_prior(rows)
    lp = tree["sample_stats"]["lp"].sel(draw=log["draw"]).values.ravel()
    np.testing.assert_allclose(lp, whole + flat, rtol=1e-9)
    off = tree["posterior_predictive"]["target"] - data.target
    noise = tree["posterior"]["noise"].mean()
    # Residuals and simulated noise: two variances, less those of four parameters.
    assert float(off.std()) == pytest.approx(float(noise) * np.sqrt(2), rel=0.05)
    prior = tree["prior"]["scale"]
    assert 0.5 < float(prior.min()) < 0.7 < 1.8 < float(prior.max()) < 2.0


@pytest.mark.parametrize("name", list(posteriors()))
def test_every_model_has_an_observation_by_observation_likelihood(name):
    """It sums to the likelihood of stars; a mean spot has part of it."""
    model = posteriors()[name].model()
    rows = model.start(np.random.default_rng(1), 8)
    whole, each = model.likelihood(rows), model.likelihood.pointwise(rows)
    if "spots" in model.likelihood.observed:
        start, end = model.likelihood.paths(rows)
        statistics = model.likelihood.statistics
        scale = (
            rows[:, -1][:, None, None, None] / np.sqrt(statistics.counts)[:, None, None]
        )
        law = norm(0.5 * (start + end), scale).logpdf(statistics.means)
        np.testing.assert_allclose(each, law.sum(axis=-1), rtol=1e-9)
    else:
        np.testing.assert_allclose(each.sum(axis=1), whole, rtol=1e-9)
