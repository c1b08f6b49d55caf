"""Sampling: seeds, executors, interruption, a cluster."""

import json
import os
import signal
import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import emcee
import numpy as np
import pytest
import xarray
from arviz_stats.base import array_stats

from reproduce.inference.diagnostics import ConvergenceError
from reproduce.inference.models.registration import registration_model
from reproduce.inference.sampling import Plan, ResumeError, sample

PLAN = Plan(3, steps=600, warmup=200, checkpoint=100)


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
        np.testing.assert_array_equal(sample(registration, PLAN, executor=pool).chain, alone.chain)


def test_short_chains_are_refused(registration):
    with pytest.raises(ConvergenceError, match="autocorrelation times"):
        sample(registration, replace(PLAN, steps=60, warmup=10))


def test_stored_chains_are_the_same_and_readable_by_emcee(registration, alone, tmp_path):
    stored = sample(registration, PLAN, folder=tmp_path)
    np.testing.assert_array_equal(stored.chain, alone.chain)
    backend = emcee.backends.HDFBackend(str(tmp_path / "ensemble-0.h5"), read_only=True)
    np.testing.assert_array_equal(backend.get_chain(discard=PLAN.warmup), alone.chain[0])
    again = sample(registration, PLAN, folder=tmp_path)
    np.testing.assert_array_equal(again.chain, alone.chain)


def test_folder_of_another_run_is_refused(registration, tmp_path):
    sample(registration, PLAN, folder=tmp_path)
    with pytest.raises(ResumeError, match="differ in seed"):
        sample(registration, replace(PLAN, seed=9), folder=tmp_path)
    data = registration.likelihood
    moved = registration_model(data.source, data.target + 0.001, data.pivot)
    with pytest.raises(ResumeError, match="differ in data"):
        sample(moved, PLAN, folder=tmp_path)


KILLED = """
import sys, numpy as np
from pathlib import Path
from reproduce.inference.models.registration import registration_model
from reproduce.inference.sampling import Plan, sample
data = np.load(sys.argv[1])
model = registration_model(data["source"], data["target"], data["pivot"])
sample(model, Plan(3, steps=600, warmup=200, checkpoint=100), folder=Path(sys.argv[2]))
"""


@pytest.mark.parametrize("moment", [0.0, 0.15, 0.4])
def test_killed_run_is_resumed_with_identical_draws(registration, alone, tmp_path, moment):
    """A real kill, at three moments after the first checkpoint of an ensemble."""
    data = registration.likelihood
    np.savez(tmp_path / "data.npz", source=data.source, target=data.target, pivot=data.pivot)
    folder = tmp_path / "run"
    process = subprocess.Popen([sys.executable, "-c", KILLED, tmp_path / "data.npz", folder])
    deadline = time.monotonic() + 60
    while not (folder / "ensemble-0.h5").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    time.sleep(moment)
    process.send_signal(signal.SIGKILL)
    process.wait()
    assert process.returncode == -signal.SIGKILL, "the run was to be killed before its end"
    done = emcee.backends.HDFBackend(str(folder / "ensemble-0.h5"), read_only=True).iteration
    assert done > 0
    assert done % PLAN.checkpoint == 0
    np.testing.assert_array_equal(sample(registration, PLAN, folder=folder).chain, alone.chain)


def test_damaged_working_copy_does_no_harm(registration, alone, tmp_path):
    sample(registration, replace(PLAN, steps=600), folder=tmp_path)
    (tmp_path / "ensemble-1.part").write_bytes(b"half a file")
    np.testing.assert_array_equal(sample(registration, PLAN, folder=tmp_path).chain, alone.chain)


def test_what_arviz_reads_back_is_the_posterior(alone, tmp_path):
    alone.to_datatree().to_netcdf(tmp_path / "p.nc")
    tree = xarray.open_datatree(tmp_path / "p.nc")
    assert tree["posterior"].sizes["chain"] == PLAN.ensembles
    assert tree["sample_stats"]["lp"].shape == tuple(tree["posterior"].sizes.values())
    assert list(tree["posterior"].data_vars) == list(alone.model.names)
    for parameter in alone.model.parameters:
        found = tree["posterior"][parameter.name]
        assert found.attrs["prior"] == str(parameter.prior)
        assert found.attrs["shown_in"] == parameter.unit
        assert array_stats.rhat(found.values) < 1.02
        spread = alone.chain[..., alone.model.names.index(parameter.name)].std()
        assert abs(found.values.std() / spread - 1) < 0.1


def test_note_of_the_run(registration, tmp_path):
    sample(registration, PLAN, folder=tmp_path)
    note = json.loads((tmp_path / "plan.json").read_text())
    assert note["model"] == "registration"
    assert note["seed"] == PLAN.seed


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
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None,
            host="127.0.0.1", protocol="tcp",
        ) as cluster,
        distributed.Client(cluster) as client,
    ):  # fmt: skip
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
