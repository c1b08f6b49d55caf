"""Simulation-based calibration: a small run, the band, a broken model, the stored studies."""

from dataclasses import dataclass, replace

import numpy as np
import pandas as pd
import pytest
from numpy.random import default_rng
from numpy.testing import assert_allclose, assert_array_equal

import calibrations as stored
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
from reproduce.views.posteriors import _diagnosed

# The main models have more replicates than the others, and printed data fewer.
MAIN = ("misalignment", "registration")
RECOMPUTED = (1, 2, 7)


def uniform(count, seed=1):
    """Return a calibration with uniform ranks of three quantities."""
    ranks = default_rng(seed).integers(0, DRAWS + 1, (count, 3))
    covered = np.zeros((count, len(LEVELS), 2), np.int8)
    return Ranks(("a", "b", "c"), ranks, np.zeros(count, bool), covered)


@dataclass(frozen=True, eq=False)
class NoisyRegistration(GaussianRegistration):
    """A registration whose data have 1.5 times the noise of its likelihood."""

    def simulate(self, parameters, generator):
        return super().simulate(parameters * [1, 1, 1, 1, 1.5], generator)


def test_a_broken_model_is_found():
    model = posteriors()["registration"].model()
    broken = replace(model, likelihood=NoisyRegistration(model.likelihood.problem))
    assert calibrate(broken, 1, 2).probabilities().min() < 0.001


def test_uniform_ranks_have_uniform_probabilities_and_exact_coverage():
    found = [uniform(150, seed).probabilities() for seed in range(40)]
    assert abs((np.array(found) < 0.2).mean() - 0.2) < 4 * np.sqrt(0.16 / 120)
    # Each rank once: the ends of an interval that cut a rank in half count half.
    ranks = np.repeat(np.arange(DRAWS + 1)[:, None], 3, axis=1)
    every = replace(uniform(100), ranks=ranks)
    for level in LEVELS:
        assert_allclose(every.coverage(level), level, atol=1e-12)


def test_power_is_the_fraction_of_calibrations_that_find_a_wrong_width():
    """Compared with ranks of single draws of a posterior that is too narrow."""
    generator, found = default_rng(3), 0.0
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
    in an ensemble, so the first replicate may have other ranks on another processor if the others
    agree.
    """
    found, model = stored.load(name), posteriors()[name].model()
    least = 1000 if model.truth else 30
    assert found.replicates >= (2000 if name in MAIN else least)
    assert found.names == named(model)
    # The least probability of all quantities: one false alarm in 1000.
    assert found.probabilities().min() > 0.001 / len(found.names)
    assert found.failed.mean() < 0.02
    arrays, note = studies.read(f"sbc-{name}")
    assert f"{stored.COMMAND} {name} " in str(note["command"])
    # Data, priors, likelihood and simulation.
    again = stored.log_posteriors(name, arrays["points"], stored.SEED)
    assert_allclose(again, arrays["log_posterior"], rtol=1e-9)

    def agrees(index):
        ranks, failed, covered = replicate(model, stored.SEED, index)
        assert failed == found.failed[index]
        assert_array_equal(covered, found.covered[index])
        return np.abs(ranks - found.ranks[index]).max() <= 2

    first, *others = RECOMPUTED
    assert agrees(first) or all(map(agrees, others))
    # The coverage does not need the chains.
    again = intervals(model, stored.SEED, 2)
    assert_array_equal(again, found.covered[:2])


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


def test_the_tables_of_the_book_are_those_of_the_stored_ranks():
    pd.testing.assert_frame_equal(stored.table(), studies.table(stored.NAME), rtol=1e-9)
    name = "registration"
    row = _diagnosed(name, stored.table().query("posterior == @name"), stored.TRIALS)
    ranks, found = stored.load(name), book_posterior(name)
    assert row["R-hat, largest"] == f"{max(one.rhat for one in found.rows):.4f}"
    counts = [str(ranks.failed.sum()), str(len(ranks.names))]
    assert [row["failed"], row["quantities"]] == counts
    assert row["replicates"] == f"{ranks.replicates:,}"
