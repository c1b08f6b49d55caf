"""Simulation-based calibration: a small run, the band, a broken model, the stored studies."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.stats import kstest

from reproduce.inference.calibration import (
    DRAWS,
    LEVELS,
    Calibration,
    band,
    calibrate,
    replicate,
)
from reproduce.inference.registration import GaussianRegistration
from reproduce.papers.posteriors import posteriors
from reproduce.store import studies
from reproduce.views import posterior_calibration as stored

SMALL = 40
REDONE = 7
STUDIES = sorted({stored.study_of(name) for name in posteriors()})


@pytest.fixture(scope="module")
def small():
    return calibrate(posteriors()["registration"].model(), stored.SEED, SMALL)


def even(count, seed=1, names=3):
    ranks = np.random.default_rng(seed).integers(0, DRAWS + 1, (count, names))
    return Calibration(("a", "b", "c"), ranks, np.zeros(count, bool), np.zeros((count, 3, 2), bool))


def test_small_calibration_is_even(small):
    assert small.ranks.shape == (SMALL, 6)
    assert small.probabilities().min() > 0.001
    assert not small.failed.any()


def test_stored_study_begins_with_the_same_replicates(small):
    """Redone here; the chains may differ in the last bits on another machine, the ranks hardly."""
    ranks = stored.load("registration").ranks[:SMALL]
    assert (np.abs(small.ranks - ranks) <= 2).mean() > 0.95


@dataclass(frozen=True, eq=False)
class TooSure(GaussianRegistration):
    """Claims two thirds of the noise it has."""

    def simulate(self, parameters, generator):
        louder = parameters.copy()
        louder[4] *= 1.5
        return super().simulate(louder, generator)


def test_broken_model_is_found_out():
    model = posteriors()["registration"].model()
    plain = model.likelihood
    broken = replace(model, likelihood=TooSure(plain.source, plain.target, plain.pivot))
    assert calibrate(broken, 1, 15).probabilities().min() < 0.001


def test_replicate_does_not_depend_on_the_others():
    model = posteriors()["registration"].model()
    one, _, _ = replicate(model, 5, 2)
    np.testing.assert_array_equal(calibrate(model, 5, 3).ranks[2], one)


def test_band_holds_the_whole_curve_as_often_as_it_says():
    low, high = band(200)
    inside = [
        ((row >= low) & (row <= high)).all()
        for seed in range(200)
        for row in even(200, seed + 10).counts()
    ]
    share = np.mean(inside)
    assert abs(share - 0.95) < 4 * np.sqrt(0.95 * 0.05 / len(inside)) + 0.01


def test_probabilities_of_even_ranks_are_even():
    found = np.concatenate([even(150, seed).probabilities() for seed in range(40)])
    assert abs((found < 0.2).mean() - 0.2) < 4 * np.sqrt(0.16 / len(found))


def test_narrow_and_shifted_ranks_are_seen():
    generator = np.random.default_rng(1)
    narrow = np.clip(generator.normal(50, 20, (400, 3)).round(), 0, DRAWS).astype(int)
    assert (replace(even(400), ranks=narrow).probabilities() < 0.01).all()


@pytest.mark.parametrize("level", LEVELS)
def test_even_ranks_cover_exactly(level):
    """Each rank once: the ends of an interval that cut a rank in half count half."""
    ranks = np.repeat(np.arange(DRAWS + 1)[:, None], 3, axis=1)
    np.testing.assert_allclose(replace(even(100), ranks=ranks).coverage(level), level, atol=1e-12)


def test_coverage_is_counted():
    found = even(4000).coverage(0.9)
    np.testing.assert_allclose(found, 0.9, atol=4 * np.sqrt(0.09 / 4000))


def test_models_without_a_study_are_named():
    assert {n for n in STUDIES if not stored.is_stored(n)} <= stored.AWAITED


@pytest.mark.parametrize(
    "name", [n for n in STUDIES if stored.is_stored(n) or n not in stored.AWAITED]
)
def test_stored_calibrations(name):
    """Enough replicates, whole files, few failures, and ranks inside their bands."""
    found = stored.load(name)
    model = posteriors()[name].model()
    assert found.replicates >= 1000
    assert found.names[:-1] == model.names
    assert found.ranks.min() >= 0
    assert found.ranks.max() <= DRAWS
    # One band per quantity: the smallest of so many probabilities, one false alarm in a thousand.
    assert found.probabilities().min() > 0.001 / len(found.names)
    assert found.failed.mean() < 0.02
    note = studies.read(stored.study_name(name)).note
    assert f"reproduce calibrate {name} " in str(note["command"])


@pytest.mark.parametrize("name", [n for n in STUDIES if stored.is_stored(n)])
def test_stored_calibrations_are_those_of_the_present_models(name):
    """One replicate redone: another prior, likelihood or sampler ranks otherwise."""
    redone, failed, _ = replicate(posteriors()[name].model(), stored.SEED, REDONE)
    found = stored.load(name)
    assert np.abs(redone - found.ranks[REDONE]).max() <= 2
    assert failed == found.failed[REDONE]


def test_round_trip(tmp_path, small):
    stored.store("registration", small, 7, tmp_path)
    again = stored.load("registration", tmp_path)
    np.testing.assert_array_equal(again.ranks, small.ranks)
    np.testing.assert_array_equal(again.covered, small.covered)
    assert again.names == small.names


def test_least_of_all_models_is_weighed_by_their_number():
    """Of even ranks the least is as small as its chance says; and every model has its line."""
    chances = []
    for seed in range(60):
        found = {str(i): even(200, 100 * seed + i) for i in range(4)}
        least, count, chance = stored.least_of_all(found)
        assert count == 12
        assert least == min(one.probabilities().min() for one in found.values())
        chances.append(chance)
    assert kstest(chances, "uniform").pvalue > 0.001
    rows = stored.overview_rows(found)
    assert [row[:4] for row in rows] == [(str(i), "200", "0", "3") for i in range(4)]
