"""Sampling: seeds, executors, longer chains, and the saved groups."""

from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest
import xarray
from numpy.testing import assert_allclose, assert_array_equal

from reproduce.inference import UnconvergedError, sampling
from reproduce.inference.sampling import Plan, sample

PLAN = Plan(3, walkers=80, steps=500, warmup=200)
SINGLE = replace(PLAN, ensembles=1)


@pytest.fixture(scope="module")
def plain(registration):
    return sample(registration, PLAN)


def test_only_the_seed_decides(registration, plain):
    np.random.seed(1)  # noqa: NPY002 - emcee must not use the global state
    again = sample(registration, SINGLE)
    assert_array_equal(again.chain, plain.chain[:1])
    with pytest.raises(ValueError, match="walkers: "):
        sample(registration, replace(PLAN, walkers=31))
    other = sample(registration, replace(SINGLE, seed=4))
    assert not np.array_equal(other.chain, again.chain)
    assert len({tuple(ensemble[0, 0]) for ensemble in plain.chain}) == PLAN.ensembles


def test_executors_give_identical_draws(registration, plain):
    for pool in (
        ThreadPoolExecutor(2),
        ProcessPoolExecutor(1, mp_context=get_context("spawn")),
    ):
        with pool:
            pair = sample(registration, replace(PLAN, ensembles=2), executor=pool)
        assert_array_equal(pair.chain, plain.chain[:2])


def test_short_chains_are_run_again_with_the_advised_steps(registration, monkeypatch):
    short = replace(SINGLE, walkers=0, steps=60, warmup=0)
    with pytest.raises(UnconvergedError) as caught:
        sample(registration, short)
    needed = caught.value.steps
    with monkeypatch.context() as limited:
        limited.setattr(sampling, "_MAX_STEPS", 61)
        with pytest.raises(UnconvergedError):
            sample(registration, short, longer=True)
    found = sample(registration, short, longer=True)
    assert found.chain.shape[1] == needed > 60
    whole = sample(registration, replace(short, steps=needed))
    assert_array_equal(found.chain, whole.chain)


def test_saved_groups_are_those_of_arviz(plain, registration, tmp_path):
    """Names, dimensions, and numbers that belong together."""
    plain.to_datatree().to_netcdf(tmp_path / "p.nc")
    tree = xarray.open_datatree(tmp_path / "p.nc")
    assert set(tree.children) == {
        *("posterior", "sample_stats", "log_likelihood", "posterior_predictive"),
        *("prior", "prior_predictive", "observed_data"),
    }
    for parameter, row in zip(registration.parameters, plain.rows, strict=True):
        found = tree["posterior"][parameter.name]
        assert found.dims == ("chain", "draw")
        assert found.attrs["prior"] == str(parameter.prior.in_unit(parameter.shown))
        assert found.attrs["units"] == parameter.unit
        assert abs(found.values.mean() - row.mean) < 0.1 * row.deviation
    data = registration.likelihood
    assert_array_equal(tree["observed_data"]["target"], data.target)
    log = tree["log_likelihood"]["target"]
    assert log.dims == ("chain", "draw", "star")
    # The draws are some of those of the posterior, by number.
    draws = tree["posterior"].sel(draw=log["draw"])
    columns = [draws[p.name].values.ravel() / p.shown for p in registration.parameters]
    rows, whole = np.stack(columns, -1), log.sum("star").values.ravel()
    assert_allclose(whole, data(rows), rtol=1e-9)
    lp = tree["sample_stats"]["lp"].sel(draw=log["draw"]).values.ravel()
    assert_allclose(lp, whole + registration.log_prior(rows), rtol=1e-9)
    off = tree["posterior_predictive"]["target"] - data.target
    noise = float(tree["posterior"]["noise"].mean())
    # Variances of residuals and of simulated noise, minus those of four parameters.
    assert float(off.std()) == pytest.approx(noise * np.sqrt(2), rel=0.05)
