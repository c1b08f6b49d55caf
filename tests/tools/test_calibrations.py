"""Simulation-based calibration: a small run, the band, a broken model, the stored studies."""

import re
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest

import calibrations as stored
import reproduce as rp
from calibrations import (
    DRAWS,
    LEVELS,
    Ranks,
    calibrate,
    intervals,
    named,
    power,
    replicate,
    simulated,
)
from reproduce.inference.models import GaussianRegistration
from reproduce.papers.posteriors import posteriors
from reproduce.store import studies
from reproduce.views.posterior import book_posterior

SMALL = 12
# The main models have more replicates than the others, and printed data fewer.
MAIN = ("misalignment", "registration")
RECOMPUTED = (1, 2, 7)


@pytest.fixture(scope="module")
def small():
    return calibrate(posteriors()["registration"].model(), stored.SEED, SMALL)


def uniform(count, seed=1):
    """Return a calibration with uniform ranks of three quantities."""
    ranks = np.random.default_rng(seed).integers(0, DRAWS + 1, (count, 3))
    covered = np.zeros((count, len(LEVELS), 2), np.int8)
    return Ranks(("a", "b", "c"), ranks, np.zeros(count, bool), covered)


def test_a_small_calibration_is_the_beginning_of_the_stored_one(small):
    """Rounding errors of another processor may change a chain, but hardly the ranks."""
    model = posteriors()["registration"].model()
    assert small.ranks.shape == (SMALL, 9)
    assert small.names[:5] == model.names
    assert small.probabilities().min() > 0.001
    assert not small.failed.any()
    ranks = stored.load("registration").ranks[:SMALL]
    assert (np.abs(small.ranks - ranks) <= 2).mean() > 0.95
    # A replicate does not depend on the others, and the coverage does not need the chains.
    np.testing.assert_array_equal(replicate(model, stored.SEED, 2)[0], small.ranks[2])
    np.testing.assert_array_equal(intervals(model, stored.SEED, SMALL), small.covered)
    assert small.covered.mean() > 0.5


@dataclass(frozen=True, eq=False)
class NoisyRegistration(GaussianRegistration):
    """A registration whose data have 1.5 times the noise of its likelihood."""

    def simulate(self, parameters, generator):
        return super().simulate(parameters * [1, 1, 1, 1, 1.5], generator)


def test_a_broken_model_is_found():
    model = posteriors()["registration"].model()
    broken = replace(model, likelihood=NoisyRegistration(model.likelihood.problem))
    assert calibrate(broken, 1, 10).probabilities().min() < 0.001


def test_uniform_ranks_have_uniform_probabilities_and_exact_coverage():
    found = [uniform(150, seed).probabilities() for seed in range(40)]
    assert abs((np.array(found) < 0.2).mean() - 0.2) < 4 * np.sqrt(0.16 / 120)
    # Each rank once: the ends of an interval that cut a rank in half count half.
    ranks = np.repeat(np.arange(DRAWS + 1)[:, None], 3, axis=1)
    every = replace(uniform(100), ranks=ranks)
    for level in LEVELS:
        np.testing.assert_allclose(every.coverage(level), level, atol=1e-12)


def test_power_is_the_fraction_of_calibrations_that_find_a_wrong_width():
    """Compared with ranks of single draws of a posterior that is too narrow."""
    generator, found = np.random.default_rng(3), 0.0
    for _ in range(60):
        truths = generator.normal(size=(200, 3, 1))
        draws = generator.normal(size=(200, 3, DRAWS))
        ranks = (0.8 * draws < truths).sum(axis=-1)
        narrow = replace(uniform(200), ranks=ranks)
        found += (narrow.probabilities() < 0.05).mean() / 60
    expected = power(200, 0.8)
    variance = expected * (1 - expected) / stored.TRIALS + found * (1 - found) / 180
    assert abs(expected - found) < 4 * np.sqrt(variance)
    assert 0.3 < expected < 0.9


