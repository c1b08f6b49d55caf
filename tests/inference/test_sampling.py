"""Sampling: seeds, executors, a cluster."""

import os
import signal
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest
import xarray
from arviz_stats.base import array_stats
from scipy.stats import norm

from reproduce.inference import UnconvergedError, sampling
from reproduce.inference.sampling import Plan, sample
from reproduce.papers.posteriors import posteriors

PLAN = Plan(3, steps=600, warmup=200)


@pytest.fixture(scope="module")
def alone(registration):
    return sample(registration, PLAN)


def test_seed_alone_decides(registration, alone):
    np.random.seed(1)  # noqa: NPY002 - emcee must not look at the global state
    again = sample(registration, PLAN)
    np.testing.assert_array_equal(again.chain, alone.chain)
    other = sample(registration, replace(PLAN, seed=4))
    assert not np.array_equal(other.chain, alone.chain)
    assert len({tuple(ensemble[0, 0]) for ensemble in alone.chain}) == PLAN.ensembles


def test_starts_are_over_dispersed(registration, alone):
    start = registration.start(np.random.default_rng(1), 64)
    assert (start.std(axis=0) > 2 * alone.draws.std(axis=0)).all()


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


def test_short_chains_are_refused(registration):
    with pytest.raises(UnconvergedError, match="autocorrelation times"):
        sample(registration, replace(PLAN, steps=60, warmup=10))


def test_short_chains_are_run_again_as_long_as_they_need(registration):
    """With the steps that the refusal names, and once is enough here."""
    short = replace(PLAN, steps=60, warmup=10)
    with pytest.raises(UnconvergedError) as refused:
        sample(registration, short)
    needed = refused.value.steps
    found = sample(registration, short, longer=True)
    assert found.chain.shape[1] == needed > 60
    whole = sample(registration, replace(short, steps=needed, warmup=needed // 4))
    np.testing.assert_array_equal(found.chain, whole.chain)


def test_chains_that_need_too_many_steps_are_refused(registration, monkeypatch):
    monkeypatch.setattr(sampling, "_MOST", 61)
    with pytest.raises(UnconvergedError):
        sample(registration, replace(PLAN, steps=60, warmup=10), longer=True)


def test_what_arviz_reads_back_is_the_posterior(alone, tmp_path):
    alone.to_datatree().to_netcdf(tmp_path / "p.nc")
    tree = xarray.open_datatree(tmp_path / "p.nc")
    assert tree["posterior"].sizes["chain"] == PLAN.ensembles
    assert tree["sample_stats"]["lp"].shape == tuple(tree["posterior"].sizes.values())
    assert list(tree["posterior"].data_vars) == list(alone.model.names)
    assert tree.attrs["seed"] == PLAN.seed
    np.testing.assert_allclose(
        tree["sample_stats"].attrs["acceptance"], alone.acceptance
    )
    for parameter, row in zip(alone.model.parameters, alone.rows, strict=True):
        found = tree["posterior"][parameter.name]
        assert found.attrs["prior"] == str(parameter.prior.in_unit(parameter.shown))
        assert found.attrs["units"] == parameter.unit
        assert array_stats.rhat(found.values) < 1.02
        assert abs(found.values.mean() - row.mean) < 0.1 * row.deviation
        assert abs(found.values.std() / row.deviation - 1) < 0.1


def test_saved_groups_are_those_of_arviz(alone, registration):
    """Names, dimensions, and numbers that belong together."""
    tree = alone.to_datatree()
    assert set(tree.children) == {
        *("posterior", "sample_stats", "log_likelihood", "posterior_predictive"),
        *("prior", "prior_predictive", "observed_data"),
    }
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


def test_odd_walkers_are_refused(registration):
    with pytest.raises(ValueError, match="even number of at least 12"):
        sample(registration, replace(PLAN, walkers=31))


@pytest.mark.filterwarnings("ignore")
def test_dask_cluster_with_a_worker_killed_midway(registration, alone):
    """A real scheduler on loopback, two workers, one killed: the draws are the same."""
    distributed = pytest.importorskip(
        "distributed", reason="the extra [cluster] is not installed; CI installs it"
    )
    dask = pytest.importorskip("dask")
    options = {
        "distributed.scheduler.allowed-failures": 10,
        "distributed.comm.timeouts.connect": "60s",
    }
    with (
        dask.config.set(options),
        distributed.LocalCluster(
            n_workers=2,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            host="127.0.0.1",
            protocol="tcp",
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        plain = sample(registration, PLAN, executor=client.get_executor())
        np.testing.assert_array_equal(plain.chain, alone.chain)
        pids = client.run(os.getpid)
        assert len(pids) == 2
        plan = replace(PLAN, ensembles=4, steps=2000)
        with ThreadPoolExecutor(1) as waiting:
            result = waiting.submit(
                sample, registration, plan, executor=client.get_executor(pure=False)
            )
            time.sleep(0.6)
            assert not result.done(), "the worker was to be killed midway"
            os.kill(next(iter(pids.values())), signal.SIGKILL)
            killed = result.result(timeout=120)
        np.testing.assert_array_equal(killed.chain, sample(registration, plan).chain)