@pytest.mark.parametrize("name", list(posteriors()))
def test_stored_calibrations_are_those_of_the_present_models(name):
    """Enough replicates, ranks inside their bands, and a part is computed again.

    Another prior, likelihood or sampler would change all ranks. Rounding grows from step to step
    in an ensemble, so one of the three replicates may have other ranks on another processor.
    """
    found, model = stored.load(name), posteriors()[name].model()
    least = 1000 if posteriors()[name].simulated else 30
    assert found.replicates >= (2000 if name in MAIN else least)
    assert found.names == named(model)
    assert found.ranks.min() >= 0
    assert found.ranks.max() <= DRAWS
    # The least probability of all quantities: one false alarm in 1000.
    assert found.probabilities().min() > 0.001 / len(found.names)
    assert found.failed.mean() < 0.02
    study = studies.read(f"sbc-{name}")
    assert f"{stored.COMMAND} {name} " in str(study.note["command"])
    # Data, priors, likelihood and simulation.
    again = stored.log_posteriors(name, study.arrays["points"], stored.SEED)
    np.testing.assert_allclose(again, study.arrays["log_posterior"], rtol=1e-9)
    same = []
    for index in RECOMPUTED:
        ranks, failed, covered = replicate(model, stored.SEED, index)
        same.append(np.abs(ranks - found.ranks[index]).max() <= 2)
        assert failed == found.failed[index]
        np.testing.assert_array_equal(covered, found.covered[index])
    assert sum(same) >= 2, same
    # A parameter has an estimate in all replicates or in none. Wider intervals cover more.
    covered = found.covered
    assert covered.shape[1:] == (len(LEVELS), model.dimension)
    np.testing.assert_array_equal((covered < 0).all(axis=0), (covered < 0).any(axis=0))
    assert (np.diff(covered, axis=1) >= 0).all()


def test_every_model_has_separate_random_numbers():
    """The same first prior and the same seed give another truth."""
    truths = [
        {simulated(model, stored.SEED, index)[0][0] for index in range(20)}
        for model in (
            posteriors()[name].model()
            for name in ("registration", "registration-distortion")
        )
    ]
    assert not set.intersection(*truths)


def test_a_stored_calibration_reads_back(tmp_path, small):
    """Also without an estimate of the second parameter."""
    covered = small.covered.copy()
    covered[..., 1] = -1
    found = replace(small, covered=covered)
    stored.store("registration", found, 7, tmp_path)
    again = stored.load("registration", tmp_path)
    np.testing.assert_array_equal(again.ranks, found.ranks)
    np.testing.assert_array_equal(again.covered, covered)
    assert again.names == found.names
    coverage = again.estimator_coverage(0.95)
    assert np.isnan(coverage).tolist() == [False, True, False, False, False]
    assert coverage[0] == covered[:, LEVELS.index(0.95), 0].mean()


def test_the_tables_of_the_book_are_those_of_the_stored_ranks():
    pd.testing.assert_frame_equal(stored.table(), studies.table(stored.NAME), rtol=1e-9)
    shown = rp.posterior().diagnostics("chen2023")._repr_html_()
    head, cell = r'<th scope="row">(.*?)</th>(.*?)</tr>', r"<td>(.*?)</td>"
    rows = {
        name: re.findall(cell, rest)
        for name, rest in re.findall(head, shown, re.DOTALL)
    }
    papers = {key: one.paper for key, one in posteriors().items()}
    assert list(rows) == [key for key, paper in papers.items() if paper == "chen2023"]
    for name, (rhat, times, size, _, *rest) in rows.items():
        ranks, found = stored.load(name), book_posterior(name)
        expected = [
            max(row.rhat for row in found.rows),
            found.chain.shape[1] / found.time,
            min(min(row.bulk, row.tail) for row in found.rows),
        ]
        numbers = [float(text.replace(",", "")) for text in (rhat, times, size)]
        assert numbers == pytest.approx(expected, rel=0, abs=0.51)
        assert numbers[0] == pytest.approx(expected[0], abs=1e-4)
        counts = (int(ranks.failed.sum()), len(ranks.names))
        assert rest[:3] == [f"{ranks.replicates:,}", *map(str, counts)]
        assert len(rest) == 7
